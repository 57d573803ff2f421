// The views of an atlas: from six sides, those of the patient if the scene says how it lies in the patient. Pure.

/** @typedef {import("./scope_pose.js").Ground} Ground */

export const STANDARD = /** @type {const} */ (["front", "back", "left", "right", "above", "below"]);
const LETTERS = { front: "A", back: "P", left: "L", right: "R", above: "S", below: "I" };
const OPPOSITE = { A: "P", P: "A", L: "R", R: "L", S: "I", I: "S" };
const POLE = 0.999; // cosine beyond which the azimuth comes from what stands above in the picture

/** @param {number[]} u @param {number[]} v */
const dot = (u, v) => u.reduce((sum, c, k) => sum + c * v[k], 0);

/** unit vector of the scene towards a side of the patient @param {string} axes as "RAS" @param {string} letter */
function towards(axes, letter) {
    const opposite = OPPOSITE[/** @type {keyof typeof OPPOSITE} */ (letter)];
    return [...axes].map((axis) => (axis === letter ? 1 : axis === opposite ? -1 : 0));
}

/** do three letters name all directions? @param {string} axes */
const known = (axes) => axes.length === 3 && ["A", "L", "S"].every((letter) => dot(towards(axes, letter), [1, 1, 1]));

/**
 * Azimuth and elevation of the free view, rad.
 * @param {typeof STANDARD[number]} side @param {Ground} ground
 * @param {string} axes where x, y and z of the scene point in the patient, as "RAS"; else the up axis counts
 */
export function standardView(side, { a, b, up }, axes) {
    const minus = (/** @type {number[]} */ v) => v.map((c) => -c);
    const own = { front: minus(b), back: b, left: minus(a), right: a, above: up, below: minus(up) };
    const from = known(axes) ? towards(axes, LETTERS[side]) : own[side];
    const height = dot(from, up);
    const elevation = Math.asin(Math.max(-1, Math.min(1, height)));
    if (Math.abs(height) < POLE) return { azimuth: Math.atan2(dot(from, a), -dot(from, b)), elevation };
    // seen along the up axis: the head stands above, or the front where the head would be seen
    const head = known(axes) ? towards(axes, side === "above" || side === "below" ? "A" : "S") : b;
    const flat = height > 0 ? minus(head) : head;
    return { azimuth: Math.atan2(dot(flat, a), -dot(flat, b)), elevation };
}
