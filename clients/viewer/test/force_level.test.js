// The force as a level between 0 and 1.
import assert from "node:assert/strict";
import { test } from "node:test";
import { blendLevel, forceLevel } from "../src/force_level.js";

test("no force has level 0, the cap of the tool 1, and more force a higher level", () => {
    assert.equal(forceLevel(0, 15), 0);
    assert.equal(forceLevel(15, 15), 1);
    assert.equal(forceLevel(99, 15), 1);
    assert.equal(forceLevel(15, undefined), 1);
    const levels = [0.1, 0.3, 1, 3, 10].map((force) => forceLevel(force, 15));
    levels.forEach((level, i) => assert.ok(level > (levels[i - 1] ?? 0) && level < 1, String(levels)));
    // an eighth of the cap is no less than a third of the scale: small forces are what a surgeon uses
    assert.ok(forceLevel(15 / 8, 15) > 0.33);
});

test("a level follows without overshoot, at any rate of pictures", () => {
    const once = blendLevel(0, 1, 0.3);
    let level = 0;
    for (let k = 0; k < 30; k++) level = blendLevel(level, 1, 0.01);
    assert.ok(Math.abs(level - once) < 1e-12 && once > 0.8 && once < 1);
    assert.equal(blendLevel(0.5, 1, 1e9), 1);
});
