// A hand in a headset: a controller or a tracked hand, the rod it holds, and what its fingers do.
import { handAt } from "./instrument_pose.js";
import * as THREE from "./three.js";

const ROD_M = 0.1; // from the controller to the tip of its tool
const ROD_RADIUS_M = 0.003;
const PINCH_M = 0.02; // the same, of a tracked hand: between its fingers
const PULSE_MS = 30;
const PULSE_MIN_N = 0.05;

export class XrHand {
    trigger = false; // grasps tissue
    squeezes = false; // holds the scene
    tip = new THREE.Vector3(0, 0, -ROD_M);
    /** @type {XRInputSource | null} null: it is not there */
    source = null;

    /** @param {THREE.XRTargetRaySpace} space that three.js moves @param {() => void} onTrigger */
    constructor(space, onTrigger) {
        this.space = space;
        const material = new THREE.MeshStandardMaterial({ color: 0x9aa7b2, roughness: 0.4 });
        this.rod = new THREE.Mesh(new THREE.CylinderGeometry(ROD_RADIUS_M, ROD_RADIUS_M, 1, 12), material);
        this.rod.rotation.x = Math.PI / 2;
        space.add(this.rod);
        const on = (/** @type {keyof THREE.WebXRSpaceEventMap} */ type, /** @type {(event: any) => void} */ act) => {
            space.addEventListener(type, act);
            return () => space.removeEventListener(type, act);
        };
        this.listeners = [
            on("connected", ({ data }) => this.connect(data)),
            on("disconnected", () => this.connect(null)),
            on("selectstart", () => {
                this.trigger = true;
                onTrigger();
            }),
            on("selectend", () => (this.trigger = false)),
            on("squeezestart", () => (this.squeezes = true)),
            on("squeezeend", () => (this.squeezes = false)),
        ];
    }

    /** @param {XRInputSource | null} source */
    connect(source) {
        this.source = source;
        this.trigger = this.squeezes = false;
        const length = source?.hand ? PINCH_M : ROD_M;
        this.tip.set(0, 0, -length);
        this.rod.visible = source !== null;
        this.rod.scale.y = length;
        this.rod.position.z = -length / 2;
    }

    /** in the room, m @returns {number[]} */
    position() {
        return this.space.position.toArray();
    }

    /** where its tool is to be; null: away, because the hand is absent or holds the scene */
    target() {
        if (!this.source || this.squeezes || !this.space.visible) return null;
        const { matrixWorld } = this.space;
        const position = this.tip.clone().applyMatrix4(matrixWorld).toArray();
        // an instrument lies in the hand as the controller does
        const [from, up] = [new THREE.Vector3().setFromMatrixPosition(matrixWorld), new THREE.Vector3()];
        up.setFromMatrixColumn(matrixWorld, 1).normalize();
        return { position, grasp: this.trigger, hand: handAt(from.toArray(), position, up.toArray()) };
    }

    /** the controller shakes with the force on its tool @param {number} force N @param {number} cap N */
    feel(force, cap) {
        const actuator = this.source?.gamepad?.hapticActuators?.[0];
        if (actuator && force > PULSE_MIN_N) actuator.pulse(Math.min(1, force / cap), PULSE_MS)?.catch(() => {});
    }

    dispose() {
        for (const remove of this.listeners) remove();
        this.space.remove(this.rod);
        this.rod.geometry.dispose();
    }
}
