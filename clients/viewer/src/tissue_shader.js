// The surface of tissue in three's physical material: mottling, cells and vessels that are fixed to the rest shape and so
// move with the tissue, bumps from their slopes, light that scatters below the surface, another colour inside.
//
// A pattern gives the gradient g of the height at rest. Over the picture the height changes by g . dFdx(rest), which holds
// for every deformation; three's formula of bump maps turns these differences into a normal (Mikkelsen, Simulation of
// wrinkled surfaces revisited, 2008). Vessels are a flat picture laid on from three sides (triplanar), by the normal at rest.
import { LOOK_IMAGE, LOOK_INSIDE } from "./asset.js";
import * as THREE from "./three.js";
import { drawVessels, growVessels, makeCells, makeNoise } from "./tissue_patterns.js";

/** places along an edge of a volume and lattice cells along it: four places are enough for a cell of noise */
const NOISE = { size: 32, cells: 4 };
const CELLS = { size: 48, cells: 8 };
const VESSELS = { places: 700, roots: 3, size: 512 };

/** @typedef {{texture: THREE.Texture, slope: number}} PatternMap */

/** @type {{noise: PatternMap, cells: PatternMap, vessels: PatternMap} | null} computed for the first body that needs them */
let patterns = null;

/** @param {THREE.Texture} texture */
function repeated(texture) {
    texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
    texture.magFilter = THREE.LinearFilter;
    texture.minFilter = THREE.LinearMipmapNearestFilter; // from far away patterns fade to their mean
    texture.generateMipmaps = true;
    texture.needsUpdate = true;
    return texture;
}

/** @param {import("./tissue_patterns.js").Pattern} pattern @returns {PatternMap} */
function volume({ data, size, slope }) {
    const texture = new THREE.Data3DTexture(data, size, size, size);
    texture.wrapR = THREE.RepeatWrapping;
    return { texture: repeated(texture), slope };
}

function allPatterns() {
    if (patterns) return patterns;
    const vessels = drawVessels(growVessels(VESSELS.places, VESSELS.roots), VESSELS.size);
    patterns = {
        noise: volume(makeNoise(NOISE.size, NOISE.cells)),
        cells: volume(makeCells(CELLS.size, CELLS.cells)),
        vessels: {
            texture: repeated(new THREE.DataTexture(vessels.data, VESSELS.size, VESSELS.size)),
            slope: vessels.slope,
        },
    };
    return patterns;
}

/** images that a body may have (PAL_IMAGES_MAX of server/mesh/files/image_file.h) */
const IMAGES_MAX = 8;

const VERTEX_HEAD = `
attribute float look;
varying float vLook;
#ifdef TISSUE_IMAGES
varying vec2 vImageAt;
#endif
#ifdef TISSUE_VESSELS
attribute vec3 restNormal;
varying vec3 vRestNormal;
#endif`;
const VERTEX = `
vLook = look;
#ifdef TISSUE_IMAGES
vImageAt = uv;
#endif
#ifdef TISSUE_VESSELS
vRestNormal = restNormal;
#endif`;

/** an array of samplers takes constant numbers only */
const imageChoice = Array.from(
    { length: IMAGES_MAX },
    (_, k) => `
#if TISSUE_IMAGES > ${k}
  if (vLook > ${LOOK_IMAGE - 0.5 + k}) colour = texture(tissueImages[${k}], vImageAt).rgb;
#endif`,
).join("");

const HEAD = `
uniform vec3 tissueInner, tissueGlow;
uniform float tissueScatter;
varying float vLook; // the same at all corners of a triangle
bool isImage = false;
bool isInside = false;
#ifdef TISSUE_IMAGES
uniform sampler2D tissueImages[TISSUE_IMAGES];
varying vec2 vImageAt;
vec3 tissueImage() {
  vec3 colour = vec3(0.0);${imageChoice}
  return colour;
}
#endif
vec3 tissueSlope = vec3(0.0); // gradient of the height at rest
float tissueFilm = 1.0; // factor of the film's roughness
#ifdef TISSUE_PATTERNS
uniform sampler3D tissueNoise, tissueCells;
uniform vec3 tissueScale;  // periods a metre: mottling, waves, (unused)
uniform vec3 tissueCellScale;
uniform vec3 tissueAmount; // mottling, borders of cells, vessels
uniform vec3 tissueRise;   // slope of a byte: waves, cells, vessels
uniform vec3 tissueTone, tissueBorder;
vec3 tissueColour(vec3 surface) {
  vec4 wide = texture(tissueNoise, vRest * tissueScale.x);
  vec4 wave = texture(tissueNoise, vRest * tissueScale.y + 0.37);
  vec4 cell = texture(tissueCells, vRest * tissueCellScale + 0.04 * wave.xyz);
  float mottled = clamp(0.5 + 1.3 * (wide.a - 0.5) + 0.7 * (wave.a - 0.5), 0.0, 1.0);
  surface = mix(surface, tissueTone, tissueAmount.x * mottled);
  surface = mix(surface, tissueBorder, tissueAmount.y * (1.0 - cell.a) * (0.4 + 1.2 * wide.a));
  tissueSlope += tissueRise.x * (2.0 * wave.xyz - 1.0) + tissueRise.y * (2.0 * cell.xyz - 1.0) * tissueCellScale;
  tissueFilm = 0.55 + 0.9 * wide.a;
  return surface;
}
#endif
#ifdef TISSUE_VESSELS
uniform sampler2D tissueVessels;
uniform float tissueVesselScale;
uniform vec3 tissueVesselColour;
varying vec3 vRestNormal;
float tissueCover = 0.0;
void tissueSide(vec2 at, vec2 dx, vec2 dy, vec3 u, vec3 v, float weight) {
  if (weight < 0.03) return; // mostly one side counts
  vec4 seen = textureGrad(tissueVessels, at * tissueVesselScale, dx * tissueVesselScale, dy * tissueVesselScale);
  tissueCover += weight * seen.r;
  tissueSlope += weight * tissueRise.z * ((2.0 * seen.g - 1.0) * u + (2.0 * seen.b - 1.0) * v);
}
vec3 tissueVessel(vec3 surface) {
  vec3 side = pow(abs(normalize(vRestNormal)), vec3(6.0));
  side /= side.x + side.y + side.z;
  vec3 dx = dFdx(vRest), dy = dFdy(vRest);
  tissueSide(vRest.yz, dx.yz, dy.yz, vec3(0, 1, 0), vec3(0, 0, 1), side.x);
  tissueSide(vRest.zx + 0.31, dx.zx, dy.zx, vec3(0, 0, 1), vec3(1, 0, 0), side.y);
  tissueSide(vRest.xy + 0.67, dx.xy, dy.xy, vec3(1, 0, 0), vec3(0, 1, 0), side.z);
  return mix(surface, tissueVesselColour, tissueAmount.z * tissueCover);
}
#endif`;

// an image has its colours already; the inside has no vessels, which lie on the outside
const COLOUR = `
isInside = abs(vLook - ${LOOK_INSIDE}.0) < 0.5;
#ifdef DOUBLE_SIDED
isInside = isInside || !gl_FrontFacing;
#endif
#ifdef TISSUE_IMAGES
isImage = !isInside && vLook > ${LOOK_IMAGE - 0.5};
if (isImage) diffuseColor.rgb = tissueImage();
#endif
#ifdef TISSUE_PATTERNS
if (!isImage) diffuseColor.rgb = tissueColour(diffuseColor.rgb);
#endif
#ifdef TISSUE_VESSELS
if (!isImage && !isInside) diffuseColor.rgb = tissueVessel(diffuseColor.rgb);
#endif
if (isInside) diffuseColor.rgb = tissueInner * (diffuseColor.rgb / max(diffuse, vec3(0.02)));`;

// with the colours of a field the surface is smooth
const BUMP = `
#ifdef TISSUE_PATTERNS
{
  vec2 rise = (1.0 - mapMix) * vec2(dot(tissueSlope, dFdx(vRest)), dot(tissueSlope, dFdy(vRest)));
  vec3 px = dFdx(-vViewPosition), py = dFdy(-vViewPosition);
  vec3 r1 = cross(py, normal), r2 = cross(normal, px);
  float det = dot(px, r1);
  normal = normalize(abs(det) * normal - sign(det) * (rise.x * r1 + rise.y * r2));
}
#endif`;

// the film is smoother than the tissue below it
const FILM = `
#ifdef USE_CLEARCOAT
clearcoatNormal = normalize(mix(nonPerturbedNormal, normal, 0.6));
#endif`;

const ROUGHNESS = `
#ifdef USE_CLEARCOAT
material.clearcoatRoughness = clamp(material.clearcoatRoughness * tissueFilm, 0.04, 1.0);
#endif`;

// light that entered beside the shaded place: beyond the edge of the shadow, and through thin edges
const SCATTER = `
{
  float grazing = 1.0 - saturate(dot(normal, geometryViewDir));
  vec3 through = vec3(0.12) * grazing * grazing * grazing;
  #if NUM_DIR_LIGHTS > 0
  for (int i = 0; i < NUM_DIR_LIGHTS; i++) {
    float facing = dot(normal, directionalLights[i].direction);
    float wrapped = saturate((facing + tissueScatter) / ((1.0 + tissueScatter) * (1.0 + tissueScatter)));
    through += max(0.0, wrapped - saturate(facing)) * directionalLights[i].color;
  }
  #endif
  reflectedLight.directDiffuse += (1.0 - mapMix) * tissueScatter * tissueGlow * through;
}`;

/** @param {string} code @param {string} chunk of three's shader @param {string} more */
function after(code, chunk, more) {
    const include = `#include <${chunk}>`;
    if (!code.includes(include)) throw new Error(`three's shader has no ${chunk}`);
    return code.replace(include, include + more);
}

/**
 * @param {import("./tissue_looks.js").Look} look
 * @returns {{defines: Record<string, string>,
 *   extend: (shader: THREE.WebGLProgramParametersWithUniforms, images: THREE.Texture[]) => void}} what a physical material
 *   needs to have this look; its geometry has `rest`, and `restNormal` with TISSUE_VESSELS, and may have `look` of its
 *   vertices and `uv` in the images; TISSUE_IMAGES: number of images
 */
export function tissueShader(look) {
    /** @type {Record<string, string>} */
    const defines = {};
    /** @type {Record<string, THREE.IUniform>} */
    const uniforms = {
        tissueInner: { value: new THREE.Color(look.inner) },
        tissueGlow: { value: new THREE.Color(look.glow) },
        tissueScatter: { value: look.scatter },
    };
    const { mottling, waves, cells, vessels, stretch } = look;
    if (mottling.amount || waves.depth || cells.amount || vessels.amount) {
        const { noise, cells: cellMap, vessels: vesselMap } = allPatterns();
        // a period of noise has NOISE.cells waves, one of cells CELLS.cells
        const wave = 1 / (NOISE.cells * waves.size);
        const cell = stretch.map((s) => 1 / (CELLS.cells * cells.size * s));
        defines.TISSUE_PATTERNS = "";
        Object.assign(uniforms, {
            tissueNoise: { value: noise.texture },
            tissueCells: { value: cellMap.texture },
            tissueScale: { value: new THREE.Vector3(1 / (NOISE.cells * mottling.size), wave, 0) },
            tissueCellScale: { value: new THREE.Vector3().fromArray(cell) },
            tissueAmount: { value: new THREE.Vector3(mottling.amount, cells.amount, vessels.amount) },
            tissueRise: {
                value: new THREE.Vector3(
                    waves.depth * noise.slope * wave,
                    cells.depth * cellMap.slope,
                    (vessels.depth * vesselMap.slope) / vessels.size,
                ),
            },
            tissueTone: { value: new THREE.Color(look.tone) },
            tissueBorder: { value: new THREE.Color(cells.colour) },
        });
        if (vessels.amount > 0) {
            defines.TISSUE_VESSELS = "";
            uniforms.tissueVessels = { value: vesselMap.texture };
            uniforms.tissueVesselScale = { value: 1 / vessels.size };
            uniforms.tissueVesselColour = { value: new THREE.Color(vessels.colour) };
        }
    }
    return {
        defines,
        extend: (shader, images) => {
            Object.assign(shader.uniforms, uniforms, { tissueImages: { value: images } });
            shader.vertexShader = after(shader.vertexShader, "common", VERTEX_HEAD);
            shader.vertexShader = after(shader.vertexShader, "begin_vertex", VERTEX);
            for (const [chunk, more] of [
                ["clipping_planes_pars_fragment", HEAD],
                ["map_fragment", COLOUR],
                ["normal_fragment_maps", BUMP],
                ["clearcoat_normal_fragment_maps", FILM],
                ["lights_physical_fragment", ROUGHNESS],
                ["lights_fragment_end", SCATTER],
            ])
                shader.fragmentShader = after(shader.fragmentShader, chunk, more);
        },
    };
}
