// A small cube whose faces name the directions of the patient, turned as the organ is. It exists only where the scene
// says how its axes lie in the patient. Pure but for the class: the cube is drawn by the page, not by the renderer.
import { text } from "./text.js";

/** @typedef {"R" | "L" | "A" | "P" | "S" | "I"} Side */
/** @typedef {[number, number, number]} Vector */

/** @type {Record<Side, Side>} the other side of each */
const OPPOSITE = { R: "L", L: "R", A: "P", P: "A", S: "I", I: "S" };
const SIDES = /** @type {Side[]} */ (Object.keys(OPPOSITE));
const HALF = 24; // pixels, of an edge

/** @param {Vector} a @param {number} s @returns {Vector} */
const scaled = (a, s) => [s * a[0], s * a[1], s * a[2]];
/** @param {Vector} a @param {Vector} b @returns {Vector} */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/**
 * Unit vectors of the scene that point to each side of the patient; null: the text is not one of axes.
 * @param {string} axes where x, y and z point, as in "RAS" @returns {Record<Side, Vector> | null}
 */
export function sidesOf(axes) {
    const sides = /** @type {Record<Side, Vector>} */ ({});
    [...axes].forEach((letter, axis) => {
        const side = SIDES.find((known) => known === letter);
        if (!side) return;
        sides[side] = /** @type {Vector} */ ([0, 1, 2].map((k) => Number(k === axis)));
        sides[OPPOSITE[side]] = scaled(sides[side], -1);
    });
    return axes.length === 3 && Object.keys(sides).length === 6 ? sides : null;
}

/**
 * Where the page's plane of a letter stands in the scene, as matrix3d: columns to the right of the letter, down from
 * it, out of it, and its middle. Superior is above the letters of the four sides around, anterior above the others.
 * @param {Side} side @param {Record<Side, Vector>} sides @returns {number[]}
 */
export function faceMatrix(side, sides) {
    const out = sides[side];
    const up = side === "S" || side === "I" ? sides.A : sides.S;
    const column = (/** @type {Vector} */ v, /** @type {number} */ w) => [...v, w];
    return [
        ...column(cross(up, out), 0),
        ...column(scaled(up, -1), 0),
        ...column(out, 0),
        ...column(scaled(out, HALF), 1),
    ];
}

/**
 * The turn from the scene to the page, whose y points down, as matrix3d.
 * @param {ArrayLike<number>} view of the camera: scene to camera, column-major 4 x 4 @returns {number[]}
 */
export function turnMatrix(view) {
    return Array.from({ length: 16 }, (none, k) =>
        k === 15 ? 1 : k > 11 || k % 4 === 3 ? 0 : k % 4 === 1 ? -view[k] : view[k],
    );
}

/**
 * The side of the patient that faces the camera most.
 * @param {Record<Side, Vector>} sides @param {ArrayLike<number>} view as above @returns {Side}
 */
export function facingSide(sides, view) {
    const towards = (/** @type {Side} */ side) =>
        sides[side][0] * view[2] + sides[side][1] * view[6] + sides[side][2] * view[10];
    return SIDES.reduce((best, side) => (towards(side) > towards(best) ? side : best));
}

const css = (/** @type {number[]} */ m) => `matrix3d(${m.map((v) => Number(v.toFixed(4))).join(",")})`;

export class OrientationCube {
    /** @param {HTMLElement} parent */
    constructor(parent) {
        this.parent = parent;
        this.axes = "";
        this.turned = "";
        /** @type {Record<Side, Vector> | null} */
        this.sides = null;
        /** @type {HTMLElement | null} */
        this.element = null;
    }

    /** @param {string} axes of the scene, "": not known @param {ArrayLike<number>} view scene to camera */
    show(axes, view) {
        if (axes !== this.axes) this.build(axes);
        if (!this.element || !this.sides) return;
        const turned = css(turnMatrix(view));
        if (turned === this.turned) return;
        this.turned = turned;
        const cube = /** @type {HTMLElement} */ (this.element.firstElementChild);
        cube.style.transform = turned;
        const label = text("orientation.label", { side: text(`orientation.${facingSide(this.sides, view)}`) });
        if (this.element.ariaLabel !== label) this.element.ariaLabel = label;
    }

    /** @param {string} axes */
    build(axes) {
        this.axes = axes;
        this.turned = "";
        this.sides = sidesOf(axes);
        this.element?.remove();
        this.element = null;
        if (!this.sides) return;
        this.element = Object.assign(document.createElement("div"), {
            id: "orientation",
            title: text("orientation.tip"),
        });
        this.element.role = "img";
        const cube = document.createElement("div");
        for (const side of SIDES) {
            const face = Object.assign(document.createElement("i"), { textContent: side });
            face.style.transform = css(faceMatrix(side, this.sides));
            cube.append(face);
        }
        this.element.append(cube);
        this.parent.append(this.element);
    }
}
