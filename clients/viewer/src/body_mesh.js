// One shown part: the geometry of decoded frames, the triangles of a part that adapts, its edges. Only vertices of the
// triangles shown have meaningful positions.
import { edgeOpacity, meanEdge } from "./edge_opacity.js";
import { FieldColours } from "./field_colours.js";
import { vertexNormals } from "./normals.js";
import { pickTriangle } from "./picking.js";
import * as THREE from "./three.js";
import { makeTissue } from "./tissue_material.js";

const LINES = { color: 0xf2dccb, opacity: 0.36 };

/**
 * Is the surface closed, with outward triangles? Then its back faces are never visible.
 * @param {Float32Array} x [n][3] @param {Uint32Array} triangles [m][3]
 */
function isClosed(x, triangles) {
    const n = x.length / 3;
    const edges = new Set();
    let volume = 0; // sixfold
    for (let t = 0; t < triangles.length; t += 3) {
        const a = triangles[t];
        const b = triangles[t + 1];
        const c = triangles[t + 2];
        const i = 3 * a;
        const j = 3 * b;
        const k = 3 * c;
        volume +=
            x[i] * (x[j + 1] * x[k + 2] - x[j + 2] * x[k + 1]) +
            x[i + 1] * (x[j + 2] * x[k] - x[j] * x[k + 2]) +
            x[i + 2] * (x[j] * x[k + 1] - x[j + 1] * x[k]);
        // an edge cancels the opposite one of the neighbouring triangle
        for (const [from, to] of [
            [a, b],
            [b, c],
            [c, a],
        ])
            if (!edges.delete(to * n + from)) edges.add(from * n + to);
    }
    return edges.size === 0 && volume > 0;
}

export class BodyMesh {
    /**
     * @param {THREE.Scene} scene
     * @param {Float32Array} rest [n][3] @param {Uint32Array} triangles [m][3]
     * @param {Uint32Array | null} visible the vertices in the triangles, null: all
     * @param {import("./tissue_looks.js").Look} look
     * @param {Uint32Array | null} originals the vertex that each vertex stands for; null: itself
     */
    constructor(scene, rest, triangles, visible, look, originals) {
        this.scene = scene;
        this.rest = rest;
        this.visible = visible;
        this.originals = originals;
        this.epoch = 0; // of its asset
        this.shown = false; // a frame has been taken: there are normals, without which it is black
        this.wanted = true;
        this.geometry = new THREE.BufferGeometry();
        this.position = new THREE.BufferAttribute(rest.slice(), 3).setUsage(THREE.DynamicDrawUsage);
        this.normal = new THREE.BufferAttribute(new Float32Array(rest.length), 3).setUsage(THREE.DynamicDrawUsage);
        this.geometry.setAttribute("position", this.position);
        this.geometry.setAttribute("normal", this.normal);
        this.geometry.setAttribute("rest", new THREE.BufferAttribute(rest, 3));
        this.colours = new FieldColours(this.geometry, rest.length / 3);
        this.nCorner = 0;
        this.takeTriangles(triangles);
        this.mesh = new THREE.Mesh(this.geometry, makeTissue(this.colours.uniforms, look));
        this.colours.material = this.mesh.material;
        if (look.vessels.amount > 0) {
            this.restNormal = new THREE.BufferAttribute(new Float32Array(rest.length), 3);
            this.geometry.setAttribute("restNormal", this.restNormal);
            this.updateRestNormals(triangles);
        }
        this.closed = isClosed(rest, this.triangles());
        if (this.closed) this.mesh.material.side = THREE.FrontSide;
        this.mesh.frustumCulled = false;
        this.mesh.visible = false;
        // the surface lies slightly behind its lines
        Object.assign(this.mesh.material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
        /** @type {THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial> | null} */
        this.lines = null;
        scene.add(this.mesh);
    }

    /** normals at rest, by which patterns are laid on @param {Uint32Array} triangles */
    updateRestNormals(triangles) {
        if (!this.restNormal) return;
        vertexNormals(this.rest, triangles, /** @type {Float32Array} */ (this.restNormal.array), this.visible);
        this.restNormal.needsUpdate = true;
    }

    nVisible() {
        return this.visible ? this.visible.length : this.rest.length / 3;
    }

    /** does a frame differ by at most `limit` m in every coordinate? @param {Float32Array} positions @param {number} limit */
    near(positions, limit) {
        const x = this.position.array;
        const visible = this.visible;
        const n = this.nVisible();
        for (let k = 0; k < n; k++) {
            const i = 3 * (visible ? visible[k] : k);
            if (
                Math.abs(x[i] - positions[i]) > limit ||
                Math.abs(x[i + 1] - positions[i + 1]) > limit ||
                Math.abs(x[i + 2] - positions[i + 2]) > limit
            )
                return false;
        }
        return this.shown;
    }

    /** writes an index with spare capacity, so that a change uploads no more bytes than needed @param {Uint32Array} triangles */
    takeTriangles(triangles) {
        const index = this.geometry.index;
        if (index && triangles.length <= index.array.length) {
            index.array.set(triangles);
            index.clearUpdateRanges();
            index.addUpdateRange(0, triangles.length);
            index.needsUpdate = true;
        } else {
            const larger = new Uint32Array(
                index ? Math.max(triangles.length, 2 * index.array.length) : triangles.length,
            );
            larger.set(triangles);
            // frees the renderer's copy of the former index
            if (index) this.geometry.dispose();
            this.geometry.setIndex(
                new THREE.BufferAttribute(larger, 1).setUsage(index ? THREE.DynamicDrawUsage : THREE.StaticDrawUsage),
            );
        }
        this.geometry.setDrawRange(0, triangles.length);
        this.nCorner = triangles.length;
    }

    /**
     * Other triangles, of a part that adapts; their frame follows at once.
     * @param {{triangles: Uint32Array, visible: Uint32Array | null}} shown
     */
    reshape({ triangles, visible }) {
        this.colours.extend(triangles, this.visible);
        this.takeTriangles(triangles);
        this.visible = visible;
        this.updateRestNormals(triangles);
    }

    /**
     * Takes a decoded frame and returns the former arrays for reuse.
     * @param {Float32Array<ArrayBuffer>} positions @param {Float32Array<ArrayBuffer>} normals
     * @returns {import("./link.js").FrameArrays}
     */
    take(positions, normals) {
        const old = {
            positions: /** @type {Float32Array<ArrayBuffer>} */ (this.position.array),
            normals: /** @type {Float32Array<ArrayBuffer>} */ (this.normal.array),
        };
        if (!this.shown) {
            this.shown = true;
            this.appear(this.wanted);
        }
        this.position.array = positions;
        this.normal.array = normals;
        this.position.needsUpdate = true;
        this.normal.needsUpdate = true;
        return old;
    }

    /** a body is hidden before its first frame @param {boolean} on */
    appear(on) {
        this.wanted = on;
        this.mesh.visible = on && this.shown;
        if (this.lines && !on) this.lines.visible = false;
    }

    /** shown vertices without copies */
    nOriginal() {
        const { originals, visible } = this;
        if (!originals) return this.nVisible();
        if (visible) return visible.reduce((n, v) => n + Number(originals[v] === v), 0);
        return originals.reduce((n, original, v) => n + Number(original === v), 0);
    }

    /** corners of the triangles in use, of the vertices without copies: those of a closed surface are joined */
    triangles() {
        const index = /** @type {THREE.BufferAttribute} */ (this.geometry.index);
        const drawn = /** @type {Uint32Array} */ (index.array).subarray(0, this.nCorner);
        const { originals } = this;
        return originals ? drawn.map((v) => originals[v]) : drawn;
    }

    /** the surface as drawn, for a file @returns {import("./exporters.js").Surface} */
    surface() {
        return { positions: this.position.array, triangles: this.triangles() };
    }

    /** draws the edges of the triangles @param {boolean} on */
    wireframe(on) {
        if (on && !this.lines) {
            const material = new THREE.MeshBasicMaterial({
                wireframe: true,
                transparent: true,
                depthWrite: false,
                toneMapped: false,
                ...LINES,
            });
            this.lines = new THREE.Mesh(this.geometry, material);
            this.lines.frustumCulled = false;
            const edge = meanEdge(this.rest, this.triangles());
            const middle = new THREE.Box3().setFromArray(this.rest).getCenter(new THREE.Vector3());
            const size = new THREE.Vector2();
            this.lines.onBeforeRender = (renderer, scene, camera) => {
                const half = renderer.getDrawingBufferSize(size).y / 2;
                const pixels = edge * half * camera.projectionMatrix.elements[5];
                material.opacity = LINES.opacity * edgeOpacity(pixels / camera.position.distanceTo(middle));
            };
            this.scene.add(this.lines);
        }
        if (this.lines) this.lines.visible = on;
    }

    /** largest displacement of the shown frame, m */
    maxDisplacement() {
        const x = this.position.array;
        const r = this.rest;
        const visible = this.visible;
        const n = this.nVisible();
        let max = 0;
        for (let k = 0; k < n; k++) {
            const i = 3 * (visible ? visible[k] : k);
            const d = (x[i] - r[i]) ** 2 + (x[i + 1] - r[i + 1]) ** 2 + (x[i + 2] - r[i + 2]) ** 2;
            if (d > max) max = d;
        }
        return Math.sqrt(max);
    }

    /** @param {THREE.Ray} ray @returns {import("./picking.js").Hit | null} */
    pick(ray) {
        return pickTriangle(ray, this.position.array, this.triangles(), this.nCorner);
    }

    dispose() {
        this.scene.remove(this.mesh);
        if (this.lines) this.scene.remove(this.lines);
        this.lines?.material.dispose();
        this.geometry.dispose();
        /** @type {THREE.Material} */ (this.mesh.material).dispose();
    }
}
