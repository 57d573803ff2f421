// Doubled vertices along the seams of an image: they have one rest position, and are drawn at one place with one normal.
// Pure.

/**
 * The copies in a rest shape, each with the first vertex at its place.
 * @param {Float32Array} rest [n][3] @returns {Uint32Array} copy, original, copy, original ...
 */
export function findCopies(rest) {
    /** @type {Map<string, number>} */
    const first = new Map();
    /** @type {number[]} */
    const pairs = [];
    for (let v = 0; v < rest.length / 3; v++) {
        const place = `${rest[3 * v]} ${rest[3 * v + 1]} ${rest[3 * v + 2]}`;
        const original = first.get(place);
        if (original === undefined) first.set(place, v);
        else pairs.push(v, original);
    }
    return Uint32Array.from(pairs);
}

/** @param {Uint32Array} copies @param {Float32Array} positions [n][3] */
export function joinPositions(copies, positions) {
    for (let k = 0; k < copies.length; k += 2)
        positions.copyWithin(3 * copies[k], 3 * copies[k + 1], 3 * copies[k + 1] + 3);
}

/**
 * The normal of all triangles around a place. Each has the normal of its own ones, so their sum is near enough.
 * @param {Uint32Array} copies @param {Float32Array} normals [n][3], of length 1
 */
export function joinNormals(copies, normals) {
    for (let k = 0; k < copies.length; k += 2)
        for (let c = 0; c < 3; c++) normals[3 * copies[k + 1] + c] += normals[3 * copies[k] + c];
    for (let k = 1; k < copies.length; k += 2) {
        const i = 3 * copies[k];
        const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]);
        for (let c = 0; c < 3 && length > 0; c++) normals[i + c] /= length;
    }
    joinPositions(copies, normals);
}
