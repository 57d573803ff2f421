// Planes that cut bodies open: positions in the box of the scene, sides, rays.
import assert from "node:assert/strict";
import { test } from "node:test";
import { DIRECTIONS, entryOf, noPlanes, PLANES_MAX, planeOf } from "../src/section_planes.js";

const box = [
    [0, -1, 2],
    [4, 1, 3],
];
const side = ({ normal, constant }, p) => constant + normal.reduce((sum, n, c) => sum + n * p[c], 0);

test("a plane goes from one end of the scene to the other", () => {
    for (const [axis, direction] of ["x", "y", "z"].entries())
        for (const at of [0, 0.25, 1]) {
            const plane = planeOf({ direction, at, flipped: false }, box, [0, 0, 1]);
            const point = box[0].map((low, c) => (c === axis ? low + at * (box[1][c] - low) : 17));
            assert.ok(Math.abs(side(plane, point)) < 1e-12);
            point[axis] -= 0.1;
            assert.ok(side(plane, point) > 0, "what lies before it is kept");
            const other = planeOf({ direction, at, flipped: true }, box, [0, 0, 1]);
            assert.ok(side(other, point) < 0, "flipped: what lies beyond it");
        }
});

test("a plane that faces the viewer removes what is nearer", () => {
    const view = [0.6, 0, 0.8];
    const plane = planeOf({ direction: "view", at: 0.5, flipped: false }, box, view);
    const middle = [2, 0, 2.5];
    assert.ok(Math.abs(side(plane, middle)) < 1e-12);
    assert.ok(
        side(
            plane,
            middle.map((m, c) => m + view[c]),
        ) < 0,
    );
    // at its ends the whole box is kept, or nothing
    for (const [at, sign] of [
        [1, 1],
        [0, -1],
    ])
        for (let k = 0; k < 8; k++) {
            const corner = [0, 1, 2].map((c) => box[(k >> c) & 1][c]);
            const end = planeOf({ direction: "view", at, flipped: false }, box, view);
            assert.ok(sign * side(end, corner) > -1e-12);
        }
});

test("no plane cuts before it is chosen", () => {
    assert.equal(noPlanes().length, PLANES_MAX);
    for (const plane of noPlanes()) assert.equal(planeOf(plane, box, [0, 0, 1]), null);
    assert.equal(DIRECTIONS[0], "none");
});

test("a ray begins where one of the planes keeps it", () => {
    const before = planeOf({ direction: "x", at: 0.5, flipped: false }, box, [0, 0, 1]); // x <= 2
    const low = planeOf({ direction: "y", at: 0.5, flipped: false }, box, [0, 0, 1]); // y <= 0
    assert.equal(entryOf([10, 1, 0], [-2, 0, 0], [before]), 4);
    assert.equal(entryOf([0, 1, 0], [1, 0, 0], [before]), 0);
    assert.equal(entryOf([10, 1, 0], [-1, -1, 0], [before, low]), 1);
    assert.equal(entryOf([10, -1, 0], [-1, 0, 0], [before, low]), 0);
    assert.equal(entryOf([3, 1, 0], [1, 0, 0], [before, low]), Infinity);
    assert.equal(entryOf([3, 1, 0], [0, 0, 1], [before]), Infinity);
    assert.equal(entryOf([3, 5, 5], [1, 0, 0], []), 0);
});
