// A field drawn as a cloud: rays march through a 3D texture of the values inside, and a transfer function makes values
// opaque from a threshold on, so that the peaks inside are seen through the rest. The surface gives way to a faint hull.
import { MAP_COLOUR } from "./colour_maps.js";
import { fillGrid, gridAround } from "./grid.js";
import { FIELDS } from "./legend.js";
import { PLANES_MAX } from "./section_planes.js";
import * as THREE from "./three.js";

const POINTS = 56; // of the grid along its longest side: about two for each element of a fine body
const STEPS = 96; // of a ray through the longest diagonal; fewer while drawing is slow
const STEPS_SLOW = 40;
const SLOW = 0.7; // resolution below which drawing counts as slow

/** @param {import("./tissue_material.js").ColourUniforms} colours */
const cloudMaterial = (colours) =>
    new THREE.ShaderMaterial({
        side: THREE.BackSide, // drawn also when the camera is inside
        transparent: true,
        depthWrite: false,
        uniforms: {
            mapRange: colours.range,
            mapStops: colours.stops,
            grid: { value: null },
            low: { value: new THREE.Vector3() },
            extent: { value: new THREE.Vector3(1, 1, 1) },
            size: { value: new THREE.Vector3(1, 1, 1) },
            values: { value: new THREE.Vector2() },
            threshold: { value: 0 },
            signed: { value: 0 },
            nStep: { value: STEPS },
            planes: { value: Array.from({ length: PLANES_MAX }, () => new THREE.Vector4()) },
            nPlane: { value: 0 },
        },
        vertexShader: `varying vec3 vPoint;
void main() {
  vec4 at = modelMatrix * vec4(position, 1.0);
  vPoint = at.xyz;
  gl_Position = projectionMatrix * viewMatrix * at;
}`,
        fragmentShader: `precision highp sampler3D;
varying vec3 vPoint;
uniform sampler3D grid;
uniform vec3 low, extent, size;
uniform vec2 mapRange, values;
uniform float threshold, signed;
uniform int nStep, nPlane;
uniform vec4 planes[${PLANES_MAX}];
${MAP_COLOUR}
void main() {
  vec3 direction = normalize(vPoint - cameraPosition);
  vec3 a = (low - cameraPosition) / direction, b = (low + extent - cameraPosition) / direction;
  vec3 first = min(a, b), last = max(a, b);
  float from = max(max(max(first.x, first.y), first.z), 0.0), to = min(min(last.x, last.y), last.z);
  float dt = length(extent) / float(nStep);
  // rays begin at different depths, so that steps make noise instead of rings
  from += dt * fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453);
  vec3 sum = vec3(0.0);
  float seen = 0.0;
  for (int i = 0; i < nStep; i++) {
    float at = from + dt * float(i);
    if (at > to || seen > 0.98) break;
    vec3 p = cameraPosition + at * direction;
    bool beyond = nPlane > 0;
    for (int k = 0; k < ${PLANES_MAX}; k++) if (k < nPlane && dot(planes[k].xyz, p) + planes[k].w >= 0.0) beyond = false;
    if (beyond) continue;
    // points of the grid are the middles of texels
    vec2 texel = texture(grid, ((p - low) / extent * (size - 1.0) + 0.5) / size).rg;
    if (texel.g < 0.02) continue;
    float value = mix(values.x, values.y, texel.r / texel.g);
    float t = (value - mapRange.x) / (mapRange.y - mapRange.x);
    float peak = signed > 0.5 ? abs(2.0 * t - 1.0) : t;
    // per hundredth of the diagonal
    float opacity = texel.g * 0.3 * smoothstep(threshold, min(threshold + 0.4, 1.0), peak);
    opacity = 1.0 - pow(1.0 - opacity, 100.0 / float(nStep));
    sum += (1.0 - seen) * opacity * mapColour(t);
    seen += (1.0 - seen) * opacity;
  }
  if (seen < 0.002) discard;
  gl_FragColor = vec4(sum / seen, seen);
  #include <colorspace_fragment>
}`,
    });

/** the outline of the body: the more opaque the more its surface is seen from the side */
const makeHull = () =>
    new THREE.ShaderMaterial({
        transparent: true,
        depthWrite: false,
        uniforms: { ink: { value: new THREE.Color(0x8f9fae) } },
        vertexShader: `varying float vFacing;
void main() {
  vec4 at = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * at;
  vFacing = abs(dot(normalize(normalMatrix * normal), normalize(at.xyz)));
}`,
        fragmentShader: `varying float vFacing;
uniform vec3 ink;
void main() {
  gl_FragColor = vec4(ink, 0.06 + 0.5 * pow(1.0 - vFacing, 2.5));
  #include <colorspace_fragment>
}`,
    });

/**
 * @typedef {{hull: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>,
 *   mesh: THREE.Mesh<THREE.BoxGeometry, THREE.ShaderMaterial>, texture: THREE.Data3DTexture | null,
 *   revision: number}} Cloud
 */

export class Volume {
    /** @param {import("./stage.js").Stage} stage @param {import("./app_state.js").AppState} state @param {import("./inside.js").Inside} inside */
    constructor(stage, state, inside) {
        this.stage = stage;
        this.state = state;
        this.inside = inside;
        /** @type {Map<number, Cloud>} by part */
        this.clouds = new Map();
    }

    /** before a picture @param {import("./slice.js").Plane[]} planes that cut the bodies */
    update(planes) {
        for (const [part, body] of this.state.bodies) {
            const interior = this.inside.volume ? this.inside.interiorOf(part, body.epoch) : null;
            const drawn = interior !== null && body.colours.uniforms.mix.value > 0;
            if (drawn) this.updateCloud(part, body, interior, planes);
            else this.drop(part);
            // the surface would hide what is inside
            if (body.wanted !== drawn) continue;
            body.appear(!drawn);
            if (!drawn) body.wireframe(this.state.wireframe);
        }
        for (const part of this.clouds.keys()) if (!this.state.bodies.has(part)) this.drop(part);
    }

    /**
     * @param {number} part @param {import("./body_mesh.js").BodyMesh} body
     * @param {import("./inside.js").Interior} interior @param {import("./slice.js").Plane[]} planes
     */
    updateCloud(part, body, interior, planes) {
        let cloud = this.clouds.get(part);
        if (!cloud) {
            const mesh = new THREE.Mesh(new THREE.BoxGeometry(1, 1, 1), cloudMaterial(body.colours.uniforms));
            const hull = new THREE.Mesh(body.geometry, makeHull());
            mesh.frustumCulled = hull.frustumCulled = false;
            hull.renderOrder = 1; // over the cloud
            this.stage.scene.add(mesh, hull);
            this.clouds.set(part, (cloud = { mesh, hull, texture: null, revision: -1 }));
        }
        const { uniforms } = cloud.mesh.material;
        uniforms.threshold.value = this.inside.threshold;
        uniforms.signed.value = FIELDS[this.state.field]?.signed ? 1 : 0;
        uniforms.nStep.value = this.stage.pace.resolution < SLOW ? STEPS_SLOW : STEPS;
        uniforms.nPlane.value = planes.length;
        planes.forEach(({ normal, constant }, k) => uniforms.planes.value[k].set(...normal, constant));
        if (cloud.revision === interior.revision) return;
        cloud.revision = interior.revision;
        const grid = gridAround(interior.x, POINTS);
        fillGrid(interior.x, interior.tets, interior.value, interior, grid);
        const extent = grid.size.map((n) => (n - 1) * grid.step);
        cloud.texture?.dispose();
        cloud.texture = new THREE.Data3DTexture(grid.data, grid.size[0], grid.size[1], grid.size[2]);
        Object.assign(cloud.texture, {
            format: THREE.RGFormat,
            minFilter: THREE.LinearFilter,
            magFilter: THREE.LinearFilter,
            unpackAlignment: 1,
            needsUpdate: true,
        });
        uniforms.grid.value = cloud.texture;
        uniforms.low.value.fromArray(grid.low);
        uniforms.extent.value.fromArray(extent);
        uniforms.size.value.fromArray(grid.size);
        uniforms.values.value.set(interior.low, interior.high);
        cloud.mesh.scale.fromArray(extent);
        cloud.mesh.position.fromArray(grid.low.map((l, c) => l + extent[c] / 2));
    }

    /** @param {number} part */
    drop(part) {
        const cloud = this.clouds.get(part);
        if (!cloud) return;
        this.stage.scene.remove(cloud.mesh, cloud.hull);
        cloud.hull.material.dispose();
        cloud.texture?.dispose();
        cloud.mesh.geometry.dispose();
        cloud.mesh.material.dispose();
        this.clouds.delete(part);
    }
}
