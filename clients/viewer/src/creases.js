// Creases of a surface: where it bends sharply at rest, as on the edge of a cut, each side gets its own vertices, so
// that the mean normals of one side do not tilt those of the other. Copies follow all other vertices. Pure.

/** angle between neighbouring triangles from which on their side is a crease: edges of cuts are near 90 degrees, the
 * smooth surface of a coarse subdivision solid bends by up to 45 */
const CREASE_DEGREES = 60;

/** unit normals of triangles @param {Float32Array} x [n][3] @param {Uint32Array} triangles [m][3] */
function unitNormals(x, triangles) {
    const out = new Float32Array(triangles.length);
    for (let t = 0; t < triangles.length; t += 3) {
        const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
        const u = [x[b] - x[a], x[b + 1] - x[a + 1], x[b + 2] - x[a + 2]];
        const v = [x[c] - x[a], x[c + 1] - x[a + 1], x[c + 2] - x[a + 2]];
        const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        const length = Math.hypot(...n);
        for (let k = 0; k < 3; k++) out[t + k] = length > 0 ? n[k] / length : 0;
    }
    return out;
}

/**
 * @param {Float32Array} rest [n][3] @param {Uint32Array} triangles [m][3]
 * @param {Uint32Array} seams copies that the asset has already: copy, original, copy, original ...
 * @returns {{triangles: Uint32Array, copies: Uint32Array, joined: Uint32Array}} the triangles with the copies' numbers, n
 *   and up; the vertex that each of them copies; pairs of vertices that are drawn with one normal, as `seams`
 */
export function splitCreases(rest, triangles, seams = new Uint32Array()) {
    const n = rest.length / 3;
    const place = originalsOf(n, seams);
    const normal = unitNormals(rest, triangles);
    const limit = Math.cos((CREASE_DEGREES * Math.PI) / 180);
    // corners that are joined across smooth sides share a vertex
    const joined = Uint32Array.from(triangles, (_, corner) => corner);
    const root = (/** @type {number} */ corner) => {
        while (joined[corner] !== corner) corner = joined[corner] = joined[joined[corner]];
        return corner;
    };
    const join = (/** @type {number} */ a, /** @type {number} */ b) => {
        const [p, q] = [root(a), root(b)];
        joined[Math.max(p, q)] = Math.min(p, q);
    };
    /** @type {Map<number, number>} first corner of each side that has no partner yet */
    const open = new Map();
    for (let corner = 0; corner < triangles.length; corner++) {
        const t = corner - (corner % 3);
        const after = t + ((corner + 1) % 3);
        const [a, b] = [place[triangles[corner]], place[triangles[after]]];
        const other = open.get(b * n + a);
        if (other === undefined) {
            open.set(a * n + b, corner);
            continue;
        }
        open.delete(b * n + a);
        const u = other - (other % 3);
        const cosine = normal[t] * normal[u] + normal[t + 1] * normal[u + 1] + normal[t + 2] * normal[u + 2];
        if (cosine < limit) continue;
        join(corner, u + ((other + 1) % 3));
        join(after, other);
    }
    const split = triangles.slice();
    const copies = [];
    const oneNormal = [];
    /** @type {Map<number, number>} vertex of each group of corners and vertex of the asset; first one of each group */
    const vertexOf = new Map();
    /** @type {Map<number, number>} */
    const first = new Map();
    const used = new Uint8Array(n);
    for (let corner = 0; corner < triangles.length; corner++) {
        const group = root(corner);
        const original = triangles[corner];
        const key = group * n + original;
        let vertex = vertexOf.get(key);
        if (vertex === undefined) {
            vertex = used[original] ? n + copies.push(original) - 1 : original;
            used[original] = 1;
            vertexOf.set(key, vertex);
            const same = first.get(group);
            if (same === undefined) first.set(group, vertex);
            else oneNormal.push(vertex, same);
        }
        split[corner] = vertex;
    }
    return { triangles: split, copies: Uint32Array.from(copies), joined: Uint32Array.from(oneNormal) };
}

/**
 * The vertex that each vertex stands for.
 * @param {number} n @param {Uint32Array} pairs copy, original, copy, original ...
 * @param {Uint32Array} more vertex of each copy that follows the n
 */
export function originalsOf(n, pairs, more = new Uint32Array()) {
    const of = Uint32Array.from({ length: n + more.length }, (_, v) => v);
    for (let k = 0; k < pairs.length; k += 2) of[pairs[k]] = pairs[k + 1];
    more.forEach((vertex, i) => (of[n + i] = of[vertex]));
    return of;
}

/**
 * Writes the values of copies behind those of the other vertices.
 * @param {Float32Array | Uint8Array} values [n + copies][size] @param {Uint32Array} copies @param {number} size numbers
 *   of a vertex
 */
export function fillCopies(values, copies, size) {
    const begin = values.length - size * copies.length;
    copies.forEach((vertex, i) => {
        for (let k = 0; k < size; k++) values[begin + size * i + k] = values[size * vertex + k];
    });
}
