// Assets: rest pose, triangles, wire order and predictor of one part (protocol/README.md, "Assets"; protocol/asset.c).
// Validates everything that frame_decoder.js and a renderer trust.
import { lz4Decode } from "./lz4.js";
import { checkOf, VERTEX_MAX } from "./wire.js";

const MAGIC = 0x314d4c50;
const VERSION = 1;
const VERSION_LOOK = 2; // with looks and image coordinates
const HEAD_BYTES = 40;
const BYTES_MAX = 2 ** 28;
const TRIANGLE_MAX = 2 ** 24;
const LEVEL_MAX = 4096;
export const ONE = 4096; // sum of the weights of a predicted vertex
const ABS_MAX = 8191;

/** looks of vertices: the outside or the inside of tissue, or an image */
export const LOOK_OUTSIDE = 0;
export const LOOK_INSIDE = 1;
export const LOOK_IMAGE = 2;

/**
 * @typedef {{
 *   rest: Float32Array, triangles: Uint32Array, vertexOf: Uint32Array, neighbour: Uint32Array, weight: Int16Array,
 *   levels: Uint32Array, look: Uint8Array<ArrayBuffer> | null, uv: Float32Array<ArrayBuffer> | null
 * }} Asset rest [n][3] m and triangles in vertex order; vertexOf [n] maps wire index to vertex; neighbour and weight
 *   [n][4] in wire order; levels: first wire index of each level; look
 *   [n] in vertex order: LOOK_OUTSIDE, LOOK_INSIDE or LOOK_IMAGE + the number of an image; null: all outside; uv: image
 *   coordinates in vertex order from the lower left corner [n][2]
 */

const need = checkOf("asset");

/** @param {Uint8Array} bytes */
function fnv1a(bytes) {
    let hash = 0x811c9dc5;
    for (let i = 0; i < bytes.length; i++) hash = Math.imul(hash ^ bytes[i], 16777619);
    return hash >>> 0;
}

/**
 * Counts of the header, checked against one another and against the bytes that are there.
 * @param {Uint8Array} bytes
 */
function readHead(bytes) {
    need(bytes.length >= HEAD_BYTES, "SHORT", "no header");
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const [magic, version, n, nTriangle, nLevel, nRaw, nLz4, sum, zero, zero2] = Array.from({ length: 10 }, (_, i) =>
        view.getUint32(4 * i, true),
    );
    need(magic === MAGIC, "MAGIC", "does not begin with PLM1");
    need(
        version === VERSION || version === VERSION_LOOK,
        "KIND",
        `version ${version}, this page reads ${VERSION} and ${VERSION_LOOK}`,
    );
    need(zero === 0 && zero2 === 0, "FLAGS", "reserved fields");
    need(
        n > 0 && n <= VERTEX_MAX && nTriangle <= TRIANGLE_MAX && nLevel > 0 && nLevel <= LEVEL_MAX && nLevel <= n,
        "COUNT",
        "counts",
    );
    const perVertex = version === VERSION_LOOK ? 49 : 40;
    need(
        perVertex * n + 12 * nTriangle + 4 * nLevel === nRaw && nRaw <= BYTES_MAX,
        "COUNT",
        "counts do not fit the length",
    );
    need(nLz4 <= bytes.length - HEAD_BYTES, "SHORT", "cut short");
    need(nLz4 >= bytes.length - HEAD_BYTES, "LONG", "bytes behind the end");
    need(Math.floor(nRaw / 255) <= nLz4, "COUNT", "states more than its bytes can hold");
    const block = bytes.subarray(HEAD_BYTES);
    need(fnv1a(block) === sum, "CHECKSUM", "checksum does not match");
    return { n, nTriangle, nLevel, nRaw, block, hasLook: version === VERSION_LOOK };
}

/**
 * u32 values from four byte planes.
 * @param {Uint8Array} raw @param {number} at @param {number} n
 */
export function planes(raw, at, n) {
    const out = new Uint32Array(n);
    for (let i = 0; i < n; i++)
        out[i] = raw[at + i] | (raw[at + n + i] << 8) | (raw[at + 2 * n + i] << 16) | (raw[at + 3 * n + i] << 24);
    return out;
}

/** @param {number} v folded difference */
export const unfold = (v) => (v >>> 1) ^ -(v & 1);

/** @param {Asset} asset @param {number} n */
function check(asset, n) {
    const { rest, triangles, vertexOf, neighbour, weight, levels, uv } = asset;
    need(rest.every(Number.isFinite), "NAN", "a rest position is not finite");
    need(uv === null || uv.every(Number.isFinite), "NAN", "an image coordinate is not finite");
    need(
        triangles.every((v) => v < n),
        "RANGE",
        "a triangle names no vertex",
    );
    need(levels[0] === 0 && levels.every((v, i) => (i === 0 || v > levels[i - 1]) && v < n), "ORDER", "levels");
    const seen = new Uint8Array(n);
    for (let i = 0; i < n; i++) {
        let sum = 0;
        let absolute = 0;
        let good = vertexOf[i] < n && seen[vertexOf[i]]++ === 0;
        for (let j = 4 * i; j < 4 * i + 4; j++) {
            sum += weight[j];
            absolute += Math.abs(weight[j]);
            good &&= weight[j] ? neighbour[j] < i : neighbour[j] === 0;
        }
        need(good && (sum === ONE || absolute === 0) && absolute <= ABS_MAX, "ORDER", `vertex ${i} of the wire order`);
    }
}

/**
 * @param {Uint8Array} bytes the whole file
 * @returns {Asset}
 */
export function decodeAsset(bytes) {
    const { n, nTriangle, nLevel, nRaw, block, hasLook } = readHead(bytes);
    const raw = new Uint8Array(nRaw);
    lz4Decode(block, raw, 0, nRaw);

    /** the next numbers of n rows of c @param {number} c */
    const floats = (c) => {
        const bits = new Uint32Array(c * n);
        for (let k = 0; k < c; k++, at += 4 * n) planes(raw, at, n).forEach((v, i) => (bits[c * i + k] = v));
        return new Float32Array(bits.buffer);
    };
    let at = 0;
    const rest = floats(3);
    const vertexOf = planes(raw, 12 * n, n);
    const neighbour = new Uint32Array(4 * n);
    const weight = new Int16Array(4 * n);
    for (let i = 0, before = 0; i < n; i++) before = vertexOf[i] = before + unfold(vertexOf[i]);
    at += 4 * n;
    for (let j = 0; j < 4; j++, at += 4 * n) {
        const plane = planes(raw, at, n);
        for (let i = 0; i < n; i++) neighbour[4 * i + j] = unfold(plane[i]) + (j ? neighbour[4 * i + j - 1] : i);
    }
    for (let j = 0; j < 4; j++, at += 2 * n)
        for (let i = 0; i < n; i++) weight[4 * i + j] = raw[at + i] | (raw[at + n + i] << 8);
    const triangles = planes(raw, at, 3 * nTriangle);
    for (let e = 0; e < 3 * nTriangle; e++) triangles[e] = unfold(triangles[e]) + (e < 3 ? 0 : triangles[e - 3]);
    at += 12 * nTriangle;
    const levels = planes(raw, at, nLevel);
    at += 4 * nLevel;
    const uv = hasLook ? floats(2) : null;
    const look = hasLook ? raw.slice(at, at + n) : null;

    const asset = { rest, triangles, vertexOf, neighbour, weight, levels, look, uv };
    check(asset, n);
    return asset;
}

/**
 * Where an asset is fetched: with the session's name, by which a proxy finds its server, as for the socket.
 * @param {string} path @param {string} socket address of it
 */
export function assetAddress(path, socket) {
    const address = new URL(path, socket.replace(/^ws/, "http"));
    address.search = new URL(socket).search;
    return address.href;
}
