// Intersection of a ray with a triangle mesh, the nearest of its triangles, and points of triangles at rest.
import * as THREE from "./three.js";

/** @typedef {{point: THREE.Vector3, normal: THREE.Vector3, distance: number, triangle: number}} Hit */

/**
 * Nearest triangle hit from its front.
 * @param {THREE.Ray} ray
 * @param {ArrayLike<number>} x positions [n][3] @param {ArrayLike<number>} triangles [m][3]
 * @param {number} nCorner corners of the triangles in use
 * @returns {Hit | null}
 */
export function pickTriangle(ray, x, triangles, nCorner) {
    const a = new THREE.Vector3();
    const b = new THREE.Vector3();
    const c = new THREE.Vector3();
    const hit = new THREE.Vector3();
    const point = new THREE.Vector3();
    let best = Infinity;
    let found = -1;
    const corners = (/** @type {number} */ t) => {
        a.fromArray(x, 3 * triangles[t]);
        b.fromArray(x, 3 * triangles[t + 1]);
        c.fromArray(x, 3 * triangles[t + 2]);
    };
    for (let t = 0; t < nCorner; t += 3) {
        corners(t);
        if (!ray.intersectTriangle(a, b, c, true, hit)) continue;
        const d = hit.distanceToSquared(ray.origin);
        if (d < best) {
            best = d;
            found = t;
            point.copy(hit);
        }
    }
    if (found < 0) return null;
    corners(found);
    return { point, normal: b.sub(a).cross(c.sub(a)).normalize(), distance: Math.sqrt(best), triangle: found / 3 };
}

/** corners of a triangle @param {ArrayLike<number>} x @param {ArrayLike<number>} triangles @param {number} t */
function corners(x, triangles, t) {
    const corner = (/** @type {number} */ k) => new THREE.Vector3().fromArray(x, 3 * triangles[3 * t + k]);
    return new THREE.Triangle(corner(0), corner(1), corner(2));
}

/**
 * The triangle nearest to a point, and its nearest point.
 * @param {THREE.Vector3} point @param {ArrayLike<number>} x [n][3] @param {ArrayLike<number>} triangles [m][3]
 * @param {(triangle: number) => boolean} counts
 * @returns {{triangle: number, point: THREE.Vector3, distance: number} | null}
 */
export function nearestTriangle(point, x, triangles, counts) {
    const near = new THREE.Vector3();
    let best = null;
    for (let t = 0; t < triangles.length / 3; t++) {
        if (!counts(t)) continue;
        const distance = corners(x, triangles, t).closestPointToPoint(point, near).distanceTo(point);
        if (!best || distance < best.distance) best = { triangle: t, point: near.clone(), distance };
    }
    return best;
}

/**
 * Where a point of a triangle lies at rest.
 * @param {number} t triangle @param {THREE.Vector3} point
 * @param {ArrayLike<number>} x positions [n][3] @param {ArrayLike<number>} rest [n][3] @param {ArrayLike<number>} triangles [m][3]
 */
export function atRest(t, point, x, rest, triangles) {
    const weight = corners(x, triangles, t).getBarycoord(point, new THREE.Vector3());
    const { a, b, c } = corners(rest, triangles, t);
    if (!weight) return a; // a triangle without area
    return a.multiplyScalar(weight.x).addScaledVector(b, weight.y).addScaledVector(c, weight.z);
}
