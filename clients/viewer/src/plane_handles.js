// Handles of the section planes in the picture, while their panel is open: an arrow along the normal moves a plane, two
// rings turn it. They are TransformControls of three.js; ToolInput asks them first, so that a drag that begins at a
// handle does nothing else. A plane that faces the viewer has no arrow: its normal is a point in the picture.
import { TransformControls } from "../vendor/addons/controls/TransformControls.js";
import { shareAt } from "./section_planes.js";
import * as THREE from "./three.js";

const ARROW_SIZE = 1.3; // of the size that three.js gives them
const RING_SIZE = 0.85; // the heads of the arrow stand out
const ARROW_COLOUR = 0xffc46b;
const RING_COLOUR = 0x8fb8de;
const ACTIVE_COLOUR = 0xffffff;
const Z = new THREE.Vector3(0, 0, 1);

/** @typedef {{anchor: THREE.Object3D, arrow: TransformControls, rings: TransformControls}} Handle anchor: z is the normal */

export class PlaneHandles {
    /**
     * @param {import("./stage.js").Stage} stage
     * @param {import("./inside.js").Inside} inside whose planes have handles
     */
    constructor(stage, inside) {
        this.stage = stage;
        this.inside = inside;
        /** @type {TransformControls | null} what is dragged */
        this.held = null;
        this.handles = inside.planes.map((_, i) => this.makeHandle(i));
    }

    /** @param {number} i plane @returns {Handle} */
    makeHandle(i) {
        const { scene, camera } = this.stage;
        const anchor = new THREE.Object3D();
        scene.add(anchor);
        const [arrow, rings] = /** @type {const} */ (["translate", "rotate"]).map((mode) => {
            const control = new TransformControls(camera);
            control.setMode(mode);
            control.setSpace("local");
            scene.add(control.getHelper());
            return control;
        });
        arrow.showX = arrow.showY = false;
        rings.showZ = false;
        arrow.setSize(ARROW_SIZE);
        rings.setSize(RING_SIZE);
        arrow.setColors(ARROW_COLOUR, ARROW_COLOUR, ARROW_COLOUR, ACTIVE_COLOUR);
        rings.setColors(RING_COLOUR, RING_COLOUR, RING_COLOUR, ACTIVE_COLOUR);
        arrow.addEventListener("objectChange", () => this.inside.movePlane(i, this.shareOf(anchor, this.along(i))));
        rings.addEventListener("objectChange", () => {
            const along = Z.clone().applyQuaternion(anchor.quaternion);
            this.inside.turnPlane(i, along.toArray(), this.shareOf(anchor, along));
        });
        return { anchor, arrow, rings };
    }

    /** direction in which the slider of a plane moves it @param {number} i */
    along(i) {
        const { normal } = /** @type {import("./slice.js").Plane} */ (this.inside.section?.where(i));
        return new THREE.Vector3(...normal).multiplyScalar(this.inside.planes[i].flipped ? 1 : -1);
    }

    /** @param {THREE.Object3D} anchor @param {THREE.Vector3} along */
    shareOf(anchor, along) {
        const { hello } = this.inside.state;
        const box = hello ? [hello.box_min_m, hello.box_max_m] : [];
        return shareAt(along.toArray(), anchor.position.toArray(), box);
    }

    /** before a picture @param {boolean} shown */
    update(shown) {
        this.handles.forEach(({ anchor, arrow, rings }, i) => {
            const plane = shown ? this.inside.section?.where(i) : null;
            for (const control of [arrow, rings]) {
                control.camera = this.stage.camera;
                if (!plane) control.detach();
                else if (!control.object) control.attach(anchor);
            }
            // a plane that is dragged has its anchor where it is dragged to
            if (!plane || this.held === arrow || this.held === rings) return;
            const flat = new THREE.Plane(new THREE.Vector3(...plane.normal), plane.constant);
            flat.projectPoint(this.stage.centre, anchor.position);
            anchor.quaternion.setFromUnitVectors(Z, this.along(i));
        });
    }

    /** @param {{clientX: number, clientY: number}} e @param {number} button */
    pointer(e, button) {
        const { x, y } = this.stage.ndc(e.clientX, e.clientY);
        return /** @type {PointerEvent} */ (/** @type {unknown} */ ({ x, y, button }));
    }

    /** the part of a handle under a place, drawn bright; null: none @param {{clientX: number, clientY: number}} e */
    hover(e) {
        /** @type {TransformControls | null} */
        let found = null;
        this.stage.placeCameras();
        for (const control of this.handles.flatMap(({ arrow, rings }) => [arrow, rings])) {
            const before = control.axis;
            if (control.object && !found) control.pointerHover(this.pointer(e, -1));
            else control.axis = null;
            if (control.axis) found = control;
            if (control.axis !== before) this.stage.dirty = true;
        }
        return found;
    }

    /** begins a drag where a handle is @param {PointerEvent} e */
    take(e) {
        this.held = this.hover(e);
        if (!this.held) return false;
        this.held.getHelper().updateMatrixWorld(); // the plane in which this part moves
        this.held.pointerDown(this.pointer(e, 0));
        return true;
    }

    /** @param {PointerEvent} e */
    drag(e) {
        this.stage.placeCameras();
        this.held?.pointerMove(this.pointer(e, -1));
    }

    release() {
        this.held?.pointerUp(null);
        if (this.held) this.stage.dirty = true;
        this.held = null;
    }
}
