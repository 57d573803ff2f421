// Images and the inside of tissue on surfaces: assets with looks, and what is drawn at the copies along a seam.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { decodeAsset } from "../src/asset.js";
import { findCopies, joinNormals } from "../src/image_seams.js";
import { lz4Decode } from "../src/lz4.js";

const HEAD = 40;
const golden = new Uint8Array(readFileSync(new URL("../../../tests/data/golden/asset.bin", import.meta.url)));

/** one run of literals @param {Uint8Array} raw */
function lz4Literals(raw) {
    const length = [];
    let rest = raw.length - 15;
    for (; rest >= 255; rest -= 255) length.push(255);
    return Uint8Array.from([0xf0, ...length, rest, ...raw]);
}

/** the golden asset as version 2, vertex k with look k modulo 4 @param {Float32Array} uv */
function withImage(uv) {
    const old = new DataView(golden.buffer, golden.byteOffset);
    const nRaw = old.getUint32(20, true);
    const raw = new Uint8Array(nRaw + 4.5 * uv.length);
    lz4Decode(golden.subarray(HEAD), raw.subarray(0, nRaw), 0, nRaw);
    const bytes = new Uint8Array(uv.buffer);
    const n = uv.length / 2;
    for (let c = 0; c < 2; c++)
        for (let i = 0; i < n; i++)
            for (let p = 0; p < 4; p++) raw[nRaw + 4 * n * c + p * n + i] = bytes[4 * (2 * i + c) + p];
    for (let i = 0; i < n; i++) raw[nRaw + 8 * n + i] = i % 4;
    const block = lz4Literals(raw);
    const out = new Uint8Array(HEAD + block.length);
    out.set(golden.subarray(0, HEAD));
    out.set(block, HEAD);
    const head = new DataView(out.buffer);
    head.setUint32(4, 2, true);
    head.setUint32(20, raw.length, true);
    head.setUint32(24, block.length, true);
    let hash = 0x811c9dc5;
    for (const byte of block) hash = Math.imul(hash ^ byte, 16777619);
    head.setUint32(28, hash, true);
    return out;
}

test("an asset of version 2 has image coordinates and looks behind all that version 1 has", () => {
    const plain = decodeAsset(golden);
    assert.deepEqual([plain.uv, plain.look], [null, null]);
    const uv = Float32Array.from({ length: (2 * plain.rest.length) / 3 }, (none, k) => 0.1 * k - 3);
    const asset = decodeAsset(withImage(uv));
    assert.deepEqual(asset.uv, uv);
    assert.deepEqual(
        [...(asset.look ?? [])],
        Array.from({ length: uv.length / 2 }, (none, k) => k % 4),
    );
    assert.deepEqual({ ...asset, uv: null, look: null }, plain);
});

test("an asset whose image coordinates are not finite, or whose version is another, is refused", () => {
    const uv = new Float32Array((2 * decodeAsset(golden).rest.length) / 3);
    uv[5] = Infinity;
    assert.throws(() => decodeAsset(withImage(uv)), /image coordinate/);
    const other = withImage(uv.fill(0));
    other[4] = 3;
    assert.throws(() => decodeAsset(other), /version 3/);
    other[4] = 1;
    assert.throws(() => decodeAsset(other), /counts do not fit/);
});

test("copies are the vertices that follow from one other alone", () => {
    const asset = decodeAsset(withImage(new Float32Array((2 * decodeAsset(golden).rest.length) / 3)));
    assert.equal(findCopies(asset).length, 0);
    const n = asset.vertexOf.length;
    const weight = asset.weight.slice();
    const neighbour = asset.neighbour.slice();
    weight.set([2048, 2048, 0, 0], 4 * (n - 1));
    neighbour.set([5, 5, 0, 0], 4 * (n - 1));
    weight.set([2048, 2048, 0, 0], 4 * (n - 2)); // a midpoint
    neighbour.set([5, 6, 0, 0], 4 * (n - 2));
    const { vertexOf } = asset;
    assert.deepEqual([...findCopies({ ...asset, weight, neighbour })], [vertexOf[n - 1], vertexOf[5]]);
    assert.equal(findCopies({ ...asset, weight, neighbour, look: null }).length, 0);
});

test("copies are drawn with one normal of all their triangles", () => {
    const copies = Uint32Array.from([2, 0, 3, 0]);
    const normals = Float32Array.from([1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 0]);
    joinNormals(copies, normals);
    const expected = [1 / Math.sqrt(5), 2 / Math.sqrt(5), 0];
    for (const v of [0, 2, 3])
        expected.forEach((value, c) => assert.ok(Math.abs(normals[3 * v + c] - value) < 1e-6, String(normals)));
    assert.deepEqual([...normals.subarray(3, 6)], [0, 0, 1], "a vertex without copies keeps its own");
});
