// The legend: fields, the range of the colour map, its ticks. Pure.
import { DIVERGING, SEQUENTIAL } from "./colour_maps.js";
import { decimal, text } from "./text.js";

const LENGTHS = /** @type {[string, number][]} */ ([
    ["mm", 1e-3],
    ["m", 1],
]);
const PRESSURES = /** @type {[string, number][]} */ ([
    ["Pa", 1],
    ["kPa", 1e3],
    ["MPa", 1e6],
    ["GPa", 1e9],
]);
const PERCENT = /** @type {[string, number][]} */ ([["%", 1e-2]]);

/**
 * Fields that this page can show. `min`: smallest range of the colours. Below it the body fades to its natural colour: its
 * values are noise of a body at rest, and a body in one dark colour would look like a finding. It is what a user cannot
 * see or does not ask about: half a millimetre, half a percent, and the stress, about 10 Pa, that half a percent causes in
 * the softest tissue. 0: a property of the material, worth showing always. `units`: from small to large with their size
 * in SI. `signed`: values on both sides of 0, which has the middle colour.
 * @type {Record<string, {min: number, units: [string, number][], signed?: boolean}>}
 */
export const FIELDS = Object.freeze({
    displacement: { min: 5e-4, units: LENGTHS },
    von_mises: { min: 10, units: PRESSURES },
    energy: {
        min: 0.02,
        units: [
            ["mJ/m³", 1e-3],
            ["J/m³", 1],
            ["kJ/m³", 1e3],
            ["MJ/m³", 1e6],
        ],
    },
    stiffness: {
        min: 0,
        units: [
            ["nJ", 1e-9],
            ["µJ", 1e-6],
            ["mJ", 1e-3],
            ["J", 1],
        ],
    },
    young: { min: 0, units: PRESSURES },
    density: { min: 0, units: [["kg/m³", 1]] },
    damping: { min: 0, units: [["1/s", 1]] },
    strain: { min: 5e-3, units: PERCENT },
    distortion: { min: 5e-3, units: PERCENT, signed: true },
});

/** name of a field for the user @param {string} field */
export const titleOf = (field) => text(/** @type {import("./text.js").TextKey} */ (`field.${field}`));

/** @param {string} field */
export const mapOf = (field) => (FIELDS[field]?.signed ? DIVERGING : SEQUENTIAL);

/** @typedef {{low: number, high: number}} Range */

/** lengths of an interval between ticks, with short multiples; a range has four intervals, five ticks */
const STEPS = [1, 1.25, 1.5, 2, 2.5, 3, 4, 5, 6, 7.5, 10];
const INTERVALS = 4;
const KEEP = 0.45; // a range is kept while the values reach this share of it
const NARROW = 0.45; // a range begins above 0 when its values spread over less than this share of the largest
const CONSTANT = 0.01; // a smaller spread is that of one value

/** the smallest step that is not below v @param {number} v > 0 */
export function roundUp(v) {
    const ten = 10 ** Math.floor(Math.log10(v) + 1e-12);
    const step = STEPS.find((s) => s * ten >= v * (1 - 1e-9)) ?? 10;
    return Number((step * ten).toPrecision(3));
}

/** @param {number} step @param {number} low multiple of it @returns {Range} */
const rangeFrom = (step, low) => ({
    low: Number(low.toPrecision(6)),
    high: Number((low + INTERVALS * step).toPrecision(6)),
});

/** the smallest range of four round intervals around values above 0 @param {number} low @param {number} high @returns {Range} */
function offsetRange(low, high) {
    for (let step = roundUp((high - low) / INTERVALS); ; step = roundUp(step * 1.01)) {
        const range = rangeFrom(step, Math.floor((low / step) * (1 + 1e-9)) * step);
        if (range.high >= high * (1 - 1e-9)) return range;
    }
}

/**
 * Range of the colour map for values between low and high: round numbers that follow the values with hysteresis. It begins
 * at 0 unless all values are near to each other; the range of a signed field is symmetric.
 * @param {string} field @param {number} low @param {number} high
 * @param {Range | null} before former range
 * @returns {Range}
 */
export function rangeOf(field, low, high, before) {
    const { min, signed } = FIELDS[field];
    const top = Math.max(high, signed ? -low : high, min, Number.MIN_VALUE * 1e16);
    if (signed) {
        const holds = before && top <= before.high && top >= KEEP * before.high;
        const to = holds ? before.high : (roundUp(top / (INTERVALS / 2)) * INTERVALS) / 2;
        return { low: -to, high: to };
    }
    const spread = high - low;
    const narrow = min === 0 && low > 0 && spread < NARROW * high && spread > CONSTANT * high;
    const next = narrow ? offsetRange(low, high) : rangeFrom(roundUp(top / INTERVALS), 0);
    const contains = before && before.low <= low && top <= before.high * (1 + 1e-9) && before.low > 0 === narrow;
    const filled = before && (spread >= KEEP * (before.high - before.low) || top >= KEEP * before.high);
    return before && contains && filled ? before : next;
}

/**
 * How much of the colours is shown: 0 natural colour up to half of the smallest range, 1 from the smallest range on.
 * @param {string} field @param {number} low @param {number} high of the values
 */
export function shareOf(field, low, high) {
    const { min } = FIELDS[field];
    return min === 0 ? 1 : Math.max(0, Math.min(1, (2 * Math.max(Math.abs(low), Math.abs(high))) / min - 1));
}

/** @param {number} v @param {string} plus */
const tickText = (v, plus) => (v > 0 ? plus : "") + decimal(String(Number(v.toPrecision(4))).replace("-", "−"));

/**
 * Five ticks of a range, evenly spaced, all in one unit.
 * @param {string} field @param {Range} range
 * @returns {{unit: string, ticks: string[]}}
 */
export function ticksOf(field, { low, high }) {
    const { signed, units } = FIELDS[field];
    const [unit, size] = units.filter(([, s]) => high >= s * (1 - 1e-9)).at(-1) ?? units[0];
    const at = (/** @type {number} */ k) => (low + ((high - low) * k) / INTERVALS) / size;
    return {
        unit,
        ticks: Array.from({ length: INTERVALS + 1 }, (_, k) => tickText(at(k), signed ? "+" : "")),
    };
}

/** what the legend says while the natural colour is shown @param {string} field */
export function restText(field) {
    const { unit, ticks } = ticksOf(field, { low: 0, high: FIELDS[field].min / 2 });
    return text("legend.rest", { value: ticks[INTERVALS].replace("+", ""), unit });
}

/** fields that a part of the session has and this page knows @param {{fields?: string[]}[]} parts @returns {string[]} */
export function offered(parts) {
    return Object.keys(FIELDS).filter((name) => parts.some((part) => part.fields?.includes(name)));
}

/**
 * Why fields are missing: one sentence, empty if none is.
 * @param {{fields?: string[]}[]} parts
 */
export function missing(parts) {
    const names = offered(parts);
    if (names.length === 0) return text("fields.none");
    if (!names.includes("von_mises")) return text("fields.elements");
    return parts.some((part) => names.some((name) => !part.fields?.includes(name))) ? text("fields.some") : "";
}
