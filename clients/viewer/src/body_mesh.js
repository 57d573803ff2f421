// One shown part: geometry that takes decoded frames and, of a part that adapts, new triangles; tissue material, fields as
// colours, lines of the triangles, picking. Only vertices of the triangles shown count: positions of others mean nothing.
import { COLOURS } from "./legend.js";
import * as THREE from "./three.js";

const BLEND_MS = 100; // from one set of values to the next, which come ten times a second
const LINES = { color: 0xf2dccb, opacity: 0.36 };
const WET = { clearcoat: 0.55, sheen: 0.35, specularIntensity: 0.55 },
  MATT = { clearcoat: 0.06, sheen: 0.02, specularIntensity: 0.3 };

/**
 * @typedef {{mix: {value: number}, range: {value: THREE.Vector2}, older: {value: THREE.Vector2}, newer: {value: THREE.Vector2},
 *   blend: {value: number}, stops: {value: THREE.Color[]}}} MapUniforms
 *   range: of the colours; older, newer: low and high of the two sets of values
 */

/**
 * Tissue: a wet layer over a soft, slightly translucent body; the colours of a field are mixed in by the shader, half of
 * them as light of their own, so that they look as in the legend on every side.
 * @param {MapUniforms} uniforms
 */
function makeTissue(uniforms) {
  const material = new THREE.MeshPhysicalMaterial({
    color: 0x82352b,
    roughness: 0.5,
    metalness: 0,
    clearcoatRoughness: 0.28,
    sheenRoughness: 0.5,
    sheenColor: new THREE.Color(0xd98a7a),
    side: THREE.DoubleSide,
    ...WET,
  });
  material.onBeforeCompile = (shader) => {
    shader.uniforms.mapMix = uniforms.mix;
    shader.uniforms.mapRange = uniforms.range;
    shader.uniforms.mapOlder = uniforms.older;
    shader.uniforms.mapNewer = uniforms.newer;
    shader.uniforms.mapBlend = uniforms.blend;
    shader.uniforms.mapStops = uniforms.stops;
    shader.vertexShader = shader.vertexShader
      .replace(
        "#include <common>",
        "#include <common>\nattribute vec3 rest;\nattribute float older, newer;\nuniform vec2 mapOlder, mapNewer;\nuniform float mapBlend;\nvarying float vField;\nvarying vec3 vRest;",
      )
      .replace(
        "#include <begin_vertex>",
        "#include <begin_vertex>\nvField = mix(mix(mapOlder.x, mapOlder.y, older), mix(mapNewer.x, mapNewer.y, newer), mapBlend);\nvRest = rest;",
      );
    shader.fragmentShader = shader.fragmentShader
      .replace(
        "#include <common>",
        `#include <common>
varying float vField;
varying vec3 vRest;
uniform float mapMix;
uniform vec2 mapRange;
uniform vec3 mapStops[${COLOURS.length}];
vec3 mapColour(float t) {
  float s = clamp(t, 0.0, 1.0) * ${(COLOURS.length - 1).toFixed(1)};
  vec3 c = mapStops[0];
  for (int i = 0; i < ${COLOURS.length - 1}; i++) c = mix(c, mapStops[i + 1], clamp(s - float(i), 0.0, 1.0));
  return c;
}
// value noise at rest positions: faint lobules that stay on the tissue when it moves
float lattice(vec3 p) { return fract(sin(dot(p, vec3(127.1, 311.7, 74.7))) * 43758.5453); }
float mottle(vec3 p) {
  vec3 i = floor(p), f = fract(p);
  f = f * f * (3.0 - 2.0 * f);
  return mix(mix(mix(lattice(i), lattice(i + vec3(1, 0, 0)), f.x), mix(lattice(i + vec3(0, 1, 0)), lattice(i + vec3(1, 1, 0)), f.x), f.y),
             mix(mix(lattice(i + vec3(0, 0, 1)), lattice(i + vec3(1, 0, 1)), f.x), mix(lattice(i + vec3(0, 1, 1)), lattice(i + vec3(1, 1, 1)), f.x), f.y), f.z);
}`,
      )
      .replace(
        "#include <color_fragment>",
        `#include <color_fragment>
float shade = 0.86 + 0.14 * mottle(vRest * 160.0) + 0.10 * mottle(vRest * 45.0);
diffuseColor.rgb *= shade;
vec3 shown = mapColour((vField - mapRange.x) / (mapRange.y - mapRange.x));
diffuseColor.rgb = mix(diffuseColor.rgb, 0.5 * shown, mapMix);`,
      )
      .replace(
        "#include <emissivemap_fragment>",
        "#include <emissivemap_fragment>\ntotalEmissiveRadiance += 0.48 * mapMix * shown;",
      );
  };
  return material;
}

/**
 * Is the surface closed, its triangles outward? Then no back side is ever seen.
 * @param {Float32Array} x [n][3] @param {Uint32Array} triangles [m][3]
 */
function isClosed(x, triangles) {
  const n = x.length / 3,
    edges = new Set();
  let volume = 0; // sixfold
  for (let t = 0; t < triangles.length; t += 3) {
    const a = triangles[t],
      b = triangles[t + 1],
      c = triangles[t + 2],
      i = 3 * a,
      j = 3 * b,
      k = 3 * c;
    volume +=
      x[i] * (x[j + 1] * x[k + 2] - x[j + 2] * x[k + 1]) +
      x[i + 1] * (x[j + 2] * x[k] - x[j] * x[k + 2]) +
      x[i + 2] * (x[j] * x[k + 1] - x[j + 1] * x[k]);
    // an edge and its like in the other direction take one another away
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
   */
  constructor(scene, rest, triangles, visible) {
    this.scene = scene;
    this.rest = rest;
    this.visible = visible;
    /** @type {MapUniforms} */
    this.uniforms = {
      mix: { value: 0 },
      range: { value: new THREE.Vector2(0, 1) },
      older: { value: new THREE.Vector2() },
      newer: { value: new THREE.Vector2() },
      blend: { value: 1 },
      stops: { value: COLOURS.map((c) => new THREE.Color(c)) },
    };
    /** @type {{low: number, high: number} | null} of the values shown */
    this.values = null;
    this.valuesAt = 0;
    this.epoch = 0; // of its asset
    this.shown = false; // a frame has been taken: normals are there
    this.geometry = new THREE.BufferGeometry();
    this.position = new THREE.BufferAttribute(rest.slice(), 3).setUsage(THREE.DynamicDrawUsage);
    this.normal = new THREE.BufferAttribute(new Float32Array(rest.length), 3).setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute("position", this.position);
    this.geometry.setAttribute("normal", this.normal);
    this.geometry.setAttribute("rest", new THREE.BufferAttribute(rest, 3));
    this.older = new THREE.BufferAttribute(new Uint8Array(rest.length / 3), 1, true).setUsage(THREE.DynamicDrawUsage);
    this.newer = new THREE.BufferAttribute(new Uint8Array(rest.length / 3), 1, true).setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute("older", this.older);
    this.geometry.setAttribute("newer", this.newer);
    this.nCorner = 0;
    this.takeTriangles(triangles);
    this.mesh = new THREE.Mesh(this.geometry, makeTissue(this.uniforms));
    if (isClosed(rest, triangles)) this.mesh.material.side = THREE.FrontSide;
    this.mesh.frustumCulled = false;
    // the body lies a little behind its lines
    Object.assign(this.mesh.material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    /** @type {THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial> | null} */
    this.lines = null;
    scene.add(this.mesh);
  }

  nVisible() {
    return this.visible ? this.visible.length : this.rest.length / 3;
  }

  /** does a frame lie within `least` m of what is shown, in every coordinate? @param {Float32Array} positions @param {number} least */
  near(positions, least) {
    const x = this.position.array,
      visible = this.visible,
      n = this.nVisible();
    for (let k = 0; k < n; k++) {
      const i = 3 * (visible ? visible[k] : k);
      if (
        Math.abs(x[i] - positions[i]) > least ||
        Math.abs(x[i + 1] - positions[i + 1]) > least ||
        Math.abs(x[i + 2] - positions[i + 2]) > least
      )
        return false;
    }
    return this.shown;
  }

  /** into an index with room to grow, so that a change moves no more bytes than it must @param {Uint32Array} triangles */
  takeTriangles(triangles) {
    const index = this.geometry.index;
    if (index && triangles.length <= index.array.length) {
      index.array.set(triangles);
      index.clearUpdateRanges();
      index.addUpdateRange(0, triangles.length);
      index.needsUpdate = true;
    } else {
      const room = new Uint32Array(index ? Math.max(triangles.length, 2 * index.array.length) : triangles.length);
      room.set(triangles);
      // what the renderer made of the former index goes with it
      if (index) this.geometry.dispose();
      this.geometry.setIndex(
        new THREE.BufferAttribute(room, 1).setUsage(index ? THREE.DynamicDrawUsage : THREE.StaticDrawUsage),
      );
    }
    this.geometry.setDrawRange(0, triangles.length);
    this.nCorner = triangles.length;
  }

  /**
   * other triangles from now on, of a part that adapts; the frame that shows them follows at once
   * @param {{triangles: Uint32Array, visible: Uint32Array | null}} shown
   */
  reshape({ triangles, visible }) {
    if (this.values) this.spreadField(triangles);
    this.takeTriangles(triangles);
    this.visible = visible;
  }

  /** new vertices take the mean value of their neighbours until values come for them @param {Uint32Array} triangles */
  spreadField(triangles) {
    const n = this.rest.length / 3,
      known = new Uint8Array(n);
    if (!this.visible) return;
    for (const v of this.visible) known[v] = 1;
    for (const attribute of [this.older, this.newer]) {
      /** @type {Map<number, {sum: number, n: number}>} */
      const fresh = new Map();
      for (let t = 0; t < triangles.length; t += 3)
        for (let c = 0; c < 3; c++) {
          const v = triangles[t + c];
          if (known[v]) continue;
          const mean = fresh.get(v) ?? { sum: 0, n: 0 };
          for (const w of [triangles[t + ((c + 1) % 3)], triangles[t + ((c + 2) % 3)]])
            if (known[w]) {
              mean.sum += attribute.array[w];
              mean.n++;
            }
          fresh.set(v, mean);
        }
      for (const [v, mean] of fresh) attribute.array[v] = mean.n ? mean.sum / mean.n : 0;
      attribute.needsUpdate = fresh.size > 0;
    }
  }

  /**
   * takes a decoded frame over and gives the former arrays back for reuse
   * @param {Float32Array} positions @param {Float32Array} normals
   * @returns {{positions: Float32Array, normals: Float32Array}}
   */
  take(positions, normals) {
    const old = {
      positions: /** @type {Float32Array} */ (this.position.array),
      normals: /** @type {Float32Array} */ (this.normal.array),
    };
    this.shown = true;
    this.position.array = positions;
    this.normal.array = normals;
    this.position.needsUpdate = true;
    this.normal.needsUpdate = true;
    return old;
  }

  /**
   * new values of the field, which the colours go over to
   * @param {Uint8Array} level [n] @param {number} low value of level 0 @param {number} high of level 255 @param {number} now ms
   */
  takeField(level, low, high, now) {
    const u = this.uniforms,
      first = !this.values;
    this.older.array = first ? level.slice() : this.newer.array;
    this.newer.array = level;
    u.older.value.set(first ? low : u.newer.value.x, first ? high : u.newer.value.y);
    u.newer.value.set(low, high);
    u.blend.value = first ? 1 : 0;
    this.older.needsUpdate = true;
    this.newer.needsUpdate = true;
    this.values = this.valuesOf(level, low, high);
    this.valuesAt = now;
    this.colour(true);
  }

  /**
   * least and largest value of what is shown
   * @param {Uint8Array} level @param {number} low @param {number} high
   */
  valuesOf(level, low, high) {
    let least = 255,
      most = 0;
    if (!this.visible) return { low, high };
    for (const v of this.visible) {
      least = Math.min(least, level[v]);
      most = Math.max(most, level[v]);
    }
    return { low: low + ((high - low) * least) / 255, high: low + ((high - low) * most) / 255 };
  }

  /** no colours: tissue again, or the values of another field are waited for */
  dropField() {
    this.values = null;
    this.colour(false);
  }

  /** @param {boolean} on */
  colour(on) {
    this.uniforms.mix.value = on ? 1 : 0;
    Object.assign(this.mesh.material, on ? MATT : WET);
  }

  /** what the first and the last colour mean @param {{low: number, high: number}} range */
  colourRange(range) {
    this.uniforms.range.value.set(range.low, range.high);
  }

  /** colours on their way to the newest values @param {number} now ms @returns {boolean} they still move */
  blend(now) {
    if (!this.values || this.uniforms.blend.value >= 1) return false;
    this.uniforms.blend.value = Math.min(1, (now - this.valuesAt) / BLEND_MS);
    return true;
  }

  /** before its first frame a body is not looked at @param {boolean} on */
  appear(on) {
    this.mesh.visible = on;
    if (this.lines && !on) this.lines.visible = false;
  }

  /** what is drawn, to be written to a file @returns {import("./exporters.js").Piece} */
  piece() {
    const index = /** @type {THREE.BufferAttribute} */ (this.geometry.index);
    return { positions: this.position.array, triangles: index.array.subarray(0, this.nCorner) };
  }

  /** lines of the triangles over the body @param {boolean} on */
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
      this.scene.add(this.lines);
    }
    if (this.lines) this.lines.visible = on;
  }

  /** largest displacement of the shown frame, m */
  moved() {
    const x = this.position.array,
      r = this.rest,
      visible = this.visible,
      n = this.nVisible();
    let most = 0;
    for (let k = 0; k < n; k++) {
      const i = 3 * (visible ? visible[k] : k),
        d = (x[i] - r[i]) ** 2 + (x[i + 1] - r[i + 1]) ** 2 + (x[i + 2] - r[i + 2]) ** 2;
      if (d > most) most = d;
    }
    return Math.sqrt(most);
  }

  /** nearest front hit of a ray @param {THREE.Ray} ray @returns {{point: THREE.Vector3, normal: THREE.Vector3, distance: number} | null} */
  pick(ray) {
    const index = /** @type {THREE.BufferAttribute} */ (this.geometry.index).array,
      x = this.position.array;
    const a = new THREE.Vector3(),
      b = new THREE.Vector3(),
      c = new THREE.Vector3(),
      hit = new THREE.Vector3();
    let best = Infinity,
      found = -1;
    const point = new THREE.Vector3();
    for (let t = 0; t < this.nCorner; t += 3) {
      a.fromArray(x, 3 * index[t]);
      b.fromArray(x, 3 * index[t + 1]);
      c.fromArray(x, 3 * index[t + 2]);
      if (!ray.intersectTriangle(a, b, c, true, hit)) continue;
      const d = hit.distanceToSquared(ray.origin);
      if (d < best) {
        best = d;
        found = t;
        point.copy(hit);
      }
    }
    if (found < 0) return null;
    a.fromArray(x, 3 * index[found]);
    b.fromArray(x, 3 * index[found + 1]);
    c.fromArray(x, 3 * index[found + 2]);
    const normal = b.sub(a).cross(c.sub(a)).normalize();
    return { point, normal, distance: Math.sqrt(best) };
  }

  dispose() {
    this.scene.remove(this.mesh);
    if (this.lines) this.scene.remove(this.lines);
    this.lines?.material.dispose();
    this.geometry.dispose();
    /** @type {THREE.Material} */ (this.mesh.material).dispose();
  }
}
