// Patterns of tissue, computed once: periodic volumes of noise and of cells, and a periodic picture of branching vessels.
// Each has its height (0 to 1) beside its slope, so that a shader needs one look-up for both. Pure.

/** repeatable numbers from 0 to below 1 @param {number} seed */
export function makeRandom(seed) {
    let state = seed >>> 0;
    return () => {
        // a linear congruential generator modulo 2^32; its low bits are poor, the high ones count
        state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
        return state / 4294967296;
    };
}

/** @param {number} v @param {number} n the remainder that is not negative */
const wrap = (v, n) => ((v % n) + n) % n;

/**
 * @typedef {{data: Uint8Array<ArrayBuffer>, size: number, slope: number}} Pattern data: RGBA of each place, x fastest; RGB of
 *   a volume are the slopes along x, y, z, from -slope to slope a period, and A the height
 */

/**
 * Height and its slope in bytes.
 * @param {Float32Array} height [size^3], 0 to 1, periodic @param {number} size
 * @returns {Pattern}
 */
function packVolume(height, size) {
    const n = height.length;
    const slopes = new Float32Array(3 * n);
    let slope = 0;
    // neighbours along an axis: `step` apart, and the last one of a line comes before its first
    [1, size, size * size].forEach((step, axis) => {
        const line = step * size;
        for (let i = 0; i < n; i++) {
            const start = i - (i % line);
            const along = i - start;
            const next = height[start + ((along + step) % line)];
            const before = height[start + ((along + line - step) % line)];
            slopes[3 * i + axis] = (next - before) * 0.5 * size;
            slope = Math.max(slope, Math.abs(slopes[3 * i + axis]));
        }
    });
    const data = new Uint8Array(4 * n);
    for (let i = 0; i < n; i++) {
        for (let c = 0; c < 3; c++) data[4 * i + c] = Math.round(127.5 * (1 + slopes[3 * i + c] / slope));
        data[4 * i + 3] = Math.round(255 * height[i]);
    }
    return { data, size, slope };
}

/**
 * Gradient noise, periodic, added to `height`.
 * @param {Float32Array} height [size^3] @param {number} size @param {number} n lattice cells along an edge
 * @param {number} share @param {() => number} random
 */
function addNoise(height, size, n, share, random) {
    const gradient = Float32Array.from({ length: 3 * n ** 3 }, () => 2 * random() - 1);
    const fade = (/** @type {number} */ t) => t * t * t * (t * (6 * t - 15) + 10);
    const mix = (/** @type {number} */ a, /** @type {number} */ b, /** @type {number} */ t) => a + t * (b - a);
    for (let z = 0, i = 0; z < size; z++)
        for (let y = 0; y < size; y++)
            for (let x = 0; x < size; x++, i++) {
                const [px, py, pz] = [(x * n) / size, (y * n) / size, (z * n) / size];
                const [ix, iy, iz] = [Math.floor(px), Math.floor(py), Math.floor(pz)];
                const [fx, fy, fz] = [px - ix, py - iy, pz - iz];
                const corner = (/** @type {number} */ a, /** @type {number} */ b, /** @type {number} */ c) => {
                    const g = 3 * ((((iz + c) % n) * n + ((iy + b) % n)) * n + ((ix + a) % n));
                    return gradient[g] * (fx - a) + gradient[g + 1] * (fy - b) + gradient[g + 2] * (fz - c);
                };
                const edge = (/** @type {number} */ b, /** @type {number} */ c) =>
                    mix(corner(0, b, c), corner(1, b, c), fade(fx));
                const face = (/** @type {number} */ c) => mix(edge(0, c), edge(1, c), fade(fy));
                height[i] += share * mix(face(0), face(1), fade(fz));
            }
}

/**
 * Gradient noise in two octaves.
 * @param {number} size places along an edge @param {number} cells lattice cells along an edge, of the first octave
 * @returns {Pattern}
 */
export function makeNoise(size, cells) {
    const random = makeRandom(1);
    const height = new Float32Array(size ** 3);
    addNoise(height, size, cells, 1, random);
    addNoise(height, size, 2 * cells, 0.45, random);
    const deviation = Math.sqrt(height.reduce((sum, h) => sum + h * h, 0) / height.length);
    // the few values beyond 2.5 standard deviations are cut off
    return packVolume(
        height.map((h) => Math.min(1, Math.max(0, 0.5 + (0.2 * h) / deviation))),
        size,
    );
}

/**
 * Cells around random points: high in their middle, 0 at the borders between them.
 * @param {number} size places along an edge @param {number} cells along an edge
 * @returns {Pattern}
 */
export function makeCells(size, cells) {
    const random = makeRandom(2);
    const point = Float32Array.from({ length: 3 * cells ** 3 }, random);
    const height = new Float32Array(size ** 3);
    for (let z = 0, i = 0; z < size; z++)
        for (let y = 0; y < size; y++)
            for (let x = 0; x < size; x++, i++) {
                const [px, py, pz] = [(x * cells) / size, (y * cells) / size, (z * cells) / size];
                const [ix, iy, iz] = [Math.floor(px), Math.floor(py), Math.floor(pz)];
                let first = Infinity;
                let second = Infinity;
                for (let k = iz - 1; k <= iz + 1; k++)
                    for (let j = iy - 1; j <= iy + 1; j++)
                        for (let l = ix - 1; l <= ix + 1; l++) {
                            const g = 3 * ((wrap(k, cells) * cells + wrap(j, cells)) * cells + wrap(l, cells));
                            const d =
                                (l + point[g] - px) ** 2 + (j + point[g + 1] - py) ** 2 + (k + point[g + 2] - pz) ** 2;
                            if (d < first) [first, second] = [d, first];
                            else if (d < second) second = d;
                        }
                // a dome: flat in the middle, steep at the border
                const t = Math.min(1, 1.6 * (Math.sqrt(second) - Math.sqrt(first)));
                height[i] = t * (2 - t);
            }
    return packVolume(height, size);
}

/** @typedef {{from: number[], to: number[], radius: number}} Vessel a piece; the unit is the period, in which both repeat */

/** shortest way from a to b on the periodic square @param {number[]} a @param {number[]} b */
const way = (a, b) => [0, 1].map((k) => b[k] - a[k] - Math.round(b[k] - a[k]));

/** its length @param {number[]} a @param {number[]} b */
const apart = (a, b) => {
    const x = b[0] - a[0];
    const y = b[1] - a[1];
    return Math.hypot(x - Math.round(x), y - Math.round(y));
};

/**
 * Branching vessels: each of many places draws the nearest tip towards it until a vessel reaches it (space colonization:
 * Runions et al., Modeling and visualization of leaf venation patterns, 2005, doi:10.1145/1073204.1073251). Where two branches meet
 * their areas add up, cubed radii (Murray's law).
 * @param {number} places @param {number} roots
 * @returns {Vessel[]}
 */
export function growVessels(places, roots) {
    const STEP = 0.008; // of the period: length of a piece
    const REACHED = 0.016; // a place that a vessel has come this near to draws no longer
    const random = makeRandom(3);
    const node = Array.from({ length: roots }, () => ({ at: [random(), random()], parent: -1 }));
    let place = Array.from({ length: places }, () => ({ at: [random(), random()], nearest: -1, distance: Infinity }));
    const nodesMax = 6 * places; // ends two places that pull one node to and fro
    for (let known = 0; place.length && known < node.length && node.length < nodesMax; ) {
        const end = node.length;
        for (const p of place)
            for (let i = known; i < end; i++) {
                const d = apart(node[i].at, p.at);
                if (d < p.distance) [p.nearest, p.distance] = [i, d];
            }
        known = end;
        place = place.filter((p) => p.distance > REACHED);
        /** @type {Map<number, number[]>} */
        const pull = new Map();
        for (const { at, nearest, distance } of place) {
            const [x, y] = way(node[nearest].at, at);
            const sum = pull.get(nearest) ?? [0, 0];
            pull.set(nearest, [sum[0] + x / distance, sum[1] + y / distance]);
        }
        for (const [i, sum] of pull) {
            const angle = Math.atan2(sum[1], sum[0]) + 0.7 * (random() - 0.5); // vessels wind
            const at = [node[i].at[0] + STEP * Math.cos(angle), node[i].at[1] + STEP * Math.sin(angle)];
            node.push({ at, parent: i });
        }
    }
    const cubed = new Float32Array(node.length);
    for (let i = node.length - 1; i >= roots; i--) {
        cubed[i] = Math.max(1, cubed[i]);
        cubed[node[i].parent] += cubed[i];
    }
    const thinnest = 0.0011; // of the period
    return node
        .map(({ at, parent }, i) => ({ from: at, parent, radius: thinnest * Math.cbrt(cubed[i]) }))
        .slice(roots)
        .map(({ from, parent, radius }) => ({ from, to: node[parent].at, radius: Math.min(radius, 7 * thinnest) }));
}

/**
 * A picture of vessels: R how much of the place is a vessel, G and B the slope along x and y, from -slope to slope a period,
 * A the height.
 * @param {Vessel[]} vessels @param {number} size pixels along an edge
 * @returns {Pattern}
 */
export function drawVessels(vessels, size) {
    const height = new Float32Array(size * size);
    const cover = new Float32Array(size * size);
    for (const { from, to, radius } of vessels) {
        const [ax, ay, r] = [from[0] * size, from[1] * size, radius * size];
        const [dx, dy] = way(from, to).map((v) => v * size);
        const reach = r + 1.5;
        const length2 = dx * dx + dy * dy || 1;
        for (let y = Math.floor(Math.min(ay, ay + dy) - reach); y <= Math.max(ay, ay + dy) + reach; y++)
            for (let x = Math.floor(Math.min(ax, ax + dx) - reach); x <= Math.max(ax, ax + dx) + reach; x++) {
                const t = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / length2));
                const d = Math.hypot(x - ax - t * dx, y - ay - t * dy);
                const i = wrap(y, size) * size + wrap(x, size);
                cover[i] = Math.max(cover[i], Math.min(1, Math.max(0, r + 0.5 - d)) * Math.min(1, 0.45 + 0.35 * r));
                height[i] = Math.max(height[i], Math.sqrt(Math.max(0, 1 - (d / (r + 1)) ** 2)) * Math.min(1, r / 4));
            }
    }
    const at = (/** @type {number} */ x, /** @type {number} */ y) => height[wrap(y, size) * size + wrap(x, size)];
    const slope = 0.25 * size; // steeper walls are cut off: a quarter of the height in one pixel
    const data = new Uint8Array(4 * size * size);
    const byte = (/** @type {number} */ s) => Math.round(127.5 * (1 + Math.min(1, Math.max(-1, s / slope))));
    for (let y = 0, i = 0; y < size; y++)
        for (let x = 0; x < size; x++, i++) {
            data[4 * i] = Math.round(255 * cover[i]);
            data[4 * i + 1] = byte((at(x + 1, y) - at(x - 1, y)) * 0.5 * size);
            data[4 * i + 2] = byte((at(x, y + 1) - at(x, y - 1)) * 0.5 * size);
            data[4 * i + 3] = Math.round(255 * height[i]);
        }
    return { data, size, slope };
}
