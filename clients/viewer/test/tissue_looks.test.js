// Looks: every appearance of the server has one, and nothing that a server sends gives none.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { isPatterned, lookOf, LOOKS } from "../src/tissue_looks.js";

test("the table has every appearance of the server and no other", () => {
    const source = readFileSync(new URL("../../../server/sim/core/definition.h", import.meta.url), "utf8");
    const words = /#define PAL_APPEARANCES[\s\\]*"([a-z_|]+)"/.exec(source)?.[1].split("|");
    assert.deepEqual(Object.keys(LOOKS).sort(), words?.sort());
});

test("colours are #rrggbb, lengths and shares are in range", () => {
    for (const [name, look] of Object.entries(LOOKS)) {
        const { colour, tone, inner, glow, cells, vessels, mottling, waves } = look;
        for (const c of [colour, tone, inner, glow, cells.colour, vessels.colour])
            assert.match(c, /^#[0-9a-f]{6}$/, name);
        for (const share of [look.scatter, look.roughness, look.wet, look.filmRoughness, mottling.amount, cells.amount])
            assert.ok(share >= 0 && share <= 1, name);
        for (const { size, depth } of [waves, cells, vessels])
            assert.ok(size >= 1e-3 && size <= 0.2 && depth >= 0 && depth < 0.1 * size, name);
        assert.equal(look.stretch.length, 3);
    }
});

test("no two appearances have the same colour", () => {
    const colours = Object.values(LOOKS).map((look) => look.colour);
    assert.equal(new Set(colours).size, colours.length);
});

test("unknown words and colours fall back", () => {
    const unknown = lookOf(undefined, undefined);
    for (const word of ["", "livr", "constructor", "__proto__", "toString"])
        assert.equal(lookOf(word, undefined), unknown);
    for (const colour of ["red", "#12345", "#12345g", "#1234567", "url(x)", ""])
        assert.equal(lookOf("liver", colour), LOOKS.liver);
});

test("a colour of its own replaces the appearance's and shifts the others with it", () => {
    const { colour, tone } = LOOKS.liver;
    const moved = (/** @type {string} */ c) => `#${(parseInt(c.slice(1), 16) + 0x101010).toString(16)}`;
    const look = lookOf("liver", moved(colour).toUpperCase());
    assert.equal(look.colour, moved(colour).toUpperCase());
    assert.equal(look.tone, moved(tone));
    assert.equal(look.cells, LOOKS.liver.cells);
    assert.equal(lookOf("plastic", "#000000").inner, "#000000");
});

test("plastic needs no pattern, tissue does", () => {
    assert.equal(isPatterned(LOOKS.plastic), false);
    assert.equal(isPatterned(LOOKS.liver), true);
});
