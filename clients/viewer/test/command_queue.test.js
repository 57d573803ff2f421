// Commands of sliders: never more than the server takes, and the last one always arrives.
import assert from "node:assert/strict";
import { test } from "node:test";
import { CommandQueue } from "../src/command_queue.js";

/** @param {string} verb @param {number} value */
const command = (verb, value) =>
    /** @type {import("../src/command_queue.js").Command} */ ({ type: "command", verb, target: "", args: { value } });

test("a slider that moves 60 times a second sends 15 in each second, and its last value", () => {
    const queue = new CommandQueue();
    const sent = [];
    for (let i = 0; i < 600; i++) {
        queue.add(command("cut", i));
        sent.push(...queue.take((1000 * i) / 60));
    }
    assert.ok(sent.length >= 15 * 9 && sent.length <= 15 * 10 + 15, String(sent.length));
    const pause = queue.pause();
    if (pause !== null) sent.push(...queue.take(10000 + pause + 1));
    assert.equal(sent.at(-1)?.args?.value, 599);
});

test("commands of another verb or target are kept, in order", () => {
    const queue = new CommandQueue();
    for (let i = 0; i < 15; i++) queue.add(command(`first${i}`, 0));
    assert.equal(queue.take(0).length, 15);
    queue.add(command("cut", 1));
    queue.add(command("undo", 2));
    queue.add(command("cut", 3));
    assert.deepEqual(
        queue.take(1000).map(({ verb, args }) => [verb, args?.value]),
        [
            ["cut", 3],
            ["undo", 2],
        ],
    );
    assert.equal(queue.pause(), null);
});
