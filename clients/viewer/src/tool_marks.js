// Everybody's tools: a ball in the member's colour, an arrow for the force on it, a name beside it.
import * as THREE from "./three.js";

/** @typedef {import("./wire.js").Tool} Tool */

/**
 * Do two states of the tools look alike: same flags, holders and colours, places within `least` m, forces within 5 mN?
 * @param {Tool[]} a @param {Tool[]} b @param {number} least
 */
export function sameTools(a, b, least) {
  const near = (/** @type {number[]} */ u, /** @type {number[]} */ v, /** @type {number} */ limit) =>
    u.every((c, k) => Math.abs(c - v[k]) <= limit);
  return (
    a.length === b.length &&
    a.every((t, i) => {
      const u = b[i];
      const same = t.flags === u.flags && t.holder === u.holder && t.colour === u.colour && t.radius === u.radius;
      return same && near(t.position, u.position, least) && near(t.force, u.force, 0.005);
    })
  );
}

export class ToolMarks {
  /** @param {import("./stage.js").Stage} stage @param {HTMLElement} labels */
  constructor(stage, labels) {
    this.stage = stage;
    this.labels = labels;
    /** @type {{ball: THREE.Mesh, arrow: THREE.ArrowHelper, label: HTMLSpanElement, at: THREE.Vector3, shown: boolean}[]} */
    this.marks = [];
    /** @type {Tool[]} as last drawn */
    this.drawn = [];
  }

  /** @param {number} index */
  mark(index) {
    while (this.marks.length <= index) {
      const ball = new THREE.Mesh(
        new THREE.SphereGeometry(1, 32, 20),
        new THREE.MeshPhysicalMaterial({ roughness: 0.25, metalness: 0.1, clearcoat: 1, clearcoatRoughness: 0.1 }),
      );
      const arrow = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.01, 0xffffff);
      const label = document.createElement("span");
      // the force mostly points into the tissue: draw its arrow over it
      for (const piece of [arrow.line, arrow.cone]) {
        piece.renderOrder = 1;
        /** @type {THREE.Material} */ (piece.material).depthTest = false;
      }
      ball.visible = arrow.visible = label.hidden = false;
      this.stage.scene.add(ball, arrow);
      this.labels.append(label);
      this.marks.push({ ball, arrow, label, at: new THREE.Vector3(), shown: false });
    }
    return this.marks[index];
  }

  /**
   * @param {Tool[]} tools @param {(holder: number) => string} nameOf @param {number} mine own tool, -1 none
   * @param {number} radiusLimit smallest drawn radius, m
   */
  update(tools, nameOf, mine, radiusLimit) {
    this.drawn = tools;
    tools.forEach((tool, i) => {
      const mark = this.mark(i);
      mark.shown = tool.held && !tool.away;
      mark.ball.visible = mark.shown;
      const force = Math.hypot(...tool.force);
      mark.arrow.visible = mark.shown && force > 0.02;
      if (!mark.shown) return;
      mark.at.fromArray(tool.position);
      mark.ball.position.copy(mark.at);
      mark.ball.scale.setScalar(Math.max(tool.radius, radiusLimit));
      /** @type {THREE.MeshPhysicalMaterial} */ (mark.ball.material).color.setHex(tool.colour);
      if (mark.arrow.visible) {
        mark.arrow.position.copy(mark.at);
        mark.arrow.setDirection(new THREE.Vector3().fromArray(tool.force).normalize());
        const length = this.stage.size * Math.min(0.5, 0.06 + 0.05 * force);
        mark.arrow.setLength(length, 0.25 * length, 0.12 * length);
        mark.arrow.setColor(tool.colour);
      }
      mark.label.textContent = i === mine ? "you" : nameOf(tool.holder);
      mark.label.style.color = "#" + tool.colour.toString(16).padStart(6, "0");
    });
    for (let i = tools.length; i < this.marks.length; i++)
      this.marks[i].shown = this.marks[i].ball.visible = this.marks[i].arrow.visible = false;
  }

  /** after the camera was placed */
  placeLabels() {
    for (const mark of this.marks) {
      const p = mark.shown ? this.stage.project(mark.at) : null;
      mark.label.hidden = !p;
      if (p) mark.label.style.transform = `translate(${Math.round(p.x + 14)}px, ${Math.round(p.y - 26)}px)`;
    }
  }
}
