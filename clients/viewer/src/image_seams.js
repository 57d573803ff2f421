// Copies of vertices where neighbouring triangles look differently, as along the seams of an image: they lie at one place
// and are drawn with one normal, unless the surface bends there (creases.js). Pure.
import { ONE } from "./asset.js";

/**
 * The copies of an asset, each with the vertex at its place, from which alone it is predicted.
 * @param {import("./asset.js").Asset} asset @returns {Uint32Array} copy, original, copy, original ...
 */
export function findCopies({ look, vertexOf, neighbour, weight }) {
    /** @type {number[]} */
    const pairs = [];
    for (let i = 0; look && i < vertexOf.length; i++)
        if (neighbour[4 * i] === neighbour[4 * i + 1] && 2 * weight[4 * i] === ONE && 2 * weight[4 * i + 1] === ONE)
            pairs.push(vertexOf[i], vertexOf[neighbour[4 * i]]);
    return Uint32Array.from(pairs);
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
    for (let k = 0; k < copies.length; k += 2)
        normals.copyWithin(3 * copies[k], 3 * copies[k + 1], 3 * copies[k + 1] + 3);
}
