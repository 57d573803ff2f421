// Text messages: the table of the viewer is that of protocol/control_table.c, and the reader accepts exactly it.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { readControl } from "../src/control_reader.js";
import { CLIENT_MESSAGES, SERVER_MESSAGES } from "../src/control_table.js";
import { WireError } from "../src/wire.js";
import { hello, part } from "./fixtures/messages.js";

/** @param {string} name */
const source = (name) => readFileSync(new URL(`../../../protocol/${name}`, import.meta.url), "utf8");

/** kinds of this table by the field types of the C table */
const KINDS = {
    U16: "u16",
    U32: "u32",
    U64: "u64",
    F64: "f64",
    NUMBER_OR_NAN: "f64",
    BOOL: "bool",
    TEXT: "text",
    TEXT_OR_EMPTY: "text",
    ROLE: "role",
    TOOL: "tool",
    NUMBERS: "numbers",
    TEXTS: "texts",
    TEXTS_OR_EMPTY: "texts",
    ARGS: "args",
};

/** @typedef {Record<string, unknown>} Table */

/** tables of control_table.c by name, in the form of control_table.js @returns {Record<string, Table>} */
function parseTables() {
    /** @type {Record<string, Table>} */
    const tables = {};
    for (const [, name, body] of source("control_table.c").matchAll(/(\w+)_fields\[\] = \{([\s\S]*?)\{0\}\}/g)) {
        /** @type {Table} */
        const table = {};
        for (const [, key, type, required, rest] of body.matchAll(/\{"(\w+)", (\w+), (true|false), ([^{}]*)\}/g)) {
            const subtable = rest.match(/(\w+)_fields\s*$/)?.[1] ?? "";
            const kind = /** @type {Record<string, string>} */ (KINDS)[type];
            const nested = type === "OBJECTS" ? [tables[subtable]] : type === "OBJECT" ? tables[subtable] : null;
            const value = nested ?? (rest.startsWith("ARRAY(") ? "vector" : kind);
            assert.ok(value, `${name}.${key} has the type ${type}`);
            table[required === "true" ? key : `${key}?`] = value;
        }
        tables[name] = table;
    }
    return tables;
}

/** messages of control.h: type, direction, name of the table @returns {{type: string, server: boolean, table: string}[]} */
function parseMessages() {
    return [...source("control.h").matchAll(/X\((\w+), "(\w+)", (true|false)\)/g)].map(([, table, type, server]) => ({
        type,
        server: server === "true",
        table,
    }));
}

test("every message has the fields of the C table, in its order", () => {
    const tables = parseTables();
    const messages = parseMessages();
    assert.ok(messages.length >= 15, `${messages.length} messages`);
    for (const server of [true, false]) {
        const mine = /** @type {Record<string, Table>} */ (server ? SERVER_MESSAGES : CLIENT_MESSAGES);
        const theirs = messages.filter((message) => message.server === server);
        assert.deepEqual(Object.keys(mine).sort(), theirs.map((message) => message.type).sort());
        for (const { type, table } of theirs) {
            assert.deepEqual(mine[type], tables[table], type);
            assert.deepEqual(Object.keys(mine[type]), Object.keys(tables[table]), `${type}: order`);
        }
    }
});

test("a message is read with its known keys; unknown ones are left out", () => {
    const message = hello({ parts: [part({ fields: ["displacement"] })], accuracy: "2 %" });
    assert.deepEqual(readControl(JSON.stringify({ ...message, later: { x: 1 } })), message);
    assert.deepEqual(readControl('{"type":"pong","stamp_ms":1.5}'), { type: "pong", stamp_ms: 1.5 });
});

test("missing fields, wrong types, unknown messages and damaged JSON are refused", () => {
    /** @type {[unknown, string][]} */
    const wrong = [
        [hello({ credit: undefined }), "FIELD"],
        [hello({ credit: -1 }), "FIELD"],
        [hello({ credit: 1.5 }), "FIELD"],
        [hello({ up: [0, 1] }), "FIELD"],
        [{ ...hello(), parts: {} }, "FIELD"],
        [{ ...hello(), parts: [{ name: "liver" }] }, "FIELD"],
        [{ ...hello(), you: null }, "FIELD"],
        [{ ...hello(), you: { id: 1, role: "king", name: "Ada" } }, "FIELD"],
        [{ ...hello(), title: 5 }, "FIELD"],
        [{ type: "join", name: "Ada", role: "viewer" }, "KIND"],
        [{ type: "toString" }, "KIND"],
        [[], "KIND"],
        [null, "KIND"],
    ];
    for (const [message, code] of wrong)
        assert.throws(() => readControl(JSON.stringify(message)), { code }, JSON.stringify(message));
    assert.throws(() => readControl("{"), WireError);
});
