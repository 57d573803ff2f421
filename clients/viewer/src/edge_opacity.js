// How strongly the edges of a mesh are drawn: edges that stand closer than a few pixels would hide the surface. Pure.

const APART_PX = 10; // edges of this length stand apart
const OPACITY_MIN = 0.2;

/** mean length of the sides of some triangles @param {ArrayLike<number>} x @param {ArrayLike<number>} triangles */
export function meanEdge(x, triangles) {
    const each = Math.max(1, Math.floor(triangles.length / 3 / 500)); // some 500 triangles are enough
    let [sum, n] = [0, 0];
    for (let t = 0; t + 2 < triangles.length; t += 3 * each) {
        const [a, b] = [3 * triangles[t], 3 * triangles[t + 1]];
        sum += Math.hypot(x[a] - x[b], x[a + 1] - x[b + 1], x[a + 2] - x[b + 2]);
        n++;
    }
    return n ? sum / n : 0;
}

/** share of the full opacity @param {number} pixels of an edge */
export const edgeOpacity = (pixels) => Math.max(OPACITY_MIN, Math.min(1, pixels / APART_PX));
