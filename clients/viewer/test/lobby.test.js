// What the lobby says of a session, and the picture that it draws.
import assert from "node:assert/strict";
import { test } from "node:test";
import { offersChoice, peopleText, stateText } from "../src/lobby.js";
import { project } from "../src/picture.js";

/** @param {object} changes */
const session = (changes) => /** @type {any} */ ({ name: "a", title: "A", state: "running", ...changes });

test("one session is opened at once, unless scenes can be opened", () => {
    assert.equal(offersChoice({ sessions: [session({})] }), false);
    assert.equal(offersChoice({ sessions: [session({})], scenes: [] }), true);
    assert.equal(offersChoice({ sessions: [] }), true);
    assert.equal(offersChoice({ sessions: [session({}), session({})] }), true);
    // one that failed is none, but who may know the reason reads it
    assert.equal(offersChoice({ sessions: [session({}), session({ state: "failed" })] }), false);
    assert.equal(offersChoice({ sessions: [session({}), session({ state: "failed", text: "no mesh" })] }), true);
    assert.equal(offersChoice({ sessions: [session({ state: "failed" })] }), true);
});

test("states are said in words", () => {
    assert.equal(stateText(session({ slowdown: 1.01 })), "running");
    assert.equal(stateText(session({ slowdown: 2 })), "0.50 of real time");
    assert.equal(stateText(session({ state: "paused" })), "paused");
    assert.equal(stateText(session({ state: "failed", text: "no mesh" })), "cannot be opened: no mesh");
    assert.equal(stateText(session({ state: "failed" })), "cannot be opened");
});

test("people are named where the server names them", () => {
    const people = [
        { name: "Ada", role: "instructor" },
        { name: "Ben", role: "trainee" },
    ];
    assert.equal(peopleText(session({ members: 2, people })), "Ada (instructor), Ben");
    assert.equal(peopleText(session({ members: 2 })), "2 members");
    assert.equal(peopleText(session({ members: 1 })), "1 member");
    assert.equal(peopleText(session({ members: 0, people: [] })), "nobody is here");
});

test("a cube shows three of its sides, within the picture, the nearest last", () => {
    const rest = new Float32Array(24);
    for (let i = 0; i < 8; i++) rest.set([i & 1, (i >> 1) & 1, (i >> 2) & 1], 3 * i);
    const quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    const triangles = new Uint32Array(quads.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]));
    const seen = project([{ rest, triangles }]);
    assert.equal(seen.length, 6);
    for (const { corners, shade } of seen) {
        assert.ok(corners.every((v) => Math.abs(v) <= 0.5 + 1e-6));
        assert.ok(shade >= 0.35 && shade <= 1);
    }
    for (let i = 1; i < seen.length; i++) assert.ok(seen[i].depth >= seen[i - 1].depth);
    // of the three sides the one above is the brightest
    const shades = [...new Set(seen.map(({ shade }) => shade.toFixed(6)))].sort();
    assert.equal(shades.length, 3);
});

test("nothing to draw draws nothing", () => {
    assert.deepEqual(project([]), []);
    assert.deepEqual(project([{ rest: new Float32Array(9), triangles: new Uint32Array([0, 1, 2]) }]), []);
});
