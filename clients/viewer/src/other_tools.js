// The tools of others as they are drawn: the network delivers their positions unevenly, and a hand does not jump.
import { mixed } from "./instrument_pose.js";

/** @typedef {import("./wire.js").Tool} Tool */

const APART_MAX_MS = 100; // a longer pause between two messages is no rhythm
const SHARE = 0.1; // of the newest interval in the mean

/** @param {Tool | undefined} tool */
const isThere = (tool) => tool?.held === true && !tool.away;

/**
 * Between two messages each tool moves evenly, from where it was drawn to where the newest one says, in the mean time
 * between messages.
 */
export class OtherTools {
    constructor() {
        /** @type {Tool[]} of the newest message */
        this.tools = [];
        /** @type {Tool[]} as each was drawn when that came */
        this.from = [];
        this.takenAt = -Infinity;
        this.apart = 1000 / 60;
    }

    /** @param {Tool[]} tools of a new message @param {number} now ms */
    take(tools, now) {
        const drawn = this.draw(now);
        const apart = now - this.takenAt;
        if (apart < APART_MAX_MS) this.apart += SHARE * (apart - this.apart);
        this.takenAt = now;
        this.from = tools.map((tool, i) => (isThere(tool) && isThere(drawn[i]) ? drawn[i] : tool));
        this.tools = tools;
    }

    /** @param {number} now ms */
    moving(now) {
        return now < this.takenAt + this.apart && this.tools.length > 0;
    }

    /** @param {number} now ms @returns {Tool[]} */
    draw(now) {
        const share = Math.min(1, Math.max(0, (now - this.takenAt) / this.apart));
        return this.tools.map((tool, i) => {
            if (!isThere(tool) || share === 1) return tool;
            const { position, quaternion } = this.from[i];
            return {
                ...tool,
                position: tool.position.map((v, k) => position[k] + share * (v - position[k])),
                quaternion: mixed(quaternion, tool.quaternion, share),
            };
        });
    }
}
