// What a click of a sculpting tool would change, as parts of the shown surface. Pure.
import { brushRing } from "./brush_ring.js";

/**
 * @typedef {"face" | "cell" | "entity" | "brush" | "place"} Target what a tool acts on
 * @typedef {{x: ArrayLike<number>, triangles: ArrayLike<number>, nCorner: number}} Surface vertices at rest [n][3] m
 * @typedef {{rest: number[], point: number[], normal: number[], picked: import("./control_cells.js").Picked | null}} Place
 *   under the mouse: at rest and as shown, m
 * @typedef {{
 *   corners: number[], sides: number[], ridges: number[], lift_m: number, vertices: number[],
 *   ring: import("./brush_ring.js").OnSide[], circle: {point: number[], normal: number[], radius_m: number} | null,
 *   dot: number[] | null
 * }} Preview triangles to fill; pairs of vertices to join by lines; the same from each of `ridges`, to its copy lift_m
 *   outside; vertices to mark; lines across triangles; a circle; a marked place
 */

/** @type {Record<string, Target>} of each tool */
export const TARGETS = Object.freeze({
    extrude: "face",
    delete: "cell",
    divide: "cell",
    merge: "face",
    bridge: "face",
    sharpen: "entity",
    paint: "brush",
    inflate: "brush",
    deflate: "brush",
    curve: "brush",
    probe: "place",
});

const RING_MIN = 24; // points of a ring below which triangles are too large for it

/** @returns {Preview} */
const nothing = () => ({
    corners: [],
    sides: [],
    ridges: [],
    lift_m: 0,
    vertices: [],
    ring: [],
    circle: null,
    dot: null,
});

/**
 * @param {string} tool @param {import("./sculpt_commands.js").Settings} settings
 * @param {Place} place @param {Surface} surface @param {import("./control_cells.js").ControlCells | null} cells
 * @returns {Preview}
 */
export function previewOf(tool, settings, place, surface, cells) {
    const target = TARGETS[tool];
    const { picked } = place;
    const out = nothing();
    if (target === "place") out.dot = place.point;
    if (target === "brush") {
        const { x, triangles, nCorner } = surface;
        const ring = brushRing(x, triangles, nCorner, place.rest, settings.radius_m);
        if (ring.length >= RING_MIN) out.ring = ring;
        else out.circle = { point: place.point, normal: place.normal, radius_m: settings.radius_m };
        out.dot = place.point;
    }
    if (!cells || !picked) return out;
    const entity = target === "entity" ? ["vertex", "edge", "face"][settings.entity] : target;
    if (entity === "vertex") out.vertices = [cells.shownVertex(picked.face, picked.vertex)];
    if (entity === "edge") out.sides = cells.borderOf(picked.edge);
    if (entity === "face" || entity === "cell") {
        const faces = entity === "cell" ? cells.facesOf(picked.cell) : [picked.face];
        out.corners = cells.cornersOf(faces);
        out.sides = cells.outlineOf(faces);
    }
    if (tool === "extrude") {
        out.lift_m = settings.distance_m;
        out.ridges = (cells.faces.get(picked.face)?.vertices ?? []).map((v) => cells.shownVertex(picked.face, v));
    }
    return out;
}
