// Values of tetrahedra on a regular grid, for volume rendering. Pure.

/**
 * @typedef {{size: number[], low: number[], step: number, data: Uint8Array}} Grid size: points along x, y, z; low: the
 *   first point, m; step: between points, m; data: two bytes each, x runs fastest: value and whether it is inside, the
 *   value times that, so that both can be interpolated and divided
 */

/**
 * Grid around the nodes, with a border of a point outside.
 * @param {ArrayLike<number>} x [n][3] @param {number} max points along the longest side
 * @returns {Grid}
 */
export function gridAround(x, max) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < x.length; i++) {
        low[i % 3] = Math.min(low[i % 3], x[i]);
        high[i % 3] = Math.max(high[i % 3], x[i]);
    }
    const longest = Math.max(...low.map((l, c) => high[c] - l)) || 1;
    const step = longest / (max - 3);
    const size = low.map((l, c) => Math.min(max, Math.ceil((high[c] - l) / step - 1e-6) + 3));
    return { size, low: low.map((l) => l - step), step, data: new Uint8Array(2 * size[0] * size[1] * size[2]) };
}

/**
 * Fills a grid: every point inside a tetrahedron gets the value there, as a byte of the range; all others nothing.
 * @param {ArrayLike<number>} x [n][3] @param {Uint32Array} tets [m][4] @param {ArrayLike<number>} value [n]
 * @param {{low: number, high: number}} range @param {Grid} grid
 */
export function fillGrid(x, tets, value, range, grid) {
    const { size, low, step, data } = grid;
    const scale = range.high > range.low ? 255 / (range.high - range.low) : 0;
    data.fill(0);
    for (let t = 0; t < tets.length; t += 4) {
        const [a, b, c, d] = [0, 1, 2, 3].map((k) => 3 * tets[t + k]);
        const u = [x[b] - x[a], x[b + 1] - x[a + 1], x[b + 2] - x[a + 2]];
        const v = [x[c] - x[a], x[c + 1] - x[a + 1], x[c + 2] - x[a + 2]];
        const w = [x[d] - x[a], x[d + 1] - x[a + 1], x[d + 2] - x[a + 2]];
        const vw = cross(v, w);
        const wu = cross(w, u);
        const uv = cross(u, v);
        const det = u[0] * vw[0] + u[1] * vw[1] + u[2] * vw[2];
        if (det === 0) continue;
        const from = [0, 1, 2].map((k) =>
            Math.max(0, Math.ceil((Math.min(x[a + k], x[b + k], x[c + k], x[d + k]) - low[k]) / step)),
        );
        const to = [0, 1, 2].map((k) =>
            Math.min(size[k] - 1, Math.floor((Math.max(x[a + k], x[b + k], x[c + k], x[d + k]) - low[k]) / step)),
        );
        const at = [0, 1, 2, 3].map((k) => value[tets[t + k]]);
        for (let k = from[2]; k <= to[2]; k++)
            for (let j = from[1]; j <= to[1]; j++)
                for (let i = from[0]; i <= to[0]; i++) {
                    const px = low[0] + i * step - x[a];
                    const py = low[1] + j * step - x[a + 1];
                    const pz = low[2] + k * step - x[a + 2];
                    const r = (px * vw[0] + py * vw[1] + pz * vw[2]) / det;
                    const s = (px * wu[0] + py * wu[1] + pz * wu[2]) / det;
                    const q = (px * uv[0] + py * uv[1] + pz * uv[2]) / det;
                    if (r < -1e-6 || s < -1e-6 || q < -1e-6 || r + s + q > 1 + 1e-6) continue;
                    const here = at[0] + r * (at[1] - at[0]) + s * (at[2] - at[0]) + q * (at[3] - at[0]);
                    const index = 2 * (i + size[0] * (j + size[1] * k));
                    data[index] = Math.max(0, Math.min(255, Math.round((here - range.low) * scale)));
                    data[index + 1] = 255;
                }
    }
}

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
