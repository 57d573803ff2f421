// Views that a user has saved, as text of the browser's storage, and the way from one view to another. Pure.

/** @typedef {{kind: "free" | "endoscope", values: Record<string, number>}} Shot a view, as numbers by name */
/** @typedef {{name: string, shot: Shot}} Saved */

export const MOVE_MS = 300; // from one view to another: long enough to follow
export const NAME_MAX = 40; // letters

/** names of the numbers of each kind */
const KEYS = {
    free: ["x", "y", "z", "near", "azimuth", "elevation"],
    endoscope: ["x", "y", "z", "yaw", "pitch", "depth", "angle", "turn", "roll"],
};
const FULL_TURNS = ["azimuth", "yaw", "turn", "roll"]; // angles that are the same after a full turn

/** starts and ends at rest @param {number} t 0 to 1 */
export const smooth = (t) => t * t * (3 - 2 * t);

/**
 * A view between two of the same kind: angles go the shorter way, distances in equal ratios.
 * @param {Shot} from @param {Shot} to @param {number} t 0 to 1 @returns {Shot}
 */
export function between(from, to, t) {
    /** @type {Record<string, number>} */
    const values = {};
    for (const [key, end] of Object.entries(to.values)) {
        const begin = from.values[key];
        let change = end - begin;
        if (FULL_TURNS.includes(key)) change -= 2 * Math.PI * Math.round(change / (2 * Math.PI));
        values[key] = key === "near" ? begin * (end / begin) ** t : begin + t * change;
    }
    return { kind: to.kind, values };
}

/** @param {unknown} value @returns {Saved | null} null: it is none */
function readOne(value) {
    const { name, shot } = /** @type {{name?: unknown, shot?: {kind?: unknown, values?: unknown}}} */ (value ?? {});
    const kind = shot?.kind;
    if (typeof name !== "string" || !name || name.length > NAME_MAX || (kind !== "free" && kind !== "endoscope"))
        return null;
    const numbers = /** @type {Record<string, unknown>} */ (shot?.values ?? {});
    /** @type {Record<string, number>} */
    const values = {};
    for (const key of KEYS[kind]) {
        const number = numbers[key];
        if (typeof number !== "number" || !Number.isFinite(number) || (key === "near" && number <= 0)) return null;
        values[key] = number;
    }
    return { name, shot: { kind, values } };
}

/** what is stored; anything else is left out @param {string | null} stored @returns {Saved[]} */
export function readViews(stored) {
    try {
        const list = JSON.parse(stored ?? "[]");
        return Array.isArray(list) ? list.flatMap((value) => readOne(value) ?? []) : [];
    } catch {
        return [];
    }
}

/** a view of the same name is replaced @param {Saved[]} views @param {string} name @param {Shot} shot @returns {Saved[]} */
export function withView(views, name, shot) {
    const saved = { name: name.slice(0, NAME_MAX), shot };
    const at = views.findIndex((view) => view.name === saved.name);
    return at < 0 ? [...views, saved] : views.map((view, i) => (i === at ? saved : view));
}

/** a name for the next view @param {Saved[]} views @param {(n: number) => string} named the name of a number */
export function nextName(views, named) {
    let n = views.length + 1;
    while (views.some(({ name }) => name === named(n))) n++;
    return named(n);
}
