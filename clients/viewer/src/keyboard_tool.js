// The tool by keyboard: Enter puts it on the organ in the middle of the picture, arrows and Page Up and Down move it,
// Enter or Escape lets go. While sculpting Enter points at the organ, and once more clicks.
import * as THREE from "./three.js";

const STEP = 0.01; // of the scene's size: way of the tool for one press of a key
const RINGS = 12; // about the middle of the picture in which the organ is looked for
/** direction of each key by the axes of the camera: right, up, towards the viewer @type {Record<string, number[]>} */
const MOVES = {
    ArrowLeft: [-1, 0, 0],
    ArrowRight: [1, 0, 0],
    ArrowUp: [0, 1, 0],
    ArrowDown: [0, -1, 0],
    PageUp: [0, 0, 1],
    PageDown: [0, 0, -1],
};

/** pixels around the middle of a picture, from the middle outwards @param {number} width @param {number} height */
export function* pixelsFromMiddle(width, height) {
    yield { x: width / 2, y: height / 2 };
    for (let ring = 1; ring <= RINGS; ring++)
        for (let k = 0; k < 6 * ring; k++) {
            const angle = (k * Math.PI) / (3 * ring);
            const r = (0.45 * ring) / RINGS;
            yield { x: width * (0.5 + r * Math.cos(angle)), y: height * (0.5 + r * Math.sin(angle)) };
        }
}

export class KeyboardTool {
    /**
     * @param {import("./stage.js").Stage} stage @param {import("./tool_input.js").ToolInput} input
     * @param {() => void} onBegin
     */
    constructor(stage, input, onBegin) {
        this.stage = stage;
        this.input = input;
        this.onBegin = onBegin;
    }

    /** @param {KeyboardEvent} e @returns {boolean} the key was for the tool */
    key(e) {
        if (e.ctrlKey || e.metaKey || e.altKey) return false;
        if (e.target instanceof HTMLInputElement || e.target instanceof HTMLSelectElement) return false;
        const { input, stage } = this;
        const held = input.held;
        if (!held)
            return e.key === "Enter" && (e.target === document.body || e.target === stage.canvas) && this.begin();
        if (e.key === "Enter" || e.key === "Escape") {
            input.release();
            return true;
        }
        const move = MOVES[e.key];
        if (!move) return false;
        const position = new THREE.Vector3()
            .fromArray(move)
            .multiplyScalar(STEP * stage.size)
            .applyQuaternion(stage.view.camera.quaternion)
            .add(new THREE.Vector3().fromArray(held.position));
        input.hold({ ...held, position: position.toArray() });
        return true;
    }

    begin() {
        const { input, stage } = this;
        const sculpts = input.mode === "sculpt";
        if (!(input.enabled || sculpts) || input.drag) return false;
        if (sculpts && input.mouse?.byKeyboard) return this.click(input.mouse);
        const { left, top } = stage.canvas.getBoundingClientRect();
        const box = stage.pane.box(stage.canvas);
        for (const { x, y } of pixelsFromMiddle(box.width, box.height)) {
            const at = { clientX: left + box.x + x, clientY: top + box.y + y };
            const hit = input.hit(at);
            if (!hit) continue;
            if (sculpts) {
                input.hover(at, true);
                return true;
            }
            // a press begins outside
            if (input.mode === "press") hit.point.addScaledVector(hit.normal, input.radius);
            const hand = input.handAt(hit.point);
            input.hold({ position: hit.point.toArray(), grasp: input.mode !== "press", hand });
            this.onBegin();
            return true;
        }
        return false;
    }

    /** while sculpting Enter first shows what lies in the middle of the picture, then clicks it @param {{x: number, y: number}} at */
    click({ x, y }) {
        const hit = this.input.hit({ clientX: x, clientY: y });
        if (hit) this.input.onClick(hit);
        else this.input.hover(null);
        return true;
    }
}
