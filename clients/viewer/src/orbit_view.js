// The free view: its camera turns about a target point, with the scene's up axis upright.
import * as THREE from "./three.js";

const FOV_DEG = 32;
const HOME_SHARE = 0.88; // of the picture's height: initial size of the scene's diagonal
const ZOOM_MIN = 0.45; // beside panels
const HOME = { azimuth: -0.6, elevation: 0.42 }; // rad
const TURN = 4; // rad for a drag over the height of the picture
const ELEVATION_MAX = 1.57; // rad: at the pole the camera has no horizon

export class OrbitView {
    kind = /** @type {const} */ ("free");
    camera = new THREE.PerspectiveCamera(FOV_DEG, 1, 0.001, 100);
    target = new THREE.Vector3();
    distance = 1;
    azimuth = HOME.azimuth; // around up, rad
    elevation = HOME.elevation;

    /** @param {import("./stage.js").Stage} stage */
    constructor(stage) {
        this.stage = stage;
    }

    /** distance of the initial view, which a narrow page increases */
    homeDistance() {
        return ((0.5 / HOME_SHARE) * this.stage.size) / Math.tan((this.camera.fov * Math.PI) / 360) / this.narrow();
    }

    home() {
        this.target.copy(this.stage.centre);
        this.distance = this.homeDistance();
        Object.assign(this, HOME);
    }

    /** @param {number} dx @param {number} dy */
    orbit(dx, dy) {
        this.azimuth -= TURN * dx;
        this.elevation = Math.max(-ELEVATION_MAX, Math.min(ELEVATION_MAX, this.elevation + TURN * dy));
    }

    /** @param {number} factor */
    zoom(factor) {
        this.distance = Math.max(0.15 * this.stage.size, Math.min(12 * this.stage.size, this.distance * factor));
    }

    /** @param {number} dx @param {number} dy */
    pan(dx, dy) {
        const height = (2 / this.camera.zoom) * this.distance * Math.tan((this.camera.fov * Math.PI) / 360);
        const e = this.camera.matrixWorld.elements;
        this.target.x += (-dx * e[0] + dy * e[4]) * height;
        this.target.y += (-dx * e[1] + dy * e[5]) * height;
        this.target.z += (-dx * e[2] + dy * e[6]) * height;
    }

    narrow() {
        return Math.max(0.5, Math.min(1, this.camera.aspect));
    }

    /**
     * @param {number} width @param {number} height
     * @param {number} left @param {number} right @param {number} bottom covered margins
     */
    fit(width, height, left, right, bottom) {
        const before = this.homeDistance();
        this.camera.aspect = width / height;
        this.distance *= this.homeDistance() / before;
        const drawn = HOME_SHARE * height * this.narrow(); // diagonal of the scene in the first view
        const fits = [1, (width - left - right) / Math.min(width, drawn), (height - bottom) / drawn];
        this.camera.zoom = Math.max(ZOOM_MIN, Math.min(...fits));
        if (left === right && !bottom) this.camera.clearViewOffset();
        else this.camera.setViewOffset(width, height, (right - left) / 2, bottom / 2, width, height);
    }

    /** unit vector from the target to the camera */
    away() {
        const [a, b] = this.stage.ground();
        const flat = a.multiplyScalar(Math.sin(this.azimuth)).addScaledVector(b, -Math.cos(this.azimuth));
        return flat.multiplyScalar(Math.cos(this.elevation)).addScaledVector(this.stage.up, Math.sin(this.elevation));
    }

    place() {
        const { size, up } = this.stage;
        this.camera.position.copy(this.target).addScaledVector(this.away(), this.distance);
        this.camera.up.copy(up);
        this.camera.near = Math.max(1e-3 * size, this.distance - 3 * size);
        this.camera.far = this.distance + 4 * size;
        this.camera.lookAt(this.target);
        this.camera.updateProjectionMatrix();
        this.camera.updateMatrixWorld();
    }

    depth() {
        return this.distance;
    }

    sees() {
        return true;
    }

    /** @param {THREE.PerspectiveCamera} _camera @param {() => void} render */
    draw(_camera, render) {
        this.stage.placeLights(this);
        render();
    }

    /** @returns {import("./saved_views.js").Shot} */
    state() {
        const { target, distance, azimuth, elevation } = this;
        const near = distance / this.homeDistance(); // holds on a page of any shape
        return { kind: this.kind, values: { x: target.x, y: target.y, z: target.z, near, azimuth, elevation } };
    }

    /** @param {import("./saved_views.js").Shot} shot */
    restore({ values }) {
        this.target.set(values.x, values.y, values.z);
        this.distance = values.near * this.homeDistance();
        this.azimuth = values.azimuth;
        this.elevation = Math.max(-ELEVATION_MAX, Math.min(ELEVATION_MAX, values.elevation));
    }
}
