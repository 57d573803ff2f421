// How strongly a force is shown. Pure.

const NOTICED_N = 0.5; // forces are told apart by their ratio above about this one, by their difference below
const CAP_N = 15; // where a tool has none
const BLEND_S = 0.15; // slower than a flicker, faster than a hand

/** 0 at no force, 1 at the cap of the tool @param {number} force N @param {number | undefined} cap N */
export const forceLevel = (force, cap) =>
    Math.min(1, Math.log1p(force / NOTICED_N) / Math.log1p((cap || CAP_N) / NOTICED_N));

/** a level that follows another @param {number} level @param {number} wanted @param {number} seconds since the last */
export const blendLevel = (level, wanted, seconds) => wanted + (level - wanted) * Math.exp(-seconds / BLEND_S);
