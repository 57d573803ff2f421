// The tools of all members: an instrument or a ball in the member's colour, an arrow for the force on it, a name beside
// it.
import { aim, handAt, isOriented } from "./instrument_pose.js";
import { shapeOf } from "./instrument_shapes.js";
import { Instrument } from "./instruments.js";
import { cssColour } from "./plan_panel.js";
import { text } from "./text.js";
import * as THREE from "./three.js";

const SAME_N = 0.005; // forces that differ by less have the same arrow
const GHOST_OPACITY = 0.25;
const LABEL_PX = 30; // of the page above a label, so that it is seen
const ARROW_MIN_N = 0.02; // smallest force with an arrow

const SAME_TURN = 1e-3; // orientations that differ by less look alike, as quaternions
// without a trocar, a hand comes from a port above the camera, to the right: directions to the eye, up and right in the
// view; its distance is that of a port from an organ
const PORT = { eye: 0.55, up: 0.75, right: 0.4, sizes: 0.75 };

/** @typedef {import("./wire.js").Tool} Tool */

/**
 * Do two states of the tools look alike: same flags, holders and colours, positions within `limit` m, orientations, and
 * forces within 5 mN?
 * @param {Tool[]} a @param {Tool[]} b @param {number} limit
 */
export function sameTools(a, b, limit) {
    const near = (/** @type {number[]} */ u, /** @type {number[]} */ v, /** @type {number} */ difference) =>
        u.every((c, k) => Math.abs(c - v[k]) <= difference);
    return (
        a.length === b.length &&
        a.every((t, i) => {
            const u = b[i];
            const same = t.flags === u.flags && t.holder === u.holder && t.colour === u.colour && t.radius === u.radius;
            const turned = !near(t.quaternion, u.quaternion, SAME_TURN);
            return same && !turned && near(t.position, u.position, limit) && near(t.force, u.force, SAME_N);
        })
    );
}

export class ToolMarks {
    /** @param {import("./stage.js").Stage} stage @param {HTMLElement} labels */
    constructor(stage, labels) {
        this.stage = stage;
        this.labels = labels;
        /** @type {{ball: THREE.Mesh, ghost: THREE.Mesh, arrow: THREE.ArrowHelper, label: HTMLSpanElement, at: THREE.Vector3, shown: boolean, instrument: Instrument | null}[]} */
        this.marks = [];
        /** @type {import("./instruments.js").ToolInfo[]} */
        this.infos = [];
        this.depth = 0; // of the own press, m; shown beside the own tool
        this.port = [0, 0, 1]; // of instruments without orientation and trocar, m
        /** @type {Tool[]} as last drawn */
        this.drawn = [];
    }

    /** the tools of a session that begins @param {import("./app_state.js").Hello} hello */
    begin({ tools, box_min_m, box_max_m, up }) {
        const size = Math.hypot(...box_max_m.map((v, k) => v - box_min_m[k]));
        this.infos = tools.map((info) => (info.trocar_m?.length === 3 ? info : { ...info, trocar_m: undefined }));
        this.port = up.map((v, k) => (box_min_m[k] + box_max_m[k]) / 2 + size * v);
        this.infos.forEach((info, i) => {
            const mark = this.mark(i);
            const shape = shapeOf(info.instrument);
            mark.instrument?.dispose();
            mark.instrument = shape && new Instrument(this.stage.scene, info, shape);
        });
    }

    /**
     * The hand of a tool whose tip is put down at a point: it comes through the trocar, else from above the camera.
     * @param {number} tool @param {THREE.Vector3} tip m @returns {import("./instrument_pose.js").Hand | null} null: a ball
     */
    hand(tool, tip) {
        if (!this.marks[tool]?.instrument) return null;
        const { camera, size } = this.stage;
        const eye = camera.position.clone().sub(tip).normalize();
        const [right, up] = [0, 1].map((column) => new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, column));
        const away = eye
            .clone()
            .multiplyScalar(PORT.eye)
            .addScaledVector(up, PORT.up)
            .addScaledVector(right, PORT.right);
        const port =
            this.infos[tool].trocar_m ??
            away
                .setLength(PORT.sizes * size)
                .add(tip)
                .toArray();
        return handAt(port, tip.toArray(), eye.toArray());
    }

    /** do jaws move, so that pictures are due? */
    get turning() {
        return this.marks.some((mark) => mark.instrument?.turning);
    }

    /** @param {number} index */
    mark(index) {
        while (this.marks.length <= index) {
            const ball = new THREE.Mesh(
                new THREE.SphereGeometry(1, 32, 20),
                new THREE.MeshPhysicalMaterial({
                    roughness: 0.25,
                    metalness: 0.1,
                    clearcoat: 1,
                    clearcoatRoughness: 0.1,
                }),
            );
            // where tissue hides the tool, it shines through
            const ghost = new THREE.Mesh(
                ball.geometry,
                new THREE.MeshBasicMaterial({
                    transparent: true,
                    opacity: GHOST_OPACITY,
                    depthTest: false,
                    depthWrite: false,
                }),
            );
            ghost.renderOrder = 1;
            ball.add(ghost);
            const arrow = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.01, 0xffffff);
            const label = document.createElement("span");
            // the force mostly points into the tissue: its arrow is drawn over it
            for (const piece of [arrow.line, arrow.cone]) {
                piece.renderOrder = 1;
                /** @type {THREE.Material} */ (piece.material).depthTest = false;
            }
            ball.visible = arrow.visible = label.hidden = false;
            this.stage.scene.add(ball, arrow);
            this.labels.append(label);
            const at = new THREE.Vector3();
            this.marks.push({ ball, ghost, arrow, label, at, shown: false, instrument: null });
        }
        return this.marks[index];
    }

    /**
     * @param {Tool[]} tools @param {(holder: number, tool: number) => string} nameOf @param {number} mine own tool, -1 none
     * @param {number} radiusLimit smallest drawn radius, m @param {number} now ms
     */
    update(tools, nameOf, mine, radiusLimit, now) {
        tools.forEach((tool, i) => {
            const mark = this.mark(i);
            mark.shown = tool.held && !tool.away;
            mark.ball.visible = mark.shown && !mark.instrument;
            mark.instrument?.show(mark.shown);
            const force = Math.hypot(...tool.force);
            mark.arrow.visible = mark.shown && force > ARROW_MIN_N;
            if (!mark.shown) return;
            mark.at.fromArray(tool.position);
            mark.ball.position.copy(mark.at);
            const radius = Math.max(tool.radius, radiusLimit);
            mark.instrument?.update(tool, this.orientation(tool, i), radius, now);
            mark.instrument?.ringAt(mark.at); // the name stands there, not over the tip
            mark.ball.scale.setScalar(radius);
            /** @type {THREE.MeshPhysicalMaterial} */ (mark.ball.material).color.setHex(tool.colour);
            /** @type {THREE.MeshBasicMaterial} */ (mark.ghost.material).color.setHex(tool.colour);
            if (mark.arrow.visible) {
                mark.arrow.position.copy(mark.ball.position);
                mark.arrow.setDirection(new THREE.Vector3().fromArray(tool.force).normalize());
                const length = this.stage.size * Math.min(0.5, 0.06 + 0.05 * force);
                mark.arrow.setLength(length, 0.25 * length, 0.12 * length);
                mark.arrow.setColor(tool.colour);
            }
            mark.label.textContent = i === mine ? this.ownLabel() : nameOf(tool.holder, i);
            mark.label.style.setProperty("--who", cssColour(tool.colour));
        });
        for (let i = tools.length; i < this.marks.length; i++) {
            this.marks[i].shown = this.marks[i].ball.visible = this.marks[i].arrow.visible = false;
            this.marks[i].instrument?.show(false);
        }
    }

    /** @param {Tool} tool @param {number} index @returns {number[]} quaternion */
    orientation(tool, index) {
        if (isOriented(tool.quaternion)) return tool.quaternion;
        const port = this.infos[index]?.trocar_m ?? this.port;
        return aim(handAt(port, tool.position, this.stage.up.toArray()), tool.position);
    }

    ownLabel() {
        const mm = Math.round(1000 * this.depth);
        return mm > 0 ? text("tool.deep", { mm }) : text("tool.you");
    }

    /** after the camera has moved */
    placeLabels() {
        for (const mark of this.marks) {
            // beside the ring of an instrument, or at its tip where the ring is out of view
            const ring = mark.shown ? this.stage.project(mark.at) : null;
            const { clientWidth, clientHeight } = this.stage.canvas;
            const out = ring && (ring.x < 0 || ring.y < LABEL_PX || ring.x > clientWidth || ring.y > clientHeight);
            const p = out ? this.stage.project(mark.ball.position) : ring;
            mark.label.hidden = !p;
            if (p) mark.label.style.transform = `translate(${Math.round(p.x + 14)}px, ${Math.round(p.y - 26)}px)`;
        }
    }
}
