// The bodies on the stage: a body of a new topology replaces the shown one with its first frame, and the newest frame of
// each part is applied once per drawn picture.
import { BodyMesh } from "./body_mesh.js";
import { showImages } from "./surface_image.js";
import { BufferAttribute } from "./three.js";
import { lookOf } from "./tissue_looks.js";

export const UNSEEN = 2e-5; // motion in units of the scene's size that is not worth a new picture: below 1/20 pixel

/** @typedef {import("./link.js").FrameArrays} FrameArrays */

export class BodySet {
    /**
     * @param {import("./app_state.js").AppState} state
     * @param {import("./stage.js").Stage} stage
     * @param {(part: number, arrays: FrameArrays) => void} giveBack takes arrays that the worker may reuse
     */
    constructor(state, stage, giveBack) {
        this.state = state;
        this.stage = stage;
        this.giveBack = giveBack;
        this.pending = state.pendingBodies;
        /** @type {BodyMesh[]} replaced, until the next picture: what they share with the renderer is kept */
        this.retired = [];
        /** @type {Map<number, FrameArrays & {shown: import("./topology_delta.js").Shown | null}>} newest frame of each part
         * that is not drawn yet, with the newest triangles since the last drawn one */
        this.frames = new Map();
    }

    /** removes parts from index n on @param {number} n */
    truncate(n) {
        for (const [part, body] of this.state.bodies) {
            if (part < n) continue;
            body.dispose();
            this.pending.get(part)?.dispose();
            this.state.bodies.delete(part);
            this.pending.delete(part);
            this.frames.delete(part);
        }
        this.stage.dirty = true;
    }

    /** @param {Extract<import("./link.js").PageMessage, {type: "part"}>} message */
    takePart({ part, epoch, rest, look, uv, originals, triangles, visible }) {
        this.pending.get(part)?.dispose();
        this.frames.delete(part); // of the older topology
        const { appearance, colour, images } = this.state.parts[part] ?? {};
        const tissue = lookOf(appearance, colour);
        const body = new BodyMesh(this.stage.scene, rest, triangles, visible, tissue, originals);
        if (look) body.geometry.setAttribute("look", new BufferAttribute(look, 1));
        if (uv && images?.length) showImages(body, uv, images, tissue.colour, this.stage);
        const waits = this.state.bodies.has(part);
        body.epoch = epoch;
        body.appear(!waits);
        this.pending.delete(part);
        if (waits) this.pending.set(part, body);
        else this.show(part, body);
    }

    /** @param {Extract<import("./link.js").PageMessage, {type: "frame"}>} message */
    takeFrame({ part, positions, normals, shown }) {
        const older = this.frames.get(part);
        if (older) this.giveBack(part, older);
        this.frames.set(part, { positions, normals, shown: shown ?? older?.shown ?? null });
    }

    /** in place of the former body @param {number} part @param {BodyMesh} body */
    show(part, body) {
        const former = this.state.bodies.get(part);
        if (former) {
            former.appear(false);
            body.colours.adopt(former.colours, performance.now());
            this.retired.push(former);
        }
        body.appear(true);
        body.wireframe(this.state.wireframe);
        this.state.bodies.set(part, body);
        this.state.countVertices();
        this.stage.dirty = true;
    }

    /** applies the newest frames @returns {boolean} the picture changes */
    applyFrames() {
        let changed = false;
        for (const [part, frame] of this.frames) {
            const next = this.pending.get(part);
            if (next) {
                this.pending.delete(part);
                this.show(part, next);
            }
            const body = this.state.bodies.get(part);
            if (!body || body.rest.length !== frame.positions.length) continue;
            this.frames.delete(part);
            const differs = frame.shown !== null || !body.near(frame.positions, UNSEEN * this.stage.size);
            if (frame.shown) {
                body.reshape(frame.shown);
                this.state.countVertices();
            }
            this.giveBack(part, differs ? body.take(frame.positions, frame.normals) : frame);
            changed ||= differs;
        }
        return changed;
    }

    /** after a picture */
    disposeRetired() {
        for (const body of this.retired.splice(0)) body.dispose();
    }

    /** nearest hit of a ray @param {import("./three.js").Ray} ray @returns {(import("./picking.js").Hit & {part: number}) | null} */
    pick(ray) {
        let nearest = null;
        for (const [part, body] of this.state.bodies) {
            const hit = body.pick(ray);
            if (hit && (!nearest || hit.distance < nearest.distance)) nearest = { ...hit, part };
        }
        return nearest;
    }
}
