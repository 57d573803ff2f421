// Estimates of the error in words: lengths, times, alternatives, what a switch did. Pure.
import { decimal, isTextKey, language, text as textOf } from "./text.js";

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
        { key: "discretisation_m", title: "accuracy.part.mesh", colour: "#5cb8ff" },
        { key: "algebraic_m", title: "accuracy.part.solver", colour: "#62d39a" },
        { key: "time_m", title: "accuracy.part.step", colour: "#ffb45c" },
        { key: "model_m", title: "accuracy.part.model", colour: "#e08bd8" },
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
    if (size >= 1000) return Math.round(v).toLocaleString(language);
    if (size >= 100) return v.toFixed(0);
    if (size < 1e-3) return v.toExponential(0).replace("e-", "e−");
    return decimal(String(Number(v.toPrecision(size >= 10 ? 3 : 2))));
}

/** @param {number | undefined} m */
export function millimetres(m) {
    if (m === undefined) return textOf("accuracy.unknown");
    return m !== 0 && m < RESOLUTION_M ? "< 0.001 mm" : `${short(1e3 * m)} mm`;
}

/** a label of the server in words: "tet_springs, 21 voxels, 8.33 ms" @param {string} label */
export const plainLabel = (label) =>
    label
        .replaceAll("_", " ")
        .replace(/\b(\d+) voxels\b/, (all, n) => textOf("accuracy.label.voxels", { n }))
        .replace(/\b([\d.]+) ms\b/, (all, ms) => textOf("accuracy.label.step", { ms: decimal(ms) }));

/** what a neighbour changes; other words of the server stay @param {string} parameter */
export const parameterText = (parameter) => {
    const key = `accuracy.parameter.${parameter}`;
    return isTextKey(key) ? textOf(key) : parameter;
};

const percent = (/** @type {number} */ value) =>
    `${value < 99.5 ? decimal(value.toPrecision(2)) : Math.round(value)} %`;

/** a point of the study: cost, error, and the error of the force where it was judged @param {StudyPoint} point */
export const pointText = (point) =>
    `${plainLabel(point.label)}: ${milliseconds(point.cost_ms)}, ${millimetres(point.error_m)}` +
    (point.force_percent === undefined
        ? ""
        : `, ${textOf("accuracy.force_off", { percent: percent(point.force_percent) })}`);

/** @param {number | undefined} ms */
export const milliseconds = (ms) => (ms === undefined ? textOf("accuracy.unknown") : `${short(ms)} ms`);

/**
 * The largest error with its age and remarks. `known`: the parts have values.
 * @param {Estimate | null} estimate @returns {{error: string, age: string, note: string, known: boolean}}
 */
export function errorText(estimate) {
    if (!estimate) return { error: textOf("accuracy.estimating"), age: "", note: "", known: false };
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
        return {
            error: textOf(diagnostic ? "accuracy.not_estimated" : "accuracy.estimating"),
            age: "",
            note: diagnostic,
            known: false,
        };
    // rounding errors of a body that nothing moves say nothing
    if (max_displacement_m !== undefined && max_displacement_m < REST_M)
        return { error: textOf("accuracy.at_rest"), age: "", note: "", known: false };
    const notes = [
        diagnostic.replace(/([^.])$/, "$1."),
        locking ? textOf("accuracy.locking") : "",
        energy_error_percent !== undefined && error_m !== undefined && error_m >= RESOLUTION_M
            ? textOf("accuracy.energy", { percent: decimal(energy_error_percent.toPrecision(2)) })
            : "",
        force_percent === undefined ? "" : textOf("accuracy.force", { percent: percent(force_percent) }),
    ];
    const age = age_s > OLD_S ? textOf("time.seconds_ago", { n: short(Math.round(age_s)) }) : "";
    const share =
        positive(error_m) && positive(max_displacement_m) && error_m >= RESOLUTION_M
            ? `, ${textOf("accuracy.share", { percent: percent((100 * error_m) / max_displacement_m) })}`
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
    if (ratio > 0.43 && ratio < 0.57) return textOf("accuracy.gain.half");
    if (ratio > 1.75 && ratio < 2.3) return textOf("accuracy.gain.twice");
    if (Math.abs(ratio - 1) < 0.02) return textOf("accuracy.gain.same");
    if (ratio < 1) return textOf("accuracy.gain.less", { percent: Math.round(100 * (1 - ratio)) });
    return ratio < 2
        ? textOf("accuracy.gain.more", { percent: Math.round(100 * (ratio - 1)) })
        : textOf("accuracy.gain.times", { n: short(ratio) });
}

/**
 * What a neighbour gains and costs: "half the error, 4.1 ms slower".
 * @param {Estimate} now @param {Neighbour} to
 */
export function neighbourText(now, to) {
    const cost = positive(now.cost_ms) && positive(to.cost_ms) ? to.cost_ms - now.cost_ms : null;
    const ms = cost === null ? "" : short(Math.abs(cost));
    const costText =
        cost === null
            ? ""
            : ", " +
              (Math.abs(cost) < SAME_MS
                  ? textOf("accuracy.same_speed")
                  : textOf(cost < 0 ? "accuracy.ms_faster" : "accuracy.ms_slower", { ms }));
    if (!known(now.error_m) || !known(to.error_m)) return plainLabel(to.label) + costText;
    const ratio = Math.max(RESOLUTION_M, to.error_m) / Math.max(RESOLUTION_M, now.error_m);
    return gainText(ratio) + costText;
}

/** what a switch of the configuration did @param {import("./control_table.js").Answer} answer */
export function switchText({ text, args = {} }) {
    const { max_move_m, prepare_ms } = args;
    if (max_move_m === undefined || prepare_ms === undefined) return text;
    const time = prepare_ms < 1000 ? `${prepare_ms.toFixed(0)} ms` : `${decimal((prepare_ms / 1000).toFixed(1))} s`;
    return textOf("accuracy.switched", { time, move: millimetres(max_move_m) });
}
