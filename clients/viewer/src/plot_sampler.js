// Samples of the time plots: what the tools do to the tissue, one row for each TOOLS message. Pure.
import { SampleRing } from "./sample_ring.js";

/**
 * @typedef {import("./wire.js").Tool} Tool
 * @typedef {{rest: Float32Array, visible: Uint32Array | null, position: {array: ArrayLike<number>}}} Surface a BodyMesh
 * @typedef {{key: string, tool: number, name: string, colour: number, cap: number | undefined}} Channel a member with a tool
 */

export const LENGTH_MAX_S = 120; // the longest history that is shown
const RATE_MAX_HZ = 70; // samples of a simulated second; servers send 60, and those of slow motion are thinned
const CHANNEL_LIMIT = 16; // members with a tool in two minutes; 8 tools change hands once
export const QUANTITIES = /** @type {const} */ (["force_N", "displacement_mm", "work_mJ"]);
/** @typedef {typeof QUANTITIES[number]} Quantity */
export const STEP = "step_ms";

/**
 * Displacement of the shown vertex that is nearest to a point, m.
 * @param {Iterable<Surface>} surfaces @param {number[]} point
 */
export function displacementAt(surfaces, [px, py, pz]) {
    let nearest = Infinity;
    let displacement = 0;
    for (const { rest, visible, position } of surfaces) {
        const x = position.array;
        const n = visible ? visible.length : rest.length / 3;
        for (let k = 0; k < n; k++) {
            const i = 3 * (visible ? visible[k] : k);
            const distance = (x[i] - px) ** 2 + (x[i + 1] - py) ** 2 + (x[i + 2] - pz) ** 2;
            if (distance >= nearest) continue;
            nearest = distance;
            displacement = (x[i] - rest[i]) ** 2 + (x[i + 1] - rest[i + 1]) ** 2 + (x[i + 2] - rest[i + 2]) ** 2;
        }
    }
    return Math.sqrt(displacement);
}

/** work of a tool from one message to the next, J: minus the mean force of the tissue along the way @param {Tool} a @param {Tool} b */
export const workBetween = (a, b) =>
    b.position.reduce((sum, x, k) => sum - ((a.force[k] + b.force[k]) / 2) * (x - a.position[k]), 0);

/** @param {Tool} tool */
const touches = (tool) => tool.held && !tool.away && tool.force.some((f) => f !== 0);

export class PlotSampler {
    constructor() {
        this.ring = new SampleRing(LENGTH_MAX_S * RATE_MAX_HZ, CHANNEL_LIMIT * QUANTITIES.length + 1);
        /** @type {Map<string, Channel>} by key */
        this.channels = new Map();
        /** @type {Tool[]} of the last message */
        this.last = [];
        /** @type {number[]} of each tool since it touched, J */
        this.work = [];
    }

    /**
     * @param {number} time of the simulation, s @param {Tool[]} tools
     * @param {{surfaces: Iterable<Surface>, stepMs: number | undefined, nameOf: (tool: Tool, index: number) => string,
     *   capOf: (index: number) => number | undefined}} scene
     */
    take(time, tools, { surfaces, stepMs, nameOf, capOf }) {
        // each message counts to the work, also those that are no sample
        this.work = tools.map((tool, i) => {
            const before = this.last[i];
            const same = before && touches(before) && touches(tool) && before.holder === tool.holder;
            return same ? this.work[i] + workBetween(before, tool) : 0;
        });
        this.last = tools;
        const { ring } = this;
        if (time > ring.lastTime && time < ring.lastTime + 1 / RATE_MAX_HZ) return;
        /** @type {Record<string, number>} */
        const row = stepMs === undefined ? {} : { [STEP]: stepMs };
        tools.forEach((tool, i) => {
            if (!tool.held) return;
            const key = `${i}:${tool.holder}`;
            this.channels.set(key, { key, tool: i, name: nameOf(tool, i), colour: tool.colour, cap: capOf(i) });
            const touching = touches(tool);
            row[`${key}:force_N`] = touching ? Math.hypot(...tool.force) : 0;
            row[`${key}:displacement_mm`] = touching ? 1e3 * displacementAt(surfaces, tool.position) : 0;
            row[`${key}:work_mJ`] = 1e3 * this.work[i];
        });
        ring.push(time, row);
        for (const key of this.channels.keys()) if (!ring.columns.has(`${key}:force_N`)) this.channels.delete(key); // forgotten, or one too many
    }

    /** channels in the order of their tools; two of the same name get the numbers of their tools @returns {Channel[]} */
    list() {
        const channels = [...this.channels.values()].sort((a, b) => a.tool - b.tool);
        return channels.map((channel) =>
            channels.some((other) => other !== channel && other.name === channel.name)
                ? { ...channel, name: `${channel.name} ${channel.tool + 1}` }
                : channel,
        );
    }
}
