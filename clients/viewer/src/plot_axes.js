// Ranges of the axes of time plots, and their data as uPlot takes them. Pure.
import { roundUp } from "./legend.js";

const GAP_S = 0.5; // a longer time between two samples is not drawn as a line: nothing was measured there

/**
 * The last `length` seconds; a shorter history fills them from the left.
 * @param {ArrayLike<number>} times of the samples, s @param {number} length s @returns {[number, number]}
 */
export function timeRange(times, length) {
    const first = times[0] ?? 0;
    const from = Math.max(first, (times[times.length - 1] ?? 0) - length);
    return [from, from + length];
}

/**
 * From 0 to the round number above the values, with a negative part if they have one.
 * @param {Iterable<number>} values @param {number} min smallest range, so that noise at rest stays flat
 * @returns {[number, number]}
 */
export function valueRange(values, min) {
    let low = 0;
    let high = min;
    for (const value of values) {
        if (value < low) low = value;
        if (value > high) high = value;
    }
    // a negative part of less than a tenth of the smallest range is rounding
    return [low < -min / 10 ? -roundUp(-low) : 0, roundUp(high)];
}

/**
 * Columns for uPlot: missing values and longer pauses are gaps.
 * @param {Float64Array} times @param {(Float32Array | undefined)[]} columns
 * @returns {[number[], ...(number | null)[][]]}
 */
export function plotData(times, columns) {
    /** @type {number[]} index of each sample, -1 in a pause */
    const rows = [];
    /** @type {number[]} */
    const x = [];
    times.forEach((time, i) => {
        if (i > 0 && time - times[i - 1] > GAP_S) {
            x.push((time + times[i - 1]) / 2);
            rows.push(-1);
        }
        x.push(time);
        rows.push(i);
    });
    const value = (/** @type {Float32Array | undefined} */ values, /** @type {number} */ i) =>
        i < 0 || !values || Number.isNaN(values[i]) ? null : values[i];
    return [x, ...columns.map((values) => rows.map((i) => value(values, i)))];
}
