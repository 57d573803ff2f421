// Bodies cut open by planes; several planes remove a corner, what lies beyond all of them. Closed bodies get caps: where the cut surface is open, the stencil counts more back faces
// than front faces, and there the slice through the tetrahedra shows the values inside, in the colours of the legend, or
// plain inner tissue where it has none. A surface that is not closed is cut without a cap: there is nothing inside.
import { MAP_COLOUR } from "./colour_maps.js";
import { planeOf } from "./section_planes.js";
import { sliceTets } from "./slice.js";
import * as THREE from "./three.js";

const INNER = 0x9c4f44; // tissue inside
const FIRST = -1000; // renderOrder: caps are drawn before everything else

/**
 * @typedef {{group: THREE.Group, sides: THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial>[],
 *   slice: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>,
 *   fill: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshStandardMaterial>,
 *   sliced: import("./slice.js").Slice | undefined, of: string}} Cap of: what the slice was made of
 */

/** @param {THREE.Side} side @param {THREE.StencilOp} op */
const countMaterial = (side, op) =>
    new THREE.MeshBasicMaterial({
        side,
        colorWrite: false,
        depthWrite: false,
        depthTest: false,
        stencilWrite: true,
        stencilFunc: THREE.AlwaysStencilFunc,
        stencilFail: op,
        stencilZFail: op,
        stencilZPass: op,
    });
const WHERE_OPEN = { stencilWrite: true, stencilRef: 0, stencilFunc: THREE.NotEqualStencilFunc };

/** @param {import("./tissue_material.js").ColourUniforms} colours */
const sliceMaterial = (colours) =>
    new THREE.ShaderMaterial({
        ...WHERE_OPEN,
        side: THREE.DoubleSide,
        clipping: true,
        transparent: false,
        uniforms: {
            mapRange: colours.range,
            mapStops: colours.stops,
            mapMix: colours.mix,
            inner: { value: new THREE.Color(INNER) },
        },
        vertexShader: `attribute float value;
varying float vValue;
#include <clipping_planes_pars_vertex>
void main() {
  vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * mvPosition;
  vValue = value;
  #include <clipping_planes_vertex>
}`,
        // the lines lie at the ticks of the legend
        fragmentShader: `varying float vValue;
uniform vec2 mapRange;
uniform float mapMix;
uniform vec3 inner;
${MAP_COLOUR}
#include <clipping_planes_pars_fragment>
void main() {
  #include <clipping_planes_fragment>
  float t = (vValue - mapRange.x) / (mapRange.y - mapRange.x);
  float line = abs(fract(4.0 * t + 0.5) - 0.5) / max(fwidth(4.0 * t), 1e-5);
  vec3 shown = mapColour(t) * (1.0 - 0.3 * (1.0 - smoothstep(0.5, 1.5, line)));
  gl_FragColor = vec4(mix(inner, shown, mapMix), 1.0);
  #include <colorspace_fragment>
}`,
    });

export class Section {
    /**
     * @param {import("./stage.js").Stage} stage @param {import("./app_state.js").AppState} state
     * @param {import("./inside.js").Inside} inside
     */
    constructor(stage, state, inside) {
        this.stage = stage;
        this.state = state;
        this.inside = inside;
        /** @type {Map<string, Cap>} by part and plane */
        this.caps = new Map();
        /** @type {THREE.Plane[]} */
        this.planes = [];
        /** @type {THREE.Plane[]} their other sides */
        this.opposite = [];
        /** @type {WeakSet<import("./body_mesh.js").BodyMesh>} cut as the planes say */
        this.cut = new WeakSet();
        stage.renderer.localClippingEnabled = true;
    }

    /** planes as the user has chosen them @returns {import("./slice.js").Plane[]} */
    chosen() {
        return this.inside.planes.flatMap((_, i) => this.where(i) ?? []);
    }

    /** a plane as the user has chosen it; null: it is off @param {number} i @returns {import("./slice.js").Plane | null} */
    where(i) {
        const { hello } = this.state;
        if (!hello) return null;
        this.stage.placeCameras();
        const view = this.stage.camera.position.clone().sub(this.stage.target).normalize().toArray();
        return planeOf(this.inside.planes[i], [hello.box_min_m, hello.box_max_m], view);
    }

    /** before a picture */
    update() {
        const chosen = this.chosen();
        const count = this.planes.length;
        if (chosen.length === 0 && count === 0) return;
        // other planes of the same number only move: materials keep their shaders
        if (chosen.length !== count) {
            this.planes = chosen.map(() => new THREE.Plane());
            this.opposite = chosen.map(() => new THREE.Plane());
            this.cut = new WeakSet();
            this.dropCaps();
        }
        chosen.forEach(({ normal, constant }, i) => {
            this.planes[i].set(new THREE.Vector3(...normal), constant);
            this.opposite[i].copy(this.planes[i]).negate();
        });
        const shown = new Set();
        for (const [part, body] of this.state.bodies) {
            this.clip(body);
            if (body.closed)
                this.planes.forEach((_, i) => {
                    const key = `${part} ${body.epoch} ${i}`;
                    shown.add(key);
                    this.updateCap(key, part, body, i, chosen[i]);
                });
        }
        for (const key of this.caps.keys()) if (!shown.has(key)) this.dropCap(key);
    }

    /** @param {import("./body_mesh.js").BodyMesh} body */
    clip(body) {
        if (body.lines) Object.assign(body.lines.material, { clippingPlanes: this.planes, clipIntersection: true });
        if (this.cut.has(body)) return;
        this.cut.add(body);
        body.mesh.material.clippingPlanes = this.planes.length ? this.planes : null;
        body.mesh.material.clipIntersection = true;
        body.mesh.material.clipShadows = true; // what is removed casts none
        body.mesh.material.needsUpdate = true;
    }

    /**
     * @param {string} key @param {number} part @param {import("./body_mesh.js").BodyMesh} body @param {number} i plane
     * @param {import("./slice.js").Plane} plane
     */
    updateCap(key, part, body, i, plane) {
        let cap = this.caps.get(key);
        if (!cap) this.caps.set(key, (cap = this.makeCap(body, i, FIRST + 10 * this.caps.size)));
        cap.group.visible = body.mesh.visible;
        const normal = this.planes[i].normal;
        const middle = this.planes[i].projectPoint(this.stage.target, new THREE.Vector3());
        cap.fill.position.copy(middle);
        cap.fill.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal.clone().negate());
        const interior = this.inside.interiorOf(part, body.epoch);
        cap.slice.visible = interior !== null && body.colours.uniforms.mix.value > 0;
        if (!interior || !cap.slice.visible) return;
        const of = `${interior.revision} ${plane.normal} ${plane.constant}`;
        if (of === cap.of) return;
        cap.of = of;
        cap.sliced = sliceTets(interior.x, interior.tets, interior.value, plane, interior, cap.sliced);
        const { geometry } = cap.slice;
        const { positions, values, n } = cap.sliced;
        if (geometry.getAttribute("position")?.array !== positions) {
            geometry.dispose();
            geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3).setUsage(THREE.DynamicDrawUsage));
            geometry.setAttribute("value", new THREE.BufferAttribute(values, 1).setUsage(THREE.DynamicDrawUsage));
        }
        for (const name of ["position", "value"]) {
            const attribute = /** @type {THREE.BufferAttribute} */ (geometry.getAttribute(name));
            attribute.clearUpdateRanges();
            attribute.addUpdateRange(0, n * attribute.itemSize);
            attribute.needsUpdate = true;
        }
        geometry.setDrawRange(0, n);
    }

    /** @param {import("./body_mesh.js").BodyMesh} body @param {number} i plane @param {number} order @returns {Cap} */
    makeCap(body, i, order) {
        const own = [this.planes[i]];
        const beyond = this.opposite.filter((_, k) => k !== i);
        const sides = [
            countMaterial(THREE.BackSide, THREE.IncrementWrapStencilOp),
            countMaterial(THREE.FrontSide, THREE.DecrementWrapStencilOp),
        ].map((material) => new THREE.Mesh(body.geometry, material));
        for (const { material } of sides) material.clippingPlanes = own;
        const slice = new THREE.Mesh(new THREE.BufferGeometry(), sliceMaterial(body.colours.uniforms));
        const size = 4 * this.stage.size;
        const fill = new THREE.Mesh(
            new THREE.PlaneGeometry(size, size),
            new THREE.MeshStandardMaterial({
                ...WHERE_OPEN,
                color: INNER,
                roughness: 0.8,
                side: THREE.DoubleSide,
                // behind the slice
                polygonOffset: true,
                polygonOffsetFactor: 2,
                polygonOffsetUnits: 8,
            }),
        );
        const normals = new THREE.MeshNormalMaterial({ ...WHERE_OPEN, side: THREE.DoubleSide });
        for (const material of [slice.material, fill.material, normals])
            material.clippingPlanes = beyond.length ? beyond : null;
        // for shadows and occlusion (picture_effects.js): a cap is as large as the body is open, which the stencil knows
        Object.assign(fill.userData, { castsNone: true, normals });
        for (const side of sides) side.userData.normals = side.material;
        // the next cap counts anew
        fill.onAfterRender = (renderer) => renderer.clearStencil();
        const group = new THREE.Group();
        [...sides, slice, fill].forEach((mesh, k) => {
            mesh.frustumCulled = false;
            mesh.renderOrder = order + k;
            group.add(mesh);
        });
        this.stage.scene.add(group);
        return { group, sides, slice, fill, sliced: undefined, of: "" };
    }

    /** @param {string} key */
    dropCap(key) {
        const cap = this.caps.get(key);
        if (!cap) return;
        this.stage.scene.remove(cap.group);
        for (const { material } of [...cap.sides, cap.slice, cap.fill]) material.dispose();
        cap.fill.userData.normals.dispose();
        cap.slice.geometry.dispose();
        cap.fill.geometry.dispose();
        this.caps.delete(key);
    }

    dropCaps() {
        for (const key of this.caps.keys()) this.dropCap(key);
    }
}
