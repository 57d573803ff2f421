// Commands: every one that the panels build has a verb of the server, all its required arguments and no unknown one.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { neighbourArgs } from "../src/accuracy_plot.js";
import { commandOf, cutCommand, PAINTS, TOOLS } from "../src/sculpt_commands.js";

const NET = new URL("../../../server/net/", import.meta.url);

/** arguments by verb, from the tables {"verb", "required | optional", …} of server/net @returns {Map<string, {required: string[], optional: string[]}>} */
function parseVerbs() {
    const sources = readdirSync(NET).filter((name) => name.endsWith(".c"));
    const text = sources.map((name) => readFileSync(new URL(name, NET), "utf8")).join("\n");
    // a list of arguments is a sequence of string literals and of macros that stand for some
    const macros = new Map(
        [...text.matchAll(/#define (\w+)\s+(.*"[\w |]*".*)/g)].map(([, name, value]) => [name, value]),
    );
    const expand = (/** @type {string} */ value) =>
        [...value.matchAll(/"([\w |]*)"|(\w+)/g)]
            .map(([, literal, macro]) => literal ?? expand(macros.get(macro) ?? ""))
            .join("");
    const rows = text.matchAll(/\{"([a-z_]+)",\s+((?:"[\w |]*"|[A-Z]+)(?:\s+"[\w |]*")*)[,}]/g);
    return new Map(
        [...rows].map(([, verb, args]) => {
            const [required, optional = ""] = expand(args).split("|");
            return [verb, { required: required.match(/\w+/g) ?? [], optional: optional.match(/\w+/g) ?? [] }];
        }),
    );
}

const verbs = parseVerbs();

/** @param {string} verb @param {Record<string, number>} args */
function check(verb, args) {
    const known = verbs.get(verb);
    assert.ok(known, `the server has no verb ${verb}`);
    const all = [...known.required, ...known.optional];
    for (const name of Object.keys(args)) assert.ok(all.includes(name), `${verb} has no argument ${name}`);
    for (const name of known.required) assert.ok(name in args, `${verb} needs ${name}`);
    for (const value of Object.values(args)) assert.ok(Number.isFinite(value), `${verb}: ${JSON.stringify(args)}`);
}

test("every tool of the sculpting panel builds a command of the server", () => {
    const settings = {
        distance_m: 0.02,
        scale: 1,
        radius_m: 0.03,
        sharpness: 2,
        entity: 1,
        pressure_Pa: 200,
        lift_m: 0.05,
        stiffness_N_m: 60,
        middle: [0, 0, 0],
    };
    const points = [
        [1, 2, 3],
        [4, 5, 6],
    ];
    for (const tool of Object.keys(TOOLS))
        for (const paint of Object.keys(PAINTS)) {
            const command = commandOf(tool, { ...settings, paint }, points.slice(0, TOOLS[tool].points));
            assert.ok(command, tool);
            check(command.verb, command.args);
        }
    for (const axis of /** @type {const} */ (["none", "x", "y", "z"])) {
        const { verb, args } = cutCommand(axis, 0.5, { low: [0, 0, 0], high: [1, 1, 1] });
        check(verb, args);
    }
    for (const verb of ["undo", "redo", "release", "set_rest_shape"]) check(verb, {});
});

test("the accuracy panel switches by a point of the study and by the arguments of a neighbour", () => {
    check("study_point", { index: 3 });
    for (const near of [{ size: 24 }, { step_ms: 8.5 }, { tolerance: 1e-6 }])
        check("configure", neighbourArgs({ parameter: "resolution", label: "", ...near }) ?? {});
});

test("every verb in the sources of the page is one of the server", () => {
    const read = (/** @type {URL} */ folder, /** @type {string} */ ending) =>
        readdirSync(folder)
            .filter((name) => name.endsWith(ending))
            .map((name) => readFileSync(new URL(name, folder), "utf8"))
            .join("\n");
    const page = read(new URL("../src/", import.meta.url), ".js").replace(/verb: "text"/g, "");
    const sent = [...page.matchAll(/verb: "([a-z_]+)"|this\.command\((.*)\)/g)].flatMap(([, verb, argument]) =>
        verb ? [verb] : [...argument.matchAll(/"([a-z_]+)"/g)].map(([, word]) => word),
    );
    assert.ok(new Set(sent).size >= 11, `found ${[...new Set(sent)]}`);
    const server = read(NET, ".c");
    for (const verb of sent) assert.ok(server.includes(`"${verb}"`), `the server has no verb ${verb}`);
});
