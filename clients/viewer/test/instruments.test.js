// Instruments: closed solids with normals outwards, the tip at the origin, jaws about their hinge; a shaft that passes
// its port.
import assert from "node:assert/strict";
import { test } from "node:test";
import { aim, handAt, isOriented, mixed, rotate, turnedTowards } from "../src/instrument_pose.js";
import { INSTRUMENTS, shapeOf } from "../src/instrument_shapes.js";
import { corners, cross, dot, subtract, turned, unit, volumeOf } from "../src/solid_shapes.js";

/** @typedef {import("../src/instrument_shapes.js").Shape} Shape */

/** @param {string} name */
const shape = (name) => /** @type {Shape} */ (shapeOf(name));
/** @param {Shape} shape */
const solidsOf = ({ steel, black, jaws }) => [...steel, ...black, ...jaws];
/** @param {number[]} a @param {number[]} b */
const distance = (a, b) => Math.hypot(...subtract(a, b));
const close = (/** @type {number} */ a, /** @type {number} */ b, tolerance = 1e-9) =>
    assert.ok(Math.abs(a - b) <= tolerance, `${a} is not ${b}`);

/** angle of a jaw turned by `angle`: points of both jaws in the axes of the instrument @param {Shape} shape @param {number} angle */
const jawPoints = (shape, angle) =>
    shape.jaws.map(({ points }, i) => {
        const turn = i ? -angle : angle;
        return points.map(([x, y, z]) => [
            shape.hinge + x * Math.cos(turn) - y * Math.sin(turn),
            x * Math.sin(turn) + y * Math.cos(turn),
            z,
        ]);
    });

for (const name of INSTRUMENTS)
    test(`${name}: every solid is closed and faces outwards`, () => {
        for (const { points, triangles } of solidsOf(shape(name))) {
            /** @type {Map<string, number>} */
            const edges = new Map();
            for (const corner of triangles)
                for (let k = 0; k < 3; k++) {
                    const key = `${corner[k]} ${corner[(k + 1) % 3]}`;
                    edges.set(key, (edges.get(key) ?? 0) + 1);
                }
            for (const [key, count] of edges) {
                assert.equal(count, 1, `half-edge ${key}`);
                assert.equal(edges.get(key.split(" ").reverse().join(" ")), 1, `twin of ${key}`);
            }
            assert.ok(volumeOf({ points, triangles }) > 0);
            const { positions, normals } = corners([{ points, triangles }]);
            for (let i = 0; i < positions.length; i += 9) {
                const [a, b, c] = [0, 3, 6].map((k) => [...positions.slice(i + k, i + k + 3)]);
                const face = cross(subtract(b, a), subtract(c, a));
                if (Math.hypot(...face) < 1e-6) continue; // a needle has no direction
                for (let k = 0; k < 9; k += 3) {
                    const normal = [...normals.slice(i + k, i + k + 3)];
                    close(Math.hypot(...normal), 1, 1e-5);
                    assert.ok(dot(normal, unit(face)) > 0.5, `normal at ${a}`);
                }
            }
        }
    });

// 0.1 mm for a tool of 7.5 mm are 0.013 radii
for (const name of INSTRUMENTS.filter((word) => word !== "probe"))
    test(`${name}: the tip is at the position of the tool, and nothing reaches beyond the sphere of contact`, () => {
        const { steel, black, jaws } = shape(name);
        const points = [...steel, ...black].flatMap((solid) => solid.points).concat(jawPoints(shape(name), 0).flat());
        const reach = Math.max(...points.map(([x]) => x));
        const nearest = Math.min(...points.map((p) => Math.hypot(...p)));
        assert.ok(nearest < (jaws.length || name === "retractor" ? 0.16 : 0.2), String(nearest));
        assert.ok(reach <= 0.2 && reach >= -0.013, String(reach));
        for (const p of points) if (p[0] > -0.5) assert.ok(Math.hypot(...p) < 1.5);
    });

test("jaws open by their angle, and close without a gap", () => {
    for (const name of ["grasper", "scissors"]) {
        const { jaws, open, held, hinge } = shape(name);
        assert.equal(jaws.length, 2);
        assert.ok(open > 3 * held && held > 0, name);
        const tips = jawPoints(shape(name), open).map((points) =>
            points.reduce((far, p) => (p[0] ** 2 + p[1] ** 2 > far[0] ** 2 + far[1] ** 2 ? far : p)),
        );
        // both tips are as far from the hinge as the hinge from the origin; between them twice the angle
        const arms = tips.map(([x, y]) => unit([x - hinge, y, 0]));
        close(Math.acos(dot(arms[0], arms[1])), 2 * open, 0.12);
        const gap = (/** @type {number} */ angle) => {
            const [upper, lower] = jawPoints(shape(name), angle);
            return Math.min(...upper.map(([, y]) => y)) - Math.max(...lower.map(([, y]) => y));
        };
        assert.ok(gap(0) < 0.1, `${name}: ${gap(0)}`);
    }
});

test("a word without a shape is a ball", () => {
    for (const word of [undefined, "", "ball", "spoon", "toString"]) assert.equal(shapeOf(word), null);
    assert.equal(shapeOf("grasper"), shapeOf("grasper"));
});

/** a number of -1 to 1 for each index, the same every time @param {number} i */
const wobble = (i) => Math.sin(12.9898 * i + 78.233);

test("the axis of an instrument passes its port wherever the tip is", () => {
    for (let i = 0; i < 200; i++) {
        const port = [0, 1, 2].map((k) => 0.3 * wobble(9 * i + k));
        const start = [0, 1, 2].map((k) => 0.1 * wobble(9 * i + k + 3));
        const tip = [0, 1, 2].map((k) => 0.1 * wobble(9 * i + k + 6));
        const hand = { ...handAt(port, start, unit([wobble(i), 1, 0.2])), roll: 3 * wobble(i + 1000) };
        const q = aim(hand, tip);
        close(Math.hypot(...q), 1);
        const x = rotate(q, [1, 0, 0]);
        // the port lies on the line through the tip along x
        const length = distance(tip, port);
        close(
            distance(
                port,
                tip.map((v, k) => v + length * x[k]),
            ),
            0,
            1e-9,
        );
    }
});

test("a hand opens its jaws in view of the eye; roll turns them about the shaft", () => {
    const port = [0, 0, 0.3];
    const tip = [0.05, 0, 0];
    const eye = unit([0, -1, 0.5]);
    const hand = handAt(port, tip, eye);
    const hinge = (/** @type {number} */ roll) => rotate(aim({ ...hand, roll }, tip), [0, 0, 1]);
    const axis = unit(subtract(port, tip));
    // as near to the eye as a direction across the shaft can be
    const across = unit(eye.map((v, k) => v - dot(eye, axis) * axis[k]));
    close(dot(hinge(0), across), 1);
    close(dot(hinge(0.5), hinge(0)), Math.cos(0.5));
    close(dot(cross(hinge(0), hinge(0.5)), axis), Math.sin(0.5));
    // a half turn away from where the jaws would be keeps the shaft
    const low = rotate(aim(handAt([1, 0, 0], [0, 0, 0], [0, 0, -1]), [0, 0, 0]), [1, 0, 0]);
    close(low[0], 1);
    // looking along the shaft says nothing about the turn, but there is one
    close(Math.hypot(...aim(handAt(port, tip, axis), tip)), 1);
});

test("who names no orientation has the quaternion 1 0 0 0", () => {
    assert.ok(!isOriented([1, 0, 0, 0]) && !isOriented([-1, 0, 0, 0]));
    assert.ok(isOriented(aim(handAt([0, 0, 1], [0, 0, 0], [0, -1, 0]), [0, 0, 0])));
});

test("half way between two orientations is half of the turn, by the shorter way", () => {
    const turn = (/** @type {number} */ angle) => [Math.cos(angle / 2), 0, 0, Math.sin(angle / 2)];
    for (const sign of [1, -1]) {
        const half = mixed(
            turn(0.2),
            turn(0.8).map((v) => sign * v),
            0.5,
        );
        close(Math.abs(dot(rotate(half, [1, 0, 0]), [Math.cos(0.5), Math.sin(0.5), 0])), 1);
    }
});

test("jaws move to their angle in steps and stay there", () => {
    let angle = 0.35;
    for (let k = 0; k < 3; k++) angle = turnedTowards(angle, 0.07, 0.1);
    assert.equal(angle, 0.07);
    assert.equal(turnedTowards(0, 0.35, 0), 0);
    close(turnedTowards(0, 0.35, 0.1), 0.1);
});

test("a turned rod has the volume of its cylinder", () => {
    const rod = turned(
        [
            [-2, 0.5],
            [0, 0.5],
        ],
        256,
    );
    close(volumeOf(rod), Math.PI * 0.25 * 2, 1e-3);
});
