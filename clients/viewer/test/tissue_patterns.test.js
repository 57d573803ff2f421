// Patterns of tissue: periodic, the same every time, and their slopes are those of their heights.
import assert from "node:assert/strict";
import { test } from "node:test";
import { drawVessels, growVessels, makeCells, makeNoise } from "../src/tissue_patterns.js";

/** @param {import("../src/tissue_patterns.js").Pattern} p @param {number[]} at place */
const height = ({ data, size }, at) => data[4 * ((at[2] * size + at[1]) * size + at[0]) + 3] / 255;

for (const [name, volume] of /** @type {const} */ ([
    ["noise", makeNoise(16, 2)],
    ["cells", makeCells(16, 3)],
]))
    test(`${name}: bytes of the slope are central differences of the height, across the border as well`, () => {
        const { data, size, slope } = volume;
        let worst = 0;
        for (const at of [
            [0, 0, 0],
            [15, 3, 7],
            [4, 15, 15],
            [9, 8, 1],
        ])
            for (let axis = 0; axis < 3; axis++) {
                const beside = (/** @type {number} */ by) =>
                    at.map((v, k) => (v + (k === axis ? by : 0) + size) % size);
                const byte = data[4 * ((at[2] * size + at[1]) * size + at[0]) + axis];
                const difference = ((height(volume, beside(1)) - height(volume, beside(-1))) * size) / 2;
                worst = Math.max(worst, Math.abs((byte / 127.5 - 1) * slope - difference));
            }
        // rounding: half a byte of slope, and a byte of height over two places
        assert.ok(worst < slope / 255 + size / 255, `${worst}`);
    });

test("noise uses its range evenly about the middle", () => {
    const { data } = makeNoise(32, 4);
    const heights = data.filter((_, i) => i % 4 === 3);
    const mean = heights.reduce((sum, h) => sum + h / 255, 0) / heights.length;
    const deviation = Math.sqrt(heights.reduce((sum, h) => sum + (h / 255 - mean) ** 2, 0) / heights.length);
    assert.ok(Math.abs(mean - 0.5) < 0.05 && deviation > 0.15 && deviation < 0.25, `${mean} ${deviation}`);
});

test("cells have borders of height 0 and domes", () => {
    const heights = makeCells(24, 3).data.filter((_, i) => i % 4 === 3);
    assert.ok(Math.min(...heights) < 13 && Math.max(...heights) > 230);
});

const vessels = growVessels(120, 2);

test("vessels are the same every time, and each hangs on a thicker one or on a root", () => {
    assert.deepEqual(growVessels(120, 2), vessels);
    const radius = new Map(vessels.map(({ from, radius: r }) => [from.join(), r]));
    const ends = vessels.filter(({ to }) => !radius.has(to.join()));
    assert.ok(ends.length > 0 && new Set(ends.map(({ to }) => to.join())).size <= 2, "trees stand on their roots");
    for (const { to, radius: r } of vessels) assert.ok((radius.get(to.join()) ?? Infinity) >= r);
    assert.ok(vessels.some(({ radius: r }) => r > 2 * Math.min(...vessels.map((v) => v.radius))));
});

test("vessels cover a small share of the picture, also at its border", () => {
    const size = 128;
    const { data } = drawVessels(vessels, size);
    const cover = data.filter((_, i) => i % 4 === 0);
    const share = cover.filter((c) => c > 60).length / cover.length;
    assert.ok(share > 0.01 && share < 0.25, `${share}`);
    const ring = Array.from({ length: size }, (_, i) => Math.max(cover[i], cover[i * size]));
    assert.ok(Math.max(...ring) > 60);
});
