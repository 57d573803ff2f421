// A small picture of surfaces without WebGL: their triangles from behind to front, lit from above. For lists, where a
// context of WebGL each would be too many.

const VIEW = norm([-0.45, -0.8, 0.4]); // towards the eye; z is up
const LIGHT = norm([-0.3, -0.6, 0.9]);
const COLOURS = [
    [196, 74, 62],
    [206, 168, 96],
    [96, 150, 190],
    [150, 180, 110],
];

/** @param {number[]} v */
function norm(v) {
    const n = Math.hypot(...v);
    return v.map((c) => c / n);
}

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/**
 * Triangles as the eye sees them, the farthest first: corners [x, y] three times in units of the picture's smaller side
 * from its middle, shade 0 to 1, and the surface.
 * @param {{rest: Float32Array, triangles: Uint32Array}[]} surfaces
 * @returns {{corners: number[], shade: number, surface: number, depth: number}[]}
 */
export function project(surfaces) {
    const right = norm(cross([0, 0, 1], VIEW));
    const up = cross(VIEW, right);
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const { rest } of surfaces)
        for (let i = 0; i < rest.length; i++) {
            low[i % 3] = Math.min(low[i % 3], rest[i]);
            high[i % 3] = Math.max(high[i % 3], rest[i]);
        }
    const middle = low.map((v, k) => (v + high[k]) / 2);
    const size = Math.hypot(...low.map((v, k) => high[k] - v)) || 1;
    /** @type {ReturnType<typeof project>} */
    const seen = [];
    surfaces.forEach(({ rest, triangles }, surface) => {
        for (let t = 0; t < triangles.length; t += 3) {
            const p = [0, 1, 2].map((k) => [0, 1, 2].map((c) => (rest[3 * triangles[t + k] + c] - middle[c]) / size));
            const normal = cross(
                p[1].map((v, c) => v - p[0][c]),
                p[2].map((v, c) => v - p[0][c]),
            );
            const area = Math.hypot(...normal);
            const dot = (/** @type {number[]} */ a) => a.reduce((sum, v, c) => sum + v * normal[c], 0) / area;
            if (!(area > 0) || dot(VIEW) <= 0) continue; // an empty one, or from behind
            seen.push({
                corners: p.flatMap((q) => [
                    q.reduce((sum, v, c) => sum + v * right[c], 0),
                    -q.reduce((sum, v, c) => sum + v * up[c], 0),
                ]),
                shade: 0.35 + 0.65 * Math.max(0, dot(LIGHT)),
                surface,
                depth: p.reduce((sum, q) => sum + q.reduce((s, v, c) => s + v * VIEW[c], 0), 0),
            });
        }
    });
    return seen.sort((a, b) => a.depth - b.depth);
}

/** @param {HTMLCanvasElement} canvas @param {{rest: Float32Array, triangles: Uint32Array}[]} surfaces */
export function drawSurfaces(canvas, surfaces) {
    const context = canvas.getContext("2d");
    if (!context) return;
    const { width, height } = canvas;
    const scale = 1.05 * Math.min(width, height);
    context.clearRect(0, 0, width, height);
    for (const { corners, shade, surface } of project(surfaces)) {
        const [r, g, b] = COLOURS[surface % COLOURS.length].map((v) => Math.round(v * shade));
        context.fillStyle = context.strokeStyle = `rgb(${r} ${g} ${b})`;
        context.beginPath();
        for (let k = 0; k < 6; k += 2)
            context.lineTo(width / 2 + scale * corners[k], height / 2 + scale * corners[k + 1]);
        context.closePath();
        context.fill();
        context.stroke(); // without seams
    }
}
