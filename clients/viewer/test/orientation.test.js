// The cube of directions: faces stand where the patient's sides are, read from outside, and turn with the camera.
import assert from "node:assert/strict";
import { test } from "node:test";
import { faceMatrix, facingSide, sidesOf, turnMatrix } from "../src/orientation.js";

/** @param {number[]} m @param {number[]} v with its fourth number */
const times = (m, v) => [0, 1, 2, 3].map((r) => m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2] + m[12 + r] * v[3]);
const dot = (/** @type {number[]} */ a, /** @type {number[]} */ b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (/** @type {number[]} */ a) => a.map((v) => v / Math.sqrt(dot(a, a)));
/** rotation of a view, column-major @param {number[]} at @param {number[]} up of the camera, which looks at the middle */
function camera(at, up) {
    const back = unit(at);
    const above = unit(up.map((v, k) => v - dot(up, back) * back[k]));
    const right = [0, 1, 2].map((k) => above[(k + 1) % 3] * back[(k + 2) % 3] - above[(k + 2) % 3] * back[(k + 1) % 3]);
    return [0, 1, 2, 3].flatMap((c) => (c < 3 ? [right[c], above[c], back[c], 0] : [0.1, 0.2, -3, 1]));
}
const near = (/** @type {number[]} */ a, /** @type {number[]} */ b) =>
    a.forEach((v, k) => assert.ok(Math.abs(v - b[k]) < 1e-9, `${a} is not ${b}`));

test("axes give the directions of all six sides", () => {
    const lps = sidesOf("LPS");
    assert.ok(lps);
    near(lps.L, [1, 0, 0]);
    near(lps.R, [-1, 0, 0]);
    near(lps.A, [0, -1, 0]);
    near(lps.I, [0, 0, -1]);
});

test("what names no axes gives no cube", () => {
    for (const text of ["", "R", "RA", "RAR", "RLS", "RASR", "ras", "XYZ"]) assert.equal(sidesOf(text), null, text);
});

for (const axes of ["RAS", "LPS", "LSA", "PIR"])
    test(`in ${axes} each letter faces the reader who looks at its side, upright`, () => {
        const sides = sidesOf(axes);
        assert.ok(sides);
        for (const side of /** @type {import("../src/orientation.js").Side[]} */ (["R", "L", "A", "P", "S", "I"])) {
            const up = side === "S" || side === "I" ? sides.A : sides.S;
            const view = camera(
                sides[side].map((v) => 2 * v),
                up,
            );
            assert.equal(facingSide(sides, view), side);
            const turn = turnMatrix(view);
            const face = faceMatrix(side, sides);
            // the page's axes of the letter are those of the page again: neither turned nor mirrored
            near(times(turn, times(face, [1, 0, 0, 0])), [1, 0, 0, 0]);
            near(times(turn, times(face, [0, 1, 0, 0])), [0, 1, 0, 0]);
            near(times(turn, times(face, [0, 0, 1, 0])), [0, 0, 1, 0]);
            const middle = times(turn, times(face, [0, 0, 0, 1]));
            near(middle, [0, 0, 24, 1]);
        }
    });

test("from the front the patient's right is on the left of the picture", () => {
    const sides = sidesOf("RAS");
    assert.ok(sides);
    const turn = turnMatrix(camera([0, 3, 0], [0, 0, 1]));
    assert.ok(times(turn, [...sides.R, 0])[0] < -0.99);
    assert.ok(times(turn, [...sides.S, 0])[1] < -0.99, "y of the page points down");
});

test("an oblique view names the side that is nearest", () => {
    const sides = sidesOf("RAS");
    assert.ok(sides);
    assert.equal(facingSide(sides, camera([1, 3, 2], [0, 0, 1])), "A");
    assert.equal(facingSide(sides, camera([-3, 1, 2], [0, 0, 1])), "L");
});
