// Time plots: the bounded history, samples of tools, axes, tables.
import assert from "node:assert/strict";
import { test } from "node:test";
import { plotData, timeRange, valueRange } from "../src/plot_axes.js";
import { toCsv } from "../src/plot_csv.js";
import { LENGTH_MAX_S, PlotSampler, depthAt, displacementAt, energyRow, workBetween } from "../src/plot_sampler.js";
import { SampleRing } from "../src/sample_ring.js";

test("a history keeps the newest rows, in order, whatever came before", () => {
    const ring = new SampleRing(10, 3);
    for (let k = 0; k < 1000; k++) {
        ring.push(k, { a: 2 * k });
        const { times, columns } = ring.since(-Infinity);
        const n = Math.min(k + 1, 10);
        assert.equal(ring.n, n);
        assert.deepEqual(
            [...times],
            Array.from({ length: n }, (_, i) => k - n + 1 + i),
        );
        assert.deepEqual(
            [...(columns.get("a") ?? [])],
            [...times].map((t) => 2 * t),
        );
    }
    assert.deepEqual([...ring.since(995.5).times], [996, 997, 998, 999]);
});

test("a history is bounded in columns, and forgets those without values", () => {
    const ring = new SampleRing(4, 2);
    ring.push(0, { a: 1 });
    ring.push(1, { b: 2, c: 3 });
    assert.deepEqual([...ring.columns.keys()], ["a", "b"]);
    for (let k = 2; k < 20; k++) ring.push(k, { c: k });
    assert.deepEqual([...ring.columns.keys()], ["c"]);
    assert.equal(ring.columns.get("c")?.length, 8);
});

test("a time that stands still is no sample, and one that goes back begins anew", () => {
    const ring = new SampleRing(4, 2);
    ring.push(5, { a: 1 });
    ring.push(5, { a: 2 });
    assert.equal(ring.n, 1);
    ring.push(3, { b: 1 });
    assert.deepEqual([...ring.since(0).times], [3]);
    assert.deepEqual([...ring.columns.keys()], ["b"]);
});

/** @param {object} changes */
const tool = (changes) =>
    /** @type {any} */ ({
        held: true,
        away: false,
        holder: 1,
        colour: 0xff0000,
        position: [0, 0, 0],
        force: [0, 0, 0],
        ...changes,
    });
/** @type {any} a triangle whose normal is z, the second vertex of which has moved by 5 mm */
const surface = {
    rest: Float32Array.of(0, 0, 0, 1, 0, 0, 0, 9, 0),
    triangles: () => Uint32Array.of(0, 1, 2),
    visible: null,
    position: { array: Float32Array.of(0, 0, 0, 1, 0.003, 0.004, 0, 9, 0) },
};
test("the displacement is that of the vertex next to the tool", () => {
    assert.equal(displacementAt([surface], [0.1, 0, 0]), 0);
    assert.ok(Math.abs(displacementAt([surface], [0.9, 0, 0]) - 0.005) < 1e-6);
    assert.equal(displacementAt([{ ...surface, visible: Uint32Array.of(0) }], [0.9, 0, 0]), 0);
    assert.equal(displacementAt([], [0, 0, 0]), 0);
});

test("the depth is that of the lowest point of the tool below the surface at rest", () => {
    const near = (/** @type {number} */ a, /** @type {number} */ b) => assert.ok(Math.abs(a - b) < 1e-9, `${a} ${b}`);
    const depth = (/** @type {number} */ z, radius = 0.01) => depthAt([surface], [0.9, 0.2, z], radius);
    near(depth(0.01), 0); // it touches
    near(depth(0.004), 0.006);
    near(depth(-0.003), 0.013);
    near(depth(0.025), -0.015); // what it grasps is lifted
    near(depth(-0.003, 0), 0.003);
    assert.equal(depthAt([], [0, 0, 0], 0.01), 0);
});

test("energies are sums over the bodies, unknown where there is none", () => {
    const body = { kinetic_J: 0.001, elastic_J: 0.0025 };
    const row = energyRow([body, { kinetic_J: 0.003, elastic_J: 0 }]);
    assert.ok(Math.abs(row.energy_mJ - 6.5) < 1e-9 && Math.abs(row.kinetic_mJ - 4) < 1e-9);
    assert.deepEqual(energyRow([]), {});
    assert.deepEqual(energyRow(undefined), {});
});

test("the work against a spring is its energy, and comes back", () => {
    // f = -k x on the tool, 100 N/m, out by 20 mm in uneven steps and back: 1/2 k x^2 = 20 mJ
    const path = [0, 0.001, 0.007, 0.02];
    const at = (/** @type {number} */ x) => tool({ position: [x, 0, 0], force: [-100 * x, 0, 0] });
    const work = (/** @type {number[]} */ xs) =>
        xs.slice(1).reduce((sum, x, i) => sum + workBetween(at(xs[i]), at(x)), 0);
    assert.ok(Math.abs(work(path) - 0.02) < 1e-12);
    assert.ok(Math.abs(work([...path, ...path.toReversed()])) < 1e-12);
});

test("a sample has force, displacement and work of each held tool, and a message between samples adds its work", () => {
    const sampler = new PlotSampler();
    const scene = {
        surfaces: [surface],
        stepMs: 2,
        nameOf: () => "Ada",
        capOf: () => 15,
        radiusOf: () => 0.01,
        energies: undefined,
    };
    const take = (/** @type {number} */ t, /** @type {any[]} */ ...tools) => sampler.take(t, tools, scene);
    take(1, tool({ position: [1, 0, 0], force: [-3, 4, 0] }), tool({ held: false }));
    take(1.001, tool({ position: [1.001, 0, 0], force: [-3, 4, 0] }), tool({ held: false })); // too soon for a sample
    take(1.1, tool({ position: [1.002, 0, 0], force: [-3, 4, 0] }), tool({ held: true, holder: 2 }));
    const { times, columns } = sampler.ring.since(0);
    assert.deepEqual([...times], [1, 1.1]);
    const last = Object.fromEntries([...columns].map(([name, values]) => [name, values[1]]));
    assert.equal(last["0:1:force_N"], 5);
    assert.ok(Math.abs(last["0:1:displacement_mm"] - 5) < 1e-4);
    assert.ok(Math.abs(last["0:1:work_mJ"] - 6) < 1e-4);
    assert.equal(last["1:2:force_N"], 0);
    assert.ok(Number.isNaN(columns.get("1:2:force_N")?.[0]));
    assert.equal(last.step_ms, 2);
    assert.deepEqual(
        sampler.list().map(({ name }) => name),
        ["Ada 1", "Ada 2"],
    );
    // lifted: the work begins anew with the next contact
    take(1.2, tool({ away: true }));
    take(1.3, tool({ position: [1, 0, 0], force: [-3, 4, 0] }));
    assert.equal(sampler.ring.since(1.25).columns.get("0:1:work_mJ")?.[0], 0);
});

test("the history is two minutes at 60 messages a second, also in slow motion", () => {
    const sampler = new PlotSampler();
    const scene = {
        surfaces: [],
        stepMs: 1,
        nameOf: () => "",
        capOf: () => undefined,
        radiusOf: () => 0,
        energies: undefined,
    };
    for (const hz of [60, 600]) {
        for (let k = 0; k < 130 * hz; k++) sampler.take(k / hz, [], scene);
        const { times } = sampler.ring.since(-Infinity);
        assert.ok(times[times.length - 1] - times[0] >= LENGTH_MAX_S - 0.1, `${hz}: from ${times[0]}`);
    }
});

test("the time axis shows the last seconds, or a shorter history from the left", () => {
    assert.deepEqual(timeRange([100, 110], 30), [100, 130]);
    assert.deepEqual(timeRange([100, 110, 160], 30), [130, 160]);
    assert.deepEqual(timeRange([], 30), [0, 30]);
});

test("the value axis is round, from 0, and has a negative part only for negative values", () => {
    assert.deepEqual(valueRange([0, 3.1], 0.1), [0, 4]);
    assert.deepEqual(valueRange([0, 0.003, -0.003], 0.1), [0, 0.1]);
    assert.deepEqual(valueRange([-7, 3.1], 0.1), [-7.5, 4]);
    assert.deepEqual(valueRange([], 1), [0, 1]);
});

test("missing values and pauses are gaps", () => {
    const data = plotData(Float64Array.of(1, 1.1, 3), [Float32Array.of(5, NaN, 7), undefined]);
    assert.deepEqual(data, [
        [1, 1.1, 2.05, 3],
        [5, null, null, 7],
        [null, null, null, null],
    ]);
});

test("a table has every bit of the samples", () => {
    const values = Float32Array.of(0.1, NaN, 1 / 3, -1.17549435e-38, 3.4e38);
    const times = [0, 0.016667, 1, 12345.678901, 99999.999999];
    const csv = toCsv(times, [
        ['force_N Ada, "the surgeon"', values],
        ["step_ms", values],
    ]);
    const lines = csv.split("\r\n");
    assert.equal(lines[0], 'time_s,"force_N Ada, ""the surgeon""",step_ms');
    assert.equal(lines.pop(), "");
    lines.slice(1).forEach((line, i) => {
        const [time, a, b] = line.split(",");
        assert.equal(Number(time), times[i]);
        assert.equal(a, b);
        if (Number.isNaN(values[i])) assert.equal(a, "");
        else assert.equal(Math.fround(Number(a)), values[i]);
    });
});
