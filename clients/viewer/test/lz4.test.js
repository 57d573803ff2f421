// LZ4 blocks written by hand: every kind of sequence, and every kind of damage.
import assert from "node:assert/strict";
import { test } from "node:test";
import { lz4Decode } from "../src/lz4.js";
import { WireError } from "../src/wire.js";

/** @param {number[]} block @param {number} n */
function expand(block, n) {
    const dst = new Uint8Array(n + 8).fill(99);
    lz4Decode(Uint8Array.from(block), dst, 4, 4 + n);
    assert.ok(
        [...dst.subarray(0, 4), ...dst.subarray(4 + n)].every((v) => v === 99),
        "nothing is written outside",
    );
    return [...dst.subarray(4, 4 + n)];
}

/** @param {number} n @param {number} [first] */
const count = (n, first = 0) => Array.from({ length: n }, (_, i) => (first + i) & 255);

test("literals of every length", () => {
    for (const n of [0, 1, 14, 15, 16, 24, 25, 269, 270, 271, 525]) {
        const head = n < 15 ? [n << 4] : [15 << 4, ...new Array(Math.floor((n - 15) / 255)).fill(255), (n - 15) % 255];
        assert.deepEqual(expand([...head, ...count(n)], n), count(n));
    }
});

test("matches that overlap what they write, near, far and long", () => {
    for (const distance of [1, 2, 3, 7, 16, 30])
        for (const length of [4, 18, 19, 24, 25, 60, 273, 274, 600]) {
            const seed = count(30, 5);
            const extra =
                length - 4 < 15 ? [] : [...new Array(Math.floor((length - 19) / 255)).fill(255), (length - 19) % 255];
            const block = [(15 << 4) | Math.min(15, length - 4), 15, ...seed, distance, 0, ...extra, 1 << 4, 77];
            const wanted = [...seed];
            for (let i = 0; i < length; i++) wanted.push(wanted[wanted.length - distance]);
            wanted.push(77);
            assert.deepEqual(expand(block, wanted.length), wanted, `distance ${distance}, length ${length}`);
        }
});

test("refuses damage of every kind", () => {
    const good = [0x40, 1, 2, 3, 4, 0x10, 9];
    assert.throws(() => expand([], 0), WireError, "no token");
    assert.throws(() => expand([0x40, 1, 2, 3], 4), WireError, "literals cut");
    assert.throws(() => expand([0xf0], 20), WireError, "length cut");
    assert.throws(() => expand([0xf0, 255, 255], 2000), WireError, "long length cut");
    assert.throws(() => expand([0x50, 1, 2, 3, 4, 5], 4), WireError, "too long for the room");
    assert.throws(() => expand([0x40, 1, 2, 3, 4], 5), WireError, "too short for the room");
    assert.throws(() => expand([0x40, 1, 2, 3, 4, 0], 8), WireError, "distance cut");
    assert.throws(() => expand([0x40, 1, 2, 3, 4, 0, 0, 0x10, 9], 9), WireError, "distance 0");
    assert.throws(() => expand([0x40, 1, 2, 3, 4, 5, 0, 0x10, 9], 9), WireError, "distance before the begin");
    assert.throws(() => expand([0x4f, 1, 2, 3, 4, 1, 0, 255, 255, 255, 0, 0x10, 9], 20), WireError, "match too long");
    assert.throws(() => expand([0x4f, 1, 2, 3, 4, 1, 0, 255], 2000), WireError, "match length cut");
    assert.throws(() => expand(good, 9), WireError, "match token without a distance");
});
