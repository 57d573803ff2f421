// The material of tissue: a glossy layer over a soft, slightly translucent body. The shader mixes in the colours of a
// field, half of them as emission, so that they match the legend on every side.
import { MAP_COLOUR, SEQUENTIAL } from "./colour_maps.js";
import * as THREE from "./three.js";

/** with colours highlights are faint: they would hide the values */
export const WET = { clearcoat: 0.55, sheen: 0.35, specularIntensity: 0.55 };
export const MATT = { clearcoat: 0.06, sheen: 0.02, specularIntensity: 0.3 };

/**
 * @typedef {{mix: {value: number}, range: {value: THREE.Vector2}, older: {value: THREE.Vector2}, newer: {value: THREE.Vector2},
 *   blend: {value: number}, stops: {value: THREE.Color[]}}} ColourUniforms mix: 0 tissue, 1 field; range: of the colours;
 *   older, newer: low and high of the two sets of values; blend: 0 older, 1 newer
 */

/** @returns {ColourUniforms} */
export function makeUniforms() {
    return {
        mix: { value: 0 },
        range: { value: new THREE.Vector2(0, 1) },
        older: { value: new THREE.Vector2() },
        newer: { value: new THREE.Vector2() },
        blend: { value: 1 },
        stops: { value: SEQUENTIAL.map((colour) => new THREE.Color(colour)) },
    };
}

/** @param {ColourUniforms} uniforms */
export function makeTissue(uniforms) {
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
${MAP_COLOUR}
// value noise at rest positions: faint lobules that move with the tissue
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
