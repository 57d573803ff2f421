// Samples of the time plots: what the tools do to the tissue, one row for each TOOLS message. Pure.
import { normalAt } from "./normals.js";
import { SampleRing } from "./sample_ring.js";

/**
 * @typedef {import("./wire.js").Tool} Tool
 * @typedef {{rest: Float32Array, triangles: () => Uint32Array, visible: Uint32Array | null, position: {array: ArrayLike<number>}}} Surface a BodyMesh
 * @typedef {{key: string, tool: number, name: string, colour: number, cap: number | undefined}} Channel a member with a tool
 */

export const LENGTH_MAX_S = 120; // the longest history that is shown
const RATE_MAX_HZ = 70; // samples of a simulated second; servers send 60, and those of slow motion are thinned
const CHANNEL_LIMIT = 16; // members with a tool in two minutes; 8 tools change hands once
export const QUANTITIES = /** @type {const} */ (["force_N", "displacement_mm", "depth_mm", "work_mJ"]);
/** @typedef {typeof QUANTITIES[number]} Quantity */
export const STEP = "step_ms";
/** of all bodies whose energies the server knows */
export const ENERGIES = /** @type {const} */ (["energy_mJ", "kinetic_mJ"]);

/**
 * The shown vertex that is nearest to a point.
 * @param {Surface[]} surfaces @param {number[]} point @param {(surface: Surface) => ArrayLike<number>} positions where vertices are
 */
function nearestVertex(surfaces, [px, py, pz], positions) {
    let nearest = Infinity;
    /** @type {{surface: Surface, i: number} | null} i: of its x in the arrays */
    let found = null;
    for (const surface of surfaces) {
        const { rest, visible } = surface;
        const x = positions(surface);
        const n = visible ? visible.length : rest.length / 3;
        for (let k = 0; k < n; k++) {
            const i = 3 * (visible ? visible[k] : k);
            const distance = (x[i] - px) ** 2 + (x[i + 1] - py) ** 2 + (x[i + 2] - pz) ** 2;
            if (distance >= nearest) continue;
            nearest = distance;
            found = { surface, i };
        }
    }
    return found;
}

/** displacement of the surface at a point, m @param {Surface[]} surfaces @param {number[]} point */
export function displacementAt(surfaces, point) {
    const found = nearestVertex(surfaces, point, ({ position }) => position.array);
    if (!found) return 0;
    const { rest, position } = found.surface;
    return Math.hypot(...[0, 1, 2].map((c) => position.array[found.i + c] - rest[found.i + c]));
}

/**
 * How far a ball reaches below the surface at rest, m; negative: it is so far above it.
 * @param {Surface[]} surfaces @param {number[]} centre @param {number} radius m
 */
export function depthAt(surfaces, centre, radius) {
    const found = nearestVertex(surfaces, centre, ({ rest }) => rest);
    if (!found) return 0;
    const { rest } = found.surface;
    const normal = normalAt(rest, found.surface.triangles(), found.i / 3);
    return radius - centre.reduce((sum, p, c) => sum + (p - rest[found.i + c]) * normal[c], 0);
}

/**
 * Total and kinetic energy of the bodies, as far as the server knows them.
 * @param {{kinetic_J: number, elastic_J: number}[] | undefined} energies @returns {Record<string, number>}
 */
export function energyRow(energies) {
    const kinetic = (energies ?? []).reduce((sum, { kinetic_J }) => sum + kinetic_J, 0);
    const elastic = (energies ?? []).reduce((sum, { elastic_J }) => sum + elastic_J, 0);
    return energies?.length ? { energy_mJ: 1e3 * (kinetic + elastic), kinetic_mJ: 1e3 * kinetic } : {};
}

/** work of a tool from one message to the next, J: minus the mean force of the tissue along the way @param {Tool} a @param {Tool} b */
export const workBetween = (a, b) =>
    b.position.reduce((sum, x, k) => sum - ((a.force[k] + b.force[k]) / 2) * (x - a.position[k]), 0);

/** @param {Tool} tool */
const touches = (tool) => tool.held && !tool.away && tool.force.some((f) => f !== 0);

export class PlotSampler {
    constructor() {
        this.ring = new SampleRing(LENGTH_MAX_S * RATE_MAX_HZ, CHANNEL_LIMIT * QUANTITIES.length + 1 + ENERGIES.length);
        /** @type {Map<string, Channel>} by key */
        this.channels = new Map();
        /** @type {Tool[]} of the last message */
        this.last = [];
        /** @type {number[]} of each tool since it touched, J */
        this.work = [];
    }

    /**
     * @param {number} time of the simulation, s @param {Tool[]} tools
     * @param {{surfaces: Surface[], stepMs: number | undefined, nameOf: (tool: Tool, index: number) => string,
     *   capOf: (index: number) => number | undefined, radiusOf: (index: number) => number,
     *   energies: {kinetic_J: number, elastic_J: number}[] | undefined}} scene
     */
    take(time, tools, { surfaces, stepMs, nameOf, capOf, radiusOf, energies }) {
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
        const row = { ...(stepMs !== undefined && { [STEP]: stepMs }), ...energyRow(energies) };
        tools.forEach((tool, i) => {
            if (!tool.held) return;
            const key = `${i}:${tool.holder}`;
            this.channels.set(key, { key, tool: i, name: nameOf(tool, i), colour: tool.colour, cap: capOf(i) });
            const touching = touches(tool);
            row[`${key}:force_N`] = touching ? Math.hypot(...tool.force) : 0;
            row[`${key}:displacement_mm`] = touching ? 1e3 * displacementAt(surfaces, tool.position) : 0;
            row[`${key}:depth_mm`] = touching ? 1e3 * depthAt(surfaces, tool.position, radiusOf(i)) : 0;
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
