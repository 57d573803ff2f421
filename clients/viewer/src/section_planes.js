// Planes that cut bodies open: where they lie, and what they leave of a ray. Pure.

/** directions that a plane may have: an axis of the scene, towards the viewer, or as it was turned in the picture */
export const DIRECTIONS = Object.freeze(["none", "x", "y", "z", "view", "turned"]);
export const PLANES_MAX = 3;

/**
 * @typedef {{direction: string, at: number, flipped: boolean, turned: number[] | null}} SectionPlane at: 0 to 1 of the
 *   scene along the direction; flipped: the other side is kept; turned: unit vector, null: it has never been turned
 * @typedef {import("./slice.js").Plane} Plane
 */

/** @returns {SectionPlane[]} */
export const noPlanes = () =>
    Array.from({ length: PLANES_MAX }, () => ({ direction: "none", at: 0.5, flipped: false, turned: null }));

/** of a box along a direction: its middle, and half of its length @param {number[]} along @param {number[][]} box */
function extentOf(along, [low, high]) {
    return {
        middle: along.reduce((sum, a, c) => sum + (a * (low[c] + high[c])) / 2, 0),
        reach: along.reduce((sum, a, c) => sum + (Math.abs(a) * (high[c] - low[c])) / 2, 0),
    };
}

/**
 * `at` of the plane that is normal to a direction and passes a point; at the end of the box where it would pass beyond
 * @param {number[]} along unit vector @param {number[]} point @param {number[][]} box
 */
export function shareAt(along, point, box) {
    const { middle, reach } = extentOf(along, box);
    const offset = along.reduce((sum, a, c) => sum + a * point[c], 0);
    return Math.max(0, Math.min(1, 0.5 + (offset - middle) / (2 * reach)));
}

/**
 * @param {SectionPlane} plane @param {number[][]} box of the scene at rest, low and high, m
 * @param {number[]} view unit vector towards the viewer
 * @returns {Plane | null} null: the plane is off
 */
export function planeOf({ direction, at, flipped, turned }, box, view) {
    if (direction === "none") return null;
    const axis = ["x", "y", "z"].indexOf(direction);
    const along = (direction === "turned" && turned) || (axis < 0 ? view : [0, 1, 2].map((c) => Number(c === axis)));
    const { middle, reach } = extentOf(along, box);
    const offset = middle + (2 * at - 1) * reach;
    // what lies beyond is removed: the part towards the viewer, or towards the end of the axis
    const sign = flipped ? 1 : -1;
    return { normal: along.map((a) => (a === 0 ? 0 : sign * a)), constant: -sign * offset };
}

/**
 * How far a ray must go until one of the planes keeps it, in lengths of its direction; infinite: never. Several planes
 * remove a corner, what lies beyond all of them, so that the rest of the body shows where the section is.
 * @param {number[]} origin @param {number[]} direction @param {Plane[]} planes
 */
export function entryOf(origin, direction, planes) {
    const entries = planes.map(({ normal, constant }) => {
        const at = constant + normal.reduce((sum, n, c) => sum + n * origin[c], 0);
        const rate = normal.reduce((sum, n, c) => sum + n * direction[c], 0);
        return at >= 0 ? 0 : rate > 0 ? -at / rate : Infinity;
    });
    return planes.length ? Math.min(...entries) : 0;
}
