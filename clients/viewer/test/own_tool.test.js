// The own tool is drawn where the hand is; the others where the server says.
import assert from "node:assert/strict";
import { test } from "node:test";
import { pressDepth, withOwnTool } from "../src/own_tool.js";

/** @param {object} changes */
const tool = (changes) =>
    /** @type {any} */ ({ held: true, away: false, position: [1, 2, 3], force: [0, 0, 1], ...changes });

test("the own tool does not wait for the round trip", () => {
    const tools = [tool({}), tool({ position: [4, 5, 6] })];
    const drawn = withOwnTool(tools, 1, { position: [7, 8, 9], quaternion: [0, 1, 0, 0] });
    assert.deepEqual(
        drawn.map((t) => t.position),
        [
            [1, 2, 3],
            [7, 8, 9],
        ],
    );
    assert.deepEqual(drawn[1].force, [0, 0, 1]);
    assert.deepEqual(drawn[1].quaternion, [0, 1, 0, 0]);
    assert.deepEqual(tools[1].position, [4, 5, 6]);
});

test("a tool that is away, not held or not one's own stays as the server says", () => {
    const tools = [tool({ away: true }), tool({ held: false })];
    for (const own of [-1, 0, 1]) assert.equal(withOwnTool(tools, own, { position: [7, 8, 9] }), tools);
    assert.equal(withOwnTool([tool({})], 0, null)[0].position[0], 1);
});

test("the depth of a press is that of the front of the tool behind the point that was touched", () => {
    const vector = (/** @type {number[]} */ v) => /** @type {any} */ ({ toArray: () => v });
    const drag = { grasp: false, into: vector([0, 0, -1]), at: vector([1, 2, 0.03]) };
    const at = (/** @type {number} */ z) => ({ contact: true, position: [1.5, 2, z], radius: 0.008 });
    assert.ok(Math.abs(pressDepth(drag, at(0.026)) - 0.012) < 1e-12);
    assert.equal(pressDepth(drag, at(0.05)), 0);
    for (const [d, t] of /** @type {any[]} */ ([
        [null, at(0)],
        [drag, undefined],
        [{ ...drag, grasp: true }, at(0)],
        [drag, { ...at(0), contact: false }],
    ]))
        assert.equal(pressDepth(d, t), 0);
});
