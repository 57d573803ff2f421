// Mouse and finger: on the organ they move the tool, beside it they move the camera. Two fingers zoom and pan.
import * as THREE from "./three.js";

/**
 * What a drag asks of the tool: position m, grab, or away.
 * @typedef {{position: number[], grab: boolean} | null} ToolWish
 */

const CLICK_PX = 6; // a button that is let go farther away has turned the view
const PRESS_S = 0.35; // time in which a press goes in

export class ToolInput {
  /**
   * @param {import("./stage.js").Stage} stage
   * @param {(ray: THREE.Ray) => {point: THREE.Vector3, normal: THREE.Vector3, distance: number} | null} pick
   * @param {(wish: ToolWish) => void} onTool called on every change
   */
  constructor(stage, pick, onTool) {
    this.stage = stage;
    this.pick = pick;
    this.onTool = onTool;
    /** @type {"pull" | "press" | "sculpt"} */
    this.mode = "pull";
    /** @type {(at: number[]) => void} called with the place that is clicked while sculpting */
    this.onClick = () => {};
    /** @type {{id: number, at: number[], x: number, y: number} | null} where a press of the button began */
    this.clicked = null;
    this.enabled = false;
    this.radius = 0.01;
    /** @type {Map<number, {x: number, y: number}>} */
    this.pointers = new Map();
    /** @type {{id: number, grab: boolean, plane: THREE.Plane, into: THREE.Vector3, start: number, depth: number, deeper: number, x: number, y: number} | null} */
    this.drag = null;
    this.touchedOnce = () => {};
    const c = stage.canvas;
    c.addEventListener("pointerdown", (e) => this.down(e));
    c.addEventListener("pointermove", (e) => this.move(e));
    c.addEventListener("pointerup", (e) => this.up(e));
    c.addEventListener("pointercancel", (e) => this.up(e));
    c.addEventListener("lostpointercapture", (e) => this.up(e));
    c.addEventListener("contextmenu", (e) => e.preventDefault());
    c.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    c.addEventListener("dblclick", (e) => {
      if (!this.pick(stage.ray(e.clientX, e.clientY))) stage.home();
    });
  }

  /** @param {PointerEvent} e */
  down(e) {
    const c = this.stage.canvas;
    c.setPointerCapture(e.pointerId);
    this.pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (this.pointers.size > 1) {
      this.letGo();
      this.clicked = null;
      return;
    }
    this.clicked = null;
    if (this.mode === "sculpt") {
      const at = e.button === 0 ? this.pick(this.stage.ray(e.clientX, e.clientY)) : null;
      if (at) this.clicked = { id: e.pointerId, at: at.point.toArray(), x: e.clientX, y: e.clientY };
      c.classList.add("busy");
      return;
    }
    const hit = this.enabled && e.button !== 1 ? this.pick(this.stage.ray(e.clientX, e.clientY)) : null;
    c.classList.add("busy");
    if (!hit) return;
    const press = this.mode === "press" || e.button === 2 || e.shiftKey;
    const into = hit.point.clone().sub(this.stage.camera.position).normalize();
    this.drag = {
      id: e.pointerId,
      grab: !press,
      into,
      start: performance.now(),
      depth: press ? 1.3 * this.radius : 0,
      deeper: 0,
      plane: new THREE.Plane().setFromNormalAndCoplanarPoint(into, hit.point),
      x: e.clientX,
      y: e.clientY,
    };
    this.touchedOnce();
    this.tick();
  }

  /** @param {PointerEvent} e */
  move(e) {
    const last = this.pointers.get(e.pointerId);
    if (!last) {
      if (e.pointerType === "mouse")
        this.stage.canvas.classList.toggle("over", (this.enabled || this.mode === "sculpt") && this.hover(e));
      return;
    }
    const dx = e.clientX - last.x,
      dy = e.clientY - last.y;
    if (this.pointers.size === 1 && this.drag) {
      this.drag.x = e.clientX;
      this.drag.y = e.clientY;
      this.tick();
    } else if (this.pointers.size === 1) {
      if (e.buttons & 4 || e.ctrlKey) this.stage.pan(dx, dy);
      else this.stage.orbit(dx, dy);
    } else if (this.pointers.size === 2) {
      const other = /** @type {{x: number, y: number}} */ ([...this.pointers].find(([id]) => id !== e.pointerId)?.[1]);
      const before = Math.hypot(last.x - other.x, last.y - other.y),
        after = Math.hypot(e.clientX - other.x, e.clientY - other.y);
      if (before > 1 && after > 1) this.stage.zoom(before / after);
      this.stage.pan(dx / 2, dy / 2);
    }
    last.x = e.clientX;
    last.y = e.clientY;
  }

  /** is the mouse over the organ? looked up at most 15 times a second @param {PointerEvent} e */
  hover(e) {
    const now = performance.now();
    if (now - (this.hoverAt ?? 0) > 66) {
      this.hoverAt = now;
      this.hoverWas = !!this.pick(this.stage.ray(e.clientX, e.clientY));
    }
    return !!this.hoverWas;
  }

  /** @param {PointerEvent} e */
  up(e) {
    this.pointers.delete(e.pointerId);
    const clicked = this.clicked;
    if (clicked?.id === e.pointerId) {
      this.clicked = null;
      if (e.type === "pointerup" && Math.hypot(e.clientX - clicked.x, e.clientY - clicked.y) < CLICK_PX)
        this.onClick(clicked.at);
    }
    if (this.drag && this.drag.id === e.pointerId) this.letGo();
    if (this.pointers.size === 0) this.stage.canvas.classList.remove("busy");
  }

  letGo() {
    if (!this.drag) return;
    this.drag = null;
    this.onTool(null);
  }

  /** @param {WheelEvent} e */
  wheel(e) {
    e.preventDefault();
    const amount = (e.deltaMode === 1 ? 16 : 1) * e.deltaY;
    if (this.drag) {
      this.drag.deeper -= amount * 1e-4 * this.stage.size;
      this.tick();
    } else this.stage.zoom(Math.exp(amount * 0.0012));
  }

  /** where the tool shall be now; also called while nothing moves, because a press goes in over time */
  tick() {
    const drag = this.drag;
    if (!drag) return;
    const ray = this.stage.ray(drag.x, drag.y);
    const point = ray.intersectPlane(drag.plane, new THREE.Vector3());
    if (!point) return;
    const t = Math.min(1, (performance.now() - drag.start) / (1000 * PRESS_S));
    // a press begins with the ball outside and goes in along the view; a pull begins on the surface
    const depth = drag.grab
      ? drag.deeper
      : -1.2 * this.radius + (drag.depth + 0.6 * this.radius) * t * t * (3 - 2 * t) + drag.deeper;
    point.addScaledVector(drag.into, depth);
    this.onTool({ position: point.toArray(), grab: drag.grab });
  }
}
