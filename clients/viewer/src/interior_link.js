// The interiors of the parts, in the worker: the asset of an interior is fetched when its first message comes, so that
// nobody loads what nobody looks at. The newest message waits for it.
import { assetAddress, decodeAsset } from "./asset.js";
import { decodeInterior, readInteriorHead, tetrahedraOf } from "./interior_decoder.js";

/**
 * @typedef {{type: "interior_mesh", part: number, epoch: number, rest: Float32Array, tets: Uint32Array}} InteriorMesh
 * @typedef {{type: "interior", part: number, epoch: number, name: string, low: number, high: number,
 *   move: Float32Array, level: Uint8Array}} InteriorValues
 * @typedef {{epoch: number, n: number, early: Uint8Array | null}} Interior n: nodes, 0 before the asset has come
 */

export class InteriorLink {
    /** @type {Map<number, {epoch: number, address: string}>} of the parts that have an interior */
    offered = new Map();
    /** @type {Map<number, Interior>} */
    interiors = new Map();

    /** @param {Pick<import("./link.js").Environment, "get" | "post">} env */
    constructor(env) {
        this.env = env;
    }

    reset() {
        this.offered.clear();
        this.interiors.clear();
    }

    /** @param {number} part @param {{epoch: number, interior?: string}} info @param {string} base address of the server */
    offer(part, { epoch, interior }, base) {
        if (interior) this.offered.set(part, { epoch, address: assetAddress(interior, base) });
        else this.offered.delete(part);
    }

    /** @param {number} part @param {Uint8Array} bytes of an INTERIOR message */
    take(part, bytes) {
        const { epoch } = readInteriorHead(bytes);
        const interior = this.interiors.get(part);
        if (interior && epoch < interior.epoch) return;
        if (!interior || epoch > interior.epoch) this.load(part, epoch, bytes);
        else if (interior.n === 0) interior.early = bytes.slice();
        else this.decode(part, interior, bytes);
    }

    /** @param {number} part @param {Interior} interior @param {Uint8Array} bytes */
    decode(part, { epoch, n }, bytes) {
        const move = new Float32Array(3 * n);
        const level = new Uint8Array(n);
        const { name, low, high } = decodeInterior(bytes, move, level);
        this.env.post({ type: "interior", part, epoch, name, low, high, move, level }, [move.buffer, level.buffer]);
    }

    /** @param {number} part @param {number} epoch @param {Uint8Array} bytes of the message that waits for the asset */
    async load(part, epoch, bytes) {
        const offer = this.offered.get(part);
        if (offer?.epoch !== epoch) return;
        const interior = { epoch, n: 0, early: bytes.slice() };
        this.interiors.set(part, interior);
        try {
            const asset = await decodeAsset(new Uint8Array(await this.env.get(offer.address)));
            const tets = tetrahedraOf(asset.triangles);
            if (this.interiors.get(part) !== interior) return;
            interior.n = asset.rest.length / 3;
            this.env.post({ type: "interior_mesh", part, epoch, rest: asset.rest, tets });
            this.decode(part, interior, interior.early);
        } catch {
            // without its asset the part is shown without its interior, until its next epoch
        }
    }
}
