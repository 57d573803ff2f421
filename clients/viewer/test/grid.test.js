// Tetrahedra on a grid: linear values are exact inside, nothing lies outside, also for a sheared and a turned body.
import assert from "node:assert/strict";
import { test } from "node:test";
import { fillGrid, gridAround } from "../src/grid.js";

/** a cube of edge 1 in five tetrahedra, moved by a matrix */
function cube(m) {
    const corners = Array.from({ length: 8 }, (_, k) => [k & 1, (k >> 1) & 1, k >> 2]);
    const x = Float32Array.from(corners.flatMap((p) => m.map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2])));
    const tets = Uint32Array.of(0, 3, 5, 6, 1, 0, 3, 5, 2, 0, 6, 3, 4, 0, 5, 6, 7, 3, 6, 5);
    return { x, tets, inverse: (p) => solve(m, p) };
}
function solve(m, p) {
    const det = (a) =>
        a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
        a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
        a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    return [0, 1, 2].map((c) => det(m.map((row, r) => row.map((v, k) => (k === c ? p[r] : v)))) / det(m));
}

for (const m of [
    [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
    ],
    [
        [0.8, -0.6, 0],
        [0.6, 0.8, 0],
        [0, 0.3, 1],
    ],
])
    test(`a linear value is exact in the body ${m}`, () => {
        const { x, tets, inverse } = cube(m);
        const linear = (p) => 2 + p[0] - 3 * p[1] + 0.5 * p[2];
        const value = Float32Array.from({ length: 8 }, (_, i) => linear(x.subarray(3 * i, 3 * i + 3)));
        const range = { low: Math.min(...value), high: Math.max(...value) };
        const grid = gridAround(x, 24);
        fillGrid(x, tets, value, range, grid);
        assert.ok(Math.max(...grid.size) === 24, `${grid.size}`);
        let inside = 0;
        for (let k = 0, at = 0; k < grid.size[2]; k++)
            for (let j = 0; j < grid.size[1]; j++)
                for (let i = 0; i < grid.size[0]; i++, at += 2) {
                    const p = [i, j, k].map((n, c) => grid.low[c] + n * grid.step);
                    const margin = Math.min(...inverse(p).map((c) => Math.min(c, 1 - c)));
                    if (Math.abs(margin) > 1e-5) assert.equal(grid.data[at + 1] === 255, margin > 0, `${p}`);
                    if (!grid.data[at + 1]) continue;
                    inside++;
                    const shown = range.low + ((range.high - range.low) * grid.data[at]) / 255;
                    assert.ok(Math.abs(shown - linear(p)) < (0.51 * (range.high - range.low)) / 255, `${p}`);
                }
        const volume = inside * grid.step ** 3;
        assert.ok(volume > 0.85 && volume < 1.15, `${volume}`);
        // a border of points outside
        for (let j = 0; j < grid.size[1]; j++) assert.equal(grid.data[2 * grid.size[0] * j + 1], 0);
    });
