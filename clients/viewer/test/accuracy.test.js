// What accuracy costs: axes, places, the front, words and orders; rows and bodies of the plan's panel.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  errorWords,
  frontOf,
  knobOrder,
  layOut,
  logPlace,
  logRange,
  logTicks,
  millimetres,
  neighbourWords,
  partsOf,
  placeOn,
  short,
  switchWords,
} from "../src/accuracy_plot.js";
import { barsOf, bodyLines, fixedWhy, rowsOf, unwatchedLine } from "../src/plan_panel.js";

/** @param {number} index @param {number} ms @param {number} error_m @param {boolean} front @param {string} method */
const point = (index, ms, error_m, front, method = "fem") => ({
  index,
  method,
  label: `${method} ${index}`,
  ms,
  error_m,
  front,
});
const POINTS = [
  point(0, 0.5, 4e-3, true, "tet_springs"),
  point(1, 2, 5e-3, false, "tet_springs"),
  point(2, 4, 1e-3, true),
  point(5, 30, 1e-4, true),
];
/** @param {object} more */
const estimate = (more) => ({ body: "liver", setting: "fem", tick: 9, own_ms: 80, ms: 4.4, error_m: 9e-4, ...more });
const BOX = { left: 40, right: 300, top: 10, bottom: 200 };

test("an axis holds all values and ends at round ones", () => {
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

test("places are logarithmic and stay on the plot", () => {
  const range = { low: 0.1, high: 10 };
  assert.equal(logPlace(1, range, 0, 100), 50);
  assert.equal(logPlace(0.1, range, 0, 100), 0);
  assert.equal(logPlace(1000, range, 0, 100), 100);
  assert.ok(Math.abs(logPlace(Math.sqrt(10), range, 0, 100) - 75) < 1e-9);
});

test("marks are few, round and within", () => {
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

test("the slider goes along the front from cheap to near", () => {
  assert.deepEqual(
    frontOf([...POINTS].reverse()).map((p) => p.index),
    [0, 2, 5],
  );
  assert.deepEqual(frontOf([point(0, NaN, 1, true), point(1, 1, 0, true)]), []);
  const front = frontOf(POINTS);
  assert.equal(placeOn(front, estimate({ point: 5 })), 2, "its own point");
  assert.equal(placeOn(front, estimate({ point: 1, ms: 2 })), 1, "off the front: the nearest cost");
  assert.equal(placeOn(front, estimate({ ms: 0.4 })), 0);
  assert.equal(placeOn(front, estimate({ ms: undefined })), -1);
  assert.equal(placeOn([], estimate({})), -1);
  assert.equal(placeOn(front, null), -1);
});

test("the plot has every point where its cost and error are", () => {
  const plot = layOut(
    POINTS,
    estimate({
      neighbours: [
        { knob: "resolution", label: "finer", ms: 9, error_m: 4e-4, size: 20 },
        { knob: "step", label: "?", ms: 9 },
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
  assert.equal(plot.neighbours.length, 1, "what is not foreseen has no place");
  for (let i = 1; i < plot.front.length; i++)
    assert.ok(
      plot.front[i].x > plot.front[i - 1].x && plot.front[i].y > plot.front[i - 1].y,
      "dearer and nearer: right and down",
    );
  for (const { x, y } of [...plot.marks, ...plot.neighbours])
    assert.ok(x > BOX.left && x < BOX.right && y > BOX.top && y < BOX.bottom);
  assert.ok(plot.live && plot.live.y !== null && Math.abs(plot.live.x - plot.x(4.4)) < 1e-9);
});

test("without a study the live point has a plot of its own; without an error it has a cost", () => {
  const alone = layOut([], estimate({}), BOX);
  assert.ok(alone.live && alone.live.y !== null && alone.xTicks.length >= 2 && alone.yTicks.length >= 2);
  const unknown = layOut(POINTS, estimate({ error_m: undefined }), BOX);
  assert.equal(unknown.live?.y, null);
  assert.equal(layOut([], null, BOX).live, null);
  const resting = layOut([], estimate({ error_m: 4e-17 }), BOX);
  assert.ok(resting.errorRange.low >= 1e-6 && resting.errorRange.high <= 1e-3, "rounding is no scale");
  const studied = layOut(POINTS, estimate({ error_m: 4e-17 }), BOX);
  assert.ok(
    studied.errorRange.low >= 1e-3 && Number(studied.live?.y) > Math.max(...studied.marks.map((m) => m.y)),
    "rest is at the foot of what was studied",
  );
});

test("parts of the error are shares of their sum, and what nobody knows is no part", () => {
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

test("a neighbour says what it brings and what it costs", () => {
  const now = estimate({}),
    to = { knob: "resolution", label: "24 voxels", size: 24 };
  assert.equal(neighbourWords(now, { ...to, ms: 8.5, error_m: 4.5e-4 }), "halve the error: +4.1 ms");
  assert.equal(neighbourWords(now, { ...to, ms: 2, error_m: 1.8e-3 }), "twice the error: −2.4 ms");
  assert.equal(neighbourWords(now, { ...to, ms: 4.4, error_m: 6.3e-4 }), "30 % less error: same cost");
  assert.equal(neighbourWords(now, { ...to, ms: 1, error_m: 9e-3 }), "10 times the error: −3.4 ms");
  assert.equal(neighbourWords(now, to), "24 voxels");
  assert.equal(neighbourWords(estimate({ error_m: undefined }), { ...to, ms: 8.5 }), "24 voxels: +4.1 ms");
});

test("lengths that are said alike are the same error", () => {
  const at = (/** @type {number} */ now, /** @type {number} */ then) =>
    neighbourWords(estimate({ error_m: now }), {
      knob: "resolution",
      label: "8 voxels",
      size: 8,
      ms: 4.4,
      error_m: then,
    });
  assert.equal(at(6e-7, 9.5e-7), "same error: same cost", "58 % of less than 0.001 mm");
  assert.equal(at(9.5e-7, 9e-7), "same error: same cost");
  assert.equal(at(0, 0), "same error: same cost", "at rest");
  assert.equal(at(0, 5e-6), "5 times the error: same cost");
  assert.equal(at(2e-6, 1e-9), "halve the error: same cost", "no more than is shown");
  assert.equal(at(2e-6, 3e-6), "50 % more error: same cost");
});

test("an error that is not known yet, not at all, or of a while ago says so", () => {
  const none = { error: "being estimated", ago: "", note: "", known: false };
  assert.deepEqual(errorWords(null), none);
  assert.deepEqual(errorWords(estimate({ tick: 0, note: "" })), none);
  assert.deepEqual(errorWords(estimate({ tick: 0, error_m: undefined, note: "it is refined while it runs" })), {
    error: "not estimated",
    ago: "",
    note: "it is refined while it runs",
    known: false,
  });
  assert.deepEqual(errorWords(estimate({ age_s: 0.4, note: "n" })), {
    error: "0.9 mm",
    ago: "",
    note: "n.",
    known: true,
  });
  assert.deepEqual(errorWords(estimate({ age_s: 12.3, zz_percent: 5, locking: true })), {
    error: "0.9 mm",
    ago: "12 s ago",
    note: "It locks: the true error is larger. In energy 5.0 %.",
    known: true,
  });
  assert.equal(errorWords(estimate({ age_s: undefined })).ago, "", "a server of before");
});

test("a knob is turned by its numbers alone, a method by none", () => {
  assert.deepEqual(knobOrder("liver", { knob: "resolution", label: "", size: 24, step_ms: 0, tolerance: 0 }), {
    verb: "knob",
    target: "liver",
    args: { size: 24 },
  });
  assert.deepEqual(knobOrder("liver", { knob: "step", label: "", step_ms: 8.5 }), {
    verb: "knob",
    target: "liver",
    args: { step_ms: 8.5 },
  });
  assert.equal(knobOrder("liver", { knob: "method", label: "", size: 24 }), null);
  assert.equal(knobOrder("liver", { knob: "solver", label: "" }), null);
});

test("a switch is told by what it did", () => {
  assert.equal(
    switchWords({ text: "x", args: { energy_percent: -0.31, most_move_m: 4e-5, made_ms: 812 } }),
    "Switched: energy −0.31 %, moved 0.04 mm, made in 812 ms.",
  );
  assert.equal(
    switchWords({ text: "x", args: { most_move_m: 4e-5, bound_m: 1.2e-3 } }),
    "Switched: moved 0.04 mm of 1.2 mm allowed.",
  );
  assert.equal(
    switchWords({ text: "x", args: { most_move_m: 4e-3, bound_m: 1.2e-3 } }),
    "Switched: moved 4 mm, more than the 1.2 mm allowed.",
  );
  assert.equal(
    switchWords({ text: "x", args: { most_move_m: 2e-8, bound_m: 1e-9 } }),
    "Switched: moved < 0.001 mm of < 0.001 mm allowed.",
    "at rest",
  );
  assert.equal(
    switchWords({ text: "x", args: { most_move_m: 3e-4, frame_move_m: 3e-5, bound_m: 2e-4 } }),
    "Switched: moves 0.3 mm, more than the 0.2 mm allowed, 0.03 mm a frame.",
  );
  assert.equal(
    switchWords({ text: "x", args: { most_move_m: 1.5e-4, frame_move_m: 1.5e-5, bound_m: 2e-4 } }),
    "Switched: moves 0.15 mm of 0.2 mm allowed, 0.015 mm a frame.",
  );
  assert.equal(switchWords({ text: "fem, 16 voxels" }), "fem, 16 voxels");
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
  assert.equal(millimetres(undefined), "not known");
  assert.equal(millimetres(4.5e-4), "0.45 mm");
  assert.equal(millimetres(1e-9), "< 0.001 mm");
});

test("rows that were switched off stay on the list, with whose they are and why", () => {
  const plan = {
    rows: ["gravity", "hex_elastic", "hex_elastic"],
    row_parts: [0, 0, 1],
    row_whys: ["gravity_m_s2", "bodies[0].model", "bodies[1].model"],
  };
  assert.deepEqual(
    rowsOf(plan, null).map((r) => [r.name, r.part, r.on, r.ms, r.why]),
    [
      ["gravity", 0, true, 0, "gravity_m_s2"],
      ["hex_elastic", 0, true, 1, "bodies[0].model"],
      ["hex_elastic", 1, true, 2, "bodies[1].model"],
    ],
  );
  const off = rowsOf(plan, {
    rows: ["hex_elastic", "hex_elastic", "field_out"],
    row_parts: [0, 1, 1],
    off: [{ row: "gravity", part: 0 }],
  });
  assert.deepEqual(
    off.map((r) => [r.name, r.part, r.on, r.ms, r.why]),
    [
      ["hex_elastic", 0, true, 0, "bodies[0].model"],
      ["hex_elastic", 1, true, 1, "bodies[1].model"],
      ["field_out", 1, true, 2, ""],
      ["gravity", 0, false, null, "gravity_m_s2"],
    ],
  );
  const fixed = rowsOf(
    { ...plan, row_fixed: [0, 1, 1] },
    { rows: ["hex_elastic", "hex_elastic", "field_out"], row_parts: [0, 1, 1], off: [{ row: "gravity", part: 0 }] },
  );
  assert.deepEqual(
    fixed.map((r) => [r.name, r.fixed]),
    [
      ["hex_elastic", true],
      ["hex_elastic", true],
      ["field_out", true],
      ["gravity", false],
    ],
    "what cannot go has no switch",
  );
  assert.deepEqual(
    off.map((r) => r.fixed),
    [false, false, false, false],
    "a server that does not say",
  );
  assert.deepEqual(
    rowsOf({ rows: ["a"] }, { rows: [] }).map((r) => [r.name, r.part, r.why]),
    [["a", 0, ""]],
    "a server of before",
  );
});

test("a row without a switch says why, and a bar is as long as its figure", () => {
  const rows = rowsOf(
    { rows: ["verlet"], row_parts: [0], row_fixed: [1] },
    { rows: ["verlet", "field_out"], row_parts: [0, 0] },
  );
  assert.deepEqual(
    rows.map((r) => [r.fixed, r.planned]),
    [
      [true, true],
      [true, false],
    ],
  );
  assert.match(fixedWhy(rows[0]), /moves the body/);
  assert.match(fixedWhy(rows[1]), /came while the scene runs/);
  assert.deepEqual(barsOf([1, 0.5, 0.0004]), [1, 0.5, 0]);
  assert.deepEqual(barsOf([0.0004, 0.0001]), [0, 0], "asleep");
  assert.deepEqual(
    barsOf([0.001]).map((v) => Number(v.toFixed(2))),
    [0.1],
  );
  assert.deepEqual(barsOf([]), []);
});

test("a stopped body says why, a rescued one how often and at what price", () => {
  const parts = [{ name: "liver" }, { name: "kidney" }];
  assert.deepEqual(
    bodyLines(
      [
        { part: 1, frozen: true, why: "node 512 moves at 3,200 m/s", rescues: 1, rescue_ms: 0.25 },
        { part: 0, asleep: true },
      ],
      parts,
    ),
    [
      {
        name: "kidney",
        frozen: true,
        mark: "stopped",
        said: ["node 512 moves at 3,200 m/s", "1 rescue, 0.250 ms in all."],
      },
      { name: "liver", frozen: false, mark: "asleep", said: [] },
    ],
  );
  assert.deepEqual(bodyLines([{ part: 0, rescues: 1234567, rescue_ms: 88.44 }], parts)[0].said, [
    "1,234,567 rescues, 88.4 ms in all.",
  ]);
  assert.deepEqual(bodyLines([], parts), []);
});

test("what nobody looks at is said not to be computed", () => {
  assert.equal(
    unwatchedLine({ field: false, estimate: false, estimates: true, unwatched: 0 }),
    "Not computed, nobody looks here: colours, errors.",
  );
  assert.equal(
    unwatchedLine({ field: true, estimate: false, estimates: false, unwatched: 12345 }),
    "12,345 steps were not skinned while nobody watched.",
  );
  assert.equal(unwatchedLine({ field: true, estimate: true, estimates: true, unwatched: 0 }), "");
});
