// The golden packets of tests/data/golden, which the C tests read too: same bytes, same numbers.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { decodeAsset } from "../src/asset.js";
import { decodeField, readFieldHead } from "../src/field_decoder.js";
import { FrameDecoder, readFrameHead } from "../src/frame_decoder.js";
import { applyTopologyDelta } from "../src/topology_delta.js";
import {
    KIND,
    POSE_FLAG,
    PROTOCOL,
    readHaptic,
    readHead,
    readTools,
    WireError,
    writeAck,
    writePose,
} from "../src/wire.js";

/** @param {string} name */
const load = (name) => new Uint8Array(readFileSync(new URL(`../../../tests/data/golden/${name}`, import.meta.url)));
/** @type {any} */
const expected = JSON.parse(new TextDecoder().decode(load("expected.json")));

/** every number of `wanted` is in `got`, as f32 when the wire carries f32 @param {any} got @param {any} wanted */
function same(got, wanted, path = "") {
    if (typeof wanted === "number")
        assert.ok(got === wanted || got === Math.fround(wanted), `${path}: ${got}, wanted ${wanted}`);
    else if (typeof wanted === "object")
        for (const key of Object.keys(wanted)) same(got[key], wanted[key], `${path}.${key}`);
    else assert.equal(got, wanted, path);
}

test("writes the golden pose and ack byte for byte", () => {
    assert.deepEqual(writePose(expected.pose), load("pose.bin"));
    assert.deepEqual(writeAck(expected.ack), load("ack.bin"));
    assert.deepEqual(readHead(load("pose.bin")), { kind: KIND.POSE, flags: 0, index: 3 });
    assert.equal(POSE_FLAG.CONTACT | POSE_FLAG.POSE_ONLY | POSE_FLAG.AWAY, expected.pose.flags);
    assert.equal(PROTOCOL, "palpate.v2");
});

test("reads the golden tools", () => {
    const tools = readTools(load("tools.bin"));
    same(tools, expected.tools);
    assert.equal(tools.tools.length, expected.tools.tools.length);
    assert.deepEqual(
        tools.tools.map((t) => t.held),
        expected.tools.tools.map((/** @type {any} */ t) => (t.flags & 1) === 1),
    );
});

test("reads the golden haptic model", () => {
    const { contact_patches: contactPatches, ...rest } = expected.haptic;
    same(readHaptic(load("haptic.bin")), { ...rest, contactPatches });
});

test("reads the golden field", () => {
    const level = new Uint8Array(expected.field.n);
    const head = decodeField(load("field.bin"), level);
    same({ ...head, level }, expected.field, "field");
    assert.equal(head.name, "von_mises");
});

test("refuses fields of bad kinds, ranges, counts and blocks", () => {
    const bytes = load("field.bin");
    /** @param {number} at @param {number} value */
    const changed = (at, value) => {
        const copy = bytes.slice();
        copy[at] = value;
        return copy;
    };
    for (const [at, value, code] of [
        [0, 0, "MAGIC"],
        [4, 1, "KIND"],
        [4, 99, "KIND"],
        [5, 1, "FLAGS"],
        [6, 16, "RANGE"],
        [12, 0, "RANGE"],
        [12, 10, "RANGE"],
        [15, 128, "RANGE"],
        [23, 255, "RANGE"],
        [27, 127, "RANGE"],
        [35, 255, "COUNT"],
        [36, 0, "LONG"],
    ])
        assert.throws(() => readFieldHead(changed(Number(at), Number(value))), { code }, `byte ${at}`);
    assert.equal(readFieldHead(changed(12, 4)).name, "stiffness");
    const level = new Uint8Array(expected.field.n);
    assert.throws(() => decodeField(bytes, new Uint8Array(level.length - 1)), { code: "COUNT" });
    assert.throws(() => decodeField(changed(40, 255), level), WireError);
});

test("applies the golden topology delta to the table of the golden asset", () => {
    const { triangles, rest } = decodeAsset(load("asset.bin"));
    const wanted = expected.topology_delta;
    const before = triangles.slice();
    const head = applyTopologyDelta(load("topology_delta.bin"), triangles, rest.length / 3);
    same(head, { part: wanted.part, epoch: wanted.epoch, revision: wanted.revision, n: wanted.n }, "topology_delta");
    assert.deepEqual([...triangles], wanted.triangles);
    wanted.slots.forEach((/** @type {number} */ slot, /** @type {number} */ i) =>
        before.set(wanted.corners.slice(3 * i, 3 * i + 3), 3 * slot),
    );
    assert.deepEqual(triangles, before);
});

test("reads the golden asset, whose hash is its name", () => {
    const bytes = load("asset.bin");
    const asset = decodeAsset(bytes);
    same(
        asset,
        { ...expected.asset, levels: {}, hash: undefined, rest: Object.assign({}, expected.asset.rest) },
        "asset",
    );
    assert.equal(asset.levels.length, expected.asset.levels);
    assert.equal(createHash("sha256").update(bytes).digest("hex").slice(0, 32), expected.asset.hash);
});

test("reads the golden frames to the same bits", () => {
    const asset = decodeAsset(load("asset.bin"));
    const decoder = new FrameDecoder(asset);
    const positions = new Float32Array(asset.rest.length);
    for (const frame of expected.frames) {
        const head = decoder.decode(load(`frame_${frame.name}.bin`), positions);
        same({ ...head, positions }, { ...frame, name: undefined }, frame.name);
    }
});

test("decodes frames in any order to the same positions", () => {
    const asset = decodeAsset(load("asset.bin"));
    const once = new FrameDecoder(asset);
    const positions = new Float32Array(asset.rest.length);
    for (const frame of [...expected.frames].reverse()) {
        once.decode(load(`frame_${frame.name}.bin`), positions);
        same(positions, { ...frame.positions }, frame.name);
    }
});

test("refuses every message cut anywhere, and with a byte too many", () => {
    const asset = decodeAsset(load("asset.bin"));
    const decoder = new FrameDecoder(asset);
    const positions = new Float32Array(asset.rest.length);
    /** @type {[string, (bytes: Uint8Array) => any][]} */
    const readers = [
        ["tools.bin", readTools],
        ["haptic.bin", readHaptic],
        ["asset.bin", decodeAsset],
        ["field.bin", (bytes) => decodeField(bytes, new Uint8Array(expected.field.n))],
        ["topology_delta.bin", (bytes) => applyTopologyDelta(bytes, asset.triangles.slice(), asset.rest.length / 3)],
        ["frame_bend.bin", (bytes) => decoder.decode(bytes, positions)],
        ["frame_affine.bin", (bytes) => decoder.decode(bytes, positions)],
    ];
    for (const [name, read] of readers) {
        const bytes = load(name);
        for (let n = 0; n < bytes.length; n++)
            assert.throws(() => read(bytes.slice(0, n)), WireError, `${name} cut to ${n}`);
        assert.throws(() => read(new Uint8Array([...bytes, 0])), WireError, name);
    }
});

test("changed bytes give a refusal or a frame, never another error", () => {
    const asset = decodeAsset(load("asset.bin"));
    const decoder = new FrameDecoder(asset);
    const positions = new Float32Array(asset.rest.length);
    for (const frame of expected.frames) {
        const bytes = load(`frame_${frame.name}.bin`);
        for (let at = 0; at < bytes.length; at++)
            for (const value of [0, 1, 127, 255, bytes[at] ^ 16]) {
                const broken = bytes.slice();
                broken[at] = value;
                try {
                    decoder.decode(broken, positions);
                } catch (error) {
                    assert.ok(error instanceof WireError, `${frame.name} byte ${at}: ${error}`);
                }
            }
    }
});

test("refuses frames of another asset, wrong kinds and unknown flags", () => {
    const bytes = load("frame_bend.bin");
    /** @param {number} at @param {number} value */
    const changed = (at, value) => {
        const copy = bytes.slice();
        copy[at] = value;
        return copy;
    };
    for (const [at, value, code] of [
        [0, 0, "MAGIC"],
        [4, 2, "KIND"],
        [4, 99, "KIND"],
        [5, 2, "FLAGS"],
        [6, 16, "RANGE"],
        [31, 255, "NAN"],
        [31, 128, "RANGE"],
        [35, 255, "COUNT"],
        [40, 0, "LONG"],
    ])
        assert.throws(() => readFrameHead(changed(Number(at), Number(value))), { code }, `byte ${at}`);
});
