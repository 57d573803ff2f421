// Decoder of the LZ4 block format, for untrusted input: the block must expand to exactly the given length.
import { WireError } from "./wire.js";

/** @returns {never} */
function damaged() {
    throw new WireError("LZ4", "compressed block is damaged");
}

/**
 * Expands the whole of src into dst[begin, end) exactly.
 * @param {Uint8Array} src @param {Uint8Array} dst @param {number} begin @param {number} end
 */
export function lz4Decode(src, dst, begin, end) {
    const n = src.length;
    let from = 0;
    let to = begin;
    if (n === 0) damaged();
    for (;;) {
        // literals: length in the token's high bits, continued while bytes are 255
        if (from >= n) damaged();
        const token = src[from++];
        let length = token >> 4;
        let byte = 255;
        if (length === 15)
            do {
                if (from >= n) damaged();
                byte = src[from++];
                length += byte;
            } while (byte === 255);
        if (length > n - from || length > end - to) damaged();
        if (length > 24) {
            dst.set(src.subarray(from, from + length), to);
            from += length;
            to += length;
        } else for (const stop = from + length; from < stop; ) dst[to++] = src[from++];
        if (from === n) break;

        // match: distance in two bytes, length in the token's low bits, at least 4; may overlap what it writes
        if (n - from < 2) damaged();
        const distance = src[from] | (src[from + 1] << 8);
        from += 2;
        length = token & 15;
        if (length === 15)
            do {
                if (from >= n) damaged();
                byte = src[from++];
                length += byte;
            } while (byte === 255);
        length += 4;
        if (distance === 0 || distance > to - begin || length > end - to) damaged();
        if (distance === 1 && length > 24) {
            dst.fill(dst[to - 1], to, to + length);
            to += length;
        } else if (distance >= length && length > 24) {
            dst.copyWithin(to, to - distance, to - distance + length);
            to += length;
        } else for (const stop = to + length; to < stop; to++) dst[to] = dst[to - distance];
    }
    if (to !== end) damaged();
}
