// The values of a field on one body, blended from one set to the next and shown as colours by the tissue's shader.
import * as THREE from "./three.js";
import { makeUniforms, MATT } from "./tissue_material.js";

const BLEND_MS = 100; // the interval of FIELD messages

export class FieldColours {
    /** @param {THREE.BufferGeometry} geometry gets the attributes of the values @param {number} n vertices */
    constructor(geometry, n) {
        this.uniforms = makeUniforms();
        /** @type {THREE.Material | null} */
        this.material = null;
        /** @type {{low: number, high: number} | null} range of the values shown; null: none */
        this.values = null;
        this.since = 0; // ms, of the newest values
        this.older = new THREE.BufferAttribute(new Uint8Array(n), 1, true).setUsage(THREE.DynamicDrawUsage);
        this.newer = new THREE.BufferAttribute(new Uint8Array(n), 1, true).setUsage(THREE.DynamicDrawUsage);
        geometry.setAttribute("older", this.older);
        geometry.setAttribute("newer", this.newer);
    }

    /**
     * New values, to which the colours blend.
     * @param {Uint8Array} level [n] @param {number} low value of level 0 @param {number} high value of level 255
     * @param {number} now ms @param {Uint32Array | null} visible vertices that count; null: all
     */
    take(level, low, high, now, visible) {
        const u = this.uniforms;
        const first = !this.values;
        this.older.array = first ? level.slice() : this.newer.array;
        this.newer.array = level;
        u.older.value.set(first ? low : u.newer.value.x, first ? high : u.newer.value.y);
        u.newer.value.set(low, high);
        u.blend.value = first ? 1 : 0;
        this.older.needsUpdate = true;
        this.newer.needsUpdate = true;
        this.values = rangeOfLevels(level, low, high, visible);
        this.since = now;
    }

    /**
     * Values of the topology before, until its own arrive: the surface does not flash in its natural colour.
     * @param {FieldColours} former @param {number} now ms
     */
    adopt(former, now) {
        const { values, uniforms, newer } = former;
        if (this.values || !values || newer.array.length !== this.newer.array.length) return;
        const [low, high] = uniforms.newer.value.toArray();
        this.take(/** @type {Uint8Array} */ (newer.array), low, high, now, null);
        // as it was shown
        this.uniforms.mix.value = uniforms.mix.value;
        this.uniforms.range.value.copy(uniforms.range.value);
        this.uniforms.stops.value.forEach((stop, i) => stop.copy(uniforms.stops.value[i]));
        if (this.material) Object.assign(this.material, MATT);
    }

    /** shows tissue, until values of another field arrive */
    drop() {
        this.values = null;
        this.enable(0);
    }

    /** @param {number} share of the colours: 0 natural colour, 1 the field alone */
    enable(share) {
        this.uniforms.mix.value = share;
        if (this.material) Object.assign(this.material, share > 0 ? MATT : this.material.userData.wet);
    }

    /** values of the first and the last colour @param {{low: number, high: number}} range @param {readonly string[]} map */
    setRange(range, map) {
        this.uniforms.range.value.set(range.low, range.high);
        this.uniforms.stops.value.forEach((stop, i) => stop.set(map[i]));
    }

    /** advances the blend @param {number} now ms @returns {boolean} the colours still change */
    blend(now) {
        if (!this.values || this.uniforms.blend.value >= 1) return false;
        this.uniforms.blend.value = Math.min(1, (now - this.since) / BLEND_MS);
        return true;
    }

    /**
     * Vertices new in the triangles take the mean of their neighbours until their values arrive.
     * @param {Uint32Array} triangles new ones @param {Uint32Array | null} visible vertices of the former triangles
     */
    extend(triangles, visible) {
        if (!this.values || !visible) return;
        const known = new Uint8Array(this.newer.array.length);
        for (const v of visible) known[v] = 1;
        for (const attribute of [this.older, this.newer]) {
            /** @type {Map<number, {sum: number, n: number}>} */
            const means = new Map();
            for (let t = 0; t < triangles.length; t += 3)
                for (let c = 0; c < 3; c++) {
                    const v = triangles[t + c];
                    if (known[v]) continue;
                    const mean = means.get(v) ?? { sum: 0, n: 0 };
                    for (const w of [triangles[t + ((c + 1) % 3)], triangles[t + ((c + 2) % 3)]])
                        if (known[w]) {
                            mean.sum += attribute.array[w];
                            mean.n++;
                        }
                    means.set(v, mean);
                }
            for (const [v, mean] of means) attribute.array[v] = mean.n ? mean.sum / mean.n : 0;
            attribute.needsUpdate = means.size > 0;
        }
    }
}

/**
 * Smallest and largest value of the visible vertices.
 * @param {Uint8Array} level @param {number} low @param {number} high @param {Uint32Array | null} visible
 */
function rangeOfLevels(level, low, high, visible) {
    if (!visible) return { low, high };
    let min = 255;
    let max = 0;
    for (const v of visible) {
        min = Math.min(min, level[v]);
        max = Math.max(max, level[v]);
    }
    return { low: low + ((high - low) * min) / 255, high: low + ((high - low) * max) / 255 };
}
