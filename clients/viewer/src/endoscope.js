// The view through an endoscope: wide angle, a light beside the lens and no other, haze with depth, a round picture in a
// dark surround. Its shaft turns about a port and is inserted and withdrawn; optics of 30 degrees look aside from it.
import { CAVITY_RADIUS, makeCavity } from "./cavity.js";
import { makeMask } from "./scope_mask.js";
import { aim, direction, pivot, roundPicture, scopeView } from "./scope_pose.js";
import * as THREE from "./three.js";

const FOV_DEG = 72; // across the round picture, as of usual laparoscopes
const PORT = 0.96 * CAVITY_RADIUS; // of the scene's size: distance of the port from the middle of the scene
const TIP = 0.58; // the same, of the tip at first: the scene fills most of the picture
const DEPTH_MIN = 0.04;
const DEPTH_MAX = 1.5 * CAVITY_RADIUS;
const CLEAR = 0.09; // of the scene's size: the lens stays off the tissue, or it would see nothing
const LAMP = 0.012; // of the scene's size, from the middle of the lens
const LIGHT = 3.4; // on tissue in the middle of the picture: the camera's exposure follows its distance
const DECAY = 1.15; // with distance; light decays with its square, of which the camera of an endoscope evens out a part
const EXPOSURE = [0.16, 1.0]; // of the scene's size: distances that the exposure follows
const AMBIENT = 0.12; // light that the walls of the abdomen throw back
const REFLECTED = 0.06; // of the studio of the free view
const HAZE = { colour: 0x1c0806, near: 0.4, far: 3.0 }; // of the scene's size
const PIVOT = 0.6; // of the field of view for a drag over the picture: near tissue then follows the pointer
const ROLL = 3; // rad for a drag over the picture

/** @typedef {import("./scope_pose.js").ScopePose} ScopePose */

export class Endoscope {
    kind = /** @type {const} */ ("endoscope");
    camera = new THREE.PerspectiveCamera(FOV_DEG);
    /** @type {ScopePose} */
    pose = { port: [0, 0, 0], yaw: 0, pitch: 0, depth: 0, angle: 0, turn: 0, roll: 0 };
    round = { x: 0, y: 0, radius: 1 };
    middle = 1; // distance of the tissue in the middle of the picture, m
    placed = false; // the camera is where the pose says
    dress = new THREE.Group();
    lamp = new THREE.PointLight(0xfff6ef, 1, 0, DECAY);
    fog = new THREE.Fog(HAZE.colour);
    background = new THREE.Color(HAZE.colour);
    mask = makeMask();

    /**
     * @param {import("./stage.js").Stage} stage
     * @param {(ray: THREE.Ray) => import("./picking.js").Hit | null} pick
     */
    constructor(stage, pick) {
        this.stage = stage;
        this.pick = pick;
        this.home();
    }

    get target() {
        return this.stage.centre;
    }

    /** @returns {import("./scope_pose.js").Ground} */
    ground() {
        const [a, b] = this.stage.ground();
        return { a: a.toArray(), b: b.toArray(), up: this.stage.up.toArray() };
    }

    /** yaw and pitch of a shaft from the port to the middle of the scene */
    straight() {
        const { a, b, up } = this.ground();
        const away = new THREE.Vector3().fromArray(this.pose.port).sub(this.stage.centre).normalize();
        const along = (/** @type {number[]} */ axis) => away.dot(new THREE.Vector3().fromArray(axis));
        return { yaw: Math.atan2(along(a), -along(b)), pitch: Math.asin(Math.max(-1, Math.min(1, along(up)))) };
    }

    /** the port is where the free view looks from; the optics look at the middle of the scene */
    home() {
        const { centre, free, size } = this.stage;
        const away = direction(this.ground(), free.azimuth, free.elevation);
        const port = away.map((c, k) => centre.getComponent(k) + PORT * size * c);
        const depth = (PORT - TIP) * size;
        const pitch = free.elevation - aim(this.pose.angle, depth / (PORT * size));
        this.take({ ...this.pose, port, yaw: free.azimuth, pitch, depth, turn: 0, roll: 0 });
        if (this.builtFor !== size) this.build();
    }

    /** what the lamp shines on has the size of the scene */
    build() {
        const { scene, size, up } = this.stage;
        this.builtFor = size;
        this.dress.clear();
        this.dress.add(this.lamp, new THREE.AmbientLight(0xffc4b0, AMBIENT), makeCavity(size, up));
        this.dress.visible = false;
        scene.add(this.dress);
        this.fog.near = HAZE.near * size;
        this.fog.far = HAZE.far * size;
    }

    /** @param {ScopePose} pose */
    take(pose) {
        const { size } = this.stage;
        const { tip, shaft } = scopeView({ ...pose, depth: 0 }, this.ground());
        const ahead = this.reach(tip, shaft);
        const limit = Math.min(DEPTH_MAX * size, ahead - CLEAR * size);
        this.pose = { ...pose, depth: Math.max(DEPTH_MIN * size, Math.min(limit, pose.depth)) };
        this.placed = false;
    }

    /** distance of tissue from a point, Infinity if there is none @param {number[]} from @param {number[]} along */
    reach(from, along) {
        const ray = new THREE.Ray(new THREE.Vector3().fromArray(from), new THREE.Vector3().fromArray(along));
        return this.pick(ray)?.distance ?? Infinity;
    }

    /** optics that look aside from the shaft @param {number} degrees */
    setAngle(degrees) {
        this.pose.angle = (degrees * Math.PI) / 180;
        this.home();
    }

    /** @param {number} dx @param {number} dy */
    orbit(dx, dy) {
        const scale = (PIVOT * FOV_DEG * Math.PI) / 180;
        this.take(pivot(this.pose, this.straight(), scale * dx, scale * dy));
    }

    /** inserts and withdraws @param {number} factor below 1 inserts */
    zoom(factor) {
        const range = DEPTH_MAX * this.stage.size;
        this.take({ ...this.pose, depth: this.pose.depth - 0.5 * range * Math.log(factor) });
    }

    /** turns angled optics about the shaft, else rolls the horizon @param {number} dx */
    pan(dx) {
        const key = this.pose.angle ? "turn" : "roll";
        this.take({ ...this.pose, [key]: this.pose[key] - ROLL * dx });
    }

    /**
     * @param {number} width @param {number} height
     * @param {number} left @param {number} right @param {number} bottom covered margins
     */
    fit(width, height, left, right, bottom) {
        this.round = roundPicture(width, height, { left, right, bottom });
        const half = (Math.tan((FOV_DEG * Math.PI) / 360) * height) / 2 / this.round.radius;
        this.camera.fov = (2 * Math.atan(half) * 180) / Math.PI;
        this.camera.aspect = width / height;
        const { x, y } = this.round;
        if (left === right && !bottom) this.camera.clearViewOffset();
        else this.camera.setViewOffset(width, height, width / 2 - x, height / 2 - y, width, height);
        this.mask.size.set(width, height);
        this.mask.round.set(this.round.x, this.round.y, this.round.radius);
        this.placed = false;
    }

    place() {
        if (this.placed) return;
        this.placed = true;
        const { size } = this.stage;
        const { camera } = this;
        const { tip, basis } = scopeView(this.pose, this.ground());
        const [x, y, z] = basis.map((axis) => new THREE.Vector3().fromArray(axis));
        camera.position.fromArray(tip);
        camera.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(x, y, z));
        camera.near = 0.004 * size;
        camera.far = 4 * size;
        camera.updateProjectionMatrix();
        camera.updateMatrixWorld();
        const ahead = this.reach(tip, z.clone().negate().toArray());
        if (ahead < Infinity) this.middle = ahead;
        const exposed = Math.max(EXPOSURE[0] * size, Math.min(EXPOSURE[1] * size, this.middle));
        this.lamp.position.copy(camera.position).addScaledVector(y, LAMP * size);
        this.lamp.intensity = LIGHT * exposed ** DECAY;
        this.mask.notch.value = this.pose.turn - this.pose.roll;
    }

    depth() {
        return this.middle;
    }

    /** is a pixel of the pane in the round picture? @param {number} x @param {number} y */
    sees(x, y) {
        return Math.hypot(x - this.round.x, y - this.round.y) < this.round.radius;
    }

    /** @param {THREE.PerspectiveCamera} _camera @param {() => void} render */
    draw(_camera, render) {
        const { renderer, scene } = this.stage;
        const { background, environmentIntensity } = scene;
        const lights = scene.children.filter((child) => child instanceof THREE.Light && child.visible);
        for (const light of lights) light.visible = false;
        this.dress.visible = true;
        this.dress.children[2].position.copy(this.stage.centre);
        Object.assign(scene, { fog: this.fog, background: this.background, environmentIntensity: REFLECTED });
        render();
        Object.assign(scene, { fog: null, background, environmentIntensity });
        this.dress.visible = false;
        for (const light of lights) light.visible = true;
        renderer.autoClear = false;
        renderer.render(this.mask.scene, this.mask.camera);
        renderer.autoClear = true;
    }

    /** @returns {import("./saved_views.js").Shot} */
    state() {
        const { port, ...rest } = this.pose;
        return { kind: this.kind, values: { x: port[0], y: port[1], z: port[2], ...rest } };
    }

    /** @param {import("./saved_views.js").Shot} shot */
    restore({ values: { x, y, z, yaw, pitch, depth, angle, turn, roll } }) {
        this.take({ port: [x, y, z], yaw, pitch, depth, angle, turn, roll });
    }
}
