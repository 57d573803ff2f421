// FIELD messages (protocol/README.md, "FIELD"; protocol/field_codec.c): one byte per vertex between low and high.
import { lz4Decode } from "./lz4.js";
import { checkOf, KIND, PART_MAX, readHead, VERTEX_MAX } from "./wire.js";

const HEAD_BYTES = 40;
/** names by their number on the wire, as in `subscribe_field` */
export const FIELD_NAMES = Object.freeze([
    "none",
    "displacement",
    "von_mises",
    "energy",
    "stiffness",
    "strain",
    "distortion",
    "young",
    "density",
    "damping",
]);

const need = checkOf("field");

/**
 * @typedef {{part: number, epoch: number, field: number, name: string, simTimeUs: number, low: number, high: number, n: number}} FieldHead
 */

/**
 * Head of a FIELD message, lengths checked.
 * @param {Uint8Array} bytes
 * @returns {FieldHead}
 */
export function readFieldHead(bytes) {
    const head = readHead(bytes);
    need(head.kind === KIND.FIELD, "KIND", `message kind ${head.kind}`);
    need(head.flags === 0, "FLAGS", `flags ${head.flags}`);
    need(bytes.length >= HEAD_BYTES, "SHORT", `${bytes.length} bytes`);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const epoch = view.getUint32(8, true);
    const field = view.getUint32(12, true);
    const timeLow = view.getUint32(16, true);
    const timeHigh = view.getUint32(20, true);
    const low = view.getFloat32(24, true);
    const high = view.getFloat32(28, true);
    const n = view.getUint32(32, true);
    const nLz4 = view.getUint32(36, true);
    need(Number.isFinite(low) && Number.isFinite(high), "NAN", "range");
    need(
        head.index < PART_MAX && field > 0 && field < FIELD_NAMES.length && timeHigh < 1 << 21 && low <= high,
        "RANGE",
        "part, kind, time or range",
    );
    need(n > 0 && n <= VERTEX_MAX, "COUNT", `${n} vertices`);
    need(nLz4 <= bytes.length - HEAD_BYTES, "SHORT", "cut short");
    need(nLz4 >= bytes.length - HEAD_BYTES, "LONG", "bytes behind the end");
    return {
        part: head.index,
        epoch,
        field,
        name: FIELD_NAMES[field],
        simTimeUs: timeHigh * 4294967296 + timeLow,
        low,
        high,
        n,
    };
}

/**
 * @param {Uint8Array} bytes a FIELD message @param {Uint8Array} level [n] takes the bytes: 0 is low, 255 high
 * @returns {FieldHead}
 */
export function decodeField(bytes, level) {
    const head = readFieldHead(bytes);
    need(head.n === level.length, "COUNT", `${head.n} vertices, the asset has ${level.length}`);
    lz4Decode(bytes.subarray(HEAD_BYTES), level, 0, head.n);
    return head;
}
