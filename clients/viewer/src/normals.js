// Smooth vertex normals of a triangle mesh, area weighted, into a given array.

/**
 * @param {Float32Array} x positions [n][3] @param {Uint32Array} triangles [m][3] @param {Float32Array} out [n][3]
 * @param {Uint32Array | null} visible the vertices of the triangles, whose normals alone are written; null: all
 */
export function vertexNormals(x, triangles, out, visible = null) {
    if (visible) for (const v of visible) out[3 * v] = out[3 * v + 1] = out[3 * v + 2] = 0;
    else out.fill(0);
    for (let t = 0; t < triangles.length; t += 3) {
        const a = 3 * triangles[t];
        const b = 3 * triangles[t + 1];
        const c = 3 * triangles[t + 2];
        const ux = x[b] - x[a];
        const uy = x[b + 1] - x[a + 1];
        const uz = x[b + 2] - x[a + 2];
        const vx = x[c] - x[a];
        const vy = x[c + 1] - x[a + 1];
        const vz = x[c + 2] - x[a + 2];
        const nx = uy * vz - uz * vy;
        const ny = uz * vx - ux * vz;
        const nz = ux * vy - uy * vx;
        ((out[a] += nx), (out[a + 1] += ny), (out[a + 2] += nz));
        ((out[b] += nx), (out[b + 1] += ny), (out[b + 2] += nz));
        ((out[c] += nx), (out[c + 1] += ny), (out[c + 2] += nz));
    }
    const n = visible ? visible.length : out.length / 3;
    for (let k = 0; k < n; k++) {
        const i = 3 * (visible ? visible[k] : k);
        const length = Math.sqrt(out[i] * out[i] + out[i + 1] * out[i + 1] + out[i + 2] * out[i + 2]);
        const s = length > 0 ? 1 / length : 0;
        ((out[i] *= s), (out[i + 1] *= s), (out[i + 2] *= s));
    }
}

/**
 * Unit normal of one vertex: of its triangles, by area; 0 of a vertex without.
 * @param {Float32Array} x positions [n][3] @param {Uint32Array} triangles [m][3] @param {number} vertex
 */
export function normalAt(x, triangles, vertex) {
    const own = [];
    for (let t = 0; t < triangles.length; t += 3)
        if (triangles[t] === vertex || triangles[t + 1] === vertex || triangles[t + 2] === vertex)
            own.push(triangles[t], triangles[t + 1], triangles[t + 2]);
    const normals = new Float32Array(x.length);
    vertexNormals(x, Uint32Array.from(own), normals, Uint32Array.from(own));
    return [...normals.subarray(3 * vertex, 3 * vertex + 3)];
}
