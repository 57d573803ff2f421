// What colours mean: fields by name, the range of the colour map, numbers as people read them. Pure.

/**
 * viridis (Smith and van der Walt 2015) without its darkest eighth, which would drown in the backdrop: nine stops whose
 * lightness grows evenly, told apart with any colour vision
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
 * Fields that this page can show. `least` is the smallest range worth colouring, so that a body at rest shows no noise;
 * units from small to large with their size in SI; `signed`: less than 0 is as good as more, the middle colour is 0.
 * @type {Record<string, {title: string, least: number, units: [string, number][], signed?: boolean}>}
 */
export const FIELDS = Object.freeze({
  displacement: {
    title: "Displacement",
    least: 1e-4,
    units: [
      ["µm", 1e-6],
      ["mm", 1e-3],
      ["m", 1],
    ],
  },
  von_mises: {
    title: "Von Mises stress",
    least: 1,
    units: [
      ["Pa", 1],
      ["kPa", 1e3],
      ["MPa", 1e6],
      ["GPa", 1e9],
    ],
  },
  energy: {
    title: "Strain energy density",
    least: 1e-3,
    units: [
      ["mJ/m³", 1e-3],
      ["J/m³", 1],
      ["kJ/m³", 1e3],
      ["MJ/m³", 1e6],
    ],
  },
  stiffness: {
    title: "Edge stiffness k_d",
    least: 1e-9,
    units: [
      ["nJ", 1e-9],
      ["µJ", 1e-6],
      ["mJ", 1e-3],
      ["J", 1],
    ],
  },
  strain: { title: "Largest strain", least: 1e-3, units: [["%", 1e-2]] },
  distortion: { title: "Volume distortion", least: 1e-3, units: [["%", 1e-2]], signed: true },
});

const STEPS = [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10];
const KEEP = 0.45; // a range stays while the values reach this part of it

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
 * Range of the colour map for values between low and high: round numbers that follow the values without flickering.
 * It begins at 0 unless all values lie in the upper half; of a signed field it goes as far below 0 as above.
 * @param {string} field @param {number} low @param {number} high
 * @param {{low: number, high: number} | null} before the range until now
 * @returns {{low: number, high: number}}
 */
export function rangeOf(field, low, high, before) {
  const least = FIELDS[field]?.least ?? 1e-9,
    signed = FIELDS[field]?.signed ?? false;
  const top = Math.max(high, signed ? -low : high, least);
  const holds = before && top <= before.high && (top >= KEEP * before.high || before.high <= roundUp(least));
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

/** fields that some part of the session gives and this page knows @param {{fields?: string[]}[]} parts @returns {string[]} */
export function offered(parts) {
  return Object.keys(FIELDS).filter((name) => parts.some((part) => part.fields?.includes(name)));
}

/**
 * Why there is less to choose than elsewhere: one sentence, empty when nothing is missing.
 * @param {{fields?: string[]}[]} parts
 */
export function missing(parts) {
  const names = offered(parts);
  if (names.length === 0) return "This server sends no fields.";
  if (!names.includes("von_mises") || !names.includes("energy"))
    return "Stress and energy need a model of finite elements.";
  return parts.some((part) => names.some((name) => !part.fields?.includes(name)))
    ? "Not every body has every field."
    : "";
}
