// Mouse and touch: on the organ they move the tool, beside it the camera. Two fingers zoom and pan.
import * as THREE from "./three.js";

/**
 * What a drag asks of the tool: position in m, grasp, and the hand that turns its instrument (null: a ball); null:
 * lifted away.
 * @typedef {{position: number[], grasp: boolean, hand?: import("./instrument_pose.js").Hand | null} | null} ToolTarget
 */

/** @typedef {import("./picking.js").Hit & {part: number}} Hit */

const HOVER_MS = 66; // between two looks at what is under the mouse
const CLICK_PX = 6; // a longer motion is not a click but turns the view
const PRESS_S = 0.35; // duration in which a press reaches its depth

export class ToolInput {
    /**
     * @param {import("./stage.js").Stage} stage
     * @param {(ray: THREE.Ray) => Hit | null} pick
     * @param {(target: ToolTarget) => void} onTarget called on every change
     * @param {(tip: THREE.Vector3) => import("./instrument_pose.js").Hand | null} handAt the hand of the own tool
     */
    constructor(stage, pick, onTarget, handAt) {
        this.stage = stage;
        this.pick = pick;
        this.onTarget = onTarget;
        this.handAt = handAt;
        /** @type {import("./controls.js").Mode} */
        this.mode = "pull";
        /** @type {(hit: Hit) => void} called with the place that is clicked while sculpting */
        this.onClick = () => {};
        /** @type {(hit: Hit | null) => void} called with the place under the mouse while sculpting */
        this.onHover = () => {};
        /** @type {{x: number, y: number, at: number, picture: number, byKeyboard: boolean} | null} mouse over the picture, or
         * where the keyboard points; at, picture: time in ms and number of the picture of the last look, -1: moved since */
        this.mouse = null;
        /** @type {{id: number, at: Hit, x: number, y: number} | null} place where the button went down */
        this.clickStart = null;
        this.enabled = false;
        this.radius = 0.01;
        /** @type {Map<number, {x: number, y: number}>} */
        this.pointers = new Map();
        /** @type {{id: number, grasp: boolean, hand: import("./instrument_pose.js").Hand | null, plane: THREE.Plane, into: THREE.Vector3, at: THREE.Vector3, start: number, depth: number, deeper: number, x: number, y: number} | null} */
        this.drag = null;
        /** @type {ToolTarget} where the keyboard holds the tool */
        this.held = null;
        this.onFirstDrag = () => {};
        /** @type {() => import("./plane_handles.js").PlaneHandles | null} asked before the organ */
        this.handles = () => null;
        const c = stage.canvas;
        c.addEventListener("pointerdown", (e) => this.down(e));
        c.addEventListener("pointermove", (e) => this.move(e));
        c.addEventListener("pointerup", (e) => this.up(e));
        c.addEventListener("pointercancel", (e) => this.up(e));
        c.addEventListener("lostpointercapture", (e) => this.up(e));
        c.addEventListener("pointerleave", () => this.hover(null));
        c.addEventListener("contextmenu", (e) => e.preventDefault());
        c.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
        c.addEventListener("dblclick", (e) => {
            stage.choose(e);
            if (!this.handles()?.hover(e) && !this.hit(e)) stage.home();
        });
    }

    /** what is under a point of the page @param {{clientX: number, clientY: number}} e */
    hit(e) {
        const { stage } = this;
        return stage.sees(e.clientX, e.clientY) ? this.pick(stage.ray(e.clientX, e.clientY)) : null;
    }

    /** @param {PointerEvent} e */
    down(e) {
        const c = this.stage.canvas;
        c.setPointerCapture(e.pointerId);
        this.pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
        if (this.pointers.size > 1) {
            this.release();
            this.handles()?.release();
            this.clickStart = null;
            return;
        }
        this.stage.choose(e);
        this.clickStart = null;
        if (e.button === 0 && this.handles()?.take(e)) {
            c.classList.add("busy");
            return;
        }
        if (this.mode === "sculpt") {
            const at = e.button === 0 ? this.hit(e) : null;
            if (at) this.clickStart = { id: e.pointerId, at, x: e.clientX, y: e.clientY };
            this.onHover(at);
            c.classList.add("busy");
            return;
        }
        const hit = this.enabled && e.button !== 1 ? this.hit(e) : null;
        c.classList.add("busy");
        if (!hit) return;
        this.held = null;
        const press = this.mode === "press" || e.button === 2 || e.shiftKey;
        const into = this.stage.ray(e.clientX, e.clientY).direction;
        this.drag = {
            id: e.pointerId,
            grasp: !press,
            hand: this.handAt(hit.point),
            into,
            at: hit.point,
            start: performance.now(),
            depth: press ? 1.3 * this.radius : 0,
            deeper: 0,
            plane: new THREE.Plane().setFromNormalAndCoplanarPoint(into, hit.point),
            x: e.clientX,
            y: e.clientY,
        };
        this.onFirstDrag();
        this.tick();
    }

    /** @param {PointerEvent} e */
    move(e) {
        const last = this.pointers.get(e.pointerId);
        if (!last) {
            this.stage.choose(e);
            if (e.pointerType === "mouse") this.hover(e);
            return;
        }
        const dx = e.clientX - last.x;
        const dy = e.clientY - last.y;
        if (this.pointers.size === 1 && this.drag) {
            this.drag.x = e.clientX;
            this.drag.y = e.clientY;
            this.tick();
        } else if (this.handles()?.held) {
            this.handles()?.drag(e);
        } else if (this.pointers.size === 1) {
            if (e.buttons & 4 || e.ctrlKey) this.stage.pan(dx, dy);
            else this.stage.orbit(dx, dy);
        } else if (this.pointers.size === 2) {
            const other = /** @type {{x: number, y: number}} */ (
                [...this.pointers].find(([id]) => id !== e.pointerId)?.[1]
            );
            const before = Math.hypot(last.x - other.x, last.y - other.y);
            const after = Math.hypot(e.clientX - other.x, e.clientY - other.y);
            if (before > 1 && after > 1) this.stage.zoom(before / after);
            this.stage.pan(dx / 2, dy / 2);
        }
        last.x = e.clientX;
        last.y = e.clientY;
    }

    /** the mouse moves over the picture; null: it has left @param {{clientX: number, clientY: number} | null} e @param {boolean} byKeyboard */
    hover(e, byKeyboard = false) {
        this.mouse = e && { x: e.clientX, y: e.clientY, at: this.mouse?.at ?? -Infinity, picture: -1, byKeyboard };
        if (!e && this.pointers.size === 0) this.onHover(null);
    }

    /** what is under the mouse? While sculpting also when the picture has changed */
    look() {
        const { mouse, stage } = this;
        const now = performance.now();
        const sculpts = this.mode === "sculpt";
        if (!mouse || this.pointers.size || now - mouse.at < HOVER_MS) return;
        if (mouse.picture >= 0 && !(sculpts && stage.pictures > mouse.picture)) return;
        Object.assign(mouse, { at: now, picture: stage.pictures });
        const at = { clientX: mouse.x, clientY: mouse.y };
        const handle = this.handles()?.hover(at) ?? null;
        const hit = !handle && (this.enabled || sculpts) ? this.hit(at) : null;
        stage.canvas.classList.toggle("over", (handle ?? hit) !== null);
        if (sculpts) this.onHover(hit);
    }

    /** @param {PointerEvent} e */
    up(e) {
        this.pointers.delete(e.pointerId);
        const clickStart = this.clickStart;
        if (clickStart?.id === e.pointerId) {
            this.clickStart = null;
            if (e.type === "pointerup" && Math.hypot(e.clientX - clickStart.x, e.clientY - clickStart.y) < CLICK_PX)
                this.onClick(clickStart.at);
        }
        if (this.drag && this.drag.id === e.pointerId) this.release();
        this.handles()?.release();
        if (this.pointers.size === 0) this.stage.canvas.classList.remove("busy");
    }

    /** by keyboard @param {NonNullable<ToolTarget>} target */
    hold(target) {
        this.held = target;
        this.onTarget(target);
    }

    release() {
        if (!this.drag && !this.held) return;
        this.drag = this.held = null;
        this.onTarget(null);
    }

    /** @param {WheelEvent} e */
    wheel(e) {
        e.preventDefault();
        const amount = (e.deltaMode === 1 ? 16 : 1) * e.deltaY;
        if (this.drag) {
            this.drag.deeper -= amount * 1e-4 * this.stage.size;
            this.tick();
        } else {
            this.stage.choose(e);
            this.stage.zoom(Math.exp(amount * 0.0012));
        }
    }

    /** turns the instrument about its shaft @param {number} angle rad */
    roll(angle) {
        const held = this.drag ?? this.held;
        if (!held?.hand) return;
        held.hand = { ...held.hand, roll: held.hand.roll + angle };
        if (this.drag) this.tick();
        else if (this.held) this.hold(this.held);
    }

    /** updates the target; also called while the pointer rests, because a press deepens over time */
    tick() {
        const drag = this.drag;
        if (!drag) return this.look();
        const ray = this.stage.ray(drag.x, drag.y);
        const point = ray.intersectPlane(drag.plane, new THREE.Vector3());
        if (!point) return;
        const t = Math.min(1, (performance.now() - drag.start) / (1000 * PRESS_S));
        // a press begins with the ball outside and moves in along the view; a pull begins on the surface
        const depth = drag.grasp
            ? drag.deeper
            : -1.2 * this.radius + (drag.depth + 0.6 * this.radius) * t * t * (3 - 2 * t) + drag.deeper;
        point.addScaledVector(drag.into, depth);
        this.onTarget({ position: point.toArray(), grasp: drag.grasp, hand: drag.hand });
    }
}
