// Colour maps of fields. Both have nine stops of evenly spaced lightness L* (CIELAB), so that equal steps of a value look
// equally large, in grey and with any colour vision too. Pure.

/** viridis (Smith and van der Walt 2015) without its darkest eighth, which a dark background would hide */
export const SEQUENTIAL = Object.freeze([
    "#472e7c",
    "#3c4f8a",
    "#2f6b8d",
    "#25868d",
    "#25a086",
    "#3db974",
    "#73ce55",
    "#b7dd2f",
    "#fde725",
]);

/** from blue below zero to orange above it, two hues that every colour vision tells apart; zero is light grey */
export const DIVERGING = Object.freeze([
    "#0b50a3",
    "#4973cb",
    "#7d98e9",
    "#b6c0f1",
    "#ebebeb",
    "#f3b499",
    "#e38255",
    "#be5727",
    "#923302",
]);

/** stops of each map, as shaders have them */
export const STOPS = SEQUENTIAL.length;

/** GLSL: the colour of a share of the range, from the stops in `mapStops`, linear light */
export const MAP_COLOUR = `
uniform vec3 mapStops[${STOPS}];
vec3 mapColour(float t) {
  float s = clamp(t, 0.0, 1.0) * ${(STOPS - 1).toFixed(1)};
  vec3 c = mapStops[0];
  for (int i = 0; i < ${STOPS - 1}; i++) c = mix(c, mapStops[i + 1], clamp(s - float(i), 0.0, 1.0));
  return c;
}`;

/** as a background of CSS, from left to right @param {readonly string[]} map */
export const gradientOf = (map) => `linear-gradient(90deg, ${map.join(", ")})`;

/** a channel of sRGB as light @param {number} v 0..1 */
const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);

/** lightness L* of a colour, 0..100 @param {string} colour "#rrggbb" */
export function lightness(colour) {
    const [r, g, b] = [1, 3, 5].map((i) => linear(parseInt(colour.slice(i, i + 2), 16) / 255));
    const y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    return y > 0.008856 ? 116 * Math.cbrt(y) - 16 : 903.3 * y;
}
