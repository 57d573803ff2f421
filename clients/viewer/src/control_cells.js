// The control cells of a sculptable part (protocol/README.md, "Control cells"): the control face of each triangle, and
// what a place picks, as the server finds it (server/session/sculpt.c, pal_sculpt_find). Pure.
import { checkOf } from "./wire.js";

/**
 * @typedef {{face: number, cell: number, vertices: number[], edges: number[]}} ControlFace edge k runs from vertex k to
 *   the next
 * @typedef {{face: number, cell: number, edge: number, vertex: number}} Picked numbers of the server
 * @typedef {ArrayLike<number>} Points [n][3] m
 */

const need = checkOf("control cells");
/** @param {unknown} list @returns {list is number[]} */
const isIndices = (list) => Array.isArray(list) && list.every((v) => Number.isInteger(v) && v >= 0);

/** distance between two points @param {ArrayLike<number>} a @param {ArrayLike<number>} b */
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

/**
 * Distance of a point from the segment a b.
 * @param {ArrayLike<number>} p @param {ArrayLike<number>} a @param {ArrayLike<number>} b
 */
function segmentDistance(p, a, b) {
    const along = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    const length2 = along[0] ** 2 + along[1] ** 2 + along[2] ** 2;
    const dot = (p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1] + (p[2] - a[2]) * along[2];
    const t = length2 > 0 ? Math.max(0, Math.min(1, dot / length2)) : 0;
    return distance(p, [a[0] + t * along[0], a[1] + t * along[1], a[2] + t * along[2]]);
}

/**
 * The parts of a file, whose types are right.
 * @param {unknown} file parsed JSON @returns {{vertices_m: number[], faces: ControlFace[], triangles: number[]}}
 */
function checkFile(file) {
    const { vertices_m, faces, triangles } = /** @type {Record<string, unknown>} */ (file ?? {});
    need(Array.isArray(vertices_m) && vertices_m.every(Number.isFinite), "FIELD", "vertices_m");
    need(Array.isArray(triangles) && triangles.every(Number.isInteger), "FIELD", "triangles");
    need(
        Array.isArray(faces) &&
            faces.every((f) => isIndices(f?.vertices) && isIndices(f.edges) && isIndices([f.face, f.cell])),
        "FIELD",
        "faces",
    );
    return /** @type {any} */ ({ vertices_m, faces, triangles });
}

export class ControlCells {
    /** @param {unknown} file parsed JSON @param {Points} rest of the part's vertices @param {Uint32Array} triangles of its asset */
    constructor(file, rest, triangles) {
        const { vertices_m, faces, triangles: runs } = checkFile(file);
        this.rest = rest;
        this.triangles = triangles;
        /** @type {number[]} at rest */
        this.vertices_m = vertices_m;
        /** @type {Map<number, ControlFace>} */
        this.faces = new Map();
        for (const face of faces) {
            const n = face.vertices.length;
            need(n >= 3 && face.edges.length === n, "COUNT", `corners of face ${face.face}`);
            need(
                face.vertices.every((v) => 3 * v < vertices_m.length),
                "RANGE",
                "a vertex of no position",
            );
            this.faces.set(face.face, face);
        }
        /** control face of each triangle, -1: none */
        this.faceOf = new Int32Array(triangles.length / 3).fill(-1);
        let at = 0;
        for (let i = 0; i + 1 < runs.length; i += 2) {
            need(
                runs[i + 1] > 0 && (runs[i] === -1 || this.faces.has(runs[i])),
                "RANGE",
                `triangles of face ${runs[i]}`,
            );
            this.faceOf.fill(runs[i], at, (at += runs[i + 1]));
        }
        need(at === this.faceOf.length, "COUNT", "triangles");
        /** @type {Map<number, number[]> | null} of each control edge, once asked for */
        this.borders = null;
    }

    /** @param {number} vertex */
    position(vertex) {
        return this.vertices_m.slice(3 * vertex, 3 * vertex + 3);
    }

    /** distance of a position at rest from edge k of a face @param {ControlFace} face @param {number} k @param {ArrayLike<number>} at */
    edgeDistance({ vertices }, k, at) {
        return segmentDistance(at, this.position(vertices[k]), this.position(vertices[(k + 1) % vertices.length]));
    }

    /**
     * What a position at rest on a control face picks.
     * @param {number} face @param {ArrayLike<number>} at m @returns {Picked | null}
     */
    pick(face, at) {
        const found = this.faces.get(face);
        if (!found) return null;
        const edges = found.edges.map((_, k) => this.edgeDistance(found, k, at));
        const corners = found.vertices.map((vertex) => distance(at, this.position(vertex)));
        return {
            face,
            cell: found.cell,
            edge: found.edges[edges.indexOf(Math.min(...edges))],
            vertex: found.vertices[corners.indexOf(Math.min(...corners))],
        };
    }

    /** boundary faces of a cell @param {number} cell */
    facesOf(cell) {
        return [...this.faces.values()].filter((face) => face.cell === cell).map(({ face }) => face);
    }

    /** corners of the triangles of some faces @param {number[]} faces */
    cornersOf(faces) {
        const wanted = new Set(faces);
        const out = [];
        for (let t = 0; t < this.faceOf.length; t++)
            if (wanted.has(this.faceOf[t])) out.push(...this.triangles.subarray(3 * t, 3 * t + 3));
        return out;
    }

    /**
     * Sides of triangles along a control edge, as pairs of vertices. They separate the triangles of the two faces that
     * share the edge; faces that share several edges divide them by distance.
     * @param {number} edge @returns {number[]}
     */
    borderOf(edge) {
        this.borders ??= this.findBorders();
        return this.borders.get(edge) ?? [];
    }

    /** outline of faces: the borders of all their edges @param {number[]} faces */
    outlineOf(faces) {
        const edges = new Set(faces.flatMap((face) => this.faces.get(face)?.edges ?? []));
        return [...edges].flatMap((edge) => this.borderOf(edge));
    }

    /** @returns {Map<number, number[]>} */
    findBorders() {
        const { rest, triangles, faceOf } = this;
        const n = rest.length / 3;
        /** @type {Map<number, number>} triangle of a side that has no partner yet */
        const open = new Map();
        /** @type {Map<number, number[]>} */
        const borders = new Map();
        for (let t = 0; t < faceOf.length; t++)
            for (let k = 0; k < 3; k++) {
                const a = triangles[3 * t + k];
                const b = triangles[3 * t + ((k + 1) % 3)];
                const other = open.get(b * n + a);
                if (other === undefined) {
                    open.set(a * n + b, t);
                    continue;
                }
                open.delete(b * n + a);
                if (faceOf[other] === faceOf[t]) continue;
                const middle = [0, 1, 2].map((c) => (rest[3 * a + c] + rest[3 * b + c]) / 2);
                const edge = this.edgeBetween(faceOf[other], faceOf[t], middle);
                if (edge < 0) continue;
                const sides = borders.get(edge);
                if (sides) sides.push(a, b);
                else borders.set(edge, [a, b]);
            }
        return borders;
    }

    /**
     * The edge that two faces share, the nearest to a position; -1: none. A face on a cut (-1) shares every edge.
     * @param {number} one @param {number} other @param {number[]} at
     */
    edgeBetween(one, other, at) {
        const face = this.faces.get(one) ?? this.faces.get(other);
        if (!face) return -1;
        const shared = this.faces.get(face.face === one ? other : one)?.edges ?? face.edges;
        let best = -1;
        let min = Infinity;
        face.edges.forEach((edge, k) => {
            const away = shared.includes(edge) ? this.edgeDistance(face, k, at) : Infinity;
            if (away < min) [best, min] = [edge, away];
        });
        return best;
    }

    /**
     * The shown vertex where a control vertex of a face stands: where its two edges of that face meet; else the nearest.
     * @param {number} face @param {number} vertex @returns {number} -1: no such face
     */
    shownVertex(face, vertex) {
        const found = this.faces.get(face);
        if (!found) return -1;
        const k = found.vertices.indexOf(vertex);
        const before = new Set(this.borderOf(found.edges[(k + found.edges.length - 1) % found.edges.length]));
        const common = this.borderOf(found.edges[k]).find((v) => before.has(v));
        if (common !== undefined) return common;
        const at = this.position(vertex);
        let best = -1;
        let min = Infinity;
        for (const v of this.cornersOf([face])) {
            const away = distance(
                at,
                [0, 1, 2].map((c) => this.rest[3 * v + c]),
            );
            if (away < min) [best, min] = [v, away];
        }
        return best;
    }
}
