import assert from "node:assert/strict";
import { test } from "node:test";
import { aim, direction, pivot, roundPicture, scopeView, turned } from "../src/scope_pose.js";

const ground = { a: [1, 0, 0], b: [0, 1, 0], up: [0, 0, 1] };
const pose = { port: [0.1, -0.3, 0.2], yaw: 0.4, pitch: 0.6, depth: 0.15, angle: 0, turn: 0, roll: 0 };
const ANGLED = Math.PI / 6;
/** @param {number[]} u @param {number[]} v */
const dot = (u, v) => u.reduce((s, c, k) => s + c * v[k], 0);
/** @param {number[]} u @param {number[]} v @param {string} [what] */
const same = (u, v, what) => u.forEach((c, k) => assert.ok(Math.abs(c - v[k]) < 1e-12, `${what} ${u} ${v}`));
/** what the camera looks along @param {number[][]} basis */
const view = (basis) => basis[2].map((c) => -c);

/** @param {number[][]} basis */
function checkRotation(basis) {
    for (let i = 0; i < 3; i++)
        for (let j = 0; j < 3; j++) assert.ok(Math.abs(dot(basis[i], basis[j]) - (i === j ? 1 : 0)) < 1e-12);
    const [x, y, z] = basis;
    assert.ok(
        x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) + x[2] * (y[0] * z[1] - y[1] * z[0]) >
            0,
    );
}

test("straight optics look along the shaft, which passes through the port", () => {
    for (const depth of [0, 0.05, 0.2]) {
        const { tip, shaft, basis } = scopeView({ ...pose, depth }, ground);
        same(
            tip,
            pose.port.map((c, k) => c + depth * shaft[k]),
        );
        same(view(basis), shaft);
        same(
            shaft,
            direction(ground, pose.yaw, pose.pitch).map((c) => -c),
        );
        assert.ok(Math.abs(dot(basis[0], ground.up)) < 1e-12, "the horizon is level");
        assert.ok(dot(basis[1], ground.up) > 0);
    }
});

test("angled optics look 30 degrees aside, first down, and to every side when turned", () => {
    let lowest = 0;
    for (const turn of [-2, -1, 0, 0.7, 1.6, Math.PI]) {
        const { shaft, basis } = scopeView({ ...pose, angle: ANGLED, turn }, ground);
        checkRotation(basis);
        assert.ok(Math.abs(dot(view(basis), shaft) - Math.cos(ANGLED)) < 1e-12);
        lowest = Math.min(lowest, dot(view(basis), ground.up));
    }
    assert.equal(dot(view(scopeView({ ...pose, angle: ANGLED }, ground).basis), ground.up), lowest);
});

test("turning straight optics changes nothing; the roll turns the picture only", () => {
    const { basis } = scopeView(pose, ground);
    scopeView({ ...pose, turn: 1.1 }, ground).basis.forEach((axis, k) => same(axis, basis[k]));
    const rolled = scopeView({ ...pose, roll: 0.5 }, ground).basis;
    same(view(rolled), view(basis));
    assert.ok(Math.abs(dot(rolled[1], basis[1]) - Math.cos(0.5)) < 1e-12);
});

test("aimed optics look at the point", () => {
    for (const angle of [0, ANGLED, 1.2])
        for (const depth of [0, 0.3, 0.8]) {
            const point = pose.port.map((c, k) => c - direction(ground, 0.4, 0.3)[k]);
            const { tip, basis } = scopeView({ ...pose, depth, angle, pitch: 0.3 - aim(angle, depth) }, ground);
            const to = point.map((c, k) => c - tip[k]);
            assert.ok(Math.abs(dot(view(basis), to) / Math.hypot(...to) - 1) < 1e-12, `${angle} ${depth}`);
        }
});

test("the picture follows a drag, however it is rolled, and the port stays", () => {
    const straight = { yaw: pose.yaw, pitch: pose.pitch };
    for (const roll of [0, 0.8, -2, Math.PI]) {
        const from = scopeView({ ...pose, roll }, ground);
        const far = from.tip.map((c, k) => c + 0.1 * view(from.basis)[k]); // in the middle of the picture
        for (const [dx, dy] of [
            [0.01, 0],
            [0, 0.01],
            [-0.007, 0.006],
        ]) {
            const to = pivot({ ...pose, roll }, straight, dx, dy);
            assert.deepEqual(to.port, pose.port);
            const { tip, basis } = scopeView(to, ground);
            const seen = [0, 1].map((axis) =>
                dot(
                    far.map((c, k) => c - tip[k]),
                    basis[axis],
                ),
            );
            assert.ok(seen[0] * dx - seen[1] * dy > 0.9 * Math.hypot(...seen) * Math.hypot(dx, dy), `${roll} ${seen}`);
        }
    }
});

test("the port limits the swing of the shaft, and the pole is never reached", () => {
    const straight = { yaw: pose.yaw, pitch: pose.pitch };
    let swung = pose;
    for (let i = 0; i < 100; i++) swung = pivot(swung, straight, 0.1, -0.1);
    assert.ok(swung.yaw - pose.yaw < 1.3 && swung.pitch <= 1.4 && swung.pitch > pose.pitch);
    checkRotation(scopeView(swung, ground).basis);
});

test("four quarter turns are none", () => {
    const { basis } = scopeView(pose, ground);
    for (const axis of /** @type {const} */ ([0, 1, 2])) {
        let now = basis;
        for (let i = 0; i < 4; i++) now = turned(now, axis, Math.PI / 2);
        now.forEach((v, k) => same(v, basis[k]));
    }
});

test("the round picture fills what panels leave free", () => {
    assert.deepEqual(roundPicture(1280, 800, { left: 0, right: 0, bottom: 0 }), { x: 640, y: 400, radius: 400 });
    assert.deepEqual(roundPicture(1280, 800, { left: 300, right: 500, bottom: 0 }), { x: 540, y: 400, radius: 240 });
    assert.deepEqual(roundPicture(390, 844, { left: 0, right: 0, bottom: 444 }), { x: 195, y: 200, radius: 195 });
    assert.deepEqual(roundPicture(390, 844, { left: 0, right: 0, bottom: 0 }), { x: 195, y: 422, radius: 195 });
});
