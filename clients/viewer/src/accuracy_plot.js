// What accuracy costs, as a plot and in words: milliseconds of a step against the largest error, both logarithmic. Pure:
// numbers and names in, places and sentences out; accuracy_panel.js draws them.

/**
 * @typedef {{index: number, method: string, label: string, ms: number, error_m: number, front?: boolean}} Point of `study`
 * @typedef {{knob: string, label: string, ms?: number, error_m?: number, size?: number, step_ms?: number, tolerance?: number}} Neighbour of `estimate`
 * @typedef {{body: string, setting: string, point?: number, tick: number, age_s?: number, ms?: number, own_ms: number, most_m?: number, error_m?: number,
 *   discretisation_m?: number, algebraic_m?: number, time_m?: number, model_m?: number, zz_percent?: number, locking?: boolean, note?: string,
 *   neighbours?: Neighbour[]}} Estimate
 * @typedef {{low: number, high: number}} Range of one axis, powers of ten and round parts of them
 */

/** errors below this are drawn here: a body at rest errs by rounding, which is nobody's scale */
export const LEAST_M = 1e-8;
/** lengths below this are said to be less than it */
export const LEAST_SAID_M = 1e-6;

/** colours of methods in the order in which they come; told apart on dark ground with any colour vision */
export const METHOD_COLOURS = Object.freeze(["#5cb8ff", "#ffb45c", "#62d39a", "#e08bd8", "#f2e36b", "#b0bec8"]);

/** parts of an error, in the order in which they are stacked */
export const PARTS = Object.freeze(
  /** @type {const} */ ([
    { key: "discretisation_m", title: "mesh", colour: "#5cb8ff" },
    { key: "algebraic_m", title: "solver", colour: "#62d39a" },
    { key: "time_m", title: "step", colour: "#ffb45c" },
    { key: "model_m", title: "model", colour: "#e08bd8" },
  ]),
);

/** is it a number that a logarithm takes? @param {number | undefined} v @returns {v is number} */
const positive = (v) => typeof v === "number" && Number.isFinite(v) && v > 0;

/** is it an error? None is one too @param {number | undefined} v @returns {v is number} */
const known = (v) => typeof v === "number" && Number.isFinite(v) && v >= 0;

/** the widest range that holds all values, out to 1, 2 or 5 times a power of ten, at least a factor of `least`
 * @param {number[]} values @param {number} least @returns {Range} */
export function logRange(values, least = 10) {
  const good = values.filter(positive);
  if (good.length === 0) return { low: 1, high: least };
  const step = (/** @type {number} */ v, /** @type {boolean} */ up) => {
    const ten = 10 ** Math.floor(Math.log10(v) + 1e-9),
      all = [1, 2, 5, 10].map((s) => s * ten);
    return up
      ? (all.find((s) => s >= v * (1 - 1e-9)) ?? 10 * ten)
      : (all.filter((s) => s <= v * (1 + 1e-9)).at(-1) ?? ten);
  };
  let low = step(Math.min(...good) / 1.15, false),
    high = step(Math.max(...good) * 1.15, true);
  while (high / low < least * (1 - 1e-9)) {
    high = step(high * 1.01, true);
    if (high / low < least * (1 - 1e-9)) low = step(low / 1.01, false);
  }
  return { low, high };
}

/** where on an axis from a to b a value lies @param {number} v @param {Range} range @param {number} a @param {number} b */
export function logPlace(v, range, a, b) {
  const at = Math.log(v / range.low) / Math.log(range.high / range.low);
  return a + (b - a) * Math.min(1, Math.max(0, at));
}

/** marks of an axis: 1, 2 and 5 where there is room, else powers of ten @param {Range} range @param {number} most */
export function logTicks(range, most = 6) {
  /** @param {number[]} steps */
  const among = (steps) => {
    const ticks = [];
    for (let ten = 10 ** Math.floor(Math.log10(range.low) + 1e-9); ten <= range.high * 1.001; ten *= 10)
      for (const s of steps) {
        const v = Number((s * ten).toPrecision(3));
        if (v >= range.low * 0.999 && v <= range.high * 1.001) ticks.push(v);
      }
    return ticks;
  };
  for (const steps of [[1, 2, 5], [1, 3], [1]]) {
    const ticks = among(steps);
    if (ticks.length <= most && ticks.length > 1) return ticks;
  }
  const all = among([1]);
  return all.length > 1 ? all.filter((_, i) => i % Math.ceil(all.length / most) === 0) : among([1, 2, 5]);
}

/** a number as people read it: two or three digits @param {number} v */
export function short(v) {
  if (v === 0) return "0";
  const size = Math.abs(v);
  if (size >= 1000) return Math.round(v).toLocaleString("en");
  if (size >= 100) return v.toFixed(0);
  if (size < 1e-3) return v.toExponential(0).replace("e-", "e−");
  return String(Number(v.toPrecision(size >= 10 ? 3 : 2)));
}

/** @param {number | undefined} m */
export const millimetres = (m) =>
  m === undefined ? "not known" : m !== 0 && m < LEAST_SAID_M ? "< 0.001 mm" : `${short(1e3 * m)} mm`;
/** @param {number | undefined} ms */
export const milliseconds = (ms) => (ms === undefined ? "not known" : `${short(ms)} ms`);

/** an estimate whose body has been awake for longer since is said to be of a while ago, s */
const OLD_S = 1;

/**
 * The largest error and what there is to say of it. `known`: there are figures.
 * @param {Estimate | null} e @returns {{error: string, ago: string, note: string, known: boolean}}
 */
export function errorWords(e) {
  if (!e) return { error: "being estimated", ago: "", note: "", known: false };
  if (e.tick === 0)
    return { error: e.note ? "not estimated" : "being estimated", ago: "", note: e.note ?? "", known: false };
  const notes = [
    (e.note ?? "").replace(/([^.])$/, "$1."),
    e.locking ? "It locks: the true error is larger." : "",
    typeof e.zz_percent === "number" && e.error_m !== undefined && e.error_m >= LEAST_SAID_M
      ? `In energy ${e.zz_percent.toPrecision(2)} %.`
      : "",
  ];
  const ago = (e.age_s ?? 0) > OLD_S ? `${short(Math.round(/** @type {number} */ (e.age_s)))} s ago` : "";
  return { error: millimetres(e.error_m), ago, note: notes.filter(Boolean).join(" "), known: true };
}

/** the points of the front by their milliseconds: what the slider goes along @param {Point[]} points @returns {Point[]} */
export function frontOf(points) {
  return points
    .filter((p) => p.front && positive(p.ms) && positive(p.error_m))
    .sort((a, b) => a.ms - b.ms || b.error_m - a.error_m);
}

/**
 * The place on the slider that stands for where the body is: its own point, else the nearest in milliseconds.
 * @param {Point[]} front @param {Estimate | null} estimate @returns {number} -1: there is none
 */
export function placeOn(front, estimate) {
  if (front.length === 0 || !estimate) return -1;
  const own = front.findIndex((p) => p.index === estimate.point);
  if (own >= 0) return own;
  if (!positive(estimate.ms)) return -1;
  const far = front.map((p) => Math.abs(Math.log(p.ms / /** @type {number} */ (estimate.ms))));
  return far.indexOf(Math.min(...far));
}

/**
 * Everything that the plot shows, in the coordinates of its picture.
 * @param {Point[]} points @param {Estimate | null} estimate @param {{left: number, right: number, top: number, bottom: number}} box
 */
export function layOut(points, estimate, box) {
  const good = points.filter((p) => positive(p.ms) && positive(p.error_m)),
    near = estimate?.neighbours ?? [];
  const both = (/** @type {{ms?: number, error_m?: number} | null} */ p) =>
    p !== null && positive(p.ms) && positive(p.error_m);
  const shown = [...good, ...near.filter(both), ...(both(estimate) ? [estimate] : [])];
  const msRange = logRange([
    ...shown.map((p) => /** @type {number} */ (p?.ms)),
    ...(positive(estimate?.ms) ? [estimate.ms] : []),
  ]);
  // a body at rest is far below all that was studied: it stands at the foot of the plot
  const least = Math.max(LEAST_M, ...(good.length ? [0.1 * Math.min(...good.map((p) => p.error_m))] : []));
  const errorRange = logRange(shown.map((p) => 1e3 * Math.max(least, /** @type {number} */ (p?.error_m))));
  const x = (/** @type {number} */ ms) => logPlace(ms, msRange, box.left, box.right);
  const y = (/** @type {number} */ m) => logPlace(1e3 * Math.max(least, m), errorRange, box.bottom, box.top);
  const methods = [...new Set(good.map((p) => p.method))];
  return {
    methods: methods.map((name, i) => ({ name, colour: METHOD_COLOURS[i % METHOD_COLOURS.length] })),
    xTicks: logTicks(msRange).map((v) => ({ at: logPlace(v, msRange, box.left, box.right), text: short(v) })),
    yTicks: logTicks(errorRange, 5).map((v) => ({ at: logPlace(v, errorRange, box.bottom, box.top), text: short(v) })),
    marks: good.map((p) => ({
      x: x(p.ms),
      y: y(p.error_m),
      point: p,
      colour: METHOD_COLOURS[methods.indexOf(p.method) % METHOD_COLOURS.length],
    })),
    front: frontOf(good).map((p) => ({ x: x(p.ms), y: y(p.error_m) })),
    neighbours: near.flatMap((n) =>
      positive(n.ms) && positive(n.error_m) ? [{ x: x(n.ms), y: y(n.error_m), of: n }] : [],
    ),
    // without an error the body is a line across the plot: what it costs is known
    live: positive(estimate?.ms)
      ? { x: x(estimate.ms), y: positive(estimate.error_m) ? y(estimate.error_m) : null }
      : null,
    x,
    y,
    msRange,
    errorRange,
  };
}

/** which of the known parts makes how much of the error, for stacked bars @param {Estimate} estimate */
export function partsOf(estimate) {
  const there = PARTS.flatMap((part) => {
    const value = estimate[part.key];
    return known(value) ? [{ ...part, value }] : [];
  });
  const sum = there.reduce((all, part) => all + part.value, 0);
  return there.map((part) => ({ ...part, share: sum > 0 ? part.value / sum : 0 }));
}

/**
 * What a neighbour brings and costs: "halve the error: +4.1 ms".
 * @param {Estimate} now @param {Neighbour} to
 */
export function neighbourWords(now, to) {
  const cost = positive(now.ms) && positive(to.ms) ? to.ms - now.ms : null;
  const price =
    cost === null
      ? ""
      : Math.abs(cost) < 0.005
        ? ": same cost"
        : `: ${cost > 0 ? "+" : "−"}${short(Math.abs(cost))} ms`;
  if (!known(now.error_m) || !known(to.error_m)) return to.label + price;
  // what is said to be less than a length is not told apart below it
  const ratio = Math.max(LEAST_SAID_M, to.error_m) / Math.max(LEAST_SAID_M, now.error_m);
  const gain =
    ratio > 0.43 && ratio < 0.57
      ? "halve the error"
      : ratio > 1.75 && ratio < 2.3
        ? "twice the error"
        : Math.abs(ratio - 1) < 0.02
          ? "same error"
          : ratio < 1
            ? `${Math.round(100 * (1 - ratio))} % less error`
            : ratio < 2
              ? `${Math.round(100 * (ratio - 1))} % more error`
              : `${short(ratio)} times the error`;
  return gain + price;
}

/** the order that goes to a neighbour; null: no knob of ours leads there @param {string} body @param {Neighbour} to */
export function knobOrder(body, to) {
  /** @type {Record<string, number>} */
  const args = {};
  for (const key of /** @type {const} */ (["size", "step_ms", "tolerance"]))
    if (to[key]) args[key] = /** @type {number} */ (to[key]);
  return to.knob === "method" || Object.keys(args).length === 0 ? null : { verb: "knob", target: body, args };
}

/** the errors shown of both settings bound what a switch may move @param {Record<string, number>} args */
function boundWords({ most_move_m, bound_m }) {
  if (typeof bound_m !== "number") return "";
  // what rounds to nothing in these words is no jump
  return most_move_m <= Math.max(bound_m, LEAST_SAID_M)
    ? ` of ${millimetres(bound_m)} allowed`
    : `, more than the ${millimetres(bound_m)} allowed`;
}

/** what a switch did @param {{text: string, args?: Record<string, number>}} answer */
export function switchWords({ text, args = {} }) {
  const said = [];
  if (typeof args.energy_percent === "number")
    said.push(`energy ${args.energy_percent >= 0 ? "+" : "−"}${Math.abs(args.energy_percent).toFixed(2)} %`);
  if (typeof args.frame_move_m === "number")
    said.push(`moves ${millimetres(args.most_move_m)}${boundWords(args)}, ${millimetres(args.frame_move_m)} a frame`);
  else if (typeof args.most_move_m === "number") said.push(`moved ${millimetres(args.most_move_m)}${boundWords(args)}`);
  if (typeof args.made_ms === "number")
    said.push(
      `made in ${args.made_ms < 1000 ? `${args.made_ms.toFixed(0)} ms` : `${(args.made_ms / 1000).toFixed(1)} s`}`,
    );
  return said.length ? `Switched: ${said.join(", ")}.` : text;
}
