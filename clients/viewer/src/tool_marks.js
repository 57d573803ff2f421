// The tools of all members: a ball in the member's colour, an arrow for the force on it, a name beside it.
import { cssColour } from "./plan_panel.js";
import * as THREE from "./three.js";

const SAME_N = 0.005; // forces that differ by less have the same arrow
const GHOST_OPACITY = 0.25;
const ARROW_MIN_N = 0.02; // smallest force with an arrow

/** @typedef {import("./wire.js").Tool} Tool */

/**
 * Do two states of the tools look alike: same flags, holders and colours, positions within `limit` m, forces within 5 mN?
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
            return same && near(t.position, u.position, limit) && near(t.force, u.force, SAME_N);
        })
    );
}

export class ToolMarks {
    /** @param {import("./stage.js").Stage} stage @param {HTMLElement} labels */
    constructor(stage, labels) {
        this.stage = stage;
        this.labels = labels;
        /** @type {{ball: THREE.Mesh, ghost: THREE.Mesh, arrow: THREE.ArrowHelper, label: HTMLSpanElement, at: THREE.Vector3, shown: boolean}[]} */
        this.marks = [];
        /** @type {Tool[]} as last drawn */
        this.drawn = [];
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
            this.marks.push({ ball, ghost, arrow, label, at: new THREE.Vector3(), shown: false });
        }
        return this.marks[index];
    }

    /**
     * @param {Tool[]} tools @param {(holder: number, tool: number) => string} nameOf @param {number} mine own tool, -1 none
     * @param {number} radiusLimit smallest drawn radius, m
     */
    update(tools, nameOf, mine, radiusLimit) {
        tools.forEach((tool, i) => {
            const mark = this.mark(i);
            mark.shown = tool.held && !tool.away;
            mark.ball.visible = mark.shown;
            const force = Math.hypot(...tool.force);
            mark.arrow.visible = mark.shown && force > ARROW_MIN_N;
            if (!mark.shown) return;
            mark.at.fromArray(tool.position);
            mark.ball.position.copy(mark.at);
            mark.ball.scale.setScalar(Math.max(tool.radius, radiusLimit));
            /** @type {THREE.MeshPhysicalMaterial} */ (mark.ball.material).color.setHex(tool.colour);
            /** @type {THREE.MeshBasicMaterial} */ (mark.ghost.material).color.setHex(tool.colour);
            if (mark.arrow.visible) {
                mark.arrow.position.copy(mark.at);
                mark.arrow.setDirection(new THREE.Vector3().fromArray(tool.force).normalize());
                const length = this.stage.size * Math.min(0.5, 0.06 + 0.05 * force);
                mark.arrow.setLength(length, 0.25 * length, 0.12 * length);
                mark.arrow.setColor(tool.colour);
            }
            mark.label.textContent = i === mine ? "you" : nameOf(tool.holder, i);
            mark.label.style.setProperty("--who", cssColour(tool.colour));
        });
        for (let i = tools.length; i < this.marks.length; i++)
            this.marks[i].shown = this.marks[i].ball.visible = this.marks[i].arrow.visible = false;
    }

    /** after the camera has moved */
    placeLabels() {
        for (const mark of this.marks) {
            const p = mark.shown ? this.stage.project(mark.at) : null;
            mark.label.hidden = !p;
            if (p) mark.label.style.transform = `translate(${Math.round(p.x + 14)}px, ${Math.round(p.y - 26)}px)`;
        }
    }
}
