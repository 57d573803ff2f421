// Which effects of the picture are on, from what pictures cost: each is tried in turn and dropped for good where it makes
// pictures slow. Pure.

const SETTLE = 3; // pictures after a change that do not count: shaders are compiled
const SAMPLE = 12; // pictures whose median is a cost
export const COST_MAX_MS = 10; // of a picture: the pace draws 60 a second up to this
const DROP_MS = 14; // an effect that is on is dropped above this: other work on the machine is forgiven some

/** @param {number[]} values */
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

export class EffectChoice {
    /** @type {Set<string>} */
    on = new Set();
    /** @type {Map<string, number>} what each costs a picture, ms, of those that were tried */
    cost = new Map();
    /** @type {number[]} of the pictures since the last change */
    sample = [];
    /** ms of a picture before the effect that is being tried; NaN: none was measured yet */
    before = NaN;
    skip = SETTLE;

    /**
     * @param {readonly string[]} names in the order in which they are tried
     * @param {readonly string[] | null} forced on whatever they cost; null: what is cheap enough
     */
    constructor(names, forced) {
        this.untried = forced ? [] : [...names];
        this.forced = forced !== null;
        for (const name of names) if (forced?.includes(name)) this.on.add(name);
        this.trying = "";
    }

    /** the cost of a picture @param {number} ms @returns {boolean} another set of effects is on */
    take(ms) {
        if (this.forced) return false;
        if (this.skip > 0) {
            this.skip--;
            return false;
        }
        this.sample.push(ms);
        if (this.sample.length < SAMPLE) return false;
        const cost = median(this.sample);
        this.sample = [];
        return this.decide(cost);
    }

    /** @param {number} cost ms */
    decide(cost) {
        if (this.trying) {
            this.cost.set(this.trying, cost - this.before);
            const name = this.trying;
            this.trying = "";
            if (cost > COST_MAX_MS) return this.drop(name);
        } else if (cost > DROP_MS && this.on.size > 0) {
            return this.drop(/** @type {string} */ ([...this.on].at(-1)));
        }
        if (cost > COST_MAX_MS) return false;
        this.before = cost;
        const next = this.untried.shift();
        if (next === undefined) return false;
        this.trying = next;
        this.on.add(next);
        this.skip = SETTLE;
        return true;
    }

    /** @param {string} name @returns {true} */
    drop(name) {
        this.on.delete(name);
        this.before = NaN;
        this.skip = SETTLE;
        return true;
    }
}

/**
 * What the address asks for with `effects`: "all", "none", or names with commas; null: nothing.
 * @param {string | null} asked @param {readonly string[]} names
 */
export function forcedEffects(asked, names) {
    if (asked === null) return null;
    return asked === "all" ? names : names.filter((name) => asked.split(",").includes(name));
}
