// Slices of tetrahedra: linear fields are exact, areas add up, the skirt surrounds them; every plane of a random mesh.
import assert from "node:assert/strict";
import { test } from "node:test";
import { outerFaces, sliceTets } from "../src/slice.js";

/** a box of n x n x n cubes of edge 1, five or six tetrahedra each: six around the diagonal, which match from cube to cube */
function box(n) {
    const node = (i, j, k) => i + (n + 1) * (j + (n + 1) * k);
    const x = [];
    for (let k = 0; k <= n; k++) for (let j = 0; j <= n; j++) for (let i = 0; i <= n; i++) x.push(i, j, k);
    const tets = [];
    const orders = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    for (let k = 0; k < n; k++)
        for (let j = 0; j < n; j++)
            for (let i = 0; i < n; i++)
                for (const order of orders) {
                    const at = [i, j, k];
                    const tet = [node(...at)];
                    for (const axis of order) {
                        at[axis]++;
                        tet.push(node(...at));
                    }
                    tets.push(...tet);
                }
    return { x: Float32Array.from(x), tets: Uint32Array.from(tets) };
}

const linear = (p) => 3 + 2 * p[0] - 5 * p[1] + 0.5 * p[2];
const valuesOf = (x) => Float32Array.from({ length: x.length / 3 }, (_, i) => linear(x.subarray(3 * i, 3 * i + 3)));
const planeThrough = (point, direction) => {
    const length = Math.hypot(...direction);
    const normal = direction.map((d) => d / length);
    return { normal, constant: -normal.reduce((sum, v, c) => sum + v * point[c], 0) };
};
function areaOf({ positions, n }, from = 0) {
    let area = 0;
    for (let k = from; k < n; k += 3) {
        const [a, b, c] = [0, 1, 2].map((i) => positions.subarray(3 * (k + i), 3 * (k + i) + 3));
        const u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        const v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
        area += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
    }
    return area;
}

test("a linear field is exact on any slice, and every corner lies in the plane", () => {
    const { x, tets } = box(3);
    const value = valuesOf(x);
    let seed = 1;
    const random = () => ((seed = (seed * 16807) % 2147483647) / 2147483647) * 2 - 1;
    for (let turn = 0; turn < 50; turn++) {
        const plane = planeThrough([1.5 + random(), 1.5 + random(), 1.5 + random()], [random(), random(), random()]);
        const slice = sliceTets(x, tets, value, plane, null);
        assert.ok(slice.n > 0 && slice.n % 3 === 0);
        for (let k = 0; k < slice.n; k++) {
            const p = slice.positions.subarray(3 * k, 3 * k + 3);
            const off = plane.constant + plane.normal.reduce((sum, v, c) => sum + v * p[c], 0);
            assert.ok(Math.abs(off) < 1e-5, `${off} from the plane`);
            assert.ok(Math.abs(slice.values[k] - linear(p)) < 2e-4, `${slice.values[k]}`);
        }
    }
});

test("slices along the axes have the area of the box, also through nodes", () => {
    const { x, tets } = box(2);
    const value = valuesOf(x);
    for (const at of [0.25, 1, 1.7])
        for (let axis = 0; axis < 3; axis++) {
            const normal = [0, 1, 2].map((c) => (c === axis ? 1 : 0));
            assert.ok(Math.abs(areaOf(sliceTets(x, tets, value, { normal, constant: -at }, null)) - 4) < 1e-5);
        }
    // the largest hexagon of a cube
    const plane = planeThrough([1, 1, 1], [1, 1, 1]);
    assert.ok(Math.abs(areaOf(sliceTets(x, tets, value, plane, null)) - 3 * Math.sqrt(3)) < 1e-5);
    assert.equal(sliceTets(x, tets, value, { normal: [1, 0, 0], constant: 5 }, null).n, 0);
});

test("the outer faces are those of the box", () => {
    const { x, tets } = box(2);
    const outer = outerFaces(tets);
    let n = 0;
    outer.forEach((mask, t) => {
        for (let c = 0; c < 4; c++) {
            if (!((mask >> c) & 1)) continue;
            n++;
            const corners = [0, 1, 2, 3].filter((k) => k !== c).map((k) => tets[4 * t + k]);
            const flat = [0, 1, 2].some((axis) => {
                const first = x[3 * corners[0] + axis];
                return (first === 0 || first === 2) && corners.every((v) => x[3 * v + axis] === first);
            });
            assert.ok(flat, "on a side of the box");
        }
    });
    assert.equal(n, 6 * 4 * 2);
});

test("the skirt surrounds the slice with the values of its border", () => {
    const { x, tets } = box(2);
    const value = valuesOf(x);
    const plane = { normal: [0, 0, 1], constant: -0.3 };
    const skirt = { outer: outerFaces(tets), width: 0.1 };
    const slice = sliceTets(x, tets, value, plane, skirt);
    const inner = sliceTets(x, tets, value, plane, null);
    const n = slice.n - inner.n;
    assert.deepEqual(slice.positions.slice(3 * n, 3 * slice.n), inner.positions.slice(0, 3 * inner.n));
    // its strips are as wide as it says, but at the four corners, where they meet
    const area = areaOf({ ...slice, n });
    assert.ok(area > 0.1 * 8 * 0.85 && area < 0.1 * 8 * 1.15, `${area}`);
    for (let k = 0; k < n; k++) {
        const p = slice.positions.subarray(3 * k, 3 * k + 3);
        const beside = Math.max(Math.abs(p[0] - 1), Math.abs(p[1] - 1));
        assert.ok(beside > 1 - 1e-6 && beside < 1.1 + 1e-6, `${beside}`);
        assert.ok(Math.abs(p[2] - 0.3) < 1e-6);
        const border = [Math.min(2, Math.max(0, p[0])), Math.min(2, Math.max(0, p[1])), p[2]];
        assert.ok(Math.abs(slice.values[k] - linear(border)) < 0.6);
    }
    // arrays are used again
    assert.equal(sliceTets(x, tets, value, plane, skirt, slice).positions, slice.positions);
});
