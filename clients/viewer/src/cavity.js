// The abdomen around the organs, as an endoscope sees it: a wall of peritoneum with fat and fine vessels, and a floor of
// bowel and fat below. Made of noise; nothing of it takes part in the simulation.
import { SimplexNoise } from "../vendor/addons/math/SimplexNoise.js";
import * as THREE from "./three.js";

export const CAVITY_RADIUS = 0.95; // of the scene's size: room for the organs and the tools
const FLOOR = 0.66; // the same, below
const SEGMENTS = [220, 140]; // around and from pole to pole: vessels are some segments wide
const PERITONEUM = new THREE.Color(0xcf8878);
const FAT = new THREE.Color(0xe6bd78);
const VESSEL = new THREE.Color(0x8e2a24);

/** @param {number} low @param {number} high @param {number} v */
const smoothstep = (low, high, v) => {
    const t = Math.max(0, Math.min(1, (v - low) / (high - low)));
    return t * t * (3 - 2 * t);
};

/** numbers that are the same in each browser: an even sequence in 0..1 */
function steady() {
    let n = 0;
    return { random: () => (n = (n + 0.6180339887498949) % 1) };
}

/** @param {number} size of the scene, m @param {THREE.Vector3} up @returns {THREE.Mesh} around the origin */
export function makeCavity(size, up) {
    const noise = new SimplexNoise(steady());
    const geometry = new THREE.SphereGeometry(1, SEGMENTS[0], SEGMENTS[1]);
    const position = geometry.getAttribute("position");
    const colours = new Float32Array(3 * position.count);
    const v = new THREE.Vector3();
    const colour = new THREE.Color();
    for (let i = 0; i < position.count; i++) {
        v.fromBufferAttribute(position, i);
        const at = (/** @type {number} */ f) => noise.noise3d(f * v.x, f * v.y, f * v.z);
        const below = smoothstep(0.1, 0.7, -v.dot(up));
        // folds: shallow on the wall, as loops of bowel below
        const folds = 0.02 * at(2.5) + 0.008 * at(7) + below * (0.07 * (Math.abs(at(3.1)) - 0.4) + 0.02 * at(9));
        const fat = smoothstep(0.05, 0.5, at(2) + 0.35 * at(6) + 0.55 * below);
        // vessels run where a noise passes through zero
        const vessel = Math.max(
            1 - smoothstep(0, 0.05, Math.abs(at(2.3) + 0.15 * at(8))),
            0.7 * (1 - smoothstep(0, 0.09, Math.abs(at(5.7)))),
        );
        colour.copy(PERITONEUM).lerp(FAT, 0.85 * fat);
        colour.lerp(VESSEL, 0.6 * vessel * (1 - 0.5 * below)).multiplyScalar(0.9 + 0.15 * at(17));
        colour.toArray(colours, 3 * i);
        v.multiplyScalar(size * (CAVITY_RADIUS + below * (FLOOR - CAVITY_RADIUS) - folds));
        position.setXYZ(i, v.x, v.y, v.z);
    }
    geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    geometry.computeVertexNormals();
    const material = new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.42, side: THREE.BackSide });
    const cavity = new THREE.Mesh(geometry, material);
    cavity.frustumCulled = false; // it is all around
    return cavity;
}
