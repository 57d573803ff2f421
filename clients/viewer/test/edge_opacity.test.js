import assert from "node:assert/strict";
import { test } from "node:test";
import { edgeOpacity, meanEdge } from "../src/edge_opacity.js";

test("the mean edge of a strip of equal triangles is their side", () => {
    const x = [];
    const triangles = [];
    for (let i = 0; i < 3000; i++) {
        x.push(0.002 * (i >> 1), 0.002 * (i & 1), 0);
        if (i >= 2 && i % 2 === 0) triangles.push(i - 2, i, i - 1); // the first side runs along the strip
    }
    assert.ok(Math.abs(meanEdge(x, triangles) - 0.002) < 1e-12);
    assert.equal(meanEdge([], []), 0);
});

test("edges fade where they stand too close, and never vanish", () => {
    assert.equal(edgeOpacity(40), 1);
    assert.equal(edgeOpacity(5), 0.5);
    assert.equal(edgeOpacity(0.1), edgeOpacity(0));
    assert.ok(edgeOpacity(0) > 0);
});
