// The scene in a headset: both hands are tools, triggers grasp tissue, grips hold the scene to move, turn and scale it.
import { SecondHand } from "./second_hand.js";
import * as THREE from "./three.js";
import { XrHand } from "./xr_hand.js";
import { regrip, startRig } from "./xr_rig.js";

const NEAR_M = 0.02;
const FAR_M = 60;
const GROUND = 0x141b22;
const FORCE_N = 10; // of a full shake where a tool has no cap

/**
 * @typedef {{
 *   state: import("./app_state.js").AppState, stage: import("./stage.js").Stage, poses: import("./pose_sender.js").PoseSender[],
 *   second: import("./link.js").Wishes, picture: () => void
 * }} XrPage poses: of the own tools, the first of which is the page's; second: join of the second hand; picture: applies
 *   frames and draws
 */

export class XrView {
    /** @type {import("./xr_rig.js").Rig | null} null: the head has not been seen yet */
    place = null;
    /** @type {number[][]} hands that held the scene in the last picture, in the room */
    held = [];
    leader = 0; // hand of the page's own tool

    /** @param {XrPage} page @param {() => void} onEnd */
    constructor(page, onEnd) {
        this.page = page;
        const { scene, renderer, size } = page.stage;
        this.onEnd = onEnd;
        this.camera = new THREE.PerspectiveCamera(70, 1, NEAR_M, FAR_M);
        this.rig = new THREE.Group();
        this.floor = new THREE.GridHelper(8, 16, 0x4a5a66, 0x2a343c);
        this.rig.add(this.camera, this.floor);
        this.level = new THREE.Group(); // y of a room is up of the scene
        const [a, b] = page.stage.ground();
        this.level.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(a, page.stage.up, b.negate()));
        this.level.add(this.rig);
        scene.add(this.level);
        this.level.updateMatrixWorld(true);
        this.hands = [0, 1].map((i) => new XrHand(renderer.xr.getController(i), () => this.lead(i)));
        this.rig.add(...this.hands.map(({ space }) => space));
        this.background = scene.background;
        scene.background = new THREE.Color(GROUND);
        this.second = new SecondHand(page.second, () => size);
        page.poses.push(this.second.poses);
    }

    /** begins; a refusal of the browser is an error @param {XrPage} page @param {() => void} onEnd */
    static async start(page, onEnd) {
        const { xr } = /** @type {{xr: XRSystem}} */ (/** @type {unknown} */ (navigator));
        const session = await xr.requestSession("immersive-vr", { optionalFeatures: ["local-floor", "hand-tracking"] });
        const { renderer } = page.stage;
        const view = new XrView(page, onEnd);
        const ended = () => {
            renderer.xr.removeEventListener("sessionend", ended);
            view.end();
        };
        renderer.xr.addEventListener("sessionend", ended);
        renderer.xr.enabled = true;
        renderer.xr.setReferenceSpaceType("local-floor");
        await renderer.xr.setSession(session);
        page.stage.immersive = view;
        renderer.setAnimationLoop((_time, frame) => frame && view.frame(frame));
        return view;
    }

    /** with one tool only, the hand that triggers has it @param {number} i */
    lead(i) {
        if (this.second.state.ownTool < 0) this.leader = i;
    }

    /** the picture before the headset shows it @param {XRFrame} frame */
    frame(frame) {
        const { picture, poses, stage, state } = this.page;
        const space = stage.renderer.xr.getReferenceSpace();
        const pose = space && frame.getViewerPose(space);
        if (!pose) return;
        if (!this.place) this.begin(pose.transform);
        this.moveScene();
        const targets = this.hands.map((hand) => hand.target());
        const other = 1 - this.leader;
        state.target = targets[this.leader];
        this.second.state.target = targets[other];
        for (const sender of poses) sender.send(true);
        this.feel(this.hands[this.leader], state);
        this.feel(this.hands[other], this.second.state);
        stage.dirty = true; // the head moves
        picture();
    }

    /** @param {XrHand} hand @param {import("./app_state.js").AppState} own of the member whose tool it has */
    feel(hand, own) {
        const tool = own.ownToolState();
        const cap = this.page.state.hello?.tools[own.ownTool]?.force_cap_N ?? FORCE_N;
        if (tool && !tool.away) hand.feel(Math.hypot(...tool.force), cap);
    }

    /** the scene before the head @param {XRRigidTransform} head */
    begin({ position: p, orientation: q }) {
        const { stage } = this.page;
        const yaw = new THREE.Euler().setFromQuaternion(new THREE.Quaternion(q.x, q.y, q.z, q.w), "YXZ").y;
        const centre = this.level.worldToLocal(stage.centre.clone()).toArray();
        const { azimuth } = stage.free;
        this.place = startRig({ position: [p.x, p.y, p.z], yaw }, { centre, size: stage.size, azimuth });
    }

    /** grips hold the scene */
    moveScene() {
        const { place } = this;
        if (!place) return;
        const held = this.hands.filter(({ squeezes }) => squeezes).map((hand) => hand.position());
        // a hand that begins or ends to hold moves nothing
        if (held.length === this.held.length) this.place = regrip(place, this.held, held, this.page.stage.size);
        this.held = held;
        const { at, yaw, scale } = this.place ?? place;
        this.rig.position.fromArray(at);
        this.rig.rotation.y = yaw;
        this.rig.scale.setScalar(scale);
        this.level.updateMatrixWorld(true);
    }

    /** called by the stage */
    draw() {
        const { stage } = this.page;
        stage.free.place();
        stage.placeLights(stage.free);
        stage.renderer.render(stage.scene, this.camera);
    }

    end() {
        const { poses, stage, state } = this.page;
        const { renderer, scene } = stage;
        renderer.setAnimationLoop(null);
        renderer.xr.enabled = false;
        stage.immersive = null;
        scene.background = this.background;
        scene.remove(this.level);
        for (const hand of this.hands) hand.dispose();
        this.floor.dispose();
        poses.splice(poses.indexOf(this.second.poses), 1);
        this.second.leave();
        state.target = null;
        poses[0].send(true);
        stage.resize();
        this.onEnd();
    }
}
