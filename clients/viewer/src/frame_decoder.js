// FRAME decoder (protocol/README.md, "FRAME"; the same arithmetic as protocol/frame_codec.c, bit for bit): Rice codes to
// residuals, closed-loop prediction in integers, positions in vertex order. One decoder per part and asset.
import { lz4Decode } from "./lz4.js";
import { checkOf, KIND, PART_MAX, readHead, VERTEX_MAX } from "./wire.js";

const HEAD_BYTES = 44;
const AFFINE_BYTES = 48;
const GROUP = 16;
const QUOTIENT_MAX = 12;
const ESCAPE_BITS = 24;
const ESCAPE_LENGTH = 37;
const MODE_MASK = 7;
const MODE_WIDE = 14;
const MODE_ZERO = 15;
const TAIL = 8;
const X_MAX = 2 ** 18 - 1;
const SLACK = 256;
const LITTLE_ENDIAN = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;

const need = checkOf("frame");

/** @param {number} n vertices */
const modeBytes = (n) => Math.ceil(Math.ceil(n / GROUP) / 2);

/** @param {number} n vertices */
const rawBound = (n) => modeBytes(n) + Math.ceil((3 * n * ESCAPE_LENGTH) / 8) + 2 * Math.ceil(n / GROUP) + TAIL;

/**
 * @typedef {{
 *   part: number, epoch: number, seq: number, simTimeUs: number, cycle: number, q: number, n: number, nRaw: number,
 *   affine: number[] | null, block: Uint8Array
 * }} FrameHead q: quantisation step m; affine: 3x4 row-major
 */

/**
 * Head of a FRAME message, lengths checked.
 * @param {Uint8Array} bytes
 * @returns {FrameHead}
 */
export function readFrameHead(bytes) {
    const { kind, flags, index } = readHead(bytes);
    need(kind === KIND.FRAME, "KIND", `message kind ${kind}`);
    need(flags <= 1, "FLAGS", `flags ${flags}`);
    const at = HEAD_BYTES + (flags ? AFFINE_BYTES : 0);
    need(bytes.length >= at, "SHORT", "no room for its head");
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const n = view.getUint32(32, true);
    const nRaw = view.getUint32(36, true);
    const nLz4 = view.getUint32(40, true);
    const q = view.getFloat32(28, true);
    const high = view.getUint32(20, true);
    need(nLz4 <= bytes.length - at, "SHORT", "block cut short");
    need(nLz4 >= bytes.length - at, "LONG", "bytes behind the block");
    need(index < PART_MAX && high < 1 << 21, "RANGE", "part or time");
    need(Number.isFinite(q), "NAN", "step");
    need(q > 0, "RANGE", "step");
    need(n > 0 && n <= VERTEX_MAX, "COUNT", `${n} vertices`);
    need(nRaw >= modeBytes(n) + TAIL && nRaw <= rawBound(n), "COUNT", `body of ${nRaw} bytes`);
    const affine = flags ? Array.from({ length: 12 }, (_, i) => view.getFloat32(HEAD_BYTES + 4 * i, true)) : null;
    need(!affine || affine.every(Number.isFinite), "NAN", "affine map");
    return {
        part: index,
        epoch: view.getUint32(8, true),
        seq: view.getUint32(12, true),
        cycle: view.getUint32(24, true),
        simTimeUs: high * 4294967296 + view.getUint32(16, true),
        q,
        n,
        nRaw,
        affine,
        block: bytes.subarray(at),
    };
}

export class FrameDecoder {
    /** @param {import("./asset.js").Asset} asset copied */
    constructor(asset) {
        const n = (this.n = asset.vertexOf.length);
        this.modeBytes = modeBytes(n);
        // the codes begin at a whole word
        this.rawBegin = (4 - (this.modeBytes % 4)) % 4;
        const buffer = new ArrayBuffer((this.rawBegin + rawBound(n) + SLACK + 3) & ~3);
        this.raw = new Uint8Array(buffer);
        this.words = new Int32Array(buffer);
        this.x = new Int32Array(3 * n);
        this.residual = new Int32Array(3 * GROUP);
        this.target = asset.vertexOf.map((v) => 3 * v);
        this.neighbour = asset.neighbour.map((i) => 3 * i);
        this.weight = Int32Array.from(asset.weight);
        this.rest = new Float32Array(3 * n);
        for (let i = 0; i < n; i++)
            for (let c = 0; c < 3; c++) this.rest[3 * i + c] = asset.rest[3 * asset.vertexOf[i] + c];
    }

    /**
     * Decodes one FRAME message of this decoder's asset.
     * @param {Uint8Array} bytes @param {Float32Array} positions [n][3] in vertex order; garbage when this throws
     * @returns {FrameHead}
     */
    decode(bytes, positions) {
        const head = readFrameHead(bytes);
        const { n, nRaw, q } = head;
        need(n === this.n, "COUNT", `${n} vertices, the asset has ${this.n}`);
        need(positions.length === 3 * n, "SPACE", "positions of another size");
        const end = this.rawBegin + nRaw;
        lz4Decode(head.block, this.raw, this.rawBegin, end);
        this.raw.fill(0, end, Math.min(end + SLACK, this.raw.length));
        if (!LITTLE_ENDIAN) swapWords(this.raw, this.rawBegin + this.modeBytes);
        this.body(8 * (nRaw - this.modeBytes - TAIL), q / 16, positions);
        if (head.affine) this.move(head.affine, q / 16, positions);
        return head;
    }

    /** @param {number} nBit bits of codes @param {number} step @param {Float32Array} positions */
    body(nBit, step, positions) {
        const { n, raw, rawBegin } = this;
        let bit = 0;
        let outside = 0;
        for (let first = 0, group = 0; first < n; first += GROUP, group++) {
            const here = Math.min(GROUP, n - first);
            const mode = (raw[rawBegin + (group >> 1)] >> (4 * (group & 1))) & 15;
            if (mode !== MODE_ZERO) {
                bit = this.codes(bit, mode, here);
                need(bit >= 0 && bit <= nBit, "COUNT", "codes do not fit the body");
            }
            outside |= this.predict(first, here, mode !== MODE_ZERO, step, positions);
        }
        need(outside >= 0, "RANGE", "displacement out of range");
        need(((bit + 7) & ~7) === nBit, "COUNT", "codes end before the body");
    }

    /**
     * Residuals of one group into this.residual; returns the bit behind its codes, -1 for an invalid code.
     * @param {number} bit @param {number} mode @param {number} here
     */
    codes(bit, mode, here) {
        const { words, residual } = this;
        const base = (this.rawBegin + this.modeBytes) >> 2;
        let k = mode;
        let coded = (1 << here) - 1;
        if (mode >= MODE_MASK) {
            const w = base + (bit >>> 5);
            const s = bit & 31;
            const low = (words[w] >>> s) | ((words[w + 1] << 1) << (31 - s));
            if (mode === MODE_WIDE) k = low & 15;
            else {
                k = mode - MODE_MASK;
                coded &= low;
            }
            bit += mode === MODE_WIDE ? 4 : here;
        }
        const mask = (1 << k) - 1;
        for (let i = 0, end = 3 * here; i < end; coded >>>= 1) {
            if ((coded & 1) === 0) {
                residual[i] = residual[i + 1] = residual[i + 2] = 0;
                i += 3;
                continue;
            }
            for (const stop = i + 3; i < stop; i++) {
                const w = base + (bit >>> 5);
                const s = bit & 31;
                const low = (words[w] >>> s) | ((words[w + 1] << 1) << (31 - s));
                const quotient = 31 - Math.clz32(low & -low);
                let v = 0;
                if (quotient < QUOTIENT_MAX && quotient >= 0) {
                    v = (quotient << k) | ((low >>> (quotient + 1)) & mask);
                    bit += quotient + 1 + k;
                } else {
                    if (quotient !== QUOTIENT_MAX) return -1;
                    const w2 = base + ((bit + QUOTIENT_MAX + 1) >>> 5);
                    const s2 = (bit + QUOTIENT_MAX + 1) & 31;
                    v = ((words[w2] >>> s2) | ((words[w2 + 1] << 1) << (31 - s2))) & ((1 << ESCAPE_BITS) - 1);
                    bit += ESCAPE_LENGTH;
                }
                residual[i] = (v >>> 1) ^ -(v & 1);
            }
        }
        return bit;
    }

    /**
     * X and positions of one group; negative if an X is out of range.
     * @param {number} first @param {number} here @param {boolean} moved @param {number} step @param {Float32Array} positions
     */
    predict(first, here, moved, step, positions) {
        const { x, rest, neighbour, weight, target, residual } = this;
        let outside = 0;
        for (let i = 0; i < here; i++) {
            const j = 4 * (first + i);
            const to = 3 * (first + i);
            const p = target[first + i];
            const n0 = neighbour[j];
            const n1 = neighbour[j + 1];
            const n2 = neighbour[j + 2];
            const n3 = neighbour[j + 3];
            const w0 = weight[j];
            const w1 = weight[j + 1];
            const w2 = weight[j + 2];
            const w3 = weight[j + 3];
            let a =
                (Math.imul(w0, x[n0]) + Math.imul(w1, x[n1]) + Math.imul(w2, x[n2]) + Math.imul(w3, x[n3]) + 2048) >>
                12;
            let b =
                (Math.imul(w0, x[n0 + 1]) +
                    Math.imul(w1, x[n1 + 1]) +
                    Math.imul(w2, x[n2 + 1]) +
                    Math.imul(w3, x[n3 + 1]) +
                    2048) >>
                12;
            let c =
                (Math.imul(w0, x[n0 + 2]) +
                    Math.imul(w1, x[n1 + 2]) +
                    Math.imul(w2, x[n2 + 2]) +
                    Math.imul(w3, x[n3 + 2]) +
                    2048) >>
                12;
            if (moved) {
                a = (a + (residual[3 * i] << 4)) | 0;
                b = (b + (residual[3 * i + 1] << 4)) | 0;
                c = (c + (residual[3 * i + 2] << 4)) | 0;
            }
            outside |= (a + X_MAX) | (X_MAX - a) | (b + X_MAX) | (X_MAX - b) | (c + X_MAX) | (X_MAX - c);
            x[to] = a;
            x[to + 1] = b;
            x[to + 2] = c;
            positions[p] = rest[to] + a * step;
            positions[p + 1] = rest[to + 1] + b * step;
            positions[p + 2] = rest[to + 2] + c * step;
        }
        return outside;
    }

    /**
     * Applies the affine map to all positions.
     * @param {number[]} a @param {number} step @param {Float32Array} positions
     */
    move(a, step, positions) {
        const { x, rest, target } = this;
        for (let i = 0; i < this.n; i++) {
            const u = rest[3 * i] + x[3 * i] * step;
            const v = rest[3 * i + 1] + x[3 * i + 1] * step;
            const w = rest[3 * i + 2] + x[3 * i + 2] * step;
            for (let r = 0; r < 3; r++)
                positions[target[i] + r] = a[4 * r] * u + a[4 * r + 1] * v + a[4 * r + 2] * w + a[4 * r + 3];
        }
    }
}

/** @param {Uint8Array} bytes @param {number} begin */
function swapWords(bytes, begin) {
    for (let at = begin; at + 4 <= bytes.length; at += 4) bytes.subarray(at, at + 4).reverse();
}
