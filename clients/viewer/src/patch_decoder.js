// PATCH messages (protocol/README.md, "PATCH"; protocol/topology_delta_codec.c): changed places of the table of triangles of a part
// that adapts, and what a table shows: its triangles without the empty places 0 0 0, and the vertices in them. Pure.
import { planes, unfold } from "./asset.js";
import { lz4Decode } from "./lz4.js";
import { KIND, PART_MAX, readHead, WireError } from "./wire.js";

const HEAD_BYTES = 32,
    PLACE_BYTES = 16,
    PLACE_MAX = 2 ** 22;

/** @param {boolean} good @param {string} code @param {string} text */
function need(good, code, text) {
    if (!good) throw new WireError(code, `patch: ${text}`);
}

/**
 * @typedef {{part: number, epoch: number, n: number, revision: number, nRaw: number}} PatchHead n: changed places;
 *   revision: of the table that comes of it
 * @typedef {{triangles: Uint32Array, visible: Uint32Array | null}} Shown visible: the vertices in the triangles,
 *   ascending; null: every vertex
 */

/**
 * Head of a PATCH message, lengths checked.
 * @param {Uint8Array} bytes
 * @returns {PatchHead}
 */
export function readPatchHead(bytes) {
    const { kind, flags, index } = readHead(bytes);
    need(kind === KIND.PATCH, "KIND", `message kind ${kind}`);
    need(flags === 0, "FLAGS", `flags ${flags}`);
    need(bytes.length >= HEAD_BYTES, "SHORT", "no room for its head");
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const epoch = view.getUint32(8, true),
        n = view.getUint32(12, true),
        low = view.getUint32(16, true),
        high = view.getUint32(20, true);
    const nRaw = view.getUint32(24, true),
        nLz4 = view.getUint32(28, true);
    need(nLz4 <= bytes.length - HEAD_BYTES, "SHORT", "block cut short");
    need(nLz4 >= bytes.length - HEAD_BYTES, "LONG", "bytes behind the block");
    need(index < PART_MAX && high < 1 << 21, "RANGE", "part or revision");
    need(n > 0 && n <= PLACE_MAX && nRaw === PLACE_BYTES * n, "COUNT", `${n} places in ${nRaw} bytes`);
    need(Math.floor(nRaw / 255) <= nLz4, "COUNT", "states more than its bytes can hold");
    return { part: index, epoch, n, revision: high * 4294967296 + low, nRaw };
}

/**
 * Decodes one PATCH message into the table; a refused one leaves it as it was.
 * @param {Uint8Array} bytes @param {Uint32Array} table [t][3] @param {number} nVertex that corners may name
 * @returns {PatchHead}
 */
export function applyPatch(bytes, table, nVertex) {
    const head = readPatchHead(bytes),
        { n, nRaw } = head,
        t = table.length / 3;
    need(n <= t, "COUNT", `${n} places, the table has ${t}`);
    const raw = new Uint8Array(nRaw);
    lz4Decode(bytes.subarray(HEAD_BYTES), raw, 0, nRaw);

    const place = planes(raw, 0, n),
        corner = planes(raw, 4 * n, 3 * n);
    for (let i = 0; i < n; i++) {
        const before = i ? place[i - 1] : 0;
        place[i] = before + unfold(place[i]);
        if (place[i] >= t || (i && place[i] <= before))
            need(false, "RANGE", `place ${place[i]} after ${before} of ${t}`);
    }
    for (let e = 0; e < 3 * n; e++) {
        corner[e] = unfold(corner[e]) + (e < 3 ? 0 : corner[e - 3]);
        if (corner[e] >= nVertex) need(false, "RANGE", `corner ${corner[e]} of ${nVertex} vertices`);
    }
    for (let i = 0; i < n; i++) table.set(corner.subarray(3 * i, 3 * i + 3), 3 * place[i]);
    return head;
}

/**
 * What a table shows.
 * @param {Uint32Array} table [t][3] @param {number} nVertex
 * @returns {Shown}
 */
export function shownOf(table, nVertex) {
    const seen = new Uint8Array(nVertex),
        triangles = new Uint32Array(table.length);
    let to = 0,
        nSeen = 0;
    for (let e = 0; e < table.length; e += 3) {
        const a = table[e],
            b = table[e + 1],
            c = table[e + 2];
        if ((a | b | c) === 0) continue;
        triangles[to] = a;
        triangles[to + 1] = b;
        triangles[to + 2] = c;
        to += 3;
        seen[a] = seen[b] = seen[c] = 1;
    }
    for (let v = 0; v < nVertex; v++) nSeen += seen[v];
    if (nSeen === nVertex) return { triangles: triangles.slice(0, to), visible: null };
    const visible = new Uint32Array(nSeen);
    for (let v = 0, i = 0; v < nVertex; v++) if (seen[v]) visible[i++] = v;
    return { triangles: triangles.slice(0, to), visible };
}
