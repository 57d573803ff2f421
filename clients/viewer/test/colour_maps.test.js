// Colour maps: evenly spaced lightness, symmetric around the middle of the diverging one, text of the legend readable.
import assert from "node:assert/strict";
import { test } from "node:test";
import { DIVERGING, SEQUENTIAL, STOPS, gradientOf, lightness } from "../src/colour_maps.js";

test("lightness is that of CIELAB", () => {
    assert.equal(lightness("#000000"), 0);
    assert.ok(Math.abs(lightness("#ffffff") - 100) < 0.1);
    assert.ok(Math.abs(lightness("#777777") - 50) < 0.2); // middle grey
});

test("the sequential map grows lighter in even steps", () => {
    const light = SEQUENTIAL.map(lightness);
    const mean = (light[STOPS - 1] - light[0]) / (STOPS - 1);
    assert.ok(mean > 6, `${mean}`);
    for (let i = 1; i < STOPS; i++) assert.ok(Math.abs(light[i] - light[i - 1] - mean) < 0.15 * mean, `stop ${i}`);
});

test("the diverging map is lightest at zero, symmetric, and even on each side", () => {
    const light = DIVERGING.map(lightness);
    const middle = (STOPS - 1) / 2;
    const mean = (light[middle] - light[0]) / middle;
    assert.ok(mean > 12, `${mean}`);
    for (let i = 1; i <= middle; i++) {
        assert.ok(Math.abs(light[middle - i] - light[middle + i]) < 1.5, `stop ${i}: ${light}`);
        assert.ok(Math.abs(light[i] - light[i - 1] - mean) < 0.15 * mean, `stop ${i}: ${light}`);
    }
    // zero has no hue
    assert.equal(new Set(DIVERGING[middle].slice(1).match(/../g)).size, 1);
});

/** a colour as somebody without red or without green cones sees it (Viénot, Brettel, Mollon 1999), linear light */
function dichromat(colour, kind) {
    const [r, g, b] = [1, 3, 5].map((i) => (parseInt(colour.slice(i, i + 2), 16) / 255) ** 2.2);
    return kind === "red"
        ? [0.11238 * r + 0.88762 * g, 0.11238 * r + 0.88762 * g, 0.00401 * r - 0.00401 * g + b]
        : [0.29275 * r + 0.70725 * g, 0.29275 * r + 0.70725 * g, -0.02234 * r + 0.02234 * g + b];
}

test("both sides of the diverging map differ without red or green cones", () => {
    for (const kind of ["red", "green"])
        for (let i = 0; i < 3; i++) {
            const blueness = (c) => dichromat(c, kind)[2] / dichromat(c, kind)[0];
            assert.ok(blueness(DIVERGING[i]) > 2.5 * blueness(DIVERGING[STOPS - 1 - i]), `${kind} stop ${i}`);
        }
});

test("a gradient has all stops", () => {
    assert.equal(gradientOf(["#000000", "#ffffff"]), "linear-gradient(90deg, #000000, #ffffff)");
});
