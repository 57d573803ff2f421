// PoseSender: a pointer may jump, the tool moves no faster than a hand, so that the server does not lift it.
import assert from "node:assert/strict";
import test from "node:test";

import { aim, handAt } from "../src/instrument_pose.js";
import { PoseSender } from "../src/pose_sender.js";

/** sends once per frame of 16 ms while the pointer jumps by 0.5 m; the positions along x and their times, ms */
function followed(t, size) {
    const sent = [];
    let now = 1000;
    t.mock.method(performance, "now", () => now);
    const state = { target: { position: [0, 0, 0], grasp: false }, ownTool: 0, ownToolState: () => undefined };
    const poses = new PoseSender(
        /** @type {any} */ (state),
        (message) => sent.push({ x: message.position?.[0], away: message.away, now }),
        () => size,
    );
    poses.send(true);
    state.target = { position: [0.5, 0, 0], grasp: false };
    for (let frame = 0; frame < 30; frame++) {
        now += 16;
        poses.send(frame === 0);
    }
    return { sent, poses, state };
}

test("the tool follows a jump of the pointer at 2.5 m/s and arrives", (t) => {
    const { sent } = followed(t, 0.2);
    for (let i = 1; i < sent.length; i++)
        assert.ok(sent[i].x - sent[i - 1].x <= (2.5 * (sent[i].now - sent[i - 1].now)) / 1000 + 1e-9);
    assert.equal(sent.at(-1).x, 0.5);
    // 0.5 m at 2.5 m/s are 200 ms, 13 poses of 16 ms; then the tool rests
    assert.equal(
        sent.findIndex((pose) => pose.x === 0.5),
        13,
    );
});

test("in a large scene it moves ten sizes a second", (t) => {
    const { sent } = followed(t, 2);
    assert.equal(
        sent.findIndex((pose) => pose.x === 0.5),
        2,
    );
});

test("a tool that was lifted is put down where the pointer is", (t) => {
    const { sent, poses, state } = followed(t, 0.2);
    state.target = null;
    poses.send(true);
    assert.ok(sent.at(-1).away);
    state.target = { position: [-0.5, 0, 0], grasp: false };
    poses.send(true);
    assert.equal(sent.at(-1).x, -0.5);
});

test("an instrument is sent with its orientation, and the shaft follows the way of the tip", (t) => {
    const { poses, state } = followed(t, 0.2);
    assert.equal(/** @type {any} */ (poses.last).quaternion, undefined); // a ball has none
    const hand = handAt([0, 0, 1], [0.5, 0, 0], [0, 1, 0]);
    state.target = { position: [-0.5, 0, 0], grasp: false, hand };
    poses.send(true);
    const { position, quaternion } = /** @type {any} */ (poses.last);
    assert.ok(position[0] > -0.5 && position[0] < 0.5);
    assert.deepEqual(quaternion, aim(hand, position));
});
