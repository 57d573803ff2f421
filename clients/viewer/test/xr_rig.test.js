import assert from "node:assert/strict";
import { test } from "node:test";
import { regrip, startRig, toLevel } from "../src/xr_rig.js";

const size = 0.3;
const rig = { at: [0.1, -0.4, 0.2], yaw: 0.7, scale: 0.6 };
const hands = [
    [-0.2, 1.1, -0.4],
    [0.25, 1.2, -0.5],
];
/** @param {number[]} u @param {number[]} v */
const near = (u, v) => u.forEach((c, k) => assert.ok(Math.abs(c - v[k]) < 1e-12, `${u} is not ${v}`));

test("at first the scene is before the head, below it, as large as arms reach", () => {
    for (const yaw of [0, 1.3, -2]) {
        const centre = [0.3, 0.1, -0.2];
        const start = startRig({ position: [0.5, 1.6, 2], yaw }, { centre, size, azimuth: 0.4 });
        const head = toLevel(start, [0.5, 1.6, 2]);
        const away = head.map((c, k) => (c - centre[k]) / start.scale);
        assert.ok(Math.abs(Math.hypot(away[0], away[2]) - 0.5) < 1e-12 && Math.abs(away[1] - 0.32) < 1e-12);
        // from the azimuth of the free view
        assert.ok(Math.abs(Math.atan2(away[0], away[2]) - 0.4) < 1e-12);
        assert.ok(Math.abs(size / start.scale - 0.5) < 1e-12);
    }
});

test("one hand moves the scene and does not turn it", () => {
    const after = [[-0.1, 1.3, -0.2]];
    const now = regrip(rig, hands.slice(0, 1), after, size);
    near(toLevel(now, after[0]), toLevel(rig, hands[0]));
    assert.deepEqual([now.yaw, now.scale], [rig.yaw, rig.scale]);
});

test("two hands turn, scale and move it: what they held, they hold", () => {
    const turn = (/** @type {number} */ angle, /** @type {number} */ stretch) =>
        hands.map(([x, y, z]) => [
            stretch * (Math.cos(angle) * x + Math.sin(angle) * z) + 0.1,
            stretch * y,
            stretch * (Math.cos(angle) * z - Math.sin(angle) * x) - 0.3,
        ]);
    for (const [angle, stretch] of [
        [0.5, 1.4],
        [-1, 0.7],
        [3, 1],
    ]) {
        const after = turn(angle, stretch);
        const now = regrip(rig, hands, after, size);
        for (const i of [0, 1]) near(toLevel(now, after[i]), toLevel(rig, hands[i]));
        assert.ok(Math.abs(now.scale - rig.scale / stretch) < 1e-12);
    }
});

test("hands at one place and great stretches do no harm", () => {
    const together = [hands[0], hands[0]];
    for (const [before, after] of [
        [together, hands],
        [hands, together],
        [together, together],
        [[], []],
    ]) {
        const now = regrip(rig, before, after, size);
        assert.ok([...now.at, now.yaw, now.scale].every(Number.isFinite));
    }
    let now = rig;
    for (let i = 0; i < 20; i++)
        now = regrip(
            now,
            hands,
            hands.map((hand) => hand.map((c) => 2 * c)),
            size,
        );
    assert.ok(Math.abs(size / now.scale - 6) < 1e-9, "as large as a room, and no larger");
});
