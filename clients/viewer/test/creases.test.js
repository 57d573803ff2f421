// Surfaces are split where they bend sharply, and nowhere else.
import assert from "node:assert/strict";
import { test } from "node:test";
import { fillCopies, originalsOf, splitCreases } from "../src/creases.js";
import { vertexNormals } from "../src/normals.js";

/** a cube of edge 1 with outward triangles */
const cube = Float32Array.from({ length: 24 }, (_, i) => ((i / 3) >> i % 3) & 1);
const sides = Uint32Array.from([
    ...[0, 2, 3, 0, 3, 1], // z = 0
    ...[4, 5, 7, 4, 7, 6],
    ...[0, 1, 5, 0, 5, 4], // y = 0
    ...[2, 6, 7, 2, 7, 3],
    ...[0, 4, 6, 0, 6, 2], // x = 0
    ...[1, 3, 7, 1, 7, 5],
]);

test("each side of a cube has its own vertices, whose normals are those of the side", () => {
    const { triangles, copies } = splitCreases(cube, sides);
    assert.equal(copies.length, 24 - 8);
    const x = new Float32Array(3 * 24);
    x.set(cube);
    fillCopies(x, copies, 3);
    const originals = originalsOf(8, new Uint32Array(), copies);
    assert.deepEqual(
        triangles.map((v) => originals[v]),
        sides,
    );
    const normals = new Float32Array(x.length);
    vertexNormals(x, triangles, normals);
    for (let v = 0; v < 24; v++) {
        const n = [...normals.subarray(3 * v, 3 * v + 3)].map(Math.abs).sort();
        assert.deepEqual(n, [0, 0, 1]);
    }
    for (let e = 0; e < sides.length; e++)
        for (let k = 0; k < 3; k++) assert.equal(x[3 * triangles[e] + k], cube[3 * sides[e] + k]);
});

test("a surface that bends by less stays as it is", () => {
    // a prism of eight sides: 45 degrees between them
    const n = 8;
    const ring = Array.from({ length: 2 * n }, (_, i) => {
        const angle = (2 * Math.PI * (i % n)) / n;
        return [Math.cos(angle), Math.sin(angle), i < n ? 0 : 1];
    }).flat();
    const mantle = Array.from({ length: n }, (_, i) => {
        const j = (i + 1) % n;
        return [i, j, j + n, i, j + n, i + n];
    }).flat();
    const { triangles, copies } = splitCreases(Float32Array.from(ring), Uint32Array.from(mantle));
    assert.equal(copies.length, 0);
    assert.deepEqual([...triangles], mantle);
    // with a lid it is split along the lid alone
    const lid = Array.from({ length: n - 2 }, (_, i) => [n, n + i + 1, n + i + 2]).flat();
    const closed = splitCreases(Float32Array.from(ring), Uint32Array.from([...mantle, ...lid]));
    assert.deepEqual(
        [...closed.copies].sort((a, b) => a - b),
        [8, 9, 10, 11, 12, 13, 14, 15],
    );
    assert.deepEqual([...closed.triangles.subarray(0, mantle.length)], mantle);
});

test("values of copies are those of what they copy", () => {
    const level = Uint8Array.from([5, 6, 7, 0, 0]);
    fillCopies(level, Uint32Array.from([2, 0]), 1);
    assert.deepEqual([...level], [5, 6, 7, 7, 5]);
});

test("copies of the asset are split at creases, and have one normal where the surface bends by less", () => {
    // two squares side by side, the right one of copies 6 and 7 of the vertices 1 and 4 between them
    const seams = Uint32Array.from([6, 1, 7, 4]);
    const triangles = Uint32Array.from([...[0, 1, 4, 0, 4, 3], ...[6, 2, 5, 6, 5, 7]]);
    const bent = (/** @type {number} */ angle) => {
        const [x, z] = [1 + Math.cos(angle), Math.sin(angle)];
        return Float32Array.from([...[0, 0, 0, 1, 0, 0, x, 0, z, 0, 1, 0], ...[1, 1, 0, x, 1, z, 1, 0, 0, 1, 1, 0]]);
    };
    const smooth = splitCreases(bent(0.5), triangles, seams);
    assert.deepEqual(smooth.triangles, triangles);
    assert.equal(smooth.copies.length, 0);
    assert.deepEqual([...smooth.joined], [6, 1, 7, 4]);
    const sharp = splitCreases(bent(1.5), triangles, seams);
    assert.deepEqual(sharp.triangles, triangles);
    assert.equal(sharp.joined.length, 0);
    assert.deepEqual([...originalsOf(8, seams, Uint32Array.of(7, 2))], [0, 1, 2, 3, 4, 5, 1, 4, 4, 2]);
});
