// TOPOLOGY_DELTA: a table changes as the message says or not at all, hostile bytes are refused, visible triangles.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { decodeAsset } from "../src/asset.js";
import { Link } from "../src/link.js";
import { vertexNormals } from "../src/normals.js";
import { applyTopologyDelta, readTopologyDeltaHead, shownOf } from "../src/topology_delta.js";
import { activeText } from "../src/plan_list.js";
import { KIND, MAGIC, WireError } from "../src/wire.js";
import { hello, part as partInfo } from "./fixtures/messages.js";

/** the shortest LZ4 block that holds these bytes as they are @param {number[]} bytes */
function literal(bytes) {
    const more = [];
    for (let rest = bytes.length - 15; rest >= 0; rest -= 255) more.push(Math.min(255, rest));
    return [Math.min(15, bytes.length) << 4, ...more, ...bytes];
}

/** @param {number} d difference */
const fold = (d) => ((d << 1) ^ (d >> 31)) >>> 0;

/** four byte planes @param {number[]} values */
const planes = (values) => [0, 8, 16, 24].flatMap((shift) => values.map((v) => (v >>> shift) & 255));

/**
 * @param {{part?: number, epoch: number, revision?: number, slots: number[], corners: number[]}} delta corners: three for each slot
 * @returns {Uint8Array}
 */
function writeDelta({ part = 0, epoch, revision = 1, slots, corners }) {
    const block = literal([
        ...planes(slots.map((p, i) => fold((p - (i ? slots[i - 1] : 0)) | 0))),
        ...planes(corners.map((c, e) => fold((c - (e < 3 ? 0 : corners[e - 3])) | 0))),
    ]);
    const bytes = new Uint8Array(32 + block.length);
    const view = new DataView(bytes.buffer);
    view.setUint32(0, MAGIC, true);
    view.setUint8(4, KIND.TOPOLOGY_DELTA);
    view.setUint16(6, part, true);
    [epoch, slots.length, revision, 0, 16 * slots.length, block.length].forEach((v, i) =>
        view.setUint32(8 + 4 * i, v, true),
    );
    bytes.set(block, 32);
    return bytes;
}

const N = 300;
/** a table of 40 slots, every fourth taken */
const table = () => Uint32Array.from({ length: 120 }, (_, e) => (e % 12 < 3 ? (7 * e + 1) % N : 0));
const good = () =>
    writeDelta({ part: 2, epoch: 5, revision: 9, slots: [0, 3, 39], corners: [4, 5, 6, 0, 0, 0, 299, 0, 298] });

/** numbers below n from a seed @param {number} seed */
function random(seed) {
    return (/** @type {number} */ n) => {
        seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
        return Math.floor((seed / 4294967296) * n);
    };
}

test("a delta changes the slots it names and no other", () => {
    const x = table();
    const head = applyTopologyDelta(good(), x, N);
    const wanted = table();
    wanted.set([4, 5, 6], 0);
    wanted.set([0, 0, 0], 9);
    wanted.set([299, 0, 298], 117);
    assert.deepEqual(x, wanted);
    assert.deepEqual(head, { part: 2, epoch: 5, n: 3, revision: 9, nRaw: 48 });
});

test("a thousand random deltas reproduce the table", () => {
    const below = random(5);
    const mine = table();
    const theirs = table();
    for (let k = 0; k < 1000; k++) {
        const slots = [...new Set(Array.from({ length: 1 + below(12) }, () => below(40)))].sort((a, b) => a - b);
        const corners = slots.flatMap(() => (below(3) ? [below(N), below(N), below(N)] : [0, 0, 0]));
        slots.forEach((p, i) => theirs.set(corners.slice(3 * i, 3 * i + 3), 3 * p));
        applyTopologyDelta(writeDelta({ epoch: 1, revision: k, slots, corners }), mine, N);
        assert.deepEqual(mine, theirs);
    }
});

test("slots out of order or beyond the table, corners that are no vertices, and wrong counts are refused", () => {
    const wrong = [
        { code: "RANGE", slots: [3, 3], corners: [1, 2, 3, 1, 2, 3] }, // twice
        { code: "RANGE", slots: [4, 3], corners: [1, 2, 3, 1, 2, 3] }, // descending
        { code: "RANGE", slots: [40], corners: [1, 2, 3] },
        { code: "RANGE", slots: [-1], corners: [1, 2, 3] },
        { code: "RANGE", slots: [1], corners: [1, 2, N] },
        { code: "RANGE", slots: [1, 2], corners: [1, 2, 3, 1, -1, 3] },
        { code: "COUNT", slots: [], corners: [] },
        {
            code: "COUNT",
            slots: Array.from({ length: 41 }, (_, i) => i),
            corners: Array.from({ length: 123 }, () => 0),
        },
    ];
    for (const { code, slots, corners } of wrong) {
        const x = table();
        assert.throws(
            () => applyTopologyDelta(writeDelta({ epoch: 1, slots, corners }), x, N),
            { code },
            `${slots}: ${corners}`,
        );
        assert.deepEqual(x, table());
    }
});

test("wrong kinds, flags, parts, revisions and lengths are refused", () => {
    for (const [at, value, code] of [
        [0, 0, "MAGIC"],
        [4, 1, "KIND"],
        [4, 99, "KIND"],
        [5, 1, "FLAGS"],
        [6, 16, "RANGE"],
        [12, 0, "COUNT"],
        [12, 4, "COUNT"],
        [15, 255, "COUNT"],
        [22, 32, "RANGE"],
        [24, 49, "COUNT"],
        [28, 0, "LONG"],
        [28, 255, "SHORT"],
    ]) {
        const bytes = good();
        bytes[Number(at)] = Number(value);
        assert.throws(() => readTopologyDeltaHead(bytes), { code }, `byte ${at}`);
    }
});

test("a damaged delta is refused without a change, or gives a table whose corners are vertices", () => {
    const bytes = good();
    for (let n = 0; n < bytes.length; n++)
        assert.throws(() => applyTopologyDelta(bytes.slice(0, n), table(), N), WireError, `cut to ${n}`);
    assert.throws(() => applyTopologyDelta(new Uint8Array([...bytes, 0]), table(), N), WireError);
    for (let at = 0; at < bytes.length; at++)
        for (let value = 0; value < 256; value++) {
            const broken = bytes.slice();
            const x = table();
            broken[at] = value;
            try {
                applyTopologyDelta(broken, x, N);
                assert.ok(x.every((v) => v < N));
            } catch (error) {
                assert.ok(error instanceof WireError, `byte ${at}: ${error}`);
                assert.deepEqual(x, table());
            }
        }
});

test("a message that states more than its bytes can hold takes no memory", () => {
    const bytes = good();
    const view = new DataView(bytes.buffer);
    const n = 2 ** 22;
    view.setUint32(12, n, true);
    view.setUint32(24, 16 * n, true);
    assert.throws(() => readTopologyDeltaHead(bytes), { code: "COUNT" });
});

test("shows the triangles without empty slots, and the vertices in them", () => {
    const shown = shownOf(new Uint32Array([0, 0, 0, 0, 5, 2, 0, 0, 0, 7, 2, 5]), 9);
    assert.deepEqual(shown, { triangles: new Uint32Array([0, 5, 2, 7, 2, 5]), visible: new Uint32Array([0, 2, 5, 7]) });
    // nothing is hidden: no list
    assert.equal(shownOf(new Uint32Array([0, 1, 2]), 3).visible, null);
    assert.equal(shownOf(new Uint32Array([0, 0, 0]), 3).triangles.length, 0);
});

test("normals of visible vertices are those of the whole mesh, hidden ones are left alone", () => {
    const x = new Float32Array([0, 0, 0, 9, 9, 9, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
    const triangles = new Uint32Array([0, 3, 2, 0, 2, 4, 0, 4, 3, 2, 3, 4]);
    const all = new Float32Array(15);
    const some = new Float32Array(15).fill(7);
    vertexNormals(x, triangles, all);
    vertexNormals(x, triangles, some, new Uint32Array([0, 2, 3, 4]));
    assert.deepEqual([...some.subarray(3, 6)], [7, 7, 7]);
    for (const v of [0, 2, 3, 4]) assert.deepEqual(some.subarray(3 * v, 3 * v + 3), all.subarray(3 * v, 3 * v + 3));
});

test("says what is active in a sentence, with the body's name only among several", () => {
    const active = [{ part: 1, nodes: 133, springs: 385, finest_nodes: 450, finest_springs: 1344 }];
    assert.deepEqual(activeText(active, [{ name: "liver" }, { name: "stomach" }]), [
        "stomach: 133 of 450 nodes, 385 of 1344 springs",
    ]);
    assert.deepEqual(activeText([{ ...active[0], part: 0, finest_nodes: 100002 }], [{ name: "stomach" }]), [
        "133 of 100,002 nodes, 385 of 1344 springs",
    ]);
    assert.deepEqual(activeText([], [{ name: "liver" }]), []);
});

/** @param {string} name */
const load = (name) => new Uint8Array(readFileSync(new URL(`../../../tests/data/golden/${name}`, import.meta.url)));
const turn = () => new Promise((resolve) => setImmediate(resolve));
const frame = load("frame_bend.bin");
const epoch = new DataView(frame.buffer).getUint32(8, true);
const part = new DataView(frame.buffer).getUint16(6, true);
const asset = decodeAsset(load("asset.bin"));

/** a connection that has heard hello and waits for the asset of the golden frames */
function stand() {
    /** @type {any[]} */
    const posted = [];
    /** @type {any} */
    const socket = {
        readyState: 1,
        closed: 0,
        send() {},
        close: (/** @type {number} */ code) => (socket.closed = code),
    };
    /** @type {(bytes: any) => void} */
    let give = () => {};
    const link = new Link({
        open: () => socket,
        get: () => new Promise((resolve) => (give = resolve)),
        post: (m) => posted.push(m),
        now: () => 0,
        later: () => {},
    });
    link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee" });
    const receive = (/** @type {any} */ m) =>
        socket.onmessage({ data: m instanceof Uint8Array ? m.slice().buffer : JSON.stringify(m) });
    const parts = (/** @type {number} */ e) => Array.from({ length: part + 1 }, () => partInfo({ epoch: e }));
    receive(hello({ parts: parts(epoch) }));
    const giveAsset = async () => {
        give(load("asset.bin").buffer);
        await turn();
        await turn();
    };
    return {
        socket,
        receive,
        parts,
        giveAsset,
        of: (/** @type {string} */ type) => posted.filter((m) => m.type === type && m.part === part),
    };
}

/** the asset's table with these slots changed @param {Record<number, number[]>} changes */
function changed(changes) {
    const triangles = asset.triangles.slice();
    for (const [slot, corners] of Object.entries(changes)) triangles.set(corners, 3 * Number(slot));
    return shownOf(triangles, asset.rest.length / 3);
}

test("a delta is displayed with the next frame, once", async () => {
    const { receive, giveAsset, of } = stand();
    await giveAsset();
    receive(frame);
    assert.equal(of("frame")[0].shown, null);
    receive(writeDelta({ part, epoch, slots: [0, 2], corners: [0, 0, 0, 3, 2, 1] }));
    receive(writeDelta({ part, epoch, slots: [2, 5], corners: [4, 2, 1, 0, 0, 0] }));
    assert.equal(of("frame").length, 1);
    receive(frame);
    assert.deepEqual(of("frame")[1].shown, changed({ 0: [0, 0, 0], 2: [4, 2, 1], 5: [0, 0, 0] }));
    receive(frame);
    assert.equal(of("frame")[2].shown, null);
});

test("deltas before the asset are applied in order, a frame before them is dropped", async () => {
    const { receive, giveAsset, of } = stand();
    receive(frame);
    receive(writeDelta({ part, epoch, slots: [0], corners: [3, 2, 1] }));
    receive(writeDelta({ part, epoch, slots: [0], corners: [4, 2, 1] }));
    await giveAsset();
    assert.equal(of("part").length, 1);
    assert.equal(of("frame").length, 0);
    receive(frame);
    assert.deepEqual(of("frame")[0].shown, changed({ 0: [4, 2, 1] }));
});

test("deltas of an older epoch are dropped, those of a newer one wait for its asset", async () => {
    const { receive, parts, giveAsset, of } = stand();
    await giveAsset();
    receive(writeDelta({ part, epoch: epoch - 1, slots: [0], corners: [3, 2, 1] }));
    receive(frame);
    assert.equal(of("frame")[0].shown, null);
    receive(writeDelta({ part, epoch: epoch + 1, slots: [0], corners: [3, 2, 1] }));
    receive({ type: "topology", parts: parts(epoch + 1) });
    await giveAsset();
    assert.equal(of("part").length, 2);
    const next = frame.slice();
    new DataView(next.buffer).setUint32(8, epoch + 1, true);
    receive(next);
    assert.deepEqual(of("frame")[1].shown, changed({ 0: [3, 2, 1] }));
});

test("an unreadable delta closes the connection, also after waiting", async () => {
    for (const early of [false, true]) {
        const { socket, receive, giveAsset } = stand();
        if (!early) await giveAsset();
        receive(writeDelta({ part, epoch, slots: [0], corners: [3, 2, asset.rest.length / 3] }));
        if (early) await giveAsset();
        assert.equal(socket.closed, 4900);
    }
});
