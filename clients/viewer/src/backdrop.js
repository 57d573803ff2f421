// The ground behind the organ: a vertical gradient, dark or light as the page is. Its saturation can show a force.
import * as THREE from "./three.js";

const HUE = 208; // degrees: blue, far from tissue
/** saturation and lightness from top to bottom, percent, at no force */
const DARK = [
    [26, 15],
    [26, 11],
    [27, 6],
];
const LIGHT = [
    [36, 95],
    [28, 90],
    [21, 81],
];
const PLACES = [0, 0.55, 1];
const SATURATION_MAX = 90; // percent, at the largest force
const LIGHTNESS_CHANGE = 9; // percent: black and white have no saturation to show
const HEIGHT = 256; // pixels of the texture: a step of brightness each

/** @param {boolean} light @param {number} level of the force, 0 to 1 @returns {string[]} colours from top to bottom */
export function backdropColours(light, level) {
    const change = light ? -LIGHTNESS_CHANGE : LIGHTNESS_CHANGE;
    return (light ? LIGHT : DARK).map(
        ([s, l]) => `hsl(${HUE} ${(s + level * (SATURATION_MAX - s)).toFixed(1)}% ${(l + level * change).toFixed(1)}%)`,
    );
}

/** @param {THREE.CanvasTexture} texture of `makeBackdrop` @param {boolean} light @param {number} level of the force, 0 to 1 */
export function paintBackdrop(texture, light, level) {
    const context = /** @type {CanvasRenderingContext2D} */ (
        /** @type {HTMLCanvasElement} */ (texture.image).getContext("2d")
    );
    const gradient = context.createLinearGradient(0, 0, 0, HEIGHT);
    backdropColours(light, level).forEach((colour, i) => gradient.addColorStop(PLACES[i], colour));
    context.fillStyle = gradient;
    context.fillRect(0, 0, 2, HEIGHT);
    texture.needsUpdate = true;
}

/** @param {boolean} light @returns {THREE.CanvasTexture} */
export function makeBackdrop(light) {
    const canvas = Object.assign(document.createElement("canvas"), { width: 2, height: HEIGHT });
    const texture = new THREE.CanvasTexture(canvas);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.name = "backdrop";
    paintBackdrop(texture, light, 0);
    return texture;
}
