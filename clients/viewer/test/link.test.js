// The connection: join, keeping frames until the asset is there, credit, latency, reconnecting; with a socket, a clock
// and a fetch of the test's own, and the golden packets as traffic.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { readFieldHead } from "../src/field_decoder.js";
import { movedAddress } from "../src/moved_address.js";
import { Link } from "../src/link.js";
import { vertexNormals } from "../src/normals.js";
import { hello, part as partInfo } from "./fixtures/messages.js";
import { KIND, POSE_FLAG, readHead, readTools } from "../src/wire.js";

/** @param {string} name */
const load = (name) => new Uint8Array(readFileSync(new URL(`../../../tests/data/golden/${name}`, import.meta.url)));
const turn = () => new Promise((resolve) => setImmediate(resolve));

class FakeSocket {
    /** @param {string} url @param {string} protocol */
    constructor(url, protocol) {
        this.url = url;
        this.protocol = protocol;
        this.readyState = 0;
        /** @type {any[]} */
        this.sent = [];
        this.closed = 0;
    }
    /** @param {any} data */
    send(data) {
        this.sent.push(data);
    }
    /** @param {number} code */
    close(code) {
        this.closed = code;
        this.readyState = 3;
    }
    accept() {
        this.readyState = 1;
        this.onopen?.();
    }
    /** @param {any} data */
    receive(data) {
        this.onmessage?.({
            data: typeof data === "string" ? data : data.buffer ? data.slice().buffer : JSON.stringify(data),
        });
    }
    /** messages of one kind that were sent @param {number} kind */
    binary(kind) {
        return this.sent.filter((m) => typeof m !== "string" && readHead(m).kind === kind);
    }
    texts() {
        return this.sent.filter((m) => typeof m === "string").map((m) => JSON.parse(m));
    }
}

function stand() {
    const stand = {
        time: 1000,
        /** @type {FakeSocket[]} */ sockets: [],
        /** @type {any[]} */ posted: [],
        /** @type {{call: () => void, ms: number}[]} */ waiting: [],
        /** @type {(value: any) => void} */ giveAsset: () => {},
        /** @type {string[]} */ asked: [],
        of: (/** @type {string} */ type) => stand.posted.filter((m) => m.type === type),
        /** @type {any} */ link: null,
    };
    stand.link = new Link({
        open: (url, protocol) => {
            const socket = new FakeSocket(url, protocol);
            stand.sockets.push(socket);
            return /** @type {any} */ (socket);
        },
        get: (url) => {
            stand.asked.push(url);
            return new Promise((resolve) => (stand.giveAsset = resolve));
        },
        post: (message) => stand.posted.push(message),
        now: () => stand.time,
        later: (call, ms) => stand.waiting.push({ call, ms }),
    });
    return stand;
}

/** a connection that has joined; the part's epoch is that of the golden frames */
async function joined() {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    s.sockets[0].accept();
    const epoch = new DataView(load("frame_bend.bin").buffer).getUint32(8, true);
    const part = new DataView(load("frame_bend.bin").buffer).getUint16(6, true);
    const parts = Array.from({ length: part + 1 }, () => partInfo({ epoch }));
    s.sockets[0].receive(hello({ parts }));
    return { s, part };
}

test("joins with the protocol's name, asks for any tool and for patches", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    assert.deepEqual(s.sockets[0].protocol, ["palpate.v2"]);
    assert.equal(s.sockets[0].sent.length, 0);
    s.sockets[0].accept();
    assert.deepEqual(s.sockets[0].texts(), [
        { type: "join", name: "Ada", role: "trainee", tool: -1, topology_deltas: true, moves: true },
    ]);
});

test("offers its ticket beside the protocol, where no address shows it", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "instructor", ticket: "AQ-_" });
    assert.deepEqual(s.sockets[0].protocol, ["palpate.v2", "ticket.AQ-_"]);
    assert.equal(s.sockets[0].url, "ws://host:1/ws");
});

test("a second hand asks for no shape and takes none, but acknowledges", () => {
    const s = stand();
    s.link.connect({ url: "ws://host/ws", name: "Ada (2)", role: "trainee", ticket: "", toolOnly: true });
    const [socket] = s.sockets;
    socket.accept();
    assert.equal(socket.texts()[0].topology_deltas, false);
    socket.receive(hello());
    socket.receive(load("frame_rest.bin"));
    socket.receive(load("tools.bin"));
    assert.deepEqual(s.asked, []);
    assert.deepEqual(s.of("frame"), []);
    assert.equal(s.of("tools").length, 1);
    assert.equal(socket.binary(KIND.ACK).length, 1);
});

test("keeps the newest frame until its asset has come, then shows it", async () => {
    const { s, part } = await joined();
    assert.equal(s.asked.at(-1), "http://host:1/asset/ab");
    s.sockets[0].receive(load("frame_spike.bin"));
    s.sockets[0].receive(load("frame_bend.bin"));
    assert.equal(s.of("frame").length, 0);
    s.giveAsset(load("asset.bin").buffer);
    await turn();
    await turn();
    const shown = s.of("frame").filter((m) => m.part === part);
    assert.equal(shown.length, 1);
    assert.equal(s.of("part").filter((m) => m.part === part).length, 1);
    assert.ok(shown[0].positions.every(Number.isFinite));
    // normals of a shown surface are of unit length or zero
    for (let i = 0; i < shown[0].normals.length; i += 3) {
        const length = Math.hypot(...shown[0].normals.subarray(i, i + 3));
        assert.ok(length === 0 || Math.abs(length - 1) < 1e-5);
    }
});

test("keeps the newest field until its asset has come, drops one of an older epoch", async () => {
    const s = stand();
    const field = load("field.bin");
    const head = readFieldHead(field);
    const n = 301;
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "viewer", ticket: "" });
    s.sockets[0].accept();
    const parts = Array.from({ length: head.part + 1 }, () => partInfo({ epoch: head.epoch }));
    s.sockets[0].receive(hello({ parts }));
    s.sockets[0].receive(field);
    assert.equal(s.of("field").length, 0);
    // as if an asset of as many vertices had come
    s.link.parts.set(head.part, { epoch: head.epoch, n, creases: Uint32Array.from([7]) });
    s.sockets[0].receive(field);
    const [shown] = s.of("field");
    assert.deepEqual([shown.part, shown.name, shown.level.length], [head.part, "von_mises", n + 1]);
    assert.equal(shown.level[n], shown.level[7]); // of a crease
    assert.ok(shown.low < shown.high);
    s.link.parts.set(head.part, { epoch: head.epoch + 1, n, creases: Uint32Array.of() });
    s.sockets[0].receive(field);
    assert.equal(s.of("field").length, 1);
    assert.equal(s.sockets[0].closed, 0);
    // of another number of vertices: the server's mistake
    s.link.parts.set(head.part, { epoch: head.epoch, n: n + 1, creases: Uint32Array.of() });
    s.sockets[0].receive(field);
    assert.equal(s.sockets[0].closed, 4900);
});

test("acknowledges every cycle, frames decoded or not", async () => {
    const { s } = await joined();
    s.sockets[0].receive(load("tools.bin"));
    s.sockets[0].receive(load("tools.bin"));
    const acks = s.sockets[0].binary(KIND.ACK);
    const cycle = readTools(load("tools.bin")).cycle;
    assert.equal(acks.length, 2);
    assert.equal(new DataView(acks[0].buffer).getUint32(8, true), cycle);
});

test("a pose carries tool, grasp and clock, and lifting the tool keeps its last place", async () => {
    const { s } = await joined();
    s.time = 1234.5;
    s.link.pose({ tool: 2, position: [0.1, 0.2, 0.3], grasp: true, away: false });
    s.link.pose({ tool: 2, position: null, grasp: false, away: true });
    const [first, second] = s.sockets[0].binary(KIND.POSE).map((m) => new DataView(m.buffer));
    assert.equal(first.getUint16(6, true), 2);
    assert.equal(Number(first.getBigUint64(16, true)), 1234500);
    assert.equal(first.getFloat64(32, true), 0.2);
    assert.equal(first.getUint32(132, true), 1);
    assert.equal(second.getFloat64(40, true), 0.3);
    assert.equal(second.getUint32(8, true), first.getUint32(8, true) + 1);
    assert.ok(second.getUint32(12, true) & POSE_FLAG.AWAY);
});

test("a resting tool is said again until the page has been silent for 3 s", async () => {
    const { s } = await joined();
    s.link.pose({ tool: 0, position: [0, 0, 1], grasp: true, away: false });
    for (let k = 0; k < 58; k++) {
        s.time += 50;
        s.link.repeatPose();
    }
    const poses = s.sockets[0].binary(KIND.POSE).map((m) => new DataView(m.buffer));
    assert.equal(poses.length, 59);
    assert.ok(poses.every((v) => v.getUint32(132, true) === 1));
    for (let k = 0; k < 10; k++) {
        s.time += 50;
        s.link.repeatPose();
    }
    const last = s.sockets[0].binary(KIND.POSE).map((m) => new DataView(m.buffer));
    assert.equal(last.length, 61); // one more at 2950 ms, then one that lifts the tool
    assert.ok(last[60].getUint32(12, true) & POSE_FLAG.AWAY);
});

test("reconnects with growing pauses after a lost connection", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    const pauses = [];
    for (let i = 0; i < 6; i++) {
        /** @type {any} */ (s.sockets[i]).onclose({ code: 1006, reason: "" });
        const next = s.waiting.pop();
        pauses.push(next?.ms);
        next?.call();
    }
    assert.deepEqual(pauses, [500, 1000, 2000, 4000, 5000, 5000]);
    assert.equal(s.sockets.length, 7);
    assert.equal(s.of("state").at(-1).state, "connecting");
});

test("who closes on being told of a lost connection is not connected again", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    const post = s.link.env.post;
    s.link.env.post = (/** @type {any} */ message) => {
        post(message);
        if (message.state === "lost") s.link.close();
    };
    /** @type {any} */ (s.sockets[0]).onclose({ code: 1006, reason: "" });
    s.waiting.forEach(({ call }) => call());
    assert.equal(s.sockets.length, 1);
});

test("a server whose asset cannot be read is asked again ever more slowly", async () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    const pauses = [];
    for (let i = 0; i < 4; i++) {
        s.sockets[i].accept();
        s.sockets[i].receive(hello());
        s.giveAsset(new Uint8Array([1, 2, 3]).buffer);
        await turn();
        assert.equal(s.sockets[i].closed, 4900);
        s.waiting.length = 0;
        /** @type {any} */ (s.sockets[i]).onclose({ code: 4900, reason: "" });
        pauses.push(s.waiting[0].ms);
        s.waiting[0].call();
    }
    assert.deepEqual(pauses, [500, 1000, 2000, 4000]);
});

test("another topology: the old part goes on until the new asset is here, then frames of the old epoch are dropped", async () => {
    const { s, part } = await joined();
    s.giveAsset(load("asset.bin").buffer);
    await turn();
    await turn();
    const old = load("frame_bend.bin");
    const fresh = load("frame_bend.bin");
    const view = new DataView(fresh.buffer, fresh.byteOffset);
    const epoch = view.getUint32(8, true) + 1;
    const frames = () => s.of("frame").filter((m) => m.part === part).length;
    view.setUint32(8, epoch, true);
    s.sockets[0].receive({
        type: "topology",
        parts: Array.from({ length: part + 1 }, () => partInfo({ epoch, asset: "/asset/cd" })),
    });
    s.sockets[0].receive(old); // was on its way
    assert.equal(frames(), 1);
    s.sockets[0].receive(fresh);
    assert.equal(frames(), 1); // waits for its asset
    s.giveAsset(load("asset.bin").buffer);
    await turn();
    await turn();
    assert.deepEqual(
        s
            .of("part")
            .filter((m) => m.part === part)
            .map((m) => m.epoch),
        [epoch - 1, epoch],
    );
    assert.equal(frames(), 2);
    s.sockets[0].receive(old);
    assert.equal(frames(), 2);
    assert.equal(s.sockets[0].closed, 0);
});

test("an asset that arrives after a newer one was asked for is not shown", async () => {
    const { s, part } = await joined();
    const first = s.giveAsset;
    const epoch = s.link.requested.get(part);
    s.sockets[0].receive({
        type: "topology",
        parts: Array.from({ length: part + 1 }, () => partInfo({ epoch: epoch + 1, asset: "/asset/cd" })),
    });
    const second = s.giveAsset;
    second(load("asset.bin").buffer);
    await turn();
    first(load("asset.bin").buffer);
    await turn();
    await turn();
    assert.equal(s.link.parts.get(part).epoch, epoch + 1);
    assert.equal(s.of("part").filter((m) => m.part === part).length, 1);
});

test("says why and stays away after a refusal", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    /** @type {any} */ (s.sockets[0]).onclose({ code: 4005, reason: "Bo has removed you" });
    assert.equal(s.waiting.length, 0);
    assert.match(s.of("state").at(-1).text, /cannot take part.*Bo has removed you/);
    // a session that is over is the whole reason
    for (const [reason, text] of [
        ["the session was ended by an instructor", "the session was ended by an instructor"],
        ["", "there is no such session"],
    ]) {
        s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
        /** @type {any} */ (s.sockets.at(-1)).onclose({ code: 4004, reason });
        assert.equal(s.of("state").at(-1).text, text);
        assert.equal(s.waiting.length, 0);
    }
});

test("a server that does not answer is told within 1.5 s, with the seconds, and that it answers again", async () => {
    const { s } = await joined();
    const reported = () => s.of("silence").map((m) => m.seconds);
    const pass = (/** @type {number} */ ms) => {
        for (let t = 0; t < ms; t += 100) {
            s.time += 100;
            for (const { call } of s.waiting.splice(0)) call();
        }
    };
    for (let i = 0; i < 10; i++) {
        s.sockets[0].receive({ type: "pong", stamp_ms: 0 });
        pass(300);
    }
    assert.deepEqual(reported(), []);
    pass(1300);
    assert.deepEqual(reported(), [1]);
    pass(2000);
    assert.deepEqual(reported(), [1, 2, 3]);
    s.sockets[0].receive({ type: "pong", stamp_ms: 0 });
    assert.deepEqual(reported(), [1, 2, 3, 0]);
});

test("a full session is tried again, and the page says so", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Ada", role: "trainee", ticket: "" });
    /** @type {any} */ (s.sockets[0]).onclose({ code: 4003, reason: "the session has no free place" });
    assert.equal(s.waiting.length, 1);
    assert.match(s.of("state").at(-1).text, /no free place, trying again/);
    assert.equal(s.of("elsewhere").length, 0);
});

test("where relays have places the page is told, and tries again all the same", () => {
    const s = stand();
    s.link.connect({ url: "ws://host:1/ws", name: "Eve", role: "viewer", ticket: "" });
    /** @type {any} */ (s.sockets[0]).onclose({ code: 4006, reason: "the server has no free place" });
    assert.equal(s.of("elsewhere").length, 1);
    assert.match(s.of("state").at(-1).text, /no free place, trying again/);
    assert.equal(s.waiting.length, 1);
});

test("a message that cannot be read closes the connection, an old connection is not heard", async () => {
    const { s } = await joined();
    s.sockets[0].receive(new Uint8Array([1, 2, 3, 4, 5, 6, 7, 8, 9]));
    assert.equal(s.sockets[0].closed, 4900);
    s.link.connect({ url: "ws://host:1/ws", name: "Bea", role: "viewer", ticket: "" });
    const n = s.posted.length;
    s.sockets[0].receive(hello());
    assert.equal(s.posted.length, n);
});

test("goes to the server that a move names, and waits there for the session", async () => {
    const { s } = await joined();
    const move = { type: "move", address: "http://host:1/", session: "liver", ticket: "new" };
    s.link.options.ticket = "old";
    s.sockets[0].receive(move);
    assert.equal(s.sockets.length, 1); // not before the server has closed
    const closes = [1001, 1006, 4004]; // the old server ends, the new one is not there, has not the session yet
    for (const [k, code] of closes.entries()) {
        /** @type {any} */ (s.sockets[k]).onclose({ code, reason: "" });
        s.waiting.pop()?.call();
        assert.equal(s.sockets[k + 1].url, "ws://host:1/ws?session=liver");
        assert.deepEqual(s.sockets[k + 1].protocol, ["palpate.v2", "ticket.new"]);
    }
    s.sockets[3].accept();
    s.sockets[3].receive(hello());
    assert.equal(s.of("state").at(-1).state, "live");
    assert.match(s.asked.at(-1), /^http:\/\/host:1\/asset\/\w+\?session=liver$/);
    // it has arrived: a session that ends there has ended
    /** @type {any} */ (s.sockets[3]).onclose({ code: 4004, reason: "" });
    assert.equal(s.of("state").at(-1).state, "refused");
});

test("a session that never comes is given up after a minute", async () => {
    const { s } = await joined();
    s.sockets[0].receive({ type: "move", address: "http://host:1", session: "liver" });
    /** @type {any} */ (s.sockets[0]).onclose({ code: 1001, reason: "" });
    s.waiting.pop()?.call();
    s.time += 60001;
    /** @type {any} */ (s.sockets[1]).onclose({ code: 4004, reason: "" });
    assert.equal(s.of("state").at(-1).state, "refused");
});

test("a page leaves for another host, whose sockets it may not open", async () => {
    const { s } = await joined();
    s.waiting.length = 0;
    s.sockets[0].receive({ type: "move", address: "https://b.example/", session: "liver" });
    /** @type {any} */ (s.sockets[0]).onclose({ code: 1001, reason: "" });
    assert.equal(s.waiting.length, 0);
    assert.match(s.of("state").at(-1).text, /moves to another server/);
    const to = { address: "https://b.example/", session: "liver-2", ticket: "new" };
    assert.equal(
        movedAddress(to, "?lang=de&session=liver", "old").href,
        "https://b.example/?lang=de&session=liver-2#new",
    );
    assert.equal(
        movedAddress({ address: "http://b:8090", session: "liver" }, "", "old").href,
        "http://b:8090/?session=liver#old",
    );
});

test("normals of a tetrahedron point away from its middle", () => {
    const x = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
    const n = new Float32Array(12);
    vertexNormals(x, new Uint32Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]), n);
    for (let i = 0; i < 4; i++) {
        let outward = 0;
        for (let k = 0; k < 3; k++) outward += n[3 * i + k] * (x[3 * i + k] - 0.25);
        assert.ok(outward > 0.3);
    }
});
