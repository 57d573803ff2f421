// The legend: round ranges that follow the values with hysteresis, units, fields on offer.
import assert from "node:assert/strict";
import { test } from "node:test";
import { DIVERGING, SEQUENTIAL } from "../src/colour_maps.js";
import {
    FIELDS,
    mapOf,
    missing,
    offered,
    rangeOf,
    restText,
    roundUp,
    shareOf,
    ticksOf,
    titleOf,
} from "../src/legend.js";

test("rounds up to a number not below the value", () => {
    for (const [v, up] of [
        [1, 1],
        [1.01, 1.25],
        [0.0173, 0.02],
        [4400, 5000],
        [9.9, 10],
        [1e-7, 1e-7],
        [0.3, 0.3],
    ])
        assert.equal(roundUp(v), up, String(v));
    for (let v = 1e-6; v < 1e9; v *= 1.37) assert.ok(roundUp(v) >= v * (1 - 1e-9) && roundUp(v) <= 1.34 * v, `up ${v}`);
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

test("a body at rest has the smallest range and its natural colour", () => {
    assert.equal(rangeOf("displacement", 0, 3e-9, null).high, FIELDS.displacement.min);
    const range = rangeOf("von_mises", 0, 1e-12, null);
    assert.equal(range.high, 10);
    assert.deepEqual(rangeOf("von_mises", 0, 0.2, range), range);
    assert.equal(rangeOf("von_mises", 0, 0.2, { low: 0, high: 4000 }).high, 10);
    assert.equal(rangeOf("distortion", 0, 0, { low: -1, high: 1 }).high, 5e-3);
    assert.equal(shareOf("von_mises", 0, 4.9), 0);
    assert.equal(shareOf("von_mises", 0, 7.5), 0.5);
    assert.equal(shareOf("von_mises", 0, 10), 1);
    assert.equal(shareOf("distortion", -0.01, 0), 1);
    assert.match(restText("displacement"), /0\.25.*mm/);
    // a material is worth showing at rest
    for (const name of Object.keys(FIELDS)) assert.equal(shareOf(name, 0, 0) === 1, FIELDS[name].min === 0, name);
    assert.equal(shareOf("stiffness", 1e-6, 1e-6), 1);
});

test("a range begins at 0 unless the values of a material are near to each other", () => {
    assert.deepEqual(rangeOf("von_mises", 930, 990, null), { low: 0, high: 1000 });
    assert.deepEqual(rangeOf("stiffness", 0.1, 1, null), { low: 0, high: 1 });
    assert.deepEqual(rangeOf("stiffness", 0.99, 0.99, null), { low: 0, high: 1 });
    const range = rangeOf("stiffness", 0.93, 0.99, null);
    assert.deepEqual(range, { low: 0.93, high: 0.99 });
    assert.deepEqual(rangeOf("stiffness", 0.95, 0.99, range), range);
    assert.deepEqual(rangeOf("stiffness", 0.01, 0.99, range), { low: 0, high: 1 });
    for (let low = 0; low < 1; low += 0.007) {
        const r = rangeOf("stiffness", low, 1, null);
        assert.ok(r.low <= low && r.high >= 1 && r.low < r.high, `${low}: ${r.low} ${r.high}`);
        const step = (r.high - r.low) / 4;
        assert.ok(Math.abs(r.low / step - Math.round(r.low / step)) < 1e-6, `${low}: ticks are multiples of a step`);
    }
});

test("the range of a signed field is symmetric, with the diverging colours", () => {
    assert.deepEqual(rangeOf("distortion", -0.013, 0.002, null), { low: -0.015, high: 0.015 });
    assert.deepEqual(rangeOf("distortion", -0.001, 0.19, null), { low: -0.2, high: 0.2 });
    assert.deepEqual(rangeOf("distortion", 0, 0, null), { low: -5e-3, high: 5e-3 });
    let range = rangeOf("distortion", -0.009, 0.004, null);
    range = rangeOf("distortion", -0.005, 0.006, range);
    assert.deepEqual(range, { low: -0.01, high: 0.01 });
    assert.deepEqual(ticksOf("distortion", range), { unit: "%", ticks: ["−1", "−0.5", "0", "+0.5", "+1"] });
    for (const name of Object.keys(FIELDS))
        assert.equal(mapOf(name), FIELDS[name].signed ? DIVERGING : SEQUENTIAL, name);
});

test("five short ticks have the unit of the largest", () => {
    assert.deepEqual(ticksOf("displacement", { low: 0, high: 0.012 }), {
        unit: "mm",
        ticks: ["0", "3", "6", "9", "12"],
    });
    assert.deepEqual(ticksOf("displacement", { low: 0, high: 5e-4 }).ticks, ["0", "0.125", "0.25", "0.375", "0.5"]);
    assert.deepEqual(ticksOf("von_mises", { low: 0, high: 1200 }), {
        unit: "kPa",
        ticks: ["0", "0.3", "0.6", "0.9", "1.2"],
    });
    assert.equal(ticksOf("von_mises", { low: 0, high: 800 }).unit, "Pa");
    assert.equal(ticksOf("energy", { low: 0, high: 3e6 }).unit, "MJ/m³");
    assert.deepEqual(ticksOf("strain", { low: 0, high: 0.12 }).ticks.at(-1), "12");
    // ticks of any range are exact multiples, which four digits can write
    for (const name of Object.keys(FIELDS))
        for (let v = 1e-5; v < 1e7; v *= 1.07) {
            const range = rangeOf(name, 0, v, null);
            const { unit, ticks } = ticksOf(name, range);
            const size = FIELDS[name].units.find(([u]) => u === unit)[1];
            ticks.forEach((tick, k) => {
                const wanted = range.low + ((range.high - range.low) * k) / 4;
                assert.ok(Math.abs(Number(tick.replace("−", "-")) * size - wanted) < 1e-9 * range.high, `${name} ${v}`);
            });
        }
});

test("each field has a name", () => {
    for (const name of Object.keys(FIELDS)) assert.ok(titleOf(name) && !titleOf(name).includes("."), name);
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
