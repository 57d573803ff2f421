// Slices of tetrahedra by a plane, with values. Linear inside each tetrahedron, as the nodes' values are. Pure.

/**
 * @typedef {{normal: number[], constant: number}} Plane points with normal·p + constant >= 0 are kept; unit normal
 * @typedef {{positions: Float32Array, values: Float32Array, n: number}} Slice triangles: positions [n][3], values [n] of
 *   their n corners; longer arrays are spare
 */

/** edges of a tetrahedron by the corners that lie behind the plane, a bit each: in order around the cut */
const CUTS = Object.freeze(
    Array.from({ length: 16 }, (_, mask) => {
        const behind = [0, 1, 2, 3].filter((c) => (mask >> c) & 1);
        const before = [0, 1, 2, 3].filter((c) => !((mask >> c) & 1));
        if (behind.length === 1 || before.length === 1) {
            const [one] = behind.length === 1 ? behind : before;
            return [0, 1, 2, 3].filter((c) => c !== one).flatMap((c) => [one, c]);
        }
        if (behind.length !== 2) return [];
        const [a, b] = behind;
        const [c, d] = before;
        return [a, c, a, d, b, d, b, c]; // neighbours share a corner
    }),
);

/**
 * Faces that only one tetrahedron has, as a bit for the corner opposite to each.
 * @param {Uint32Array} tets [m][4] @returns {Uint8Array} [m]
 */
export function outerFaces(tets) {
    const outer = new Uint8Array(tets.length / 4);
    // sorted corners as one number, exact up to 200,000 nodes, which a million tetrahedra have
    const n = tets.reduce((max, node) => Math.max(max, node), 0) + 1;
    /** @type {Map<number, number>} face to 4 t + opposite corner */
    const open = new Map();
    for (let at = 0; at < tets.length; at++) {
        const first = at & ~3;
        const [a, b, c] = [1, 2, 3].map((k) => tets[first + ((at + k) & 3)]).sort((p, q) => p - q);
        const key = (a * n + b) * n + c;
        const other = open.get(key);
        if (other === undefined) {
            open.set(key, at);
            outer[at >> 2] |= 1 << (at & 3);
        } else outer[other >> 2] &= ~(1 << (other & 3));
    }
    return outer;
}

/** @param {number} n corners @param {Slice} [spare] @returns {Slice} */
function withRoom(n, spare) {
    if (spare && spare.values.length >= n) return { ...spare, n: 0 };
    return { positions: new Float32Array(3 * n), values: new Float32Array(n), n: 0 };
}

/** appends a corner; three make a triangle @param {Slice} to @param {ArrayLike<number>} from x y z value at 4 k @param {number} k */
function put(to, from, k) {
    to.positions[3 * to.n] = from[4 * k];
    to.positions[3 * to.n + 1] = from[4 * k + 1];
    to.positions[3 * to.n + 2] = from[4 * k + 2];
    to.values[to.n++] = from[4 * k + 3];
}

/**
 * Tetrahedra with corners on both sides of the plane, each with the mask of those behind it.
 * @param {Float32Array} distance of the nodes @param {Uint32Array} tets
 */
function crossing(distance, tets) {
    const found = [];
    for (let t = 0; t < tets.length; t += 4) {
        let mask = 0;
        for (let c = 0; c < 4; c++) if (distance[tets[t + c]] < 0) mask |= 1 << c;
        if (mask !== 0 && mask !== 15) found.push(t, mask);
    }
    return found;
}

/**
 * A side of the cross-section's border.
 * @typedef {{ends: number[], keys: [number, number], inside: number[]}} Side ends: x y z value twice; keys: the same for
 *   the same point; inside: a point of the section beside it
 */

/**
 * Sides of the cut of one tetrahedron that lie in its outer faces.
 * @param {Side[]} rim @param {Float64Array} corner @param {number[]} key @param {number[]} edges @param {number} outer
 */
function addSides(rim, corner, key, edges, outer) {
    const n = key.length;
    for (let e = 0; e < n; e++) {
        const f = (e + 1) % n;
        const touched = (1 << edges[2 * e]) | (1 << edges[2 * e + 1]) | (1 << edges[2 * f]) | (1 << edges[2 * f + 1]);
        // the face with both edges lacks one corner
        if (!(outer & ~touched & 15)) continue;
        const third = 4 * ((e + 2) % n);
        rim.push({
            ends: [...corner.subarray(4 * e, 4 * e + 4), ...corner.subarray(4 * f, 4 * f + 4)],
            keys: [key[e], key[f]],
            inside: [...corner.subarray(third, third + 3)],
        });
    }
}

/** unit vector in the plane, normal to a side and away from its inside @param {Side} side @param {number[]} normal */
function outward({ ends, inside }, [nx, ny, nz]) {
    const [dx, dy, dz] = [ends[4] - ends[0], ends[5] - ends[1], ends[6] - ends[2]];
    const out = [ny * dz - nz * dy, nz * dx - nx * dz, nx * dy - ny * dx];
    const towards = out.reduce((sum, o, c) => sum + o * (inside[c] - ends[c]), 0);
    const length = Math.hypot(...out) * (towards > 0 ? -1 : 1);
    return length ? out.map((o) => o / length) : [0, 0, 0];
}

/**
 * A strip of some width along each side; at corners the strips meet.
 * @param {Slice} to @param {Side[]} rim @param {number[]} normal @param {number} width
 */
function addSkirt(to, rim, normal, width) {
    /** @type {Map<number, number[]>} */
    const sums = new Map();
    for (const side of rim) {
        const out = outward(side, normal);
        for (const key of side.keys)
            sums.set(
                key,
                (sums.get(key) ?? [0, 0, 0]).map((v, c) => v + out[c]),
            );
    }
    for (const { ends, keys } of rim) {
        const corners = [...ends, ...ends];
        keys.forEach((key, k) => {
            const sum = /** @type {number[]} */ (sums.get(key));
            const length = Math.hypot(...sum) || 1;
            for (let c = 0; c < 3; c++) corners[8 + 4 * k + c] += (width * sum[c]) / length;
        });
        for (const k of [0, 1, 2, 1, 3, 2]) put(to, corners, k);
    }
}

/**
 * Cross-section of the tetrahedra with a plane, and a skirt around it: the shown surface may stand out from the
 * tetrahedra by part of an element, where values go on as at the border. The skirt's triangles come first, so that what
 * is exact is drawn over it.
 * @param {ArrayLike<number>} x positions [n][3] @param {Uint32Array} tets [m][4] @param {ArrayLike<number>} value [n]
 * @param {Plane} plane
 * @param {{outer: Uint8Array, width: number} | null} skirt outerFaces of the tetrahedra; width of the skirt, m
 * @param {Slice} [spare] a slice that is no longer used
 * @returns {Slice}
 */
export function sliceTets(x, tets, value, { normal, constant }, skirt, spare) {
    const nNode = x.length / 3;
    const distance = new Float32Array(nNode);
    for (let i = 0; i < nNode; i++)
        distance[i] = normal[0] * x[3 * i] + normal[1] * x[3 * i + 1] + normal[2] * x[3 * i + 2] + constant;
    const cut = crossing(distance, tets);
    const inner = withRoom(3 * cut.length); // at most two triangles for each of cut.length / 2 tetrahedra
    /** @type {Side[]} */
    const rim = [];
    const corner = new Float64Array(16); // x y z value
    for (let k = 0; k < cut.length; k += 2) {
        const t = cut[k];
        const edges = CUTS[cut[k + 1]];
        const key = [];
        for (let e = 0; 2 * e < edges.length; e++) {
            const [a, b] = [tets[t + edges[2 * e]], tets[t + edges[2 * e + 1]]].sort((p, q) => p - q);
            const s = distance[a] / (distance[a] - distance[b]);
            for (let c = 0; c < 3; c++) corner[4 * e + c] = x[3 * a + c] + s * (x[3 * b + c] - x[3 * a + c]);
            corner[4 * e + 3] = value[a] + s * (value[b] - value[a]);
            key.push(a * nNode + b);
        }
        for (let e = 2; e < key.length; e++) for (const at of [0, e - 1, e]) put(inner, corner, at);
        if (skirt && skirt.outer[t >> 2]) addSides(rim, corner, key, edges, skirt.outer[t >> 2]);
    }
    const all = withRoom(inner.n + 6 * rim.length, spare);
    if (skirt) addSkirt(all, rim, normal, skirt.width);
    all.positions.set(inner.positions.subarray(0, 3 * inner.n), 3 * all.n);
    all.values.set(inner.values.subarray(0, inner.n), all.n);
    all.n += inner.n;
    return all;
}
