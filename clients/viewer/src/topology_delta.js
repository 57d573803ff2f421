// TOPOLOGY_DELTA messages (protocol/README.md, "TOPOLOGY_DELTA"; protocol/topology_delta_codec.c): changed slots of the
// triangle table of an adaptive part; the visible triangles of a table, without empty slots 0 0 0, and their vertices. Pure.
import { planes, unfold } from "./asset.js";
import { lz4Decode } from "./lz4.js";
import { checkOf, KIND, PART_MAX, readHead } from "./wire.js";

const HEAD_BYTES = 32;
const SLOT_BYTES = 16;
const SLOT_MAX = 2 ** 22;

const need = checkOf("topology delta");

/**
 * @typedef {{part: number, epoch: number, n: number, revision: number, nRaw: number}} TopologyDeltaHead n: changed slots;
 *   revision: of the resulting table
 * @typedef {{triangles: Uint32Array, visible: Uint32Array | null}} Shown visible: the vertices in the triangles,
 *   ascending; null: every vertex
 */

/**
 * Head of a TOPOLOGY_DELTA message, lengths checked.
 * @param {Uint8Array} bytes
 * @returns {TopologyDeltaHead}
 */
export function readTopologyDeltaHead(bytes) {
    const { kind, flags, index } = readHead(bytes);
    need(kind === KIND.TOPOLOGY_DELTA, "KIND", `message kind ${kind}`);
    need(flags === 0, "FLAGS", `flags ${flags}`);
    need(bytes.length >= HEAD_BYTES, "SHORT", "no room for its head");
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const epoch = view.getUint32(8, true);
    const n = view.getUint32(12, true);
    const low = view.getUint32(16, true);
    const high = view.getUint32(20, true);
    const nRaw = view.getUint32(24, true);
    const nLz4 = view.getUint32(28, true);
    need(nLz4 <= bytes.length - HEAD_BYTES, "SHORT", "block cut short");
    need(nLz4 >= bytes.length - HEAD_BYTES, "LONG", "bytes behind the block");
    need(index < PART_MAX && high < 1 << 21, "RANGE", "part or revision");
    need(n > 0 && n <= SLOT_MAX && nRaw === SLOT_BYTES * n, "COUNT", `${n} slots in ${nRaw} bytes`);
    need(Math.floor(nRaw / 255) <= nLz4, "COUNT", "states more than its bytes can hold");
    return { part: index, epoch, n, revision: high * 4294967296 + low, nRaw };
}

/**
 * Applies one TOPOLOGY_DELTA message to the table; a refused one changes nothing.
 * @param {Uint8Array} bytes @param {Uint32Array} table [t][3] @param {number} nVertex number of vertices
 * @returns {TopologyDeltaHead}
 */
export function applyTopologyDelta(bytes, table, nVertex) {
    const head = readTopologyDeltaHead(bytes);
    const { n, nRaw } = head;
    const t = table.length / 3;
    need(n <= t, "COUNT", `${n} slots, the table has ${t}`);
    const raw = new Uint8Array(nRaw);
    lz4Decode(bytes.subarray(HEAD_BYTES), raw, 0, nRaw);

    const slot = planes(raw, 0, n);
    const corner = planes(raw, 4 * n, 3 * n);
    for (let i = 0; i < n; i++) {
        const before = i ? slot[i - 1] : 0;
        slot[i] = before + unfold(slot[i]);
        if (slot[i] >= t || (i && slot[i] <= before)) need(false, "RANGE", `slot ${slot[i]} after ${before} of ${t}`);
    }
    for (let e = 0; e < 3 * n; e++) {
        corner[e] = unfold(corner[e]) + (e < 3 ? 0 : corner[e - 3]);
        if (corner[e] >= nVertex) need(false, "RANGE", `corner ${corner[e]} of ${nVertex} vertices`);
    }
    for (let i = 0; i < n; i++) table.set(corner.subarray(3 * i, 3 * i + 3), 3 * slot[i]);
    return head;
}

/**
 * Visible triangles and vertices of a table.
 * @param {Uint32Array} table [t][3] @param {number} nVertex
 * @returns {Shown}
 */
export function shownOf(table, nVertex) {
    const seen = new Uint8Array(nVertex);
    const triangles = new Uint32Array(table.length);
    let to = 0;
    let nSeen = 0;
    for (let e = 0; e < table.length; e += 3) {
        const a = table[e];
        const b = table[e + 1];
        const c = table[e + 2];
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
