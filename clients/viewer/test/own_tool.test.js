// The own tool is drawn where the hand is; the others where the server says.
import assert from "node:assert/strict";
import { test } from "node:test";
import { withOwnTool } from "../src/own_tool.js";

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
