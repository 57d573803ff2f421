// protocol/README.md: the bytes of its example decode to the numbers that it tells, and its tables have the server's words.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { FrameDecoder } from "../src/frame_decoder.js";

const tree = new URL("../../../", import.meta.url);
/** @param {string} path */
const read = (path) => readFileSync(new URL(path, tree), "utf8");
const page = read("protocol/README.md");

/** the cells of all rows between two headings @param {string} heading */
function rows(heading) {
    const text = page.split(`${heading}\n`)[1].split(/^#/m)[0];
    const lines = text.split("\n").filter((line) => line.startsWith("| ") && !line.startsWith("| ---"));
    return lines.map((line) =>
        line
            .split("|")
            .map((cell) => cell.trim())
            .slice(1, -1),
    );
}
/** @param {string} cell */
const numbers = (cell) => cell.split(" ").map(Number);

test("the example of a FRAME", () => {
    const all = rows("### A FRAME, byte by byte");
    const parts = all.filter((row) => row[1].startsWith("`"));
    const vertices = all.filter((row) => row.length === 4 && /^\d$/.test(row[0]));
    assert.equal(vertices.length, 4);
    /** @type {number[]} */
    const bytes = [];
    for (const [at, hex] of parts) {
        assert.equal(bytes.length, Number(at), `${hex} is not at ${at}`);
        bytes.push(
            ...hex
                .replaceAll("`", "")
                .split(" ")
                .map((byte) => parseInt(byte, 16)),
        );
    }
    const rest = Float32Array.from(vertices.flatMap((row) => numbers(row[1])));
    const positions = new Float32Array(12);
    const head = new FrameDecoder({
        rest,
        triangles: new Uint32Array(),
        vertexOf: Uint32Array.of(0, 1, 2, 3),
        neighbour: new Uint32Array(16),
        weight: Int16Array.of(0, 0, 0, 0, 4096, 0, 0, 0, 4096, 0, 0, 0, 4096, 0, 0, 0),
        levels: Uint32Array.of(0),
        uv: null,
        look: null,
    }).decode(Uint8Array.from(bytes), positions);
    const stated = { part: 0, epoch: 1, seq: 2, simTimeUs: 16667, cycle: 3, n: 4, nRaw: 13, q: Math.fround(1e-4) };
    for (const [key, value] of Object.entries(stated)) assert.equal(Reflect.get(head, key), value, key);
    vertices.forEach(([, , x, position], i) =>
        numbers(position).forEach((wanted, c) => {
            // one rounding to f32 of 0.1 m
            assert.ok(Math.abs(positions[3 * i + c] - wanted) < 1e-8, `vertex ${i}, axis ${c}`);
            assert.ok(Math.abs(rest[3 * i + c] + (numbers(x)[c] * 1e-4) / 16 - wanted) < 1e-8, `X of vertex ${i}`);
        }),
    );
});

const net = readdirSync(new URL("server/net/", tree)).filter((name) => name.endsWith(".c"));
const source = net.map((name) => read(`server/net/${name}`)).join("\n");

test("the table of errors has every code of the server, and no other", () => {
    const stated = rows("### Errors").flatMap((row) => [...row[0].matchAll(/`(\w+)`/g)].map((match) => match[1]));
    const sent = source.matchAll(/pal_hub_(?:refuse|notice)\(\s*\w+, "(\w+)"/g);
    assert.deepEqual([...new Set(stated)].sort(), [...new Set([...sent].map((match) => match[1]))].sort());
});

test("the table of metrics has every metric of the server, and no other", () => {
    const stated = rows("## Metrics over HTTP").flatMap((row) =>
        [...row[0].matchAll(/`(palpate_\w+)/g)].map((match) => match[1]),
    );
    // {"name", "Sentence.", ...} of the table of numbers, and the histogram
    const sent = [...source.matchAll(/\{"(\w+)", "[A-Z][^"]*\.",/g)].map((match) => "palpate_" + match[1]);
    sent.push(...[...source.matchAll(/TYPE (\w+) histogram/g)].map((match) => match[1]));
    assert.deepEqual(stated.sort(), sent.sort());
});
