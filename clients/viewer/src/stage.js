// The stage: renderer, light, camera and its orbit. Lengths are metres of the scene frame; `up` is the scene's.
import { makeBackdrop } from "./backdrop.js";
import { Pace } from "./pace.js";
import { makeEffects } from "./picture_effects.js";
import * as THREE from "./three.js";

const RATIO_MIN = 0.4; // drawn pixels per page pixel, where drawing is slow
const HOME_SHARE = 0.88; // of the picture's height: initial size of the scene's diagonal
const ZOOM_MIN = 0.45; // beside panels
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
        this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !software, powerPreference: "high-performance" });
        this.renderer.toneMapping = THREE.NeutralToneMapping;
        this.renderer.toneMappingExposure = 1.05;
        this.scene = new THREE.Scene();
        const light = window.matchMedia("(prefers-color-scheme: light)");
        this.scene.background = makeBackdrop(light.matches);
        light.addEventListener("change", () => {
            this.scene.background = makeBackdrop(light.matches);
            this.dirty = true;
        });
        this.camera = new THREE.PerspectiveCamera(32, 1, 0.001, 100);
        this.up = new THREE.Vector3(0, 0, 1);
        this.target = new THREE.Vector3();
        this.distance = 1;
        this.azimuth = -0.6; // around up, rad
        this.elevation = 0.42;
        this.size = 0.3; // diagonal of the scene, m
        this.middle = new THREE.Vector3(); // of the scene
        this.key = new THREE.DirectionalLight(0xfff5ea, 2.6);
        this.rim = new THREE.DirectionalLight(0xfff1e6, 1.0);
        this.fill = new THREE.DirectionalLight(0xfff0e8, 0.6); // from the camera and below: no visible side is black
        this.scene.add(this.key, this.rim, this.fill, new THREE.HemisphereLight(0xe9eaec, 0x3f3430, 0.85));
        this.scene.environment = makeStudio(this.renderer);
        this.scene.environmentIntensity = 0.75;
        this.left = this.right = this.bottom = 0; // margins that panels cover, pixels
        this.dirty = true;
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

    /** looks at a box, of the scene's rest shape @param {number[][]} box @param {number[]} up */
    frameBox(box, up) {
        const [low, high] = box;
        this.up.fromArray(up).normalize();
        this.middle.set((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
        this.target.copy(this.middle);
        this.size = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
        this.home();
    }

    /** distance of the initial view, which a narrow page increases */
    homeDistance() {
        return ((0.5 / HOME_SHARE) * this.size) / Math.tan((this.camera.fov * Math.PI) / 360) / this.narrow();
    }

    narrow() {
        return Math.max(0.5, Math.min(1, this.camera.aspect));
    }

    home() {
        this.distance = this.homeDistance();
        this.azimuth = -0.6;
        this.elevation = 0.42;
        this.dirty = true;
    }

    pixelRatio() {
        return Math.max(RATIO_MIN, this.pace.resolution * Math.min(window.devicePixelRatio || 1, 2));
    }

    resize() {
        const width = this.canvas.clientWidth || 1;
        const height = this.canvas.clientHeight || 1;
        this.sizeDue = true;
        const before = this.homeDistance();
        this.camera.aspect = width / height;
        this.distance *= this.homeDistance() / before;
        this.updateProjection();
    }

    /**
     * The scene stands in the middle of what panels leave free, and fits there.
     * @param {number} left @param {number} right @param {number} bottom covered margins, pixels
     */
    setMargins(left, right, bottom) {
        if (left === this.left && right === this.right && bottom === this.bottom) return;
        Object.assign(this, { left, right, bottom });
        this.updateProjection();
    }

    updateProjection() {
        const width = this.canvas.clientWidth || 1;
        const height = this.canvas.clientHeight || 1;
        const drawn = HOME_SHARE * height * this.narrow(); // diagonal of the scene in the first view
        const fits = [1, (width - this.left - this.right) / Math.min(width, drawn), (height - this.bottom) / drawn];
        this.camera.zoom = Math.max(ZOOM_MIN, Math.min(...fits));
        if (this.left === this.right && !this.bottom) this.camera.clearViewOffset();
        else this.camera.setViewOffset(width, height, (this.right - this.left) / 2, this.bottom / 2, width, height);
        this.camera.updateProjectionMatrix();
        this.dirty = true;
    }

    /** two unit vectors normal to up @returns {[THREE.Vector3, THREE.Vector3]} */
    ground() {
        const a = new THREE.Vector3(1, 0, 0);
        if (Math.abs(a.dot(this.up)) > 0.9) a.set(0, 1, 0);
        a.addScaledVector(this.up, -a.dot(this.up)).normalize();
        return [a, new THREE.Vector3().crossVectors(this.up, a)];
    }

    /** turn by pixels @param {number} dx @param {number} dy */
    orbit(dx, dy) {
        this.azimuth -= (dx / this.canvas.clientHeight) * 4;
        this.elevation = Math.max(-1.5, Math.min(1.5, this.elevation + (dy / this.canvas.clientHeight) * 4));
        this.dirty = true;
    }

    /** @param {number} factor of the distance */
    zoom(factor) {
        this.distance = Math.max(0.15 * this.size, Math.min(12 * this.size, this.distance * factor));
        this.dirty = true;
    }

    /** moves the target point by pixels @param {number} dx @param {number} dy */
    pan(dx, dy) {
        const perPixel =
            ((2 / this.camera.zoom) * this.distance * Math.tan((this.camera.fov * Math.PI) / 360)) /
            this.canvas.clientHeight;
        const e = this.camera.matrixWorld.elements;
        this.target.x += (-dx * e[0] + dy * e[4]) * perPixel;
        this.target.y += (-dx * e[1] + dy * e[5]) * perPixel;
        this.target.z += (-dx * e[2] + dy * e[6]) * perPixel;
        this.dirty = true;
    }

    placeCamera() {
        const [a, b] = this.ground();
        const flat = a.clone().multiplyScalar(Math.sin(this.azimuth)).addScaledVector(b, -Math.cos(this.azimuth));
        const away = flat.multiplyScalar(Math.cos(this.elevation)).addScaledVector(this.up, Math.sin(this.elevation));
        this.camera.position.copy(this.target).addScaledVector(away, this.distance);
        this.camera.up.copy(this.up);
        this.camera.near = Math.max(1e-3 * this.size, this.distance - 3 * this.size);
        this.camera.far = this.distance + 4 * this.size;
        this.camera.lookAt(this.target);
        this.camera.updateProjectionMatrix();
        this.camera.updateMatrixWorld();
        // the lights move with the camera, so that the visible side is lit
        const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
        this.key.position
            .copy(this.target)
            .addScaledVector(this.up, 1.2)
            .addScaledVector(right, -0.7)
            .addScaledVector(away, 0.9);
        this.key.target.position.copy(this.target);
        this.rim.position
            .copy(this.target)
            .addScaledVector(this.up, 0.5)
            .addScaledVector(right, 1.1)
            .addScaledVector(away, -1.0);
        this.rim.target.position.copy(this.target);
        this.fill.position
            .copy(this.target)
            .addScaledVector(away, 1)
            .addScaledVector(this.up, -0.6)
            .addScaledVector(right, 0.35);
        this.fill.target.position.copy(this.target);
        this.fill.target.updateMatrixWorld();
        this.key.target.updateMatrixWorld();
        this.rim.target.updateMatrixWorld();
    }

    /** is the last picture finished, and its pause over? */
    ready() {
        return this.pace.ready(performance.now());
    }

    /** a canvas that gets another size is blank until it is drawn, so both happen in one turn */
    applySize() {
        if (!this.sizeDue) return;
        this.sizeDue = false;
        this.renderer.setPixelRatio(this.pixelRatio());
        this.renderer.setSize(this.canvas.clientWidth || 1, this.canvas.clientHeight || 1, false);
    }

    /** draws when something changed */
    draw() {
        if (!this.dirty) return;
        this.dirty = false;
        this.applySize();
        this.placeCamera();
        this.pace.begin(performance.now());
        if (this.effects) this.effects.render();
        else this.renderer.render(this.scene, this.camera);
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
        const half = Math.tan((this.camera.fov * Math.PI) / 360) * this.distance;
        return ((this.canvas.clientHeight || 1) * this.camera.zoom) / (2 * half);
    }

    /** ray through a pixel @param {number} x @param {number} y client pixels @returns {THREE.Ray} */
    ray(x, y) {
        const box = this.canvas.getBoundingClientRect();
        const ndc = new THREE.Vector2(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
        this.placeCamera();
        const caster = new THREE.Raycaster();
        caster.setFromCamera(ndc, this.camera);
        return caster.ray;
    }

    /** client pixels of a point, null behind the camera @param {THREE.Vector3} point @returns {{x: number, y: number} | null} */
    project(point) {
        const p = point.clone().project(this.camera);
        if (p.z > 1) return null;
        return { x: ((p.x + 1) / 2) * this.canvas.clientWidth, y: ((1 - p.y) / 2) * this.canvas.clientHeight };
    }
}
