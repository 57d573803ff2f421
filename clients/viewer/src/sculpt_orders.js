// Orders of sculpting from what the panel is set to and where it was clicked; places of a cut; words for people. Pure.

/**
 * @typedef {{distance_m: number, scale: number, radius_m: number, paint: string, sharp: number, sharpWhat: number,
 *            pressure_Pa: number, lift_m: number, stiffness_N_m: number, middle: number[]}} Settings
 * @typedef {{verb: string, args: Record<string, number>}} Order
 * @typedef {{low: number[], high: number[]}} Box
 */

/** @type {Record<string, {title: string, places: number, hints: string[]}>} what a click does: places it takes, what to say before each */
export const TOOLS = Object.freeze({
  extrude: { title: "Extrude", places: 1, hints: ["Click a face: a cell grows out of it."] },
  delete: { title: "Delete", places: 1, hints: ["Click a cell: it goes."] },
  divide: { title: "Divide", places: 1, hints: ["Click a cell: it is cut into smaller ones."] },
  merge: { title: "Merge", places: 2, hints: ["Click the first of two faces that become one.", "Now the other face."] },
  bridge: {
    title: "Bridge",
    places: 2,
    hints: ["Click the first of two faces that a cell joins.", "Now the other face."],
  },
  sharpen: { title: "Sharpen", places: 1, hints: ["Click near the edge, the vertex or the face."] },
  paint: { title: "Paint", places: 1, hints: ["Click where to paint."] },
  inflate: { title: "Inflate", places: 1, hints: ["Click what to blow up."] },
  deflate: { title: "Deflate", places: 1, hints: ["Click what to suck in."] },
  curve: {
    title: "Curve",
    places: 2,
    hints: ["Click one end of a handle.", "Now the other end: its middle is pulled."],
  },
  probe: { title: "Probe", places: 1, hints: ["Click where to look up the material."] },
});

/** tools that are forces: they last until they are released, and follow their slider */
export const FORCES = Object.freeze(["inflate", "deflate", "curve"]);

/** @type {Record<string, {title: string, young_factor: number, density_factor: number}>} strokes of the brush: factors of stiffness and density */
export const PAINTS = Object.freeze({
  stiffer: { title: "Stiffer", young_factor: 2, density_factor: 1 },
  softer: { title: "Softer", young_factor: 0.5, density_factor: 1 },
  heavier: { title: "Heavier", young_factor: 1, density_factor: 1.5 },
  lighter: { title: "Lighter", young_factor: 1, density_factor: 1 / 1.5 },
});

/**
 * The way a handle's middle goes: away from the body's middle, across the handle; below 0: towards it.
 * @param {number[]} a m @param {number[]} b m, its ends @param {number[]} middle m, of the body @param {number} lift_m
 */
export function liftOf(a, b, middle, lift_m) {
  const dot = (/** @type {number[]} */ u, /** @type {number[]} */ v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const along = b.map((v, i) => v - a[i]),
    out = a.map((v, i) => (v + b[i]) / 2 - middle[i]);
  const share = dot(along, along) > 0 ? dot(out, along) / dot(along, along) : 0;
  const across = out.map((v, i) => v - share * along[i]),
    length = Math.hypot(...across);
  return length > 1e-9 ? across.map((v) => (lift_m * v) / length) : [0, 0, lift_m];
}

/**
 * The order of a tool at the places clicked, or null: it wants more of them.
 * @param {string} tool of TOOLS @param {Settings} settings @param {number[][]} places m
 * @returns {Order | null}
 */
export function orderOf(tool, settings, places) {
  if (places.length < TOOLS[tool].places) return null;
  const [x_m, y_m, z_m] = places[0];
  /** @type {Record<string, number>} */
  const args = { x_m, y_m, z_m };
  if (TOOLS[tool].places === 2) [args.x2_m, args.y2_m, args.z2_m] = places[1];
  if (tool === "extrude") Object.assign(args, { distance_m: settings.distance_m, scale: settings.scale });
  if (tool === "sharpen") Object.assign(args, { sharp: settings.sharp, what: settings.sharpWhat });
  if (tool === "paint") {
    const { young_factor, density_factor } = PAINTS[settings.paint];
    Object.assign(args, { radius_m: settings.radius_m, young_factor, density_factor });
  }
  if (FORCES.includes(tool)) args.radius_m = settings.radius_m;
  if (tool === "inflate" || tool === "deflate")
    args.pressure_Pa = tool === "inflate" ? settings.pressure_Pa : -settings.pressure_Pa;
  if (tool === "curve") {
    args.stiffness_N_m = settings.stiffness_N_m;
    [args.dx_m, args.dy_m, args.dz_m] = liftOf(places[0], places[1], settings.middle, settings.lift_m);
  }
  return { verb: tool === "deflate" ? "inflate" : tool, args };
}

/**
 * A cut across an axis, at a part of the box; from there on to the far side nothing is shown.
 * @param {"none" | "x" | "y" | "z"} axis @param {number} part 0..1 @param {Box} box
 * @returns {Order}
 */
export function cutOrder(axis, part, box) {
  const k = ["x", "y", "z"].indexOf(axis);
  if (k < 0) return { verb: "uncut", args: {} };
  const args = { nx: 0, ny: 0, nz: 0, offset_m: box.low[k] + part * (box.high[k] - box.low[k]) };
  args[/** @type {"nx" | "ny" | "nz"} */ ("n" + axis)] = 1;
  return { verb: "cut", args };
}

/** a box around another one and points @param {Box} box @param {Float32Array} x [n][3] @returns {Box} */
export function boxAround(box, x) {
  const low = [...box.low],
    high = [...box.high];
  for (let i = 0; i < x.length; i++) {
    low[i % 3] = Math.min(low[i % 3], x[i]);
    high[i % 3] = Math.max(high[i % 3], x[i]);
  }
  return { low, high };
}

/** three figures, in a unit that fits @param {number} pascal */
function stiffness(pascal) {
  const [unit, size] = pascal >= 1e6 ? ["MPa", 1e6] : pascal >= 1e3 ? ["kPa", 1e3] : ["Pa", 1];
  return `${Number((pascal / Number(size)).toPrecision(3))} ${unit}`;
}

/** what came of an order, in short @param {{verb: string, text: string, args: Record<string, number>}} answer of the server */
export function said({ verb, text, args }) {
  if (verb === "probe" && args.young_Pa !== undefined)
    return `${stiffness(args.young_Pa)}, ${Number(args.density_kg_m3.toPrecision(3))} kg/m³`;
  if (args?.cells === undefined) return text;
  const title = TOOLS[verb]?.title ?? verb[0].toUpperCase() + verb.slice(1);
  return `${title}: ${args.cells} cells${args.made_ms === undefined ? "" : `, ${Math.round(args.made_ms)} ms`}`;
}
