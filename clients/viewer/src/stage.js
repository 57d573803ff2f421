// The stage: renderer, light, and the panes of its canvas, one of which takes the input. Lengths are metres of the scene
// frame; `up` is the scene's.
import { makeBackdrop } from "./backdrop.js";
import { OrbitView } from "./orbit_view.js";
import { Pace } from "./pace.js";
import { makeEffects } from "./picture_effects.js";
import * as THREE from "./three.js";
import { ViewPane } from "./view_pane.js";

const RATIO_MIN = 0.4; // drawn pixels per page pixel, where drawing is slow
const POLL_MS = 2; // between checks whether a picture is finished

/** is there no graphics card? Some browsers report it, others only name the renderer */
function isSoftwareRenderer() {
    const context = document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: true });
    if (!context) return true;
    const named = context.getExtension("WEBGL_debug_renderer_info");
    const name = named ? String(context.getParameter(named.UNMASKED_RENDERER_WEBGL)) : "";
    context.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/**
 * Environment map of soft light panels, rendered once: glossy tissue needs something to reflect.
 * @param {THREE.WebGLRenderer} renderer
 * @returns {THREE.Texture}
 */
function makeStudio(renderer) {
    const studio = new THREE.Scene();
    const panel = (
        /** @type {number} */ strength,
        /** @type {string} */ colour,
        /** @type {number[]} */ at,
        /** @type {number[]} */ size,
    ) => {
        const material = new THREE.MeshBasicMaterial({ color: new THREE.Color(colour).multiplyScalar(strength) });
        const mesh = new THREE.Mesh(new THREE.BoxGeometry(size[0], size[1], size[2]), material);
        mesh.position.set(at[0], at[1], at[2]);
        studio.add(mesh);
    };
    const room = new THREE.Mesh(
        new THREE.SphereGeometry(10, 24, 16),
        new THREE.MeshBasicMaterial({ color: 0x2a2725, side: THREE.BackSide }),
    );
    studio.add(room);
    // lamps above, small and bright as in an operating room: their reflections in wet tissue are spots, not patches
    for (const [x, y] of [
        [-2.4, 1],
        [0, -2.2],
        [2.4, 1],
    ])
        panel(26, "#fff6ea", [x, y, 7], [1.3, 1.3, 0.2]);
    panel(0.9, "#fff4ea", [-7, 0, 2], [0.2, 7, 7]);
    panel(0.7, "#fff2e6", [7, -2, 1], [0.2, 6, 6]);
    panel(0.35, "#c9b7ab", [0, 0, -7], [9, 9, 0.2]); // light from below, weak
    const generator = new THREE.PMREMGenerator(renderer);
    const texture = generator.fromScene(studio, 0.035).texture;
    generator.dispose();
    for (const { geometry, material } of /** @type {THREE.Mesh<THREE.BufferGeometry, THREE.Material>[]} */ (
        studio.children
    )) {
        geometry.dispose();
        material.dispose();
    }
    return texture;
}

export class Stage {
    /** @param {HTMLCanvasElement} canvas */
    constructor(canvas) {
        this.canvas = canvas;
        const software = isSoftwareRenderer();
        this.renderer = new THREE.WebGLRenderer({
            canvas,
            antialias: !software,
            stencil: true, // caps of sections
            powerPreference: "high-performance",
        });
        this.renderer.toneMapping = THREE.NeutralToneMapping;
        this.renderer.toneMappingExposure = 1.05;
        this.scene = new THREE.Scene();
        const light = window.matchMedia("(prefers-color-scheme: light)");
        this.scene.background = makeBackdrop(light.matches);
        light.addEventListener("change", () => {
            this.scene.background = makeBackdrop(light.matches);
            this.dirty = true;
        });
        this.up = new THREE.Vector3(0, 0, 1);
        this.centre = new THREE.Vector3();
        this.size = 0.3; // diagonal of the scene, m
        this.free = new OrbitView(this);
        /** @type {import("./view_pane.js").View[]} all views that exist, shown or not */
        this.views = [this.free];
        this.panes = [new ViewPane(this.free)];
        this.pane = this.panes[0]; // the one under the pointer: it takes the input
        this.key = new THREE.DirectionalLight(0xfff5ea, 2.6);
        this.rim = new THREE.DirectionalLight(0xfff1e6, 1.0);
        this.fill = new THREE.DirectionalLight(0xfff0e8, 0.6); // from the camera and below: no visible side is black
        this.scene.add(this.key, this.rim, this.fill, new THREE.HemisphereLight(0xe9eaec, 0x3f3430, 0.85));
        this.scene.environment = makeStudio(this.renderer);
        this.scene.environmentIntensity = 0.75;
        /** @type {{draw: () => void} | null} what draws for a headset, at its pace */
        this.immersive = null;
        this.left = this.right = this.bottom = 0; // margins that panels cover, pixels
        this.dirty = true;
        this.pictures = 0; // drawn so far
        const ratio = Math.min(window.devicePixelRatio || 1, 2);
        this.pace = new Pace(RATIO_MIN / ratio, software ? 0.6 / ratio : 1);
        this.effects = makeEffects(this, software, new URLSearchParams(location.search).get("effects"));
        this.sizeDue = true; // the canvas has not the size of its element yet
        new ResizeObserver(() => this.resize()).observe(canvas);
        // moving to a screen with another pixel ratio keeps the size
        window.addEventListener("resize", () => this.resize());
        // three.js restores what it was given; a texture that was drawn is lost with the context
        canvas.addEventListener("webglcontextrestored", () => {
            this.scene.environment?.dispose();
            this.scene.environment = makeStudio(this.renderer);
            this.dirty = true;
        });
        this.resize();
    }

    /** of the pane under the pointer */
    get view() {
        return this.pane.view;
    }

    get camera() {
        return this.pane.camera;
    }

    get target() {
        return this.view.target;
    }

    /** looks at a box, of the scene's rest shape @param {number[][]} box @param {number[]} up */
    frameBox(box, up) {
        const [low, high] = box;
        this.up.fromArray(up).normalize();
        this.centre.set((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
        this.size = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
        for (const view of this.views) view.home();
        this.dirty = true;
    }

    pixelRatio() {
        return Math.max(RATIO_MIN, this.pace.resolution * Math.min(window.devicePixelRatio || 1, 2));
    }

    resize() {
        this.sizeDue = true;
        this.fit();
    }

    /**
     * The scene stands in the middle of what panels leave free, and fits there.
     * @param {number} left @param {number} right @param {number} bottom covered margins, pixels
     */
    setMargins(left, right, bottom) {
        if (left === this.left && right === this.right && bottom === this.bottom) return;
        Object.assign(this, { left, right, bottom });
        this.fit();
    }

    /** shows other panes @param {ViewPane[]} panes from left to right */
    setPanes(panes) {
        this.panes = panes;
        if (!panes.includes(this.pane)) this.pane = panes[0];
        this.fit();
    }

    /** fits the views into their panes */
    fit() {
        for (const pane of this.panes) pane.fit(this.canvas, this.left, this.right, this.bottom);
        this.placeCameras();
        this.dirty = true;
    }

    /** the pane at a point of the page @param {number} x @param {number} y client pixels */
    paneAt(x, y) {
        const { left, top } = this.canvas.getBoundingClientRect();
        const inside = (/** @type {ViewPane} */ pane) => {
            const box = pane.box(this.canvas);
            return x - left < box.x + box.width && y - top < box.y + box.height;
        };
        return this.panes.find(inside) ?? this.pane;
    }

    /** the pane under the pointer takes the input @param {{clientX: number, clientY: number}} pointer */
    choose({ clientX, clientY }) {
        const pane = this.paneAt(clientX, clientY);
        if (pane !== this.pane) this.dirty = true; // names stand in the pane that is worked in
        this.pane = pane;
    }

    /** two unit vectors normal to up @returns {[THREE.Vector3, THREE.Vector3]} */
    ground() {
        const a = new THREE.Vector3(1, 0, 0);
        if (Math.abs(a.dot(this.up)) > 0.9) a.set(0, 1, 0);
        a.addScaledVector(this.up, -a.dot(this.up)).normalize();
        return [a, new THREE.Vector3().crossVectors(this.up, a)];
    }

    home() {
        this.view.home();
        this.dirty = true;
    }

    /** turn by pixels @param {number} dx @param {number} dy */
    orbit(dx, dy) {
        this.view.orbit(dx / this.canvas.clientHeight, dy / this.canvas.clientHeight);
        this.dirty = true;
    }

    /** @param {number} factor of the distance */
    zoom(factor) {
        this.view.zoom(factor);
        this.dirty = true;
    }

    /** moves the target point by pixels @param {number} dx @param {number} dy */
    pan(dx, dy) {
        this.view.pan(dx / this.canvas.clientHeight, dy / this.canvas.clientHeight);
        this.dirty = true;
    }

    placeCameras() {
        for (const pane of this.panes) pane.place();
    }

    /** the lights move with the camera, so that the visible side is lit @param {OrbitView} view */
    placeLights({ camera, target }) {
        const right = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
        const away = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 2);
        this.key.position
            .copy(target)
            .addScaledVector(this.up, 1.2)
            .addScaledVector(right, -0.7)
            .addScaledVector(away, 0.9);
        this.rim.position
            .copy(target)
            .addScaledVector(this.up, 0.5)
            .addScaledVector(right, 1.1)
            .addScaledVector(away, -1.0);
        this.fill.position
            .copy(target)
            .addScaledVector(away, 1)
            .addScaledVector(this.up, -0.6)
            .addScaledVector(right, 0.35);
        for (const light of [this.key, this.rim, this.fill]) {
            light.target.position.copy(target);
            light.target.updateMatrixWorld();
        }
    }

    /** is the last picture finished, and its pause over? */
    ready() {
        return this.immersive !== null || this.pace.ready(performance.now());
    }

    /** a canvas that gets another size is blank until it is drawn, so both happen in one turn */
    applySize() {
        if (!this.sizeDue) return;
        this.sizeDue = false;
        this.renderer.setPixelRatio(this.pixelRatio());
        this.renderer.setSize(this.canvas.clientWidth || 1, this.canvas.clientHeight || 1, false);
    }

    /** draws the whole canvas as a camera sees the scene @param {THREE.PerspectiveCamera} camera */
    render(camera) {
        if (this.effects && this.view.kind === "free") this.effects.render(camera);
        else this.renderer.render(this.scene, camera);
    }

    drawPanes() {
        if (this.panes.length === 1) return this.view.draw(this.camera, () => this.render(this.camera));
        this.renderer.setScissorTest(true);
        for (const pane of this.panes) {
            const { x, y, width, height } = pane.box(this.canvas);
            const below = (this.canvas.clientHeight || 1) - y - height;
            this.renderer.setViewport(x, below, width, height);
            this.renderer.setScissor(x, below, width, height);
            pane.view.draw(pane.camera, () => this.renderer.render(this.scene, pane.camera));
        }
        this.renderer.setScissorTest(false);
        this.renderer.setViewport(0, 0, this.canvas.clientWidth || 1, this.canvas.clientHeight || 1);
    }

    /** draws when something changed */
    draw() {
        if (!this.dirty) return;
        this.dirty = false;
        this.pictures++;
        if (this.immersive) return this.immersive.draw();
        this.applySize();
        this.placeCameras();
        this.pace.begin(performance.now());
        this.drawPanes();
        // drawing continues after render returns: the fence signals its end
        const gl = /** @type {WebGL2RenderingContext} */ (this.renderer.getContext());
        const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        gl.flush();
        const poll = () => {
            if (fence && !gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) {
                setTimeout(poll, POLL_MS);
                return;
            }
            gl.deleteSync(fence);
            if (this.pace.done(performance.now())) this.resize();
            this.effects?.take(this.pace.costMs);
        };
        setTimeout(poll, POLL_MS);
    }

    /** of a metre at the depth of the middle of the view */
    pixelsPerMetre() {
        const half = Math.tan((this.camera.fov * Math.PI) / 360) * this.view.depth();
        return (this.pane.box(this.canvas).height * this.camera.zoom) / (2 * half);
    }

    /** place in the pane under the pointer, -1 to 1 from left to right and from below @param {number} x @param {number} y client pixels */
    ndc(x, y) {
        const outer = this.canvas.getBoundingClientRect();
        const box = this.pane.box(this.canvas);
        return new THREE.Vector2(
            ((x - outer.left - box.x) / box.width) * 2 - 1,
            1 - ((y - outer.top - box.y) / box.height) * 2,
        );
    }

    /** ray through a pixel @param {number} x @param {number} y client pixels @returns {THREE.Ray} */
    ray(x, y) {
        this.placeCameras();
        const caster = new THREE.Raycaster();
        caster.setFromCamera(this.ndc(x, y), this.camera);
        return caster.ray;
    }

    /** is a pixel part of the picture, not of its surround? @param {number} x @param {number} y client pixels */
    sees(x, y) {
        const outer = this.canvas.getBoundingClientRect();
        const box = this.pane.box(this.canvas);
        return this.view.sees(x - outer.left - box.x, y - outer.top - box.y);
    }

    /** client pixels of a point, null behind the camera @param {THREE.Vector3} point @returns {{x: number, y: number} | null} */
    project(point) {
        const p = point.clone().project(this.camera);
        if (p.z > 1) return null;
        const { x, y, width, height } = this.pane.box(this.canvas);
        return { x: x + ((p.x + 1) / 2) * width, y: y + ((1 - p.y) / 2) * height };
    }
}
