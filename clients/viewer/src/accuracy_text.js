// Estimates of the error in words: lengths, times, alternatives, what a switch did. Pure.

/**
 * @typedef {import("./control_table.js").Estimate} Estimate
 * @typedef {import("./control_table.js").Neighbour} Neighbour
 * @typedef {import("./control_table.js").StudyPoint} StudyPoint
 */

/** smallest length that is displayed, m: shorter ones are "< 0.001 mm" */
export const RESOLUTION_M = 1e-6;
const OLD_S = 1; // an older estimate is displayed with its age; a switch does not use it either
const REST_M = 1e-5; // a body that moves less is at rest
const SAME_MS = 0.005; // half the last digit of a displayed time

/** parts of the error, in the order of the stacked bar */
export const PARTS = Object.freeze(
    /** @type {const} */ ([
        { key: "discretisation_m", title: "mesh", colour: "#5cb8ff" },
        { key: "algebraic_m", title: "solver", colour: "#62d39a" },
        { key: "time_m", title: "step", colour: "#ffb45c" },
        { key: "model_m", title: "model", colour: "#e08bd8" },
    ]),
);

/** can a logarithmic axis show it? @param {number | undefined} v @returns {v is number} */
export const positive = (v) => typeof v === "number" && Number.isFinite(v) && v > 0;

/** is it an error? Zero is one @param {number | undefined} v @returns {v is number} */
const known = (v) => typeof v === "number" && Number.isFinite(v) && v >= 0;

/** two or three digits @param {number} v */
export function short(v) {
    if (v === 0) return "0";
    const size = Math.abs(v);
    if (size >= 1000) return Math.round(v).toLocaleString("en");
    if (size >= 100) return v.toFixed(0);
    if (size < 1e-3) return v.toExponential(0).replace("e-", "e−");
    return String(Number(v.toPrecision(size >= 10 ? 3 : 2)));
}

/** @param {number | undefined} m */
export function millimetres(m) {
    if (m === undefined) return "unknown";
    return m !== 0 && m < RESOLUTION_M ? "< 0.001 mm" : `${short(1e3 * m)} mm`;
}

/** a label of the server without underscores @param {string} label */
export const plainLabel = (label) => label.replaceAll("_", " ");

const percent = (/** @type {number} */ value) => `${value < 99.5 ? value.toPrecision(2) : Math.round(value)} %`;

/** a point of the study: cost, error, and the error of the force where it was judged @param {StudyPoint} point */
export const pointText = (point) =>
    `${plainLabel(point.label)}: ${milliseconds(point.cost_ms)}, ${millimetres(point.error_m)}` +
    (point.force_percent === undefined ? "" : `, force ${percent(point.force_percent)} off at 50 ms`);

/** @param {number | undefined} ms */
export const milliseconds = (ms) => (ms === undefined ? "unknown" : `${short(ms)} ms`);

/**
 * The largest error with its age and remarks. `known`: the parts have values.
 * @param {Estimate | null} estimate @returns {{error: string, age: string, note: string, known: boolean}}
 */
export function errorText(estimate) {
    if (!estimate) return { error: "being estimated", age: "", note: "", known: false };
    const {
        age_s = 0,
        error_m,
        max_displacement_m,
        locking,
        diagnostic = "",
        tick,
        energy_error_percent,
        force_percent,
    } = estimate;
    if (tick === 0)
        return { error: diagnostic ? "not estimated" : "being estimated", age: "", note: diagnostic, known: false };
    // rounding errors of a body that nothing moves say nothing
    if (max_displacement_m !== undefined && max_displacement_m < REST_M)
        return { error: "none: at rest", age: "", note: "", known: false };
    const notes = [
        diagnostic.replace(/([^.])$/, "$1."),
        locking ? "Volumetric locking: the true error is larger." : "",
        energy_error_percent !== undefined && error_m !== undefined && error_m >= RESOLUTION_M
            ? `Relative error in the energy norm: ${energy_error_percent.toPrecision(2)} %.`
            : "",
        force_percent === undefined ? "" : `Force of tools: ${percent(force_percent)} off.`,
    ];
    const age = age_s > OLD_S ? `${short(Math.round(age_s))} s ago` : "";
    const share =
        positive(error_m) && positive(max_displacement_m) && error_m >= RESOLUTION_M
            ? `, ${percent((100 * error_m) / max_displacement_m)} of what moves`
            : "";
    return { error: millimetres(error_m) + share, age, note: notes.filter(Boolean).join(" "), known: true };
}

/** the known parts of the error and their shares @param {Estimate} estimate */
export function partsOf(estimate) {
    const parts = PARTS.flatMap((part) => {
        const value = estimate[part.key];
        return known(value) ? [{ ...part, value }] : [];
    });
    const sum = parts.reduce((all, part) => all + part.value, 0);
    return parts.map((part) => ({ ...part, share: sum > 0 ? part.value / sum : 0 }));
}

/** @param {number} ratio of the errors */
function gainText(ratio) {
    if (ratio > 0.43 && ratio < 0.57) return "half the error";
    if (ratio > 1.75 && ratio < 2.3) return "twice the error";
    if (Math.abs(ratio - 1) < 0.02) return "same error";
    if (ratio < 1) return `${Math.round(100 * (1 - ratio))} % less error`;
    return ratio < 2 ? `${Math.round(100 * (ratio - 1))} % more error` : `${short(ratio)} times the error`;
}

/**
 * What a neighbour gains and costs: "half the error: +4.1 ms".
 * @param {Estimate} now @param {Neighbour} to
 */
export function neighbourText(now, to) {
    const cost = positive(now.cost_ms) && positive(to.cost_ms) ? to.cost_ms - now.cost_ms : null;
    const difference = cost === null ? "" : `${cost > 0 ? "+" : "−"}${short(Math.abs(cost))} ms`;
    const costText = cost === null ? "" : Math.abs(cost) < SAME_MS ? ": same cost" : `: ${difference}`;
    if (!known(now.error_m) || !known(to.error_m)) return plainLabel(to.label) + costText;
    const ratio = Math.max(RESOLUTION_M, to.error_m) / Math.max(RESOLUTION_M, now.error_m);
    return gainText(ratio) + costText;
}

/** the errors of both configurations bound the displacement of a switch @param {Record<string, number>} args */
function boundText({ max_move_m, bound_m }) {
    if (typeof bound_m !== "number") return "";
    return max_move_m <= Math.max(bound_m, RESOLUTION_M)
        ? ` (bound ${millimetres(bound_m)})`
        : ` (beyond the bound of ${millimetres(bound_m)})`;
}

/** what a switch of the configuration did @param {import("./control_table.js").Answer} answer */
export function switchText({ text, args = {} }) {
    const { energy_percent, max_frame_move_m, prepare_ms, max_move_m } = args;
    const facts = [];
    if (energy_percent !== undefined)
        facts.push(`energy ${energy_percent > -0.005 ? "+" : "−"}${Math.abs(energy_percent).toFixed(2)} %`);
    if (max_move_m !== undefined) facts.push(`surface moves ${millimetres(max_move_m)}${boundText(args)}`);
    if (max_frame_move_m !== undefined) facts.push(`${millimetres(max_frame_move_m)} per frame`);
    if (prepare_ms !== undefined)
        facts.push(
            `prepared in ${prepare_ms < 1000 ? `${prepare_ms.toFixed(0)} ms` : `${(prepare_ms / 1000).toFixed(1)} s`}`,
        );
    return facts.length ? `Switched: ${facts.join(", ")}.` : text;
}
