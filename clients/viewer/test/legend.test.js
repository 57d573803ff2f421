// The legend: round ranges that follow the values with hysteresis, units, fields on offer.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { COLOURS, FIELDS, labels, missing, offered, rangeOf, roundDown, roundUp } from "../src/legend.js";

test("rounds up to a number not below the value and down to one not above", () => {
    for (const [v, up, down] of [
        [1, 1, 1],
        [1.01, 1.2, 1],
        [0.0173, 0.02, 0.015],
        [4400, 5000, 4000],
        [9.9, 10, 8],
        [1e-7, 1e-7, 1e-7],
        [0.3, 0.3, 0.3],
    ])
        assert.deepEqual([roundUp(v), roundDown(v)], [up, down], String(v));
    for (let v = 1e-6; v < 1e9; v *= 1.37) {
        assert.ok(roundUp(v) >= v * (1 - 1e-9) && roundUp(v) <= 1.5 * v, `up ${v}`);
        assert.ok(roundDown(v) <= v * (1 + 1e-9) && roundDown(v) >= v / 1.5, `down ${v}`);
    }
});

test("the range of a long pull contains every value", () => {
    let range = null;
    let changes = 0;
    for (let mm = 0; mm <= 120; mm += 0.5) {
        const next = rangeOf("displacement", 0, mm / 1000, range);
        assert.ok(next.high >= (mm / 1000) * (1 - 1e-9) && next.low === 0, `${mm} mm`);
        changes += range !== null && next.high !== range.high ? 1 : 0;
        range = next;
    }
    assert.equal(range?.high, 0.12);
    assert.ok(changes < 40, `${changes} changes`);
});

test("values that vary by half keep the range, a large drop changes it", () => {
    let range = rangeOf("von_mises", 0, 900, null);
    assert.equal(range.high, 1000);
    for (let k = 0; k < 50; k++) range = rangeOf("von_mises", 0, 700 + 250 * Math.sin(k), range);
    assert.equal(range.high, 1000);
    range = rangeOf("von_mises", 0, 300, range);
    assert.equal(range.high, 300);
});

test("a body at rest has the smallest range", () => {
    assert.equal(rangeOf("displacement", 0, 3e-9, null).high, FIELDS.displacement.min);
    const range = rangeOf("von_mises", 0, 1e-12, null);
    assert.equal(range.high, 1);
    assert.deepEqual(rangeOf("von_mises", 0, 0.2, range), range);
});

test("a range begins at 0 unless all values lie in its upper half", () => {
    assert.deepEqual(rangeOf("von_mises", 100, 1000, null), { low: 0, high: 1000 });
    assert.deepEqual(rangeOf("von_mises", 930, 990, null), { low: 800, high: 1000 });
    let range = rangeOf("von_mises", 930, 990, null);
    range = rangeOf("von_mises", 950, 990, range);
    assert.deepEqual(range, { low: 800, high: 1000 });
    assert.deepEqual(rangeOf("von_mises", 10, 990, range), { low: 0, high: 1000 });
    for (let low = 0; low < 1000; low += 7) {
        const r = rangeOf("von_mises", low, 1000, null);
        assert.ok(r.low <= low && r.low < r.high, `${low}`);
    }
});

test("the range of a signed field is symmetric", () => {
    assert.deepEqual(rangeOf("distortion", -0.013, 0.002, null), { low: -0.015, high: 0.015 });
    assert.deepEqual(rangeOf("distortion", -0.001, 0.19, null), { low: -0.2, high: 0.2 });
    assert.deepEqual(rangeOf("distortion", 0, 0, null), { low: -1e-3, high: 1e-3 });
    let range = rangeOf("distortion", -0.009, 0.004, null);
    range = rangeOf("distortion", -0.005, 0.006, range);
    assert.deepEqual(range, { low: -0.01, high: 0.01 });
    assert.deepEqual(labels("distortion", range), { low: "−1", high: "+1", unit: "%" });
    assert.deepEqual(labels("strain", { low: 0, high: 0.12 }), { low: "0", high: "12", unit: "%" });
});

test("both ends have the unit of the larger one", () => {
    assert.deepEqual(labels("displacement", { low: 0, high: 0.012 }), { low: "0", high: "12", unit: "mm" });
    assert.deepEqual(labels("displacement", { low: 0, high: 2.5e-4 }), { low: "0", high: "250", unit: "µm" });
    assert.deepEqual(labels("von_mises", { low: 800, high: 1200 }), { low: "0.8", high: "1.2", unit: "kPa" });
    assert.deepEqual(labels("von_mises", { low: 0, high: 800 }), { low: "0", high: "800", unit: "Pa" });
    assert.deepEqual(labels("energy", { low: 0, high: 0.25 }), { low: "0", high: "250", unit: "mJ/m³" });
    assert.deepEqual(labels("energy", { low: 0, high: 3e6 }), { low: "0", high: "3", unit: "MJ/m³" });
    assert.deepEqual(labels("stiffness", { low: 0, high: 2.5e-3 }), { low: "0", high: "2.5", unit: "mJ" });
    assert.deepEqual(labels("stiffness", rangeOf("stiffness", 4e-6, 9e-6, null)), { low: "0", high: "10", unit: "µJ" });
});

test("only fields of the session are offered, with the reason why others are missing", () => {
    const springs = { fields: ["displacement", "stiffness"] };
    const plain = { fields: ["displacement"] };
    const fem = { fields: ["displacement", "von_mises", "energy", "later_one"] };
    assert.deepEqual(offered([fem]), ["displacement", "von_mises", "energy"]);
    assert.deepEqual(offered([springs]), ["displacement", "stiffness"]);
    assert.deepEqual(offered([plain]), ["displacement"]);
    assert.deepEqual(offered([{}]), []);
    assert.equal(missing([fem]), "");
    assert.match(missing([springs]), /finite elements/);
    assert.match(missing([plain]), /finite elements/);
    assert.match(missing([springs, fem]), /Some bodies/);
    assert.match(missing([{}]), /no fields/);
});

test("colours grow lighter from stop to stop, and the legend of style.css has the same", () => {
    const light = COLOURS.map((c) => {
        const [r, g, b] = [1, 3, 5].map((i) => (parseInt(c.slice(i, i + 2), 16) / 255) ** 2.2);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    });
    for (let i = 1; i < light.length; i++) assert.ok(light[i] > light[i - 1] * 1.1, `stop ${i}`);
    const style = readFileSync(new URL("../style.css", import.meta.url), "utf8");
    assert.ok(style.includes(COLOURS.join(", ")));
});
