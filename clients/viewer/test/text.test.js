import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";
import { LANGUAGES, chooseLanguage, decimal, refusalText, text } from "../src/text.js";

const { en, ...others } = LANGUAGES;
const folder = new URL("../", import.meta.url);
const sources = readdirSync(new URL("src/", folder))
    .filter((name) => name.endsWith(".js") && !name.startsWith("text_"))
    .map((name) => readFileSync(new URL(`src/${name}`, folder), "utf8"));
const page = readFileSync(new URL("index.html", folder), "utf8");
/** names in braces @param {string} s */
const values = (s) => [...s.matchAll(/\{(\w+)\}/g)].map((match) => match[1]).sort();

for (const [language, texts] of Object.entries(others))
    test(`${language} has each text of English, with the same values`, () => {
        assert.deepEqual(Object.keys(texts).sort(), Object.keys(en).sort());
        for (const key of Object.keys(en)) {
            assert.deepEqual(values(texts[key]), values(en[key]), key);
            assert.ok(texts[key].trim(), key);
        }
    });

test("each key of the page exists, and each text is used", () => {
    const used = [...page.matchAll(/data-(?:text|title|label)="([^"]+)"/g)].map((match) => match[1]);
    for (const key of used) assert.ok(Object.hasOwn(en, key), key);
    const all = sources.join("\n");
    // a key is written whole, or begins with a part that ends in a dot and is completed by a value
    const parts = [...all.matchAll(/`([\w.]+\.)\$\{/g)].map((match) => match[1]);
    for (const key of Object.keys(en))
        assert.ok(
            used.includes(key) || all.includes(`"${key}"`) || parts.some((part) => key.startsWith(part)),
            `nothing shows "${key}"`,
        );
});

test("a refusal is the server's own sentence, or one of the user's language", () => {
    assert.equal(refusalText("muted", "Ada lets you watch only", "en"), "Ada lets you watch only");
    assert.equal(refusalText("muted", "Ada lets you watch only", "de"), LANGUAGES.de["refusal.muted"]);
    assert.equal(refusalText("busy", "pause: wait 2 s", "de"), "Der Server ist beschäftigt: pause: wait 2 s");
    assert.equal(refusalText("verb", "there is no command x", "de"), "there is no command x");
});

test("numbers have the decimal sign of the language", () => {
    assert.equal(decimal("1234.50 ms", "de"), "1234,50 ms");
    assert.equal(decimal("1234.50 ms", "en"), "1234.50 ms");
    assert.equal(decimal("12", "de"), "12");
});

test("the language is the first known one", () => {
    assert.equal(chooseLanguage([null, "fr-CA", "de-AT", "en"]), "de");
    assert.equal(chooseLanguage([undefined, "constructor", ""]), "en");
});

test("values replace their names", () => {
    assert.equal(text("tools.pull", { x: 1 }), en["tools.pull"]);
});
