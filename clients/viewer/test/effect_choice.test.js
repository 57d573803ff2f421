// Effects are tried one by one, kept while pictures stay fast, and dropped for good.
import assert from "node:assert/strict";
import { test } from "node:test";
import { COST_MAX_MS, EffectChoice, forcedEffects } from "../src/effect_choice.js";

const NAMES = ["shadow", "occlusion"];

/**
 * Draws pictures whose cost is `base` and what each effect that is on adds.
 * @param {EffectChoice} choice @param {number} pictures @param {number} base ms @param {Record<string, number>} added ms
 * @returns {string[]} sets of effects after each change
 */
function draw(choice, pictures, base, added) {
    const sets = [];
    for (let i = 0; i < pictures; i++) {
        const cost = base + [...choice.on].reduce((sum, name) => sum + added[name], 0);
        if (choice.take(cost)) sets.push([...choice.on].join("+"));
    }
    return sets;
}

test("cheap effects come on one after another and their costs are known", () => {
    const choice = new EffectChoice(NAMES, null);
    assert.deepEqual(draw(choice, 100, 3, { shadow: 1, occlusion: 4 }), ["shadow", "shadow+occlusion"]);
    assert.deepEqual(
        [...choice.cost],
        [
            ["shadow", 1],
            ["occlusion", 4],
        ],
    );
});

test("an effect that makes pictures slow is dropped for good, a cheaper one stays", () => {
    const choice = new EffectChoice(NAMES, null);
    const sets = draw(choice, 400, 3, { shadow: 1, occlusion: 30 });
    assert.deepEqual(sets, ["shadow", "shadow+occlusion", "shadow"]);
    assert.equal(choice.cost.get("occlusion"), 30);
});

test("where pictures are slow without effects none is tried, until they are fast", () => {
    const choice = new EffectChoice(NAMES, null);
    assert.deepEqual(draw(choice, 200, COST_MAX_MS + 1, { shadow: 0, occlusion: 0 }), []);
    assert.deepEqual(draw(choice, 40, 2, { shadow: 0, occlusion: 0 }), ["shadow", "shadow+occlusion"]);
});

test("single slow pictures change nothing", () => {
    const choice = new EffectChoice(NAMES, null);
    draw(choice, 100, 3, { shadow: 1, occlusion: 1 });
    for (let i = 0; i < 300; i++) assert.equal(choice.take(i % 5 ? 5 : 200), false);
});

test("effects are given up one by one when the scene becomes slow", () => {
    const choice = new EffectChoice(NAMES, null);
    draw(choice, 100, 3, { shadow: 1, occlusion: 1 });
    assert.deepEqual(draw(choice, 200, 40, { shadow: 1, occlusion: 1 }), ["shadow", ""]);
    assert.deepEqual(draw(choice, 200, 3, { shadow: 1, occlusion: 1 }), []);
});

test("the address decides over the cost", () => {
    const all = new EffectChoice(NAMES, forcedEffects("all", NAMES));
    assert.deepEqual([...all.on], NAMES);
    assert.deepEqual(draw(all, 300, 500, { shadow: 100, occlusion: 100 }), []);
    assert.deepEqual(forcedEffects("none", NAMES), []);
    assert.deepEqual(forcedEffects("occlusion,fog", NAMES), ["occlusion"]);
    assert.equal(forcedEffects(null, NAMES), null);
});
