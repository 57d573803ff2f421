// Sends the poses of the own tool: at most one per POSE_MS while it moves, one per REST_MS while it rests.

const POSE_MS = 16;
const REST_MS = 50; // the server releases a silent tool
const GRASP_WAIT_MS = 1500; // longest wait for the server to grasp the tissue

/** @typedef {{position: number[], since: number}} Anchor */

export class PoseSender {
    /**
     * @param {import("./app_state.js").AppState} state
     * @param {(message: import("./link.js").WorkerMessage) => void} post
     */
    constructor(state, post) {
        this.state = state;
        this.post = post;
        /** @type {Anchor | null} where the present grasp began */
        this.anchor = null;
        this.away = true;
        this.sentAt = 0;
    }

    /**
     * Position to send: the target, but a grasp stays where it began until the server holds the tissue there. Only the
     * newest pose counts, so a fast drag would otherwise close the tool beside the organ.
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
            if (!moved && now - this.sentAt < REST_MS) return;
            if (moved && now - this.sentAt < POSE_MS / 2 && !this.away) return;
            const position = this.position(target, now);
            this.post({ type: "pose", tool: ownTool, position, grasp: target.grasp, away: false });
            this.away = false;
            this.sentAt = now;
        } else if (!this.away) {
            this.post({ type: "pose", tool: ownTool, position: null, grasp: false, away: true });
            this.away = true;
            this.anchor = null;
        }
    }
}
