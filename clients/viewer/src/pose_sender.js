// Sends the poses of the own tool: at most one per POSE_MS while it moves, one per REST_MS while it rests.
import { aim } from "./instrument_pose.js";

const POSE_MS = 16;
const REST_MS = 50; // the server releases a silent tool
const GRASP_WAIT_MS = 1500; // longest wait for the server to grasp the tissue
// m/s and sizes of the scene a second: half of the speed at which the server takes a motion for a jump and lifts the tool
const SPEED_M_S = 2.5;
const SPEED_SIZES_S = 10;

/** @typedef {{position: number[], since: number}} Anchor */

export class PoseSender {
    /**
     * @param {import("./app_state.js").AppState} state
     * @param {(message: import("./link.js").WorkerMessage) => void} post
     * @param {() => number} size of the scene, m
     */
    constructor(state, post, size) {
        this.state = state;
        this.post = post;
        this.size = size;
        /** @type {Anchor | null} where the present grasp began */
        this.anchor = null;
        this.away = true;
        this.sentAt = 0;
        /** @type {{position: number[], quaternion?: number[]} | null} the last pose; null: the tool was away */
        this.last = null;
        /** the tool has not reached its target yet, because the pointer was faster than a hand */
        this.behind = false;
    }

    /**
     * The position on the way to `target` that a hand reaches by now.
     * @param {number[]} target @param {number} now ms @returns {number[]}
     */
    reached(target, now) {
        const { last } = this;
        const speed = Math.max(SPEED_M_S, SPEED_SIZES_S * this.size());
        const far = last ? Math.hypot(...target.map((v, i) => v - last.position[i])) : 0;
        const share = (speed * Math.min(now - this.sentAt, REST_MS)) / 1000 / far;
        this.behind = far > 0 && share < 1;
        return last && this.behind ? last.position.map((v, i) => v + share * (target[i] - v)) : target;
    }

    /**
     * Position to send: the target, but a grasp stays where it began until the server holds the tissue there, so that
     * the tissue follows a fast drag from its first step on.
     * @param {{position: number[], grasp: boolean}} target @param {number} now ms
     */
    position(target, now) {
        if (!target.grasp) this.anchor = null;
        else if (!this.anchor) this.anchor = { position: target.position, since: now };
        if (!this.anchor) return target.position;
        const tool = this.state.ownToolState();
        const waits = now - this.anchor.since < GRASP_WAIT_MS && !(tool?.held && tool.grasps);
        if (!waits) this.anchor.since = -Infinity;
        return waits ? this.anchor.position : target.position;
    }

    /** @param {boolean} moved false: repeats a pose of a resting tool */
    send(moved) {
        const { target, ownTool } = this.state;
        if (ownTool < 0) return;
        const now = performance.now();
        if (target) {
            const moves = moved || this.behind;
            if (!moves && now - this.sentAt < REST_MS) return;
            if (moves && now - this.sentAt < POSE_MS / 2 && !this.away) return;
            const position = this.reached(this.position(target, now), now);
            this.last = { position, ...(target.hand && { quaternion: aim(target.hand, position) }) };
            this.post({ type: "pose", tool: ownTool, ...this.last, grasp: target.grasp, away: false });
            this.away = false;
            this.sentAt = now;
        } else if (!this.away) {
            this.post({ type: "pose", tool: ownTool, position: null, grasp: false, away: true });
            this.away = true;
            this.anchor = this.last = null;
            this.behind = false;
        }
    }
}
