// What a place picks, the outlines of faces, the ring of a brush, and what a tool would change.
import assert from "node:assert/strict";
import { test } from "node:test";
import { brushRing, circle } from "../src/brush_ring.js";
import { ControlCells } from "../src/control_cells.js";
import { commandOf, TOOLS } from "../src/sculpt_commands.js";
import { previewOf, TARGETS } from "../src/sculpt_preview.js";
import { WireError } from "../src/wire.js";

/**
 * Two square control faces side by side, 0..1 and 1..2, of cells 3 and 5; each of four squares of two triangles.
 *   vertices of the surface: 5 columns, 3 rows, half a unit apart
 */
const COLUMNS = 5;
const rest = Float32Array.from({ length: 3 * COLUMNS * 3 }, (_, i) => {
    const v = Math.floor(i / 3);
    return [(v % COLUMNS) / 2, Math.floor(v / COLUMNS) / 2, 0][i % 3];
});
/** squares, left face first */
const triangles = Uint32Array.from([0, 1, 5, 6, 2, 3, 7, 8].flatMap((v) => [v, v + 1, v + 6, v, v + 6, v + 5]));
const FILE = {
    vertices_m: [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 2, 0, 0, 2, 1, 0],
    faces: [
        { face: 4, cell: 3, vertices: [0, 1, 2, 3], edges: [10, 11, 12, 13] },
        { face: 9, cell: 5, vertices: [1, 4, 5, 2], edges: [14, 15, 16, 11] },
    ],
    triangles: [4, 8, 9, 8],
};
const cells = new ControlCells(FILE, rest, triangles);
const SETTINGS = {
    distance_m: 0.2,
    scale: 1,
    radius_m: 0.75,
    paint: "stiffer",
    sharpness: 1,
    entity: 1,
    pressure_Pa: 1,
    lift_m: 0.1,
    stiffness_N_m: 60,
    middle: [0, 0, 0],
};
const surface = { x: rest, triangles, nCorner: triangles.length };
/** @param {number[]} at @param {import("../src/control_cells.js").Picked | null} picked */
const place = (at, picked) => ({ rest: at, point: at, normal: [0, 0, 1], picked });

test("a place picks its face, the cell, and the nearest edge and vertex", () => {
    assert.deepEqual(cells.pick(4, [0.1, 0.4, 0]), { face: 4, cell: 3, edge: 13, vertex: 0 });
    assert.deepEqual(cells.pick(4, [0.9, 0.6, 0]), { face: 4, cell: 3, edge: 11, vertex: 2 });
    assert.deepEqual(cells.pick(9, [1.5, 0.1, 0]), { face: 9, cell: 5, edge: 14, vertex: 1 });
    assert.equal(cells.pick(-1, [0, 0, 0]), null);
    assert.deepEqual([...cells.faceOf], [...Array(8).fill(4), ...Array(8).fill(9)]);
});

test("an edge is drawn along the sides between its faces, a vertex where two edges meet", () => {
    const between = new Set(cells.borderOf(11));
    assert.deepEqual([...between].sort(), [12, 2, 7]);
    assert.equal(cells.borderOf(11).length, 4);
    assert.deepEqual(cells.borderOf(13), []); // nothing lies beyond
    assert.equal(cells.shownVertex(4, 1), 2);
    assert.equal(cells.shownVertex(4, 3), 10);
});

test("beside a cut every side of a face belongs to one of its edges", () => {
    const cut = new ControlCells({ ...FILE, triangles: [4, 8, -1, 8] }, rest, triangles);
    assert.deepEqual([...new Set(cut.borderOf(11))].sort(), [12, 2, 7]);
    assert.equal(cut.faceOf[15], -1);
});

test("files that are wrong are refused", () => {
    const bad = [
        null,
        {},
        { ...FILE, vertices_m: [0, "1"] },
        { ...FILE, triangles: [4, 8] },
        { ...FILE, triangles: [4, 8, 7, 8] },
        { ...FILE, triangles: [4, -8, 9, 24] },
        { ...FILE, faces: [{ face: 4, cell: 3, vertices: [0, 1], edges: [0, 1] }] },
        { ...FILE, faces: [{ face: 4, cell: 3, vertices: [0, 1, 99], edges: [0, 1, 2] }] },
        { ...FILE, faces: [null] },
    ];
    for (const file of bad) assert.throws(() => new ControlCells(file, rest, triangles), WireError);
});

test("every tool has a target, and shows what its click changes", () => {
    assert.deepEqual(Object.keys(TARGETS), Object.keys(TOOLS));
    const picked = cells.pick(4, [0.9, 0.6, 0]);
    const of = (/** @type {string} */ tool, more = {}) =>
        previewOf(tool, { ...SETTINGS, ...more }, place([0.9, 0.6, 0], picked), surface, cells);
    assert.equal(of("extrude").corners.length, 24);
    assert.equal(of("extrude").lift_m, 0.2);
    assert.equal(of("extrude").ridges.length, 4);
    assert.equal(of("delete").corners.length, 24);
    assert.deepEqual(of("sharpen").sides, cells.borderOf(11));
    assert.deepEqual(of("sharpen", { entity: 0 }).vertices, [12]);
    assert.equal(of("sharpen", { entity: 2 }).corners.length, 24);
    assert.deepEqual(of("probe").dot, [0.9, 0.6, 0]);
    // nothing is known yet of the cells
    assert.deepEqual(previewOf("delete", SETTINGS, place([0, 0, 0], null), surface, null).corners, []);
    assert.equal(commandOf("delete", SETTINGS, [[0.9, 0.6, 0]])?.verb, "delete");
});

test("the ring of a brush lies at its radius, on the surface", () => {
    const n = 20;
    const x = Float32Array.from({ length: 3 * (n + 1) ** 2 }, (_, i) => {
        const v = Math.floor(i / 3);
        const [u, w] = [(v % (n + 1)) / n, Math.floor(v / (n + 1)) / n];
        return [u, w, 0.3 * u * w][i % 3];
    });
    const grid = Array.from({ length: n * n }, (_, q) => {
        const v = Math.floor(q / n) * (n + 1) + (q % n);
        return [v, v + 1, v + n + 2, v, v + n + 2, v + n + 1];
    }).flat();
    const centre = [0.5, 0.5, 0.075];
    const ring = brushRing(x, grid, grid.length, centre, 0.3);
    assert.ok(ring.length > 100 && ring.length % 2 === 0);
    for (const { a, b, t } of ring) {
        const at = [0, 1, 2].map((k) => x[3 * a + k] + t * (x[3 * b + k] - x[3 * a + k]) - centre[k]);
        assert.ok(Math.abs(Math.hypot(...at) - 0.3) < 1e-6);
    }
    // each point belongs to two segments: the ring is closed
    const count = new Map();
    for (const { a, b } of ring) count.set(`${a} ${b}`, (count.get(`${a} ${b}`) ?? 0) + 1);
    assert.ok([...count.values()].every((times) => times === 2));
});

test("where triangles are larger than the brush a circle about the normal replaces the ring", () => {
    const preview = previewOf("paint", { ...SETTINGS, radius_m: 0.05 }, place([0.2, 0.3, 0], null), surface, null);
    assert.deepEqual(preview.circle, { point: [0.2, 0.3, 0], normal: [0, 0, 1], radius_m: 0.05 });
    const points = circle([1, 2, 3], [0, 0.6, 0.8], 0.05, 36);
    assert.equal(points.length, 2 * 3 * 36);
    for (let i = 0; i < points.length; i += 3) {
        const away = [points[i] - 1, points[i + 1] - 2, points[i + 2] - 3];
        assert.ok(Math.abs(Math.hypot(...away) - 0.05) < 1e-12);
        assert.ok(Math.abs(0.6 * away[1] + 0.8 * away[2]) < 1e-12);
    }
});
