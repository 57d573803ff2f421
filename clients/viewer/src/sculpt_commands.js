// Commands of sculpting from the settings of the panel and the clicked points; the plane of a cut; answers in words. Pure.
import { decimal, isTextKey, text } from "./text.js";

/** @typedef {import("./text.js").TextKey} TextKey */
/**
 * @typedef {{distance_m: number, scale: number, radius_m: number, paint: string, sharpness: number, entity: number,
 *            pressure_Pa: number, lift_m: number, stiffness_N_m: number, middle: number[]}} Settings
 * @typedef {{verb: string, args: Record<string, number>}} Command
 * @typedef {{low: number[], high: number[]}} Box
 */

/** @type {Record<string, {points: number, key: string}>} points: clicks that the tool needs; key: chooses it */
export const TOOLS = Object.freeze({
    extrude: { points: 1, key: "E" },
    delete: { points: 1, key: "X" },
    divide: { points: 1, key: "D" },
    merge: { points: 2, key: "J" },
    bridge: { points: 2, key: "B" },
    sharpen: { points: 1, key: "S" },
    paint: { points: 1, key: "T" },
    inflate: { points: 1, key: "I" },
    deflate: { points: 1, key: "O" },
    curve: { points: 2, key: "U" },
    probe: { points: 1, key: "Q" },
});

/** what to do before each click of a tool @param {string} tool of TOOLS @param {number} clicks so far */
export const hintOf = (tool, clicks) => text(/** @type {TextKey} */ (`sculpt.hint.${tool}.${clicks}`));

const CUT_MARGIN = 0.04; // of the box: the outline of a cut stands out by so much

/** tools that are forces: they act until they are released, and follow their slider */
export const FORCES = Object.freeze(["inflate", "deflate", "curve"]);

/** @type {Record<string, {young_factor: number, density_factor: number}>} factors of one stroke of the brush */
export const PAINTS = Object.freeze({
    stiffer: { young_factor: 2, density_factor: 1 },
    softer: { young_factor: 0.5, density_factor: 1 },
    heavier: { young_factor: 1, density_factor: 1.5 },
    lighter: { young_factor: 1, density_factor: 1 / 1.5 },
});

/**
 * Displacement of a curve's middle: perpendicular to the curve, away from the centre of the body; towards it if lift < 0.
 * @param {number[]} a end, m @param {number[]} b other end, m @param {number[]} middle of the body, m @param {number} lift_m
 */
export function liftOf(a, b, middle, lift_m) {
    const dot = (/** @type {number[]} */ u, /** @type {number[]} */ v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    const along = b.map((v, i) => v - a[i]);
    const out = a.map((v, i) => (v + b[i]) / 2 - middle[i]);
    const share = dot(along, along) > 0 ? dot(out, along) / dot(along, along) : 0;
    const across = out.map((v, i) => v - share * along[i]);
    const length = Math.hypot(...across);
    return length > 1e-9 ? across.map((v) => (lift_m * v) / length) : [0, 0, lift_m];
}

/**
 * Command of a tool at the clicked points; null: the tool needs more of them.
 * @param {string} tool of TOOLS @param {Settings} settings @param {number[][]} points m
 * @returns {Command | null}
 */
export function commandOf(tool, settings, points) {
    if (points.length < TOOLS[tool].points) return null;
    const [x_m, y_m, z_m] = points[0];
    /** @type {Record<string, number>} */
    const args = { x_m, y_m, z_m };
    if (TOOLS[tool].points === 2) [args.x2_m, args.y2_m, args.z2_m] = points[1];
    if (tool === "extrude") Object.assign(args, { distance_m: settings.distance_m, scale: settings.scale });
    if (tool === "sharpen") Object.assign(args, { sharpness: settings.sharpness, entity: settings.entity });
    if (tool === "paint") {
        const { young_factor, density_factor } = PAINTS[settings.paint];
        Object.assign(args, { radius_m: settings.radius_m, young_factor, density_factor });
    }
    if (FORCES.includes(tool)) args.radius_m = settings.radius_m;
    if (tool === "inflate" || tool === "deflate")
        args.pressure_Pa = tool === "inflate" ? settings.pressure_Pa : -settings.pressure_Pa;
    if (tool === "curve") {
        args.stiffness_N_m = settings.stiffness_N_m;
        [args.dx_m, args.dy_m, args.dz_m] = liftOf(points[0], points[1], settings.middle, settings.lift_m);
    }
    return { verb: tool === "deflate" ? "inflate" : tool, args };
}

/**
 * A cut perpendicular to an axis, at a share of the box; the far side is hidden.
 * @param {"none" | "x" | "y" | "z"} axis @param {number} share 0..1 @param {Box} box
 * @returns {Command}
 */
export function cutCommand(axis, share, box) {
    const k = ["x", "y", "z"].indexOf(axis);
    if (k < 0) return { verb: "uncut", args: {} };
    const args = { nx: 0, ny: 0, nz: 0, offset_m: box.low[k] + share * (box.high[k] - box.low[k]) };
    args[/** @type {"nx" | "ny" | "nz"} */ ("n" + axis)] = 1;
    return { verb: "cut", args };
}

/**
 * Outline of the plane of a cut, a little larger than the box: pairs of points.
 * @param {"none" | "x" | "y" | "z"} axis @param {number} share 0..1 @param {Box} box @returns {number[][]}
 */
export function cutOutline(axis, share, box) {
    const k = ["x", "y", "z"].indexOf(axis);
    if (k < 0) return [];
    const { low, high } = box;
    const corner = (/** @type {number} */ p, /** @type {number} */ q) => {
        const end = [0, 0, 0];
        [end[k], end[(k + 1) % 3], end[(k + 2) % 3]] = [share, p, q];
        return low.map((v, c) => v + end[c] * (high[c] - v));
    };
    const [near, far] = [-CUT_MARGIN, 1 + CUT_MARGIN];
    const corners = [corner(near, near), corner(far, near), corner(far, far), corner(near, far)];
    return corners.flatMap((point, i) => [point, corners[(i + 1) % 4]]);
}

/** box around a box and points @param {Box} box @param {Float32Array} x [n][3] @returns {Box} */
export function boxAround(box, x) {
    const low = [...box.low];
    const high = [...box.high];
    for (let i = 0; i < x.length; i++) {
        low[i % 3] = Math.min(low[i % 3], x[i]);
        high[i % 3] = Math.max(high[i % 3], x[i]);
    }
    return { low, high };
}

/** three digits, in the unit that fits @param {number} pascal */
function pressureText(pascal) {
    const [unit, size] = pascal >= 1e6 ? ["MPa", 1e6] : pascal >= 1e3 ? ["kPa", 1e3] : ["Pa", 1];
    return decimal(`${Number((pascal / Number(size)).toPrecision(3))} ${unit}`);
}

/** result of a command in words @param {import("./control_table.js").Answer} answer */
export function answerText({ verb, text: sentence, args = {} }) {
    const key = `sculpt.done.${verb}`;
    if (!isTextKey(key)) return sentence;
    if (verb !== "probe") return text(key);
    const density = String(Number(args.density_kg_m3.toPrecision(3)));
    return text(key, { stiffness: pressureText(args.young_Pa), density });
}
