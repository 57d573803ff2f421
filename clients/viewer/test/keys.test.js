// Keys: actions, keys that a focused element uses itself, repetition of held keys.
import assert from "node:assert/strict";
import { test } from "node:test";
import { keyMap } from "../src/keys.js";

function stand() {
    /** @type {string[]} */
    const did = [];
    const record = (/** @type {string} */ what) => () => did.push(what);
    const view = {
        orbit: (/** @type {number} */ x, /** @type {number} */ y) => did.push(`orbit ${x} ${y}`),
        zoom: (/** @type {number} */ f) => did.push(f < 1 ? "nearer" : "away"),
        home: record("home"),
    };
    const find = keyMap({ " ": record("pause"), r: record("reset") }, view);
    const press = (/** @type {string} */ key, /** @type {any} */ more = {}) =>
        find({
            key,
            ctrlKey: false,
            metaKey: false,
            altKey: false,
            repeat: false,
            target: { tagName: "BODY" },
            ...more,
        })?.();
    return { did, press };
}

test("letters act in either case; with a modifier they belong to the browser", () => {
    const { did, press } = stand();
    press("R");
    press("r", { ctrlKey: true });
    assert.deepEqual(did, ["reset"]);
});

test("space presses the focused button instead of pausing", () => {
    const { did, press } = stand();
    press(" ", { target: { tagName: "BUTTON" } });
    press(" ", { target: { tagName: "INPUT", type: "checkbox" } });
    press(" ");
    assert.deepEqual(did, ["pause"]);
});

test("keys typed into a text field are text", () => {
    const { did, press } = stand();
    for (const key of ["r", " ", "ArrowLeft", "-"]) press(key, { target: { tagName: "INPUT", type: "text" } });
    for (const key of ["r", " ", "ArrowDown"]) press(key, { target: { tagName: "SELECT" } }); // letters choose from a list
    assert.deepEqual(did, []);
});

test("a held arrow key keeps turning the view, a held letter acts once", () => {
    const { did, press } = stand();
    press("ArrowLeft");
    press("ArrowLeft", { repeat: true });
    press("r");
    press("r", { repeat: true });
    assert.deepEqual(did, ["orbit -40 0", "orbit -40 0", "reset"]);
});
