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

const GAP = 2; // pixels between two views; the pictures of the eyes are of equal size

export class ViewPane {
    /** @type {((camera: import("./three.js").PerspectiveCamera) => import("./three.js").PerspectiveCamera) | null} camera
     * of an eye, null: the view's own */
    lens = null;

    /**
     * @param {View} view
     * @param {number} from @param {number} to shares of the canvas, from left to right
     * @param {boolean} stacks from top to bottom on a page that is higher than wide
     */
    constructor(view, from = 0, to = 1, stacks = false) {
        this.view = view;
        this.from = from;
        this.to = to;
        this.stacks = stacks;
        this.camera = view.camera;
    }

    /** on the canvas, pixels of the page @param {{clientWidth: number, clientHeight: number}} canvas */
    box({ clientWidth, clientHeight }) {
        const [width, height] = [clientWidth || 1, clientHeight || 1];
        const stacked = this.stacks && height > width;
        const [start, end] = [this.from, this.to].map((share) => Math.round(share * (stacked ? height : width)));
        const begin = start && this.stacks ? start + GAP : start;
        const extent = Math.max(1, end - begin);
        return stacked ? { x: 0, y: begin, width, height: extent } : { x: begin, y: 0, width: extent, height };
    }

    /**
     * @param {HTMLCanvasElement} canvas
     * @param {number} left @param {number} right @param {number} bottom margins of the canvas, pixels
     */
    fit(canvas, left, right, bottom) {
        const { x, y, width, height } = this.box(canvas);
        const atRight = x + width === (canvas.clientWidth || 1);
        const atFoot = y + height === (canvas.clientHeight || 1);
        this.view.fit(width, height, x === 0 ? left : 0, atRight ? right : 0, atFoot ? bottom : 0);
    }

    place() {
        this.view.place();
        this.camera = this.lens ? this.lens(this.view.camera) : this.view.camera;
    }
}
