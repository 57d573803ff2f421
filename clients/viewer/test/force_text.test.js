// A force at its limit is no measurement.
import assert from "node:assert/strict";
import { test } from "node:test";
import { forceText } from "../src/force_text.js";

test("a force below the cap is a number", () => {
    assert.equal(forceText(0, 15), "0.00 N");
    assert.equal(forceText(14.9, 15), "14.90 N");
    assert.equal(forceText(3, undefined), "3.00 N");
});

test("at the cap it says so", () => {
    assert.equal(forceText(15, 15), "> 15 N, limit");
    assert.equal(forceText(14.99, 15), "> 15 N, limit");
    assert.equal(forceText(2.5, 2.5), "> 2.5 N, limit");
});
