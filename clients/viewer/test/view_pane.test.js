import assert from "node:assert/strict";
import { test } from "node:test";
import { ViewPane } from "../src/view_pane.js";

const view = /** @type {any} */ ({ camera: {} });
const canvas = (/** @type {number} */ clientWidth, /** @type {number} */ clientHeight) => ({
    clientWidth,
    clientHeight,
});

test("two panes cover the canvas but for a line, whatever its size", () => {
    const panes = [new ViewPane(view, 0, 0.5, true), new ViewPane(view, 0.5, 1, true)];
    for (const [width, height] of [
        [1280, 800],
        [1279, 801],
        [390, 844],
        [391, 845],
    ]) {
        const [a, b] = panes.map((pane) => pane.box(canvas(width, height)));
        assert.equal(a.width * a.height + b.width * b.height, width * height - 2 * Math.min(width, height));
        if (width > height) assert.deepEqual([b.x, b.y], [a.width + 2, 0]);
        else assert.deepEqual([b.x, b.y], [0, a.height + 2], "they are stacked on a narrow page");
    }
});

test("the panes of eyes stand side by side on every page", () => {
    assert.deepEqual(new ViewPane(view, 0.5, 1).box(canvas(390, 844)), { x: 195, y: 0, width: 195, height: 844 });
    assert.deepEqual(new ViewPane(view).box(canvas(0, 0)), { x: 0, y: 0, width: 1, height: 1 });
});
