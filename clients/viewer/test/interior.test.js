// INTERIOR messages: the seed of the fuzzer, which the C codec wrote, and what is refused; the interiors of a link.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { decodeInterior, readInteriorHead, tetrahedraOf } from "../src/interior_decoder.js";
import { InteriorLink } from "../src/interior_link.js";
import { WireError } from "../src/wire.js";

const N = 40;
const seed = () =>
    new Uint8Array(readFileSync(new URL("../../../tests/data/fuzz/interior/whole.bin", import.meta.url)));
const decode = (bytes) => {
    const move = new Float32Array(3 * N);
    const level = new Uint8Array(N);
    return { head: decodeInterior(bytes, move, level), move, level };
};

test("reads what the C codec has written", () => {
    const { head, move, level } = decode(seed());
    assert.deepEqual(
        { ...head, q: Number(head.q.toPrecision(6)) },
        {
            part: 1,
            epoch: 3,
            field: 2,
            name: "von_mises",
            simTimeUs: 12345,
            low: 0,
            high: 3900,
            q: 1e-4,
            n: N,
        },
    );
    for (let i = 0; i < N; i++) {
        const wanted = [0.001 * i, -0.002 * i, 0.03 * Math.sin(i)];
        for (let c = 0; c < 3; c++) assert.ok(Math.abs(move[3 * i + c] - wanted[c]) < 0.51e-4, `node ${i} axis ${c}`);
        assert.ok(Math.abs((head.high * level[i]) / 255 - 100 * i) < 0.502 * (3900 / 255));
    }
});

test("refuses damaged messages", () => {
    const whole = seed();
    for (let cut = 0; cut < whole.length; cut++) assert.throws(() => decode(whole.subarray(0, cut)), `cut at ${cut}`);
    assert.throws(() => decode(Uint8Array.from([...whole, 0])), /interior/);
    for (const [at, value, format] of [
        [12, 0, "setUint32"],
        [12, 10, "setUint32"],
        [20, 1 << 21, "setUint32"],
        [24, NaN, "setFloat32"],
        [28, -1, "setFloat32"],
        [32, 0, "setFloat32"],
        [32, Infinity, "setFloat32"],
        [32, 1e31, "setFloat32"],
        [36, 0, "setUint32"],
        [36, N + 1, "setUint32"],
        [36, 2 ** 31, "setUint32"],
        [40, 1, "setUint32"],
    ]) {
        const bytes = seed();
        new DataView(bytes.buffer)[format](at, value, true);
        assert.throws(() => decode(bytes), `${at}: ${value}`);
    }
    // any byte: refused, or finite numbers
    for (let at = 0; at < whole.length; at++)
        for (const value of [0, 127, 255]) {
            const bytes = seed();
            bytes[at] = value;
            try {
                assert.ok(decode(bytes).move.every(Number.isFinite), `${at}: ${value}`);
            } catch (error) {
                assert.ok(error instanceof WireError, `${at}: ${error}`);
            }
        }
});

test("tetrahedra are pairs of faces", () => {
    assert.deepEqual([...tetrahedraOf(Uint32Array.of(7, 8, 9, 9, 8, 5))], [7, 8, 9, 5]);
    assert.throws(() => tetrahedraOf(Uint32Array.of(7, 8, 9, 9, 7, 5)), /interior/);
    assert.throws(() => tetrahedraOf(Uint32Array.of(7, 8, 9)), /interior/);
});

test("an interior is fetched with its first message, once, and not again after a failure", async () => {
    const asked = [];
    const posted = [];
    const link = new InteriorLink({
        get: (url) => {
            asked.push(url);
            return Promise.reject(new Error("404"));
        },
        post: (message) => posted.push(message),
    });
    assert.equal(readInteriorHead(seed()).epoch, 3);
    link.take(1, seed()); // not offered
    assert.deepEqual(asked, []);
    link.offer(1, { epoch: 3, interior: "/asset/x" }, "http://host/ws");
    link.take(1, seed());
    await new Promise(setImmediate);
    link.take(1, seed());
    await new Promise(setImmediate);
    assert.deepEqual([asked, posted], [["http://host/asset/x"], []]);
});
