// What bodies look like, one row for each appearance of a scene (PAL_APPEARANCES of server/sim/core/definition.h). Pure.

/**
 * Colours are sRGB. Patterns are fixed to the rest shape: `size` is the length of one period or cell, `depth` how far the
 * surface rises.
 * @typedef {object} Look
 * @property {string} colour of the surface
 * @property {string} tone colour that mottling mixes in
 * @property {string} inner colour of the inside, on back faces
 * @property {string} glow colour of light that has been scattered below the surface
 * @property {number} scatter 0 to 1: how far light wraps around the surface, and how bright thin edges are
 * @property {number} roughness 0 to 1, of the tissue
 * @property {number} wet 0 to 1: strength of the film that reflects
 * @property {number} filmRoughness 0 to 1
 * @property {{size: number, amount: number}} mottling m; share of `tone`
 * @property {{size: number, depth: number}} waves m: uneven surface
 * @property {{size: number, depth: number, amount: number, colour: string}} cells m; lobules, pores or fibres, and how much
 *   of `colour` their borders get
 * @property {number[]} stretch of cells along x, y, z: 1 round, above 1 longer
 * @property {{size: number, depth: number, amount: number, colour: string}} vessels m: period of the branching pattern
 */

const NONE = { size: 0.05, depth: 0, amount: 0, colour: "#000000" };

/** @type {Look} soft tissue that the scene does not name */
const TISSUE = {
    colour: "#985248",
    tone: "#7c3d35",
    inner: "#87443d",
    glow: "#d2594a",
    scatter: 0.35,
    roughness: 0.5,
    wet: 0.5,
    filmRoughness: 0.25,
    mottling: { size: 0.04, amount: 0.35 },
    waves: { size: 0.012, depth: 1e-4 },
    cells: { size: 0.0022, depth: 8e-6, amount: 0.12, colour: "#b87c70" },
    stretch: [1, 1, 1],
    vessels: NONE,
};

/** @type {Readonly<Record<string, Look>>} */
export const LOOKS = Object.freeze({
    liver: {
        ...TISSUE,
        colour: "#743a34",
        tone: "#552522",
        inner: "#6b332e",
        glow: "#b5443a",
        scatter: 0.28,
        roughness: 0.42,
        wet: 0.85,
        filmRoughness: 0.16,
        mottling: { size: 0.05, amount: 0.55 },
        waves: { size: 0.011, depth: 1.0e-4 },
        cells: { size: 0.0013, depth: 5e-6, amount: 0.14, colour: "#93564d" },
        vessels: { size: 0.09, depth: 2e-5, amount: 0.2, colour: "#42161a" },
    },
    gall_bladder: {
        ...TISSUE,
        colour: "#74895f",
        tone: "#4f6b55",
        inner: "#7d7b48",
        glow: "#8ea676",
        scatter: 0.5,
        wet: 0.9,
        filmRoughness: 0.14,
        mottling: { size: 0.03, amount: 0.5 },
        cells: { size: 0.0012, depth: 5e-6, amount: 0.1, colour: "#8fa468" },
        vessels: { size: 0.035, depth: 6e-5, amount: 0.6, colour: "#7a2f26" },
    },
    stomach: {
        ...TISSUE,
        colour: "#b98d85",
        tone: "#a5706a",
        inner: "#b06a64",
        glow: "#e88a7a",
        scatter: 0.5,
        wet: 0.75,
        filmRoughness: 0.2,
        mottling: { size: 0.045, amount: 0.4 },
        waves: { size: 0.014, depth: 2e-4 },
        cells: { size: 0.003, depth: 1e-5, amount: 0.12, colour: "#d9b5ae" },
        stretch: [1, 1, 5],
        vessels: { size: 0.07, depth: 1.2e-4, amount: 0.55, colour: "#8a3034" },
    },
    intestine: {
        ...TISSUE,
        colour: "#cba39a",
        tone: "#b98880",
        inner: "#b56c66",
        glow: "#ea9686",
        scatter: 0.55,
        wet: 0.85,
        filmRoughness: 0.16,
        waves: { size: 0.01, depth: 2.4e-4 },
        cells: { size: 0.0025, depth: 1e-5, amount: 0.12, colour: "#dec0b8" },
        stretch: [1, 5, 1],
        vessels: { size: 0.045, depth: 1e-4, amount: 0.5, colour: "#93313a" },
    },
    kidney: {
        ...TISSUE,
        colour: "#7d423a",
        tone: "#642e2a",
        inner: "#a2574a",
        wet: 0.8,
        filmRoughness: 0.18,
        cells: { size: 0.0014, depth: 5e-6, amount: 0.12, colour: "#99574b" },
        vessels: { size: 0.03, depth: 3e-5, amount: 0.3, colour: "#4a1518" },
        glow: "#bd4c40",
    },
    spleen: {
        ...TISSUE,
        colour: "#62323f",
        tone: "#47202e",
        inner: "#6b2a36",
        glow: "#9c3c4c",
        wet: 0.85,
        filmRoughness: 0.17,
        cells: { size: 0.0018, depth: 6e-6, amount: 0.16, colour: "#7d4450" },
        vessels: { size: 0.06, depth: 3e-5, amount: 0.15, colour: "#2f0c18" },
    },
    pancreas: {
        ...TISSUE,
        colour: "#d3a178",
        tone: "#b97a58",
        inner: "#c98e6a",
        glow: "#f3a878",
        scatter: 0.45,
        wet: 0.6,
        waves: { size: 0.009, depth: 4e-4 },
        cells: { size: 0.005, depth: 3.5e-4, amount: 0.3, colour: "#a5654a" },
        vessels: { size: 0.05, depth: 5e-5, amount: 0.35, colour: "#8a2f2c" },
    },
    heart: {
        ...TISSUE,
        colour: "#8c4540",
        tone: "#c2a06c",
        inner: "#7a221f",
        glow: "#c9483c",
        wet: 0.8,
        filmRoughness: 0.18,
        mottling: { size: 0.07, amount: 0.4 },
        waves: { size: 0.016, depth: 3e-4 },
        cells: { size: 0.0016, depth: 4e-5, amount: 0.18, colour: "#6b1d1c" },
        stretch: [1, 4, 4],
        vessels: { size: 0.06, depth: 4e-4, amount: 0.7, colour: "#5c1420" },
    },
    lung: {
        ...TISSUE,
        colour: "#d9a49c",
        tone: "#a98482",
        inner: "#c87f78",
        glow: "#f5a99a",
        scatter: 0.55,
        wet: 0.55,
        cells: { size: 0.009, depth: 1.2e-4, amount: 0.45, colour: "#7c6469" },
    },
    brain: {
        ...TISSUE,
        colour: "#d8b2a4",
        tone: "#c08f84",
        inner: "#e6d2c4",
        glow: "#f3b8a4",
        scatter: 0.5,
        wet: 0.7,
        vessels: { size: 0.05, depth: 2.2e-4, amount: 0.75, colour: "#7d1f2b" },
    },
    vessel: {
        ...TISSUE,
        colour: "#ab4c48",
        tone: "#8a3536",
        inner: "#d8a49a",
        glow: "#df6254",
        scatter: 0.5,
        wet: 0.75,
        filmRoughness: 0.18,
        mottling: { size: 0.012, amount: 0.4 },
        waves: { size: 0.005, depth: 6e-5 },
        cells: { size: 0.0011, depth: 2e-5, amount: 0.2, colour: "#cf6f66" },
        stretch: [1, 1, 4],
    },
    bone: {
        ...TISSUE,
        colour: "#e4d6b6",
        tone: "#cdb78c",
        inner: "#b56a58",
        glow: "#f6dfb4",
        scatter: 0.2,
        roughness: 0.6,
        wet: 0.25,
        filmRoughness: 0.35,
        cells: { size: 0.0016, depth: 5e-5, amount: 0.18, colour: "#b79a70" },
    },
    fat: {
        ...TISSUE,
        colour: "#e2bd62",
        tone: "#cf9a43",
        inner: "#e8cc84",
        glow: "#ffd070",
        scatter: 0.6,
        roughness: 0.45,
        wet: 0.6,
        waves: { size: 0.01, depth: 3e-4 },
        cells: { size: 0.0045, depth: 3e-4, amount: 0.22, colour: "#b98236" },
        vessels: { size: 0.04, depth: 3e-5, amount: 0.3, colour: "#a8452e" },
    },
    muscle: {
        ...TISSUE,
        colour: "#8a443d",
        tone: "#6c2e2b",
        inner: "#7c2622",
        wet: 0.65,
        filmRoughness: 0.22,
        cells: { size: 0.0013, depth: 9e-5, amount: 0.4, colour: "#c08a7c" },
        stretch: [1, 1, 14],
    },
    skin: {
        ...TISSUE,
        colour: "#d9a58a",
        tone: "#cb8a72",
        inner: "#b84a3c",
        glow: "#f08060",
        scatter: 0.45,
        roughness: 0.58,
        wet: 0.12,
        filmRoughness: 0.45,
        cells: { size: 0.0012, depth: 4e-5, amount: 0.1, colour: "#b87860" },
    },
    plastic: {
        ...TISSUE,
        colour: "#6f8797",
        tone: "#6f8797",
        inner: "#52646f",
        glow: "#8fa6b4",
        scatter: 0.08,
        roughness: 0.42,
        wet: 0.35,
        filmRoughness: 0.3,
        mottling: { size: 0.05, amount: 0 },
        waves: { size: 0.05, depth: 0 },
        cells: NONE,
    },
});

/**
 * The look of a part; what the server says and this page does not know is drawn as tissue of no organ.
 * @param {string | undefined} appearance @param {string | undefined} colour "#rrggbb"
 * @returns {Look}
 */
export function lookOf(appearance, colour) {
    const look = Object.hasOwn(LOOKS, appearance ?? "") ? LOOKS[/** @type {string} */ (appearance)] : TISSUE;
    if (!/^#[0-9a-f]{6}$/i.test(colour ?? "")) return look;
    return { ...look, ...recoloured(look, /** @type {string} */ (colour)) };
}

/** @param {string} colour @returns {number[]} channels, 0 to 255 */
const channels = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));

/** the other colours keep their ratio to the surface's @param {Look} look @param {string} colour */
function recoloured(look, colour) {
    const from = channels(look.colour);
    const to = channels(colour);
    const moved = (/** @type {string} */ other) =>
        "#" +
        channels(other)
            .map((v, k) => Math.round(Math.min(255, Math.max(0, to[k] + v - from[k]))))
            .map((v) => v.toString(16).padStart(2, "0"))
            .join("");
    return { colour, tone: moved(look.tone), inner: moved(look.inner), glow: moved(look.glow) };
}

/** does the look need patterns at all? @param {Look} look */
export const isPatterned = (look) =>
    look.mottling.amount > 0 || look.waves.depth > 0 || look.cells.amount > 0 || look.vessels.amount > 0;
