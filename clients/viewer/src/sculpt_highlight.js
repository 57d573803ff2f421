// Draws what a click of the chosen sculpting tool would change: faces and cells filled and outlined, edges, vertices,
// the ring of a brush. The addon for wide lines and the control cells are loaded when sculpting is first chosen.
import { assetAddress } from "./asset.js";
import { circle } from "./brush_ring.js";
import { ControlCells } from "./control_cells.js";
import { atRest, nearestTriangle } from "./picking.js";
import { previewOf } from "./sculpt_preview.js";
import * as THREE from "./three.js";

const COLOUR = 0x8fe8ff; // against the red of tissue
const LINE_PX = 3;
const DOT_PX = 5; // radius
const FILL_OPACITY = 0.4;
const ABOVE = 0.002; // of the scene's size: lines stand so far outside the surface
const REACH = 0.1; // of the scene's size: PAL_PICK_REACH of the server
const CIRCLE_SEGMENTS = 72;

/** @typedef {import("./picking.js").Hit & {part: number}} Hit */
/** @typedef {import("./sculpt_preview.js").Preview} Preview */
/** @typedef {import("./control_cells.js").Picked} Picked */

export class SculptHighlight {
    /**
     * @param {import("./stage.js").Stage} stage @param {import("./app_state.js").AppState} state
     * @param {import("./sculpt_panel.js").SculptPanel} panel
     */
    constructor(stage, state, panel) {
        this.stage = stage;
        this.state = state;
        this.panel = panel;
        this.on = false;
        /** @type {Hit | null} under the mouse */
        this.hit = null;
        /** @type {Picked | null} there */
        this.picked = null;
        /** @type {Map<number, {epoch: number, file: unknown, cells: ControlCells | null}>} of each part */
        this.files = new Map();
        /** @type {Preview[]} of the clicked places and of the one under the mouse */
        this.previews = [];
        /** @type {import("./body_mesh.js").BodyMesh | null} that they lie on */
        this.body = null;
        /** @type {Marks | null} */
        this.marks = null;
    }

    /** @param {boolean} on sculpting is chosen */
    enable(on) {
        if (this.on === on) return;
        this.on = on;
        this.hover(null);
        this.panel.onChange();
        if (on) void this.load();
    }

    /** after `hello`: epochs count anew */
    begin() {
        this.files.clear();
        this.hover(null);
        void this.load();
    }

    /** fetches the control cells of new topologies; until they are there only brushes are shown */
    async load() {
        if (!this.on) return;
        const lines = this.marks ? null : await import("./wide_lines.js");
        if (lines) this.marks ??= new Marks(this.stage.scene, lines);
        const loads = this.state.parts.map(async ({ control_cells, epoch }, part) => {
            if (!control_cells || this.files.get(part)?.epoch === epoch) return;
            const entry = { epoch, file: null, cells: null };
            this.files.set(part, entry);
            // a file that has been replaced meanwhile is gone, and `topology` names the next
            const reply = await fetch(assetAddress(control_cells, location.href)).catch(() => null);
            if (reply?.ok) entry.file = await reply.json().catch(() => null);
        });
        await Promise.all(loads);
        this.refresh();
    }

    /** control cells of a part as it is shown, null: not loaded @param {number} part */
    cellsOf(part) {
        const entry = this.files.get(part);
        const body = this.state.bodies.get(part);
        if (!entry?.file || !body || body.epoch !== entry.epoch) return null;
        const { file } = entry;
        entry.file = null; // of a file that is wrong an error is reported once
        entry.cells ??= new ControlCells(file, body.rest, body.triangles());
        entry.file = file;
        return entry.cells;
    }

    /** @param {Hit | null} hit under the mouse */
    hover(hit) {
        const { hit: former } = this;
        if (!hit && !former) return;
        if (hit && former && hit.part === former.part && hit.point.equals(former.point)) return;
        this.hit = hit;
        this.refresh();
    }

    /** where a hit lies at rest and what it picks, as the server finds it @param {Hit} hit @returns {import("./sculpt_preview.js").Place | null} */
    placeOf(hit) {
        const body = this.state.bodies.get(hit.part);
        if (!body) return null;
        const cells = this.cellsOf(hit.part);
        const x = body.position.array;
        const triangles = body.triangles();
        let on = { triangle: hit.triangle, point: hit.point };
        // on a cut the nearest control face counts
        if (cells && cells.faceOf[hit.triangle] < 0) {
            const near = nearestTriangle(hit.point, x, triangles, (t) => cells.faceOf[t] >= 0);
            if (near && near.distance <= REACH * this.stage.size) on = near;
        }
        const rest = atRest(on.triangle, on.point, x, body.rest, triangles).toArray();
        const picked = cells?.pick(cells.faceOf[on.triangle], rest) ?? null;
        return { rest, point: hit.point.toArray(), normal: hit.normal.toArray(), picked };
    }

    /** after a change of the place, the tool, its settings or the topology */
    refresh() {
        const hits = [...this.panel.hits, ...(this.hit ? [this.hit] : [])];
        const part = hits[0]?.part;
        this.body = (part === undefined ? null : this.state.bodies.get(part)) ?? null;
        this.picked = null;
        this.previews = [];
        this.stage.dirty = true;
        if (!this.on || !this.body) return;
        const { body } = this;
        const surface = { x: body.rest, triangles: body.triangles(), nCorner: body.nCorner };
        for (const hit of hits) {
            const place = hit.part === part ? this.placeOf(hit) : null;
            if (!place) continue;
            if (hit === this.hit) this.picked = place.picked;
            const { tool } = this.panel;
            this.previews.push(previewOf(tool, this.panel.settings(), place, surface, this.cellsOf(hit.part)));
        }
    }

    /** places the marks on the surface as it is now; before each picture */
    update() {
        if (!this.marks) return;
        const { body, stage } = this;
        // of another topology until the mouse is looked at again
        if (body && ![...this.state.bodies.values()].includes(body)) this.hover(null);
        this.marks.draw(
            this.body,
            this.body?.mesh.visible ? this.previews : [],
            this.on ? this.panel.plane() : [],
            ABOVE * stage.size,
            DOT_PX / stage.pixelsPerMetre(),
        );
    }
}

/** The objects on the stage. */
class Marks {
    /**
     * @param {THREE.Scene} scene @param {typeof import("./wide_lines.js")} lines
     */
    constructor(scene, { LineSegments2, LineSegmentsGeometry, LineMaterial }) {
        this.scene = scene;
        this.makeGeometry = () => new LineSegmentsGeometry();
        const plain = { color: COLOUR, toneMapped: false, transparent: true, depthWrite: false };
        this.fill = new THREE.Mesh(
            new THREE.BufferGeometry(),
            new THREE.MeshBasicMaterial({
                ...plain,
                opacity: FILL_OPACITY,
                polygonOffset: true,
                polygonOffsetFactor: -1,
            }),
        );
        this.lines = new LineSegments2(this.makeGeometry(), new LineMaterial({ ...plain, linewidth: LINE_PX }));
        this.dotMaterial = new THREE.MeshBasicMaterial({ ...plain, depthTest: false });
        this.ball = new THREE.SphereGeometry(1, 16, 10);
        /** @type {THREE.Mesh[]} */
        this.dots = [];
        /** @type {number[] | null} corners in the index of the fill */
        this.filled = null;
        this.capacity = 0; // of the lines
        for (const object of [this.fill, this.lines]) {
            object.frustumCulled = false;
            object.renderOrder = 1;
            scene.add(object);
        }
    }

    /**
     * @param {import("./body_mesh.js").BodyMesh | null} body @param {Preview[]} previews
     * @param {number[][]} plane outline of a cut @param {number} above_m @param {number} dot_m radius of a dot
     */
    draw(body, previews, plane, above_m, dot_m) {
        const points = [...plane];
        const dots = [];
        for (const preview of body ? previews : []) {
            const { position, normal } = /** @type {import("./body_mesh.js").BodyMesh} */ (body);
            const at = (/** @type {number} */ v) => pointOf(position.array, normal.array, v, above_m);
            const on = preview.ring.map(({ a, b, t }) => mix(at(a), at(b), t));
            points.push(...preview.sides.map(at), ...on, ...circlePoints(preview));
            const step = liftStep(preview, position.array);
            if (step) {
                const lifted = (/** @type {number} */ v) => at(v).map((c, k) => c + step[k]);
                points.push(...preview.sides.map(lifted), ...preview.ridges.flatMap((v) => [at(v), lifted(v)]));
            }
            dots.push(...preview.vertices.filter((v) => v >= 0).map(at));
            if (preview.dot) dots.push(preview.dot);
        }
        this.setFill(body, previews);
        this.setLines(points);
        this.setDots(dots, dot_m);
    }

    /** triangles of the body, whose vertices they share @param {import("./body_mesh.js").BodyMesh | null} body @param {Preview[]} previews */
    setFill(body, previews) {
        const corners = previews.length === 1 ? previews[0].corners : previews.flatMap((preview) => preview.corners);
        const { geometry } = this.fill;
        this.fill.visible = body !== null && corners.length > 0;
        if (!this.fill.visible || !body) return;
        if (geometry.getAttribute("position") === body.position && same(this.filled, corners)) return;
        // the vertices stay the body's
        geometry.deleteAttribute("position");
        geometry.dispose();
        this.fill.geometry = new THREE.BufferGeometry();
        this.fill.geometry.setAttribute("position", body.position);
        this.fill.geometry.setIndex(corners);
        this.filled = corners;
    }

    /** @param {number[][]} points pairs */
    setLines(points) {
        const n = points.length / 2;
        this.lines.visible = n > 0;
        if (!n) return;
        if (n > this.capacity) {
            this.capacity = 2 * n;
            this.lines.geometry.dispose();
            this.lines.geometry = this.makeGeometry();
            this.lines.geometry.setPositions(new Float32Array(6 * this.capacity));
        }
        const start = /** @type {THREE.InterleavedBufferAttribute} */ (
            this.lines.geometry.getAttribute("instanceStart")
        );
        points.forEach((point, i) => start.data.array.set(point, 3 * i));
        start.data.needsUpdate = true;
        this.lines.geometry.instanceCount = n;
    }

    /** @param {number[][]} places @param {number} radius_m */
    setDots(places, radius_m) {
        while (this.dots.length < places.length) {
            const dot = new THREE.Mesh(this.ball, this.dotMaterial);
            dot.renderOrder = 2;
            this.scene.add(dot);
            this.dots.push(dot);
        }
        this.dots.forEach((dot, i) => {
            dot.visible = i < places.length;
            if (!dot.visible) return;
            dot.position.fromArray(places[i]);
            dot.scale.setScalar(radius_m);
        });
    }
}

/** @param {number[] | null} a @param {number[]} b */
const same = (a, b) => a !== null && a.length === b.length && a.every((v, i) => v === b[i]);

/** @param {number[]} a @param {number[]} b @param {number} t */
const mix = (a, b, t) => a.map((v, k) => v + t * (b[k] - v));

/** a vertex, moved outside @param {ArrayLike<number>} x @param {ArrayLike<number>} n @param {number} v @param {number} above_m */
const pointOf = (x, n, v, above_m) => [0, 1, 2].map((k) => x[3 * v + k] + above_m * n[3 * v + k]);

/** @param {Preview} preview @returns {number[][]} */
function circlePoints({ circle: round }) {
    if (!round) return [];
    const flat = circle(round.point, round.normal, round.radius_m, CIRCLE_SEGMENTS);
    return Array.from({ length: flat.length / 3 }, (_, i) => flat.slice(3 * i, 3 * i + 3));
}

/** how far an extruded face moves: along the area of its triangles @param {Preview} preview @param {ArrayLike<number>} x */
function liftStep({ corners, lift_m }, x) {
    if (!lift_m) return null;
    const area = new THREE.Vector3();
    const [a, b, c] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    for (let t = 0; t < corners.length; t += 3) {
        [a, b, c].forEach((corner, k) => corner.fromArray(x, 3 * corners[t + k]));
        area.add(b.sub(a).cross(c.sub(a)));
    }
    return area.setLength(lift_m).toArray();
}
