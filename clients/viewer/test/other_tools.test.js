// Tools of others move evenly between two messages.
import assert from "node:assert/strict";
import { test } from "node:test";
import { OtherTools } from "../src/other_tools.js";

/** @param {number[]} position @param {object} changes */
const tool = (position, changes = {}) =>
    /** @type {any} */ ({ held: true, away: false, position, quaternion: [1, 0, 0, 0], ...changes });
/** @param {OtherTools} others @param {number} now */
const x = (others, now) => others.draw(now)[0].position[0];

test("a tool that is told 50 times a second moves between two messages", () => {
    const others = new OtherTools();
    for (let k = 0; k <= 50; k++) others.take([tool([k, 0, 0])], 20 * k);
    const seen = [0, 5, 10, 15, 20].map((ms) => x(others, 1000 + ms));
    assert.ok(Math.abs(seen[0] - 49) < 0.1 && seen[4] === 50, String(seen));
    for (let k = 1; k < seen.length; k++) assert.ok(Math.abs(seen[k] - seen[k - 1] - 0.25) < 0.06, String(seen));
    assert.ok(others.moving(1010) && !others.moving(1030));
});

test("uneven arrival moves it no faster than half as fast again", () => {
    const others = new OtherTools();
    let last = 0;
    let fastest = 0;
    for (let ms = 0; ms < 3000; ms++) {
        // sent every 20 ms at 1 unit each, late by 0 to 8 ms
        const k = Math.floor(ms / 20);
        if (ms % 20 === (7 * k) % 9) others.take([tool([k, 0, 0])], ms);
        const now = x(others, ms);
        if (ms > 1000) fastest = Math.max(fastest, now - last);
        last = now;
    }
    assert.ok(fastest < 1.5 / 20, String(20 * fastest));
});

test("a tool that comes, or comes back, begins where it is", () => {
    const others = new OtherTools();
    others.take([tool([1, 0, 0])], 0);
    assert.equal(x(others, 1), 1);
    others.take([tool([2, 0, 0], { away: true })], 20);
    others.take([tool([9, 0, 0])], 40);
    assert.equal(x(others, 41), 9);
});
