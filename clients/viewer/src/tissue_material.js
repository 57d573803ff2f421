// The material of a body: the surface of its look (tissue_shader.js) under a wet film. The shader mixes in the colours of a
// field, half of them as emission, so that they match the legend on every side.
import { MAP_COLOUR, SEQUENTIAL } from "./colour_maps.js";
import * as THREE from "./three.js";
import { tissueShader } from "./tissue_shader.js";

/** with the colours of a field highlights are faint: they would hide the values */
export const MATT = { clearcoat: 0.06, specularIntensity: 0.3 };

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

/** @param {ColourUniforms} uniforms @param {import("./tissue_looks.js").Look} look */
export function makeTissue(uniforms, look) {
    const wet = { clearcoat: look.wet, specularIntensity: 0.55 };
    const material = new THREE.MeshPhysicalMaterial({
        color: look.colour,
        roughness: look.roughness,
        metalness: 0,
        clearcoatRoughness: look.filmRoughness,
        side: THREE.DoubleSide,
        ...wet,
    });
    material.userData.wet = wet; // without a field
    const surface = tissueShader(look);
    Object.assign(/** @type {{defines: object}} */ (/** @type {unknown} */ (material)).defines, surface.defines);
    material.onBeforeCompile = (shader) => {
        surface.extend(shader, material.userData.images ?? []);
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
${MAP_COLOUR}`,
            )
            .replace(
                "#include <color_fragment>",
                `#include <color_fragment>
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
