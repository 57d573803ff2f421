// The legend: fields, the range of the colour map, the text of its ends. Pure.

/**
 * viridis (Smith and van der Walt 2015) without its darkest eighth, which the background would hide: nine stops of evenly
 * increasing lightness, distinguishable with any colour vision
 */
export const COLOURS = Object.freeze([
    "#472e7c",
    "#3c4f8a",
    "#2f6b8d",
    "#25868d",
    "#25a086",
    "#3db974",
    "#73ce55",
    "#b7dd2f",
    "#fde725",
]);

/**
 * Fields that this page can show. `min`: smallest range of the colours, so that a body at rest shows no noise; units from
 * small to large with their size in SI; `signed`: values on both sides of 0, which has the middle colour.
 * @type {Record<string, {title: string, min: number, units: [string, number][], signed?: boolean}>}
 */
export const FIELDS = Object.freeze({
    displacement: {
        title: "Displacement",
        min: 1e-4,
        units: [
            ["µm", 1e-6],
            ["mm", 1e-3],
            ["m", 1],
        ],
    },
    von_mises: {
        title: "Von Mises stress",
        min: 1,
        units: [
            ["Pa", 1],
            ["kPa", 1e3],
            ["MPa", 1e6],
            ["GPa", 1e9],
        ],
    },
    energy: {
        title: "Strain energy density",
        min: 1e-3,
        units: [
            ["mJ/m³", 1e-3],
            ["J/m³", 1],
            ["kJ/m³", 1e3],
            ["MJ/m³", 1e6],
        ],
    },
    stiffness: {
        title: "Edge stiffness",
        min: 1e-9,
        units: [
            ["nJ", 1e-9],
            ["µJ", 1e-6],
            ["mJ", 1e-3],
            ["J", 1],
        ],
    },
    strain: { title: "Largest strain", min: 1e-3, units: [["%", 1e-2]] },
    distortion: { title: "Volume distortion", min: 1e-3, units: [["%", 1e-2]], signed: true },
});

const STEPS = [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10];
const KEEP = 0.45; // a range is kept while the values reach this share of it

/** the smallest round number that is not below v @param {number} v > 0 */
export function roundUp(v) {
    const ten = 10 ** Math.floor(Math.log10(v) + 1e-12);
    const step = STEPS.find((s) => s * ten >= v * (1 - 1e-9)) ?? 10;
    return Number((step * ten).toPrecision(2));
}

/** the largest round number that is not above v @param {number} v > 0 */
export function roundDown(v) {
    const ten = 10 ** Math.floor(Math.log10(v) + 1e-12);
    const step = STEPS.filter((s) => s * ten <= v * (1 + 1e-9)).at(-1) ?? 1;
    return Number((step * ten).toPrecision(2));
}

/**
 * Range of the colour map for values between low and high: round numbers that follow the values with hysteresis. It begins
 * at 0 unless all values lie in the upper half; the range of a signed field is symmetric.
 * @param {string} field @param {number} low @param {number} high
 * @param {{low: number, high: number} | null} before former range
 * @returns {{low: number, high: number}}
 */
export function rangeOf(field, low, high, before) {
    const min = FIELDS[field]?.min ?? 1e-9;
    const signed = FIELDS[field]?.signed ?? false;
    const top = Math.max(high, signed ? -low : high, min);
    const holds = before && top <= before.high && (top >= KEEP * before.high || before.high <= roundUp(min));
    const to = holds ? before.high : roundUp(top);
    if (signed) return { low: -to, high: to };
    const floor = low > 0.55 * to ? roundDown(low) : 0;
    const kept = before && holds && before.low <= low && before.low > 0 === low > 0.5 * to;
    return { low: kept ? before.low : floor < to ? floor : 0, high: to };
}

/** @param {number} v */
const digits = (v) => (v === 0 ? "0" : Math.abs(v) >= 100 ? v.toFixed(0) : String(Number(v.toPrecision(3))));

/**
 * The two ends of a range in one unit.
 * @param {string} field @param {{low: number, high: number}} range
 * @returns {{low: string, high: string, unit: string}}
 */
export function labels(field, range) {
    const units = FIELDS[field].units;
    const [unit, size] = units.filter(([, s]) => range.high >= s * (1 - 1e-9)).at(-1) ?? units[0];
    const plus = FIELDS[field].signed ? "+" : "";
    return { low: digits(range.low / size).replace("-", "−"), high: plus + digits(range.high / size), unit };
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
    if (names.length === 0) return "This session has no fields.";
    if (!names.includes("von_mises") || !names.includes("energy")) return "Stress and energy require finite elements.";
    return parts.some((part) => names.some((name) => !part.fields?.includes(name)))
        ? "Some bodies do not have all fields."
        : "";
}
