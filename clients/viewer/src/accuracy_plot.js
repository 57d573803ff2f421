// The plot of error against cost: milliseconds per step and the largest error, both axes logarithmic. Pure: numbers in,
// positions out; accuracy_chart.js draws them.
import { positive, RESOLUTION_M, short } from "./accuracy_text.js";

/**
 * @typedef {import("./control_table.js").Estimate} Estimate
 * @typedef {import("./control_table.js").StudyPoint} StudyPoint
 * @typedef {{low: number, high: number}} Range of one axis
 * @typedef {ReturnType<typeof layOutPlot>} Plot
 */

/** smaller errors are drawn here: they are rounding errors */
const ERROR_MIN_M = 1e-8;

/** colours of the methods in the order of the study, distinguishable on dark ground with any colour vision */
export const METHOD_COLOURS = Object.freeze(["#5cb8ff", "#ffb45c", "#62d39a", "#e08bd8", "#f2e36b", "#b0bec8"]);

/**
 * Range that contains all values, with ends of 1, 2 or 5 times a power of ten, at span a factor of `span`.
 * @param {number[]} values @param {number} span @returns {Range}
 */
export function logRange(values, span = 10) {
    const good = values.filter(positive);
    if (good.length === 0) return { low: 1, high: span };
    const step = (/** @type {number} */ v, /** @type {boolean} */ up) => {
        const ten = 10 ** Math.floor(Math.log10(v) + 1e-9);
        const all = [1, 2, 5, 10].map((s) => s * ten);
        return up
            ? (all.find((s) => s >= v * (1 - 1e-9)) ?? 10 * ten)
            : (all.filter((s) => s <= v * (1 + 1e-9)).at(-1) ?? ten);
    };
    let low = step(Math.min(...good) / 1.15, false);
    let high = step(Math.max(...good) * 1.15, true);
    while (high / low < span * (1 - 1e-9)) {
        high = step(high * 1.01, true);
        if (high / low < span * (1 - 1e-9)) low = step(low / 1.01, false);
    }
    return { low, high };
}

/** position of a value on an axis from a to b @param {number} v @param {Range} range @param {number} a @param {number} b */
export function logPosition(v, range, a, b) {
    const at = Math.log(v / range.low) / Math.log(range.high / range.low);
    return a + (b - a) * Math.min(1, Math.max(0, at));
}

/** ticks of an axis: 1, 2 and 5 where they fit, else powers of ten @param {Range} range @param {number} max */
export function logTicks(range, max = 6) {
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
        if (ticks.length <= max && ticks.length > 1) return ticks;
    }
    const all = among([1]);
    return all.length > 1 ? all.filter((_, i) => i % Math.ceil(all.length / max) === 0) : among([1, 2, 5]);
}

/** the Pareto front in the order of cost: the positions of the slider @param {StudyPoint[]} points @returns {StudyPoint[]} */
export function frontOf(points) {
    return points
        .filter((p) => p.pareto_optimal && positive(p.cost_ms) && positive(p.error_m))
        .sort((a, b) => a.cost_ms - b.cost_ms || b.error_m - a.error_m);
}

/**
 * Slider position of the running configuration: its own point, else the nearest one in cost.
 * @param {StudyPoint[]} front @param {Estimate | null} estimate @returns {number} -1: none
 */
export function positionOn(front, estimate) {
    if (front.length === 0 || !estimate) return -1;
    const own = front.findIndex((p) => p.index === estimate.study_point);
    if (own >= 0) return own;
    if (!positive(estimate.cost_ms)) return -1;
    const distances = front.map((p) => Math.abs(Math.log(p.cost_ms / /** @type {number} */ (estimate.cost_ms))));
    return distances.indexOf(Math.min(...distances));
}

/**
 * The errors that the plot shows: those under the study's loads, which are of one kind; the estimate is of the present
 * load and has no place among them. The running configuration has that of its own point, and a neighbour as many times
 * that as it is predicted to have of the present error. Without a study all are errors under the present load.
 * @param {StudyPoint[]} good @param {Estimate | null} estimate
 * @returns {{studied: boolean, live: number | undefined, of: (error_m: number | undefined) => number | undefined}}
 */
function errorsOf(good, estimate) {
    if (good.length === 0) return { studied: false, live: estimate?.error_m, of: (error_m) => error_m };
    const live = good.find((p) => p.index === estimate?.study_point)?.error_m;
    const now = estimate?.error_m;
    const scale = live !== undefined && positive(now) && now >= RESOLUTION_M ? live / now : undefined;
    return { studied: true, live, of: (error_m) => (scale && positive(error_m) ? scale * error_m : undefined) };
}

/**
 * The contents of the plot, in the coordinates of its drawing.
 * @param {StudyPoint[]} points @param {Estimate | null} estimate @param {{left: number, right: number, top: number, bottom: number}} box
 */
export function layOutPlot(points, estimate, box) {
    const good = points.filter((p) => positive(p.cost_ms) && positive(p.error_m));
    const errors = errorsOf(good, estimate);
    const near = (estimate?.neighbours ?? []).flatMap((of) => {
        const error_m = errors.of(of.error_m);
        return positive(of.cost_ms) && positive(error_m) ? [{ of, cost_ms: of.cost_ms, error_m }] : [];
    });
    const msRange = logRange([...good, ...near, estimate].flatMap((p) => (positive(p?.cost_ms) ? [p.cost_ms] : [])));
    const shown = [...good, ...near].map((p) => p.error_m).concat(positive(errors.live) ? [errors.live] : []);
    const errorRange = logRange(shown.map((m) => 1e3 * Math.max(ERROR_MIN_M, m)));
    const x = (/** @type {number} */ ms) => logPosition(ms, msRange, box.left, box.right);
    const y = (/** @type {number} */ m) => logPosition(1e3 * Math.max(ERROR_MIN_M, m), errorRange, box.bottom, box.top);
    const methods = [...new Set(good.map((p) => p.method))];
    return {
        methods: methods.map((name, i) => ({ name, colour: METHOD_COLOURS[i % METHOD_COLOURS.length] })),
        xTicks: logTicks(msRange).map((v) => ({ at: logPosition(v, msRange, box.left, box.right), text: short(v) })),
        yTicks: logTicks(errorRange, 5).map((v) => ({
            at: logPosition(v, errorRange, box.bottom, box.top),
            text: short(v),
        })),
        marks: good.map((p) => ({
            x: x(p.cost_ms),
            y: y(p.error_m),
            point: p,
            colour: METHOD_COLOURS[methods.indexOf(p.method) % METHOD_COLOURS.length],
        })),
        front: frontOf(good).map((p) => ({ x: x(p.cost_ms), y: y(p.error_m) })),
        neighbours: near.map(({ of, cost_ms, error_m }) => ({ x: x(cost_ms), y: y(error_m), of })),
        studied: errors.studied,
        // a configuration of unknown error is a vertical line at its cost
        live: positive(estimate?.cost_ms)
            ? { x: x(estimate.cost_ms), y: positive(errors.live) ? y(errors.live) : null }
            : null,
        x,
        y,
        msRange,
        errorRange,
    };
}

/**
 * Arguments of the command that switches to a neighbour.
 * @param {import("./control_table.js").Neighbour} near @returns {Record<string, number> | null} null: only a point of the study does
 */
export function neighbourArgs(near) {
    /** @type {Record<string, number>} */
    const args = {};
    if (near.size) args.size = near.size;
    if (near.step_ms) args.step_ms = near.step_ms;
    if (near.tolerance) args.tolerance = near.tolerance;
    return near.parameter === "method" || Object.keys(args).length === 0 ? null : args;
}
