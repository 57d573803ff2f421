// Shown surfaces as files in metres: OBJ, binary STL, PLY; only vertices in triangles are written. Pure.

/** @typedef {{positions: ArrayLike<number>, triangles: ArrayLike<number>}} Surface positions [n][3] m, triangles [m][3] */

/**
 * Several surfaces as one, without unused vertices.
 * @param {Surface[]} surfaces
 * @returns {{positions: Float32Array, triangles: Uint32Array}}
 */
export function joinSurfaces(surfaces) {
    /** @type {number[]} */
    const positions = [];
    /** @type {number[]} */
    const triangles = [];
    for (const surface of surfaces) {
        /** @type {Map<number, number>} */
        const indexOf = new Map();
        for (let e = 0; e < surface.triangles.length; e++) {
            const v = surface.triangles[e];
            let at = indexOf.get(v);
            if (at === undefined) {
                at = positions.length / 3;
                indexOf.set(v, at);
                positions.push(surface.positions[3 * v], surface.positions[3 * v + 1], surface.positions[3 * v + 2]);
            }
            triangles.push(at);
        }
    }
    return { positions: Float32Array.from(positions), triangles: Uint32Array.from(triangles) };
}

/** nine digits restore every bit of a float @param {number} value */
const digits = (value) => String(Number(value.toPrecision(9)));

/** @param {Surface[]} surfaces @returns {string} */
export function toObj(surfaces) {
    const { positions: x, triangles: t } = joinSurfaces(surfaces);
    const lines = [`# ${x.length / 3} vertices in metres, ${t.length / 3} triangles`];
    for (let i = 0; i < x.length; i += 3) lines.push(`v ${digits(x[i])} ${digits(x[i + 1])} ${digits(x[i + 2])}`);
    for (let i = 0; i < t.length; i += 3) lines.push(`f ${t[i] + 1} ${t[i + 1] + 1} ${t[i + 2] + 1}`);
    return lines.join("\n") + "\n";
}

/** @param {Surface[]} surfaces @returns {ArrayBuffer} */
export function toStl(surfaces) {
    const { positions: x, triangles: t } = joinSurfaces(surfaces);
    const n = t.length / 3;
    const bytes = new ArrayBuffer(84 + 50 * n);
    const view = new DataView(bytes);
    new Uint8Array(bytes).set(new TextEncoder().encode("Palpate, metres"));
    view.setUint32(80, n, true);
    for (let k = 0; k < n; k++) {
        const [a, b, c] = [0, 1, 2].map((i) => [0, 1, 2].map((d) => x[3 * t[3 * k + i] + d]));
        const u = b.map((v, d) => v - a[d]);
        const w = c.map((v, d) => v - a[d]);
        const normal = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
        const length = Math.hypot(...normal) || 1;
        [...normal.map((v) => v / length), ...a, ...b, ...c].forEach((v, i) =>
            view.setFloat32(84 + 50 * k + 4 * i, v, true),
        );
    }
    return bytes;
}

/** @param {Surface[]} surfaces @returns {ArrayBuffer} binary, little endian */
export function toPly(surfaces) {
    const { positions: x, triangles: t } = joinSurfaces(surfaces);
    const n = x.length / 3;
    const m = t.length / 3;
    const head = new TextEncoder().encode(`ply
format binary_little_endian 1.0
comment metres
element vertex ${n}
property float x
property float y
property float z
element face ${m}
property list uchar int vertex_indices
end_header
`);
    const bytes = new ArrayBuffer(head.length + 12 * n + 13 * m);
    const view = new DataView(bytes);
    new Uint8Array(bytes).set(head);
    let at = head.length;
    for (const v of x) {
        view.setFloat32(at, v, true);
        at += 4;
    }
    for (let k = 0; k < m; k++) {
        view.setUint8(at++, 3);
        for (let i = 0; i < 3; i++, at += 4) view.setInt32(at, t[3 * k + i], true);
    }
    return bytes;
}

/** @type {Record<string, (surfaces: Surface[]) => string | ArrayBuffer>} by file extension */
export const WRITERS = Object.freeze({ obj: toObj, stl: toStl, ply: toPly });
