// Where a brush ends on a surface: the line of points at the brush's radius from its centre, at rest. Pure.

/** @typedef {{a: number, b: number, t: number}} OnSide the point a + t (b - a) on the side of a triangle */

/**
 * The point of the side a b at a distance from the centre: one end is nearer, the other farther.
 * @param {ArrayLike<number>} x @param {number} a @param {number} b @param {ArrayLike<number>} centre @param {number} radius_m
 * @returns {OnSide}
 */
function crossing(x, a, b, centre, radius_m) {
    let [q, h, c] = [0, 0, -(radius_m ** 2)]; // q t^2 + 2 h t + c = 0
    for (let k = 0; k < 3; k++) {
        const along = x[3 * b + k] - x[3 * a + k];
        const from = x[3 * a + k] - centre[k];
        q += along * along;
        h += along * from;
        c += from * from;
    }
    // the root between 0 and 1: c and its counterpart at b differ in sign
    const root = Math.sqrt(Math.max(0, h * h - q * c));
    const t = c < 0 ? (-h + root) / q : (-h - root) / q;
    return { a, b, t: Math.max(0, Math.min(1, t)) };
}

/**
 * Segments of the ring as pairs of points, two for each triangle that the ring crosses. Triangles that are larger than
 * the brush may have none.
 * @param {ArrayLike<number>} x vertices at rest [n][3] m @param {ArrayLike<number>} triangles [m][3]
 * @param {number} nCorner corners in use @param {ArrayLike<number>} centre m @param {number} radius_m
 * @returns {OnSide[]}
 */
export function brushRing(x, triangles, nCorner, centre, radius_m) {
    const out = [];
    const inside = new Uint8Array(x.length / 3);
    for (let v = 0; v < inside.length; v++) {
        const away2 = (x[3 * v] - centre[0]) ** 2 + (x[3 * v + 1] - centre[1]) ** 2 + (x[3 * v + 2] - centre[2]) ** 2;
        inside[v] = away2 < radius_m ** 2 ? 1 : 0;
    }
    for (let t = 0; t < nCorner; t += 3) {
        const n = inside[triangles[t]] + inside[triangles[t + 1]] + inside[triangles[t + 2]];
        if (n === 0 || n === 3) continue;
        for (let k = 0; k < 3; k++) {
            const a = triangles[t + k];
            const b = triangles[t + ((k + 1) % 3)];
            // from the smaller to the larger vertex: neighbours compute the same point
            if (inside[a] !== inside[b]) out.push(crossing(x, Math.min(a, b), Math.max(a, b), centre, radius_m));
        }
    }
    return out;
}

/**
 * A circle, as segments: for triangles larger than the brush.
 * @param {number[]} centre m @param {number[]} normal unit @param {number} radius_m @param {number} n segments
 * @returns {number[]} [2 n][3]
 */
export function circle(centre, normal, radius_m, n) {
    const k = normal.map(Math.abs).indexOf(Math.min(...normal.map(Math.abs)));
    const axis = [0, 1, 2].map((c) => (c === k ? 1 : 0));
    const cross = (/** @type {number[]} */ u, /** @type {number[]} */ v) => [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    const side = cross(normal, axis);
    const length = Math.hypot(...side);
    const u = side.map((v) => v / length);
    const v = cross(normal, u);
    const point = (/** @type {number} */ i) => {
        const angle = (2 * Math.PI * i) / n;
        return centre.map((c, d) => c + radius_m * (Math.cos(angle) * u[d] + Math.sin(angle) * v[d]));
    };
    return Array.from({ length: n }, (_, i) => [...point(i), ...point(i + 1)]).flat();
}
