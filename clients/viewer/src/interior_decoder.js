// INTERIOR messages (protocol/README.md, "INTERIOR"; protocol/interior_codec.c) and the tetrahedra of an interior's asset.
import { FIELD_NAMES } from "./field_decoder.js";
import { lz4Decode } from "./lz4.js";
import { checkOf, KIND, PART_MAX, readHead, VERTEX_MAX } from "./wire.js";

const HEAD_BYTES = 44;
const NODE_BYTES = 7;
const Q_MAX = 1e30; // m: steps of it stay finite floats

const need = checkOf("interior");

/**
 * @typedef {{part: number, epoch: number, field: number, name: string, simTimeUs: number, low: number, high: number,
 *   q: number, n: number}} InteriorHead
 */

/**
 * Head of an INTERIOR message, lengths checked.
 * @param {Uint8Array} bytes
 * @returns {InteriorHead}
 */
export function readInteriorHead(bytes) {
    const head = readHead(bytes);
    need(head.kind === KIND.INTERIOR, "KIND", `message kind ${head.kind}`);
    need(head.flags === 0, "FLAGS", `flags ${head.flags}`);
    need(bytes.length >= HEAD_BYTES, "SHORT", `${bytes.length} bytes`);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const field = view.getUint32(12, true);
    const timeHigh = view.getUint32(20, true);
    const [low, high, q] = [24, 28, 32].map((at) => view.getFloat32(at, true));
    const n = view.getUint32(36, true);
    const nLz4 = view.getUint32(40, true);
    need(Number.isFinite(low) && Number.isFinite(high) && Number.isFinite(q), "NAN", "range");
    need(
        head.index < PART_MAX &&
            field > 0 &&
            field < FIELD_NAMES.length &&
            timeHigh < 1 << 21 &&
            low <= high &&
            q > 0 &&
            q <= Q_MAX,
        "RANGE",
        "part, kind, time, range or step",
    );
    need(n > 0 && n <= VERTEX_MAX, "COUNT", `${n} nodes`);
    need(nLz4 <= bytes.length - HEAD_BYTES, "SHORT", "cut short");
    need(nLz4 >= bytes.length - HEAD_BYTES, "LONG", "bytes behind the end");
    return {
        part: head.index,
        epoch: view.getUint32(8, true),
        field,
        name: FIELD_NAMES[field],
        simTimeUs: timeHigh * 4294967296 + view.getUint32(16, true),
        low,
        high,
        q,
        n,
    };
}

/**
 * @param {Uint8Array} bytes an INTERIOR message @param {Float32Array} move [n][3] takes the displacements, m
 * @param {Uint8Array} level [n] takes the values: 0 is low, 255 high
 * @returns {InteriorHead}
 */
export function decodeInterior(bytes, move, level) {
    const head = readInteriorHead(bytes);
    const { n, q } = head;
    need(n === level.length && 3 * n === move.length, "COUNT", `${n} nodes, the asset has ${level.length}`);
    const planes = new Uint8Array(NODE_BYTES * n);
    lz4Decode(bytes.subarray(HEAD_BYTES), planes, 0, planes.length);
    for (let c = 0; c < 3; c++) {
        const at = 2 * n * c;
        let now = 0;
        for (let i = 0; i < n; i++) {
            const folded = planes[at + i] | (planes[at + n + i] << 8);
            now = ((now + ((folded >> 1) ^ -(folded & 1))) << 16) >> 16; // mod 2^16, signed
            move[3 * i + c] = q * now;
        }
    }
    level.set(planes.subarray(6 * n));
    return head;
}

/**
 * Tetrahedra from the faces of an interior's asset: a b c and c b d for each.
 * @param {Uint32Array} triangles
 * @returns {Uint32Array} [m][4]
 */
export function tetrahedraOf(triangles) {
    need(triangles.length % 6 === 0, "COUNT", `${triangles.length / 3} faces`);
    const tets = new Uint32Array((triangles.length / 6) * 4);
    for (let t = 0, k = 0; t < triangles.length; t += 6, k += 4) {
        need(triangles[t + 1] === triangles[t + 4] && triangles[t + 2] === triangles[t + 3], "RANGE", "two faces");
        tets.set([triangles[t], triangles[t + 1], triangles[t + 2], triangles[t + 5]], k);
    }
    return tets;
}
