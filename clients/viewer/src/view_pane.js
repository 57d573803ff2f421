// A part of the canvas, and the view drawn there.

/**
 * What a pane can show. Drags are in units of the canvas's height.
 * @typedef {{
 *   kind: "free" | "endoscope",
 *   camera: import("./three.js").PerspectiveCamera,
 *   target: import("./three.js").Vector3,
 *   home: () => void,
 *   orbit: (dx: number, dy: number) => void,
 *   zoom: (factor: number) => void,
 *   pan: (dx: number, dy: number) => void,
 *   fit: (width: number, height: number, left: number, right: number, bottom: number) => void,
 *   place: () => void,
 *   depth: () => number,
 *   sees: (x: number, y: number) => boolean,
 *   draw: (camera: import("./three.js").PerspectiveCamera, render: () => void) => void,
 *   state: () => import("./saved_views.js").Shot,
 *   restore: (shot: import("./saved_views.js").Shot) => void,
 * }} View fit: into so many pixels, with margins that panels cover; place: moves the camera to where it belongs; depth: of
 *   the middle of the view, m; sees: is a pixel of the pane part of the picture; draw: with the lights of this view
 */

export class ViewPane {
    /** @type {((camera: import("./three.js").PerspectiveCamera) => import("./three.js").PerspectiveCamera) | null} camera
     * of an eye, null: the view's own */
    lens = null;

    /** @param {View} view @param {number} left @param {number} width shares of the canvas's width */
    constructor(view, left = 0, width = 1) {
        this.view = view;
        this.left = left;
        this.width = width;
        this.camera = view.camera;
    }

    /** on the canvas, pixels of the page @param {HTMLCanvasElement} canvas */
    box(canvas) {
        const width = canvas.clientWidth || 1;
        const x = Math.round(this.left * width);
        return { x, width: Math.round((this.left + this.width) * width) - x || 1, height: canvas.clientHeight || 1 };
    }

    /**
     * @param {HTMLCanvasElement} canvas
     * @param {number} left @param {number} right @param {number} bottom margins of the canvas, pixels
     */
    fit(canvas, left, right, bottom) {
        const { width, height } = this.box(canvas);
        this.view.fit(width, height, this.left === 0 ? left : 0, this.left + this.width === 1 ? right : 0, bottom);
    }

    place() {
        this.view.place();
        this.camera = this.lens ? this.lens(this.view.camera) : this.view.camera;
    }
}
