// Intersection of a ray with a triangle mesh.
import * as THREE from "./three.js";

/** @typedef {{point: THREE.Vector3, normal: THREE.Vector3, distance: number}} Hit */

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
    return { point, normal: b.sub(a).cross(c.sub(a)).normalize(), distance: Math.sqrt(best) };
}
