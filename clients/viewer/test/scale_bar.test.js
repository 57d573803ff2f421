// The scale bar has a round length and a readable width at any distance.
import assert from "node:assert/strict";
import { test } from "node:test";
import { scaleOf } from "../src/scale_bar.js";

test("a liver that fills the picture has a bar of 20 mm", () => {
    assert.deepEqual(scaleOf(3000), { px: 60, text: "20 mm" });
    assert.deepEqual(scaleOf(2999), { px: 150, text: "50 mm" });
});

test("lengths are round, widths between 60 and 150 pixels", () => {
    for (let pixels = 3; pixels < 3e7; pixels *= 1.07) {
        const { px, text } = scaleOf(pixels);
        assert.ok(px >= 60 && px <= 151, `${pixels}: ${px}`);
        assert.match(text, /^(1|2|5)0*( mm| m)$|^0\.0*(1|2|5) mm$/);
        const metres = text.endsWith(" mm") ? parseFloat(text) / 1000 : parseFloat(text);
        assert.ok(Math.abs(metres * pixels - px) <= 0.51, text);
    }
});
