// A bar of a round length at the depth of the middle of the view, as on a map. Pure but for `show`.

import { decimal } from "./text.js";

const MIN_PX = 60;

/**
 * The shortest of 1, 2 or 5 times a power of ten that is at least 60 pixels long.
 * @param {number} pixels of a metre @returns {{px: number, text: string}}
 */
export function scaleOf(pixels) {
    const ten = 10 ** Math.floor(Math.log10(MIN_PX / pixels) + 1e-9);
    const length = [1, 2, 5, 10].map((s) => s * ten).find((m) => m * pixels >= MIN_PX * (1 - 1e-9)) ?? 10 * ten;
    const mm = Number((1e3 * length).toPrecision(1));
    return { px: Math.round(length * pixels), text: decimal(mm < 1000 ? `${mm} mm` : `${mm / 1000} m`) };
}

/** @param {HTMLElement} bar @param {number} pixels of a metre */
export function showScale(bar, pixels) {
    const { px, text } = scaleOf(pixels);
    if (bar.textContent !== text) bar.textContent = text;
    const width = `${px}px`;
    if (bar.style.width !== width) bar.style.width = width;
    bar.hidden = false;
}
