// The material is shown in colour while a tool needs it, without losing the user's choice.
import assert from "node:assert/strict";
import { test } from "node:test";
import { materialField, PaintColours } from "../src/paint_colours.js";

/** @param {string} field chosen by the user @param {string[]} fields of the part */
function stand(field, fields) {
    const state = { parts: [{ fields }], field };
    return { state, colours: new PaintColours(state, { choose: (name) => (state.field = name) }) };
}

test("each tool has the field of the material that it changes or measures", () => {
    assert.equal(materialField("paint", "softer"), "young");
    assert.equal(materialField("paint", "lighter"), "density");
    assert.equal(materialField("probe", "lighter"), "young");
    assert.equal(materialField("extrude", "softer"), null);
});

test("the user's choice comes back", () => {
    const { state, colours } = stand("von_mises", ["von_mises", "strain"]);
    colours.show("strain");
    assert.equal(state.field, "strain");
    colours.show("strain");
    colours.show(null);
    assert.equal(state.field, "von_mises");
});

test("a choice that the user makes meanwhile stays", () => {
    const { state, colours } = stand("none", ["von_mises", "strain"]);
    colours.show("strain");
    state.field = "von_mises";
    colours.show("strain");
    assert.equal(state.field, "von_mises");
    colours.show(null);
    assert.equal(state.field, "von_mises");
});

test("a field that no part has is not chosen", () => {
    const { state, colours } = stand("displacement", ["displacement"]);
    colours.show("strain");
    assert.equal(state.field, "displacement");
    colours.show(null);
    assert.equal(state.field, "displacement");
});
