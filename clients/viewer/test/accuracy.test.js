// The panel of accuracy: axes, positions, the Pareto front, texts and commands.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
    frontOf,
    layOutPlot,
    logPosition,
    logRange,
    logTicks,
    neighbourArgs,
    positionOn,
} from "../src/accuracy_plot.js";
import { errorText, millimetres, neighbourText, partsOf, pointText, short, switchText } from "../src/accuracy_text.js";

/** @param {number} index @param {number} ms @param {number} error_m @param {boolean} front @param {string} method */
const point = (index, ms, error_m, front, method = "fem") => ({
    index,
    method,
    label: `${method} ${index}`,
    cost_ms: ms,
    error_m,
    pareto_optimal: front,
});
const POINTS = [
    point(0, 0.5, 4e-3, true, "tet_springs"),
    point(1, 2, 5e-3, false, "tet_springs"),
    point(2, 4, 1e-3, true),
    point(5, 30, 1e-4, true),
];
/** @param {object} more */
const estimate = (more) => ({
    body: "liver",
    configuration: "fem",
    tick: 9,
    estimate_ms: 80,
    cost_ms: 4.4,
    error_m: 9e-4,
    ...more,
});
const BOX = { left: 40, right: 300, top: 10, bottom: 200 };

test("an axis contains all values and ends at round numbers", () => {
    assert.deepEqual(logRange([0.5, 30]), { low: 0.2, high: 50 });
    assert.deepEqual(logRange([4]), { low: 1, high: 10 });
    assert.deepEqual(logRange([]), { low: 1, high: 10 });
    assert.deepEqual(logRange([NaN, 0, -1]), { low: 1, high: 10 });
    for (const values of [
        [1e-4, 3],
        [7, 7.1],
        [0.999, 1.001],
        [1e-9, 1e6],
    ]) {
        const { low, high } = logRange(values);
        assert.ok(low < Math.min(...values) && high > Math.max(...values) && high / low >= 9.99, values.join());
    }
});

test("positions are logarithmic and stay on the plot", () => {
    const range = { low: 0.1, high: 10 };
    assert.equal(logPosition(1, range, 0, 100), 50);
    assert.equal(logPosition(0.1, range, 0, 100), 0);
    assert.equal(logPosition(1000, range, 0, 100), 100);
    assert.ok(Math.abs(logPosition(Math.sqrt(10), range, 0, 100) - 75) < 1e-9);
});

test("ticks are few, round and within the axis", () => {
    assert.deepEqual(logTicks({ low: 0.2, high: 50 }, 8), [0.2, 0.5, 1, 2, 5, 10, 20, 50]);
    assert.deepEqual(logTicks({ low: 0.2, high: 50 }, 6), [0.3, 1, 3, 10, 30]);
    for (const [low, high] of [
        [1e-4, 1e4],
        [2, 20],
        [5, 50],
        [1e-9, 1],
    ]) {
        const ticks = logTicks({ low, high }, 6);
        assert.ok(
            ticks.length >= 2 && ticks.length <= 6 && ticks.every((v) => v >= low * 0.99 && v <= high * 1.01),
            `${low} ${high}: ${ticks}`,
        );
    }
});

test("the slider moves along the Pareto front in the order of cost", () => {
    assert.deepEqual(
        frontOf([...POINTS].reverse()).map((p) => p.index),
        [0, 2, 5],
    );
    assert.deepEqual(frontOf([point(0, NaN, 1, true), point(1, 1, 0, true)]), []);
    const front = frontOf(POINTS);
    assert.equal(positionOn(front, estimate({ study_point: 5 })), 2, "its own point");
    assert.equal(positionOn(front, estimate({ study_point: 1, cost_ms: 2 })), 1, "off the front: the nearest cost");
    assert.equal(positionOn(front, estimate({ cost_ms: 0.4 })), 0);
    assert.equal(positionOn(front, estimate({ cost_ms: undefined })), -1);
    assert.equal(positionOn([], estimate({})), -1);
    assert.equal(positionOn(front, null), -1);
});

test("every point of the plot lies at its cost and error", () => {
    const plot = layOutPlot(
        POINTS,
        estimate({
            study_point: 2,
            neighbours: [
                { parameter: "resolution", label: "finer", cost_ms: 9, error_m: 4e-4, size: 20 },
                { parameter: "step", label: "?", cost_ms: 9 },
            ],
        }),
        BOX,
    );
    assert.deepEqual(
        plot.methods.map((m) => m.name),
        ["tet_springs", "fem"],
    );
    assert.equal(plot.marks.length, 4);
    assert.equal(plot.front.length, 3);
    assert.equal(plot.neighbours.length, 1, "a neighbour without a prediction is not drawn");
    for (let i = 1; i < plot.front.length; i++)
        assert.ok(
            plot.front[i].x > plot.front[i - 1].x && plot.front[i].y > plot.front[i - 1].y,
            "more expensive and more accurate: right and down",
        );
    for (const { x, y } of [...plot.marks, ...plot.neighbours])
        assert.ok(x > BOX.left && x < BOX.right && y > BOX.top && y < BOX.bottom);
    assert.ok(plot.live && Math.abs(plot.live.x - plot.x(4.4)) < 1e-9);
});

test("one axis has errors of one kind: those under the loads of the study", () => {
    const neighbours = [{ parameter: "resolution", label: "finer", cost_ms: 9, error_m: 0.029, size: 20 }];
    // a strong pull: 58 mm now, where the study's loads leave 1 mm
    const pulled = layOutPlot(POINTS, estimate({ study_point: 2, error_m: 0.058, neighbours }), BOX);
    assert.equal(pulled.studied, true);
    assert.equal(pulled.live?.y, pulled.y(1e-3), "the running configuration has the error of its own point");
    assert.equal(pulled.neighbours[0].y, pulled.y(0.5e-3), "a neighbour that halves the error has half of that");
    assert.ok(pulled.errorRange.high <= 10, "the present error does not set the scale");
    const other = layOutPlot(POINTS, estimate({ error_m: 0.058, neighbours }), BOX);
    assert.equal(other.live?.y, null, "a configuration that was not studied has no error of that kind");
    assert.equal(other.neighbours.length, 0);
    const alone = layOutPlot([], estimate({ error_m: 0.058, neighbours }), BOX);
    assert.equal(alone.studied, false);
    assert.equal(alone.live?.y, alone.y(0.058));
});

test("the live point is drawn without a study, and without an error at its cost", () => {
    const alone = layOutPlot([], estimate({}), BOX);
    assert.ok(alone.live && alone.live.y !== null && alone.xTicks.length >= 2 && alone.yTicks.length >= 2);
    const unknown = layOutPlot([], estimate({ error_m: undefined }), BOX);
    assert.equal(unknown.live?.y, null);
    assert.equal(layOutPlot([], null, BOX).live, null);
    const resting = layOutPlot([], estimate({ error_m: 4e-17 }), BOX);
    assert.ok(
        resting.errorRange.low >= 1e-6 && resting.errorRange.high <= 1e-3,
        "rounding errors do not set the scale",
    );
});

test("parts of the error are shares of their sum, unknown ones are left out", () => {
    const parts = partsOf(estimate({ discretisation_m: 6e-4, algebraic_m: 0, time_m: 2e-4 }));
    assert.deepEqual(
        parts.map((p) => p.key),
        ["discretisation_m", "algebraic_m", "time_m"],
    );
    assert.ok(Math.abs(parts[0].share - 0.75) < 1e-12 && parts[1].share === 0);
    assert.deepEqual(
        partsOf(estimate({ time_m: 0 })).map((p) => p.share),
        [0],
    );
});

test("a neighbour is described by its gain and cost", () => {
    const now = estimate({});
    const to = { parameter: "resolution", label: "24 voxels", size: 24 };
    assert.equal(neighbourText(now, { ...to, cost_ms: 8.5, error_m: 4.5e-4 }), "half the error, 4.1 ms slower");
    assert.equal(neighbourText(now, { ...to, cost_ms: 2, error_m: 1.8e-3 }), "twice the error, 2.4 ms faster");
    assert.equal(neighbourText(now, { ...to, cost_ms: 4.4, error_m: 6.3e-4 }), "30 % less error, as fast");
    assert.equal(neighbourText(now, { ...to, cost_ms: 1, error_m: 9e-3 }), "10 times the error, 3.4 ms faster");
    assert.equal(neighbourText(now, to), "24 voxels across");
    assert.equal(
        neighbourText(estimate({ error_m: undefined }), { ...to, cost_ms: 8.5 }),
        "24 voxels across, 4.1 ms slower",
    );
});

test("errors that are displayed alike are the same", () => {
    const at = (/** @type {number} */ now, /** @type {number} */ then) =>
        neighbourText(estimate({ error_m: now }), {
            parameter: "resolution",
            label: "8 voxels",
            size: 8,
            cost_ms: 4.4,
            error_m: then,
        });
    assert.equal(at(6e-7, 9.5e-7), "same error, as fast", "58 % of less than 0.001 mm");
    assert.equal(at(9.5e-7, 9e-7), "same error, as fast");
    assert.equal(at(0, 0), "same error, as fast", "at rest");
    assert.equal(at(0, 5e-6), "5 times the error, as fast");
    assert.equal(at(2e-6, 1e-9), "half the error, as fast", "no more than is displayed");
    assert.equal(at(2e-6, 3e-6), "50 % more error, as fast");
});

test("an error that is pending, unavailable or old is described so", () => {
    const none = { error: "being estimated", age: "", note: "", known: false };
    assert.deepEqual(errorText(null), none);
    assert.deepEqual(errorText(estimate({ tick: 0, diagnostic: "" })), none);
    assert.deepEqual(errorText(estimate({ tick: 0, error_m: undefined, diagnostic: "it is refined while it runs" })), {
        error: "not estimated",
        age: "",
        note: "it is refined while it runs",
        known: false,
    });
    assert.deepEqual(errorText(estimate({ age_s: 0.4, diagnostic: "n" })), {
        error: "0.9 mm",
        age: "",
        note: "n.",
        known: true,
    });
    assert.deepEqual(errorText(estimate({ age_s: 12.3, energy_error_percent: 5, locking: true })), {
        error: "0.9 mm",
        age: "12 s ago",
        note: "Volumetric locking: the true error is larger. Relative error in the energy norm: 5.0 %.",
        known: true,
    });
    assert.equal(errorText(estimate({ age_s: undefined })).age, "", "without an age");
    assert.equal(errorText(estimate({ max_displacement_m: 0.009 })).error, "0.9 mm, 10 % of what moves");
    assert.equal(errorText(estimate({ max_displacement_m: 9e-4 })).error, "0.9 mm, 100 % of what moves");
    assert.deepEqual(errorText(estimate({ max_displacement_m: 1e-7, error_m: 4e-17 })), {
        error: "none: at rest",
        age: "",
        note: "",
        known: false,
    });
    assert.equal(errorText(estimate({ force_percent: 12.34 })).note, "Force of tools: 12 % off.");
});

test("a neighbour is reached by its own arguments, another method only as a point of the study", () => {
    const near = (/** @type {object} */ fields) => ({ parameter: "resolution", label: "", ...fields });
    assert.deepEqual(neighbourArgs(near({ size: 24, step_ms: 0, tolerance: 0 })), { size: 24 });
    assert.deepEqual(neighbourArgs(near({ parameter: "step", step_ms: 8.5 })), { step_ms: 8.5 });
    assert.equal(neighbourArgs(near({ parameter: "method", size: 24 })), null);
    assert.equal(neighbourArgs(near({ parameter: "solver" })), null);
});

test("a switch says how long it took, and how far the surface moved", () => {
    const text = (/** @type {Record<string, number>} */ args) =>
        switchText({ type: "answer", verb: "study_point", text: "fem, 16 voxels", args });
    assert.equal(text({ max_move_m: 4e-5, prepare_ms: 812 }), "Switched in 812 ms, surface moved 0.04 mm.");
    assert.equal(text({ max_move_m: 2e-8, prepare_ms: 1234 }), "Switched in 1.2 s, surface moved < 0.001 mm.");
    assert.equal(text({ energy_percent: -0.31 }), "fem, 16 voxels");
});

test("numbers are short", () => {
    assert.deepEqual([0, 0.0004, 0.0123, 0.5, 4.123, 12.34, 123.4, 12345].map(short), [
        "0",
        "4e−4",
        "0.012",
        "0.5",
        "4.1",
        "12.3",
        "123",
        "12,345",
    ]);
    assert.equal(millimetres(undefined), "unknown");
    assert.equal(millimetres(4.5e-4), "0.45 mm");
    assert.equal(millimetres(1e-9), "< 0.001 mm");
});

test("a point of the study says how far its force is off where that was measured", () => {
    const point = { index: 0, method: "fem", label: "fem 8_voxels", cost_ms: 1.5, error_m: 4e-4 };
    assert.equal(pointText(point), "fem 8 voxels across: 1.5 ms, 0.4 mm");
    assert.equal(
        pointText({ ...point, force_percent: 6.54 }),
        "fem 8 voxels across: 1.5 ms, 0.4 mm, force 6.5 % off at 50 ms",
    );
});
