// Closed surfaces made of rings of points: rods, blades, bent plates. Pure; lengths in any unit.

/**
 * A closed surface: points, and triangles of three indices each, counter-clockwise seen from outside.
 * @typedef {{points: number[][], triangles: number[][]}} Solid
 */

const CREASE = Math.cos((35 * Math.PI) / 180); // faces that meet at a larger angle have an edge between them

/** @param {number[]} a @param {number[]} b */
export const subtract = (a, b) => a.map((v, i) => v - b[i]);
/** @param {number[]} a @param {number[]} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {number[]} a @param {number[]} b */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @param {number[]} a */
export const unit = (a) => {
    const length = Math.hypot(...a);
    return a.map((v) => v / (length || 1));
};

/** six times the volume would be enough to tell inside from outside @param {Solid} solid */
export const volumeOf = ({ points, triangles }) =>
    triangles.reduce((sum, [a, b, c]) => sum + dot(points[a], cross(points[b], points[c])), 0) / 6;

/**
 * Skin over rings of equally many points; the first and the last ring are closed by a fan.
 * @param {number[][][]} rings @returns {Solid}
 */
export function loft(rings) {
    const n = rings[0].length;
    const points = rings.flat();
    /** @type {number[][]} */
    const triangles = [];
    for (let r = 0; r + 1 < rings.length; r++)
        for (let i = 0; i < n; i++) {
            const [a, b] = [r * n + i, r * n + ((i + 1) % n)];
            triangles.push([a, b, a + n], [b, b + n, a + n]);
        }
    for (const first of [true, false]) {
        const ring = first ? rings[0] : rings[rings.length - 1];
        const at = first ? 0 : (rings.length - 1) * n;
        points.push([0, 1, 2].map((k) => ring.reduce((sum, point) => sum + point[k], 0) / n));
        for (let i = 0; i < n; i++) {
            const [a, b] = [at + i, at + ((i + 1) % n)];
            triangles.push(first ? [b, a, points.length - 1] : [a, b, points.length - 1]);
        }
    }
    const solid = { points, triangles };
    return volumeOf(solid) > 0 ? solid : { points, triangles: triangles.map(([a, b, c]) => [a, c, b]) };
}

/**
 * A body of revolution about the x axis.
 * @param {number[][]} profile x and radius @param {number} [sides] @returns {Solid}
 */
export const turned = (profile, sides = 24) =>
    loft(
        profile.map(([x, radius]) =>
            Array.from({ length: sides }, (_, i) => {
                const angle = (2 * Math.PI * i) / sides;
                return [x, radius * Math.cos(angle), radius * Math.sin(angle)];
            }),
        ),
    );

/**
 * An outline of the x-y plane with a thickness along z; its edges are broken by `bevel`.
 * @param {number[][]} outline @param {number} low @param {number} high @param {number} bevel @returns {Solid}
 */
export function plate(outline, low, high, bevel) {
    const middle = [0, 1].map((k) => outline.reduce((sum, p) => sum + p[k], 0) / outline.length);
    const ring = (/** @type {number} */ z, /** @type {number} */ inset) =>
        outline.map((p) => [...p.map((v, k) => v - inset * Math.sign(v - middle[k])), z]);
    return loft([ring(low, bevel), ring(low + bevel, 0), ring(high - bevel, 0), ring(high, bevel)]);
}

/**
 * A section along a path in the x-y plane: `section(s)` gives its points as (across the path in the plane, along z),
 * s from 0 to 1.
 * @param {number[][]} path points (x, y) @param {(s: number) => number[][]} section @returns {Solid}
 */
export function swept(path, section) {
    const last = path.length - 1;
    return loft(
        path.map(([x, y], i) => {
            const [before, after] = [path[Math.max(0, i - 1)], path[Math.min(last, i + 1)]];
            const [tx, ty] = unit([after[0] - before[0], after[1] - before[1]]);
            return section(i / last).map(([across, z]) => [x - ty * across, y + tx * across, z]);
        }),
    );
}

/** @param {number} a half axis @param {number} b half axis @param {number} [sides] points of an ellipse */
export const ellipse = (a, b, sides = 16) =>
    Array.from({ length: sides }, (_, i) => {
        const angle = (2 * Math.PI * i) / sides;
        return [a * Math.cos(angle), b * Math.sin(angle)];
    });

/** @param {Solid} solid @param {number[]} by */
export const moved = ({ points, triangles }, by) => ({
    points: points.map((p) => p.map((v, k) => v + by[k])),
    triangles,
});

/** mirrored in the plane y = 0 @param {Solid} solid @returns {Solid} */
export const mirrored = ({ points, triangles }) => ({
    points: points.map(([x, y, z]) => [x, -y, z]),
    triangles: triangles.map(([a, b, c]) => [a, c, b]),
});

/**
 * Corners of all triangles with normals: smooth where faces meet flatly, an edge elsewhere.
 * @param {Solid[]} solids @returns {{positions: Float32Array, normals: Float32Array}} [3 * triangles][3]
 */
export function corners(solids) {
    /** @type {number[]} */
    const positions = [];
    /** @type {number[]} */
    const normals = [];
    for (const { points, triangles } of solids) {
        const faces = triangles.map(([a, b, c]) =>
            cross(subtract(points[b], points[a]), subtract(points[c], points[a])),
        );
        /** @type {number[][]} faces at each point */
        const around = points.map(() => []);
        triangles.forEach((corner, f) => corner.forEach((p) => around[p].push(f)));
        triangles.forEach((corner, f) => {
            const own = unit(faces[f]);
            for (const p of corner) {
                const sum = [0, 0, 0];
                for (const g of around[p])
                    if (dot(unit(faces[g]), own) > CREASE) faces[g].forEach((v, k) => (sum[k] += v));
                positions.push(...points[p]);
                normals.push(...unit(sum));
            }
        });
    }
    return { positions: new Float32Array(positions), normals: new Float32Array(normals) };
}
