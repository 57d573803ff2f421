// The connection of one viewer: join, assets, frames, credit, reconnection. Socket, fetch, clock and output are passed
// in, so that the same code runs in the worker and under node --test.
import { assetAddress, decodeAsset } from "./asset.js";
import { CommandQueue } from "./command_queue.js";
import { readControl } from "./control_reader.js";
import { fillCopies, originalsOf, splitCreases } from "./creases.js";
import { decodeField, readFieldHead } from "./field_decoder.js";
import { InteriorLink } from "./interior_link.js";
import { FrameDecoder, readFrameHead } from "./frame_decoder.js";
import { findCopies, joinNormals } from "./image_seams.js";
import { vertexNormals } from "./normals.js";
import { text as textOf } from "./text.js";
import { applyTopologyDelta, readTopologyDeltaHead, shownOf } from "./topology_delta.js";
import { KIND, POSE_FLAG, PROTOCOL, readHead, readTools, writeAck, writePose } from "./wire.js";

export const REPEAT_MS = 50; // period of repeated poses of a resting tool: the server releases a silent one
const TICKET = "ticket."; // prefix of the subprotocol that is a ticket
const RETRY_MS = 500; // pause before the first reconnection, doubled with each failure
const RETRY_MAX_MS = 5000;
const PAGE_SILENCE_MS = 3000; // a page that has been silent for longer no longer holds its tool
const PING_MS = 1000;
const SILENT_MS = 1100; // the server sends its status three times a second: longer is no answer
const LISTEN_MS = 200; // between two looks at that: it is told within 1.5 s
const FIGURES_MS = 500;
const LATENCY_MAX_MS = 10000; // a larger value comes from the clock of another connection
const NONE = new Uint32Array(); // no vertex is doubled
const SPARE_MAX = 4; // pairs of arrays that wait for reuse
const MOVE_MS = 60000; // so long a server that a session moves to is asked for it: it may be loading the scene
const CLOSE_FULL = 4003; // for now: tried again
const CLOSE_NO_SESSION = 4004; // or it has ended
const CLOSE_ELSEWHERE = 4006; // no place here, but relays have
const CLOSE_UNREADABLE = 4900; // close code: the server sent what this page cannot read

/** close codes after which reconnection is useless, with the text for the user */
const FINAL = new Map([
    [1002, textOf("link.rejected")],
    [1008, textOf("link.denied")],
    [1009, textOf("link.rejected")],
    [4001, textOf("link.flood")],
    [CLOSE_NO_SESSION, textOf("link.no_session")],
    [4005, textOf("link.removed")],
]);

/**
 * @typedef {import("./control_table.js").ServerMessage} ServerMessage
 * @typedef {import("./control_table.js").ClientMessage} ClientMessage
 * @typedef {import("./topology_delta.js").Shown} Shown
 * @typedef {"connecting" | "live" | "lost" | "refused"} ConnectionState
 * @typedef {{tool: number, position: number[] | null, quaternion?: number[], grasp: boolean, away: boolean}} ToolPose
 *   position m; quaternion w x y z, absent: unknown; away: the tool is lifted out of the scene
 * @typedef {{positions: Float32Array<ArrayBuffer>, normals: Float32Array<ArrayBuffer>}} FrameArrays [n][3] each
 * @typedef {{latency_ms: number, rtt_ms: number, decode_ms: number, bytes_s: number}} LinkFigures
 */
/**
 * Messages from the worker to the page.
 * @typedef {{type: "state", state: ConnectionState, text: string}
 *   | {type: "control", message: ServerMessage}
 *   | ({type: "part", part: number, epoch: number, rest: Float32Array, look: Uint8Array<ArrayBuffer> | null,
 *       uv: Float32Array<ArrayBuffer> | null, originals: Uint32Array | null} & Shown)
 *   | ({type: "frame", part: number, shown: Shown | null} & FrameArrays)
 *   | {type: "field", part: number, name: string, low: number, high: number, level: Uint8Array}
 *   | import("./interior_link.js").InteriorMesh | import("./interior_link.js").InteriorValues
 *   | {type: "tools", time: number, tools: import("./wire.js").Tool[]}
 *   | {type: "silence", seconds: number}
 *   | {type: "elsewhere"}
 *   | {type: "figures", figures: LinkFigures}} PageMessage silence: of the server, whole seconds; 0: it answers again;
 *   elsewhere: there is no place here, but relays have
 */
/**
 * Messages from the page to the worker.
 * @typedef {{url: string, name: string, role: import("./control_table.js").Role, ticket: string, toolOnly?: boolean}} Wishes
 *   of a join; a ticket of "": none; toolOnly: nothing of the scene but its tools is taken
 * @typedef {({type: "connect"} & Wishes)
 *   | ({type: "pose"} & ToolPose)
 *   | {type: "control", message: ClientMessage}
 *   | ({type: "reuse", part: number} & FrameArrays)} WorkerMessage
 */
/**
 * @typedef {{
 *   open: (url: string, protocols: string[]) => WebSocket,
 *   get: (url: string) => Promise<ArrayBuffer>,
 *   post: (message: PageMessage, transfer?: Transferable[]) => void,
 *   now: () => number,
 *   later: (call: () => void, ms: number) => void,
 * }} Environment
 * @typedef {{decoder: FrameDecoder, table: Uint32Array, shown: Shown, changed: boolean, epoch: number, n: number,
 *   creases: Uint32Array, spare: FrameArrays[], joined: Uint32Array}} Part joined: pairs of vertices with one normal; table: of
 *   triangles, up to date; shown: of the table at the last frame; changed: the table has changed since; n: vertices of
 *   the asset; creases: vertices that creases add to them, copies of these
 */

/**
 * Values of the asset's vertices, then those of the copies behind them.
 * @template {Float32Array | Uint8Array} T
 * @param {T} values @param {Uint32Array} creases @param {T} longer @param {number} size
 */
function extended(values, creases, longer, size) {
    longer.set(values);
    fillCopies(longer, creases, size);
    return longer;
}

/** close reason: at most 123 bytes of ASCII @param {unknown} error */
const closeReason = (error) =>
    String(error)
        .replace(/[^ -~]/g, "?")
        .slice(0, 100);

export class Link {
    /** @type {WebSocket | null} */
    socket = null;
    /** @type {Wishes} */
    options = { url: "", name: "Guest", role: "trainee", ticket: "" };
    commands = new CommandQueue();
    tries = 0;
    generation = 0; // of the connection: events of older ones are ignored
    poseSeq = 0;
    /** @type {ToolPose | null} of the held tool */
    lastPose = null;
    poseFromPageAt = 0; // ms
    poseSentAt = 0; // ms
    /** @type {number[]} */
    lastPosition = [0, 0, 0];
    figuresAt = 0;
    heardAt = 0; // ms
    silence = 0; // s, as the page was told
    movedAt = -Infinity; // ms: of the last `move`, until the session answers
    leaves = false; // the page goes to another host
    /** @type {Map<number, Part>} */
    parts = new Map();
    /** @type {Map<number, number>} epoch of the asset requested last */
    requested = new Map();
    /** @type {Map<number, Uint8Array>} newest frame of a part whose asset has not arrived */
    earlyFrames = new Map();
    /** @type {Map<number, Uint8Array>} newest field of such a part */
    earlyFields = new Map();
    /** @type {Map<number, Uint8Array[]>} all topology deltas of such a part, in order */
    earlyDeltas = new Map();
    decodeUs = 0;
    nDecoded = 0;
    decodeSum = 0;
    bytes = 0;
    ownTool = -1;
    latency = 0;
    rtt = 0;
    echo = 0;

    /** @param {Environment} env */
    constructor(env) {
        this.env = env;
        this.interiors = new InteriorLink(env);
        this.figuresAt = env.now();
    }

    reset() {
        this.lastPose = null;
        this.reportSilence(0);
        this.commands.waiting = [];
        this.parts.clear();
        this.interiors.reset();
        this.requested.clear();
        this.earlyFrames.clear();
        this.earlyFields.clear();
        this.earlyDeltas.clear();
        this.decodeUs = this.nDecoded = this.decodeSum = this.bytes = 0;
        this.latency = this.rtt = this.echo = 0;
        this.ownTool = -1;
    }

    /** @param {Wishes} options */
    connect(options) {
        this.options = options;
        this.tries = 0;
        this.movedAt = -Infinity;
        this.leaves = false;
        this.close();
        this.dial();
    }

    /** ends the connection; no message follows */
    close() {
        const old = this.socket;
        this.socket = null;
        this.generation++;
        old?.close(1000);
    }

    dial() {
        const generation = this.generation;
        this.reset();
        this.report("connecting", textOf(this.tries ? "state.reconnecting" : "state.connecting"));
        const { ticket, url } = this.options;
        const socket = this.env.open(url, ticket ? [PROTOCOL, TICKET + ticket] : [PROTOCOL]);
        socket.binaryType = "arraybuffer";
        this.socket = socket;
        socket.onopen = () => {
            if (generation !== this.generation) return;
            this.send({
                type: "join",
                name: this.options.name,
                role: this.options.role,
                tool: this.options.role === "viewer" ? null : -1,
                topology_deltas: !this.options.toolOnly,
                moves: true,
            });
        };
        socket.onmessage = (event) => {
            if (generation !== this.generation) return;
            try {
                this.receive(event.data);
            } catch (error) {
                // an unreadable message is an error of the server: close with the reason and reconnect
                socket.close(CLOSE_UNREADABLE, closeReason(error));
            }
        };
        // what it means is told by the closing that follows; the package ws throws an error without a listener
        socket.onerror = () => {};
        socket.onclose = (event) => {
            if (generation !== this.generation) return;
            const next = ++this.generation; // another one when the page closes or connects on what it is told below
            this.socket = null;
            if (this.leaves) return this.report("lost", textOf("link.moves"));
            const moves = this.env.now() - this.movedAt < MOVE_MS;
            const text = FINAL.get(event.code);
            if (text && !(moves && event.code === CLOSE_NO_SESSION)) {
                // the reason of a session that is over says everything
                const { code, reason } = event;
                this.report("refused", (code === CLOSE_NO_SESSION ? reason : reason && `${text}: ${reason}`) || text);
                return;
            }
            const pause = Math.min(RETRY_MAX_MS, RETRY_MS * 2 ** this.tries++);
            const full = event.code === CLOSE_FULL || event.code === CLOSE_ELSEWHERE;
            this.report(
                "lost",
                full
                    ? textOf("link.full", { reason: event.reason || textOf("link.session_full") })
                    : textOf(moves ? "link.moves" : "link.lost"),
            );
            if (event.code === CLOSE_ELSEWHERE) this.env.post({ type: "elsewhere" });
            this.env.later(() => next === this.generation && this.dial(), pause);
        };
    }

    /** @param {ConnectionState} state @param {string} text */
    report(state, text) {
        this.env.post({ type: "state", state, text });
    }

    /** @param {ClientMessage} message */
    send(message) {
        if (message.type !== "command") return this.write(message);
        this.commands.add(message);
        this.sendCommands();
    }

    sendCommands() {
        const generation = this.generation;
        for (const command of this.commands.take(this.env.now())) this.write(command);
        const pause = this.commands.pause();
        if (pause !== null) this.env.later(() => generation === this.generation && this.sendCommands(), pause + 1);
    }

    /** @param {ClientMessage} message */
    write(message) {
        if (this.socket?.readyState === 1) this.socket.send(JSON.stringify(message));
    }

    /** @param {ToolPose} pose */
    pose(pose) {
        this.lastPose = pose.away ? null : pose;
        this.poseFromPageAt = this.env.now();
        this.sendPose(pose);
    }

    /** called every REPEAT_MS: drawing may block the page for longer than the server waits for a tool */
    repeatPose() {
        const now = this.env.now();
        if (!this.lastPose || now - this.poseSentAt < 0.8 * REPEAT_MS) return;
        if (now - this.poseFromPageAt < PAGE_SILENCE_MS) this.sendPose(this.lastPose);
        else this.pose({ ...this.lastPose, position: null, grasp: false, away: true });
    }

    /** @param {ToolPose} pose */
    sendPose(pose) {
        if (this.socket?.readyState !== 1) return;
        this.poseSentAt = this.env.now();
        this.lastPosition = pose.position ?? this.lastPosition;
        this.socket.send(
            writePose({
                tool: pose.tool,
                seq: ++this.poseSeq,
                flags: POSE_FLAG.POSE_ONLY | (pose.away ? POSE_FLAG.AWAY : 0),
                stampUs: Math.round(this.env.now() * 1000),
                position: this.lastPosition,
                quaternion: pose.quaternion,
                buttons: pose.grasp ? 1 : 0,
            }),
        );
    }

    /** @param {string | ArrayBuffer} data */
    receive(data) {
        this.heardAt = this.env.now();
        if (this.silence) this.reportSilence(0);
        if (typeof data === "string") {
            this.bytes += data.length;
            this.control(readControl(data));
            return;
        }
        const bytes = new Uint8Array(data);
        this.bytes += bytes.length;
        const head = readHead(bytes);
        if (this.options.toolOnly && head.kind !== KIND.TOOLS) return;
        if (head.kind === KIND.FRAME) this.frame(head.index, bytes);
        else if (head.kind === KIND.TOOLS) this.tools(bytes);
        else if (head.kind === KIND.FIELD) this.field(head.index, bytes);
        else if (head.kind === KIND.INTERIOR) this.interiors.take(head.index, bytes);
        else if (head.kind === KIND.TOPOLOGY_DELTA) this.topologyDelta(head.index, bytes);
    }

    /** @param {ServerMessage} message */
    control(message) {
        if (message.type === "hello") {
            this.ownTool = message.you.tool ?? -1;
            message.parts.forEach((part, i) => this.loadPart(i, part));
            this.report("live", "live");
            this.movedAt = -Infinity;
            this.ping();
            this.listen();
        } else if (message.type === "topology") message.parts.forEach((part, i) => this.loadPart(i, part));
        else if (message.type === "pong") this.rtt = this.env.now() - message.stamp_ms;
        else if (message.type === "move") this.move(message);
        this.env.post({ type: "control", message });
    }

    /**
     * The next connection goes there. A page may only ask the host that it comes from: to another one, the page goes.
     * @param {import("./control_table.js").Move} to
     */
    move(to) {
        const url = new URL("ws", to.address.replace(/^http/, "ws"));
        url.searchParams.set("session", to.session);
        this.movedAt = this.env.now();
        this.leaves = url.host !== new URL(this.options.url).host;
        this.options = { ...this.options, url: url.href, ticket: to.ticket ?? this.options.ticket };
    }

    /** @param {number} seconds */
    reportSilence(seconds) {
        if (seconds === this.silence) return;
        this.silence = seconds;
        this.env.post({ type: "silence", seconds });
    }

    listen() {
        const generation = this.generation;
        const silent = this.env.now() - this.heardAt;
        this.reportSilence(silent > SILENT_MS ? Math.max(1, Math.floor(silent / 1000)) : 0);
        this.env.later(() => generation === this.generation && this.listen(), LISTEN_MS);
    }

    ping() {
        const generation = this.generation;
        this.send({ type: "ping", stamp_ms: this.env.now() });
        this.env.later(() => generation === this.generation && this.ping(), PING_MS);
    }

    /** @param {number} index @param {{epoch: number, asset: string, interior?: string, sculptable?: boolean}} info */
    async loadPart(index, info) {
        if (this.options.toolOnly) return;
        this.interiors.offer(index, info, this.options.url);
        if (this.requested.get(index) === info.epoch) return;
        this.requested.set(index, info.epoch);
        const generation = this.generation;
        const address = assetAddress(info.asset, this.options.url);
        try {
            const asset = await decodeAsset(new Uint8Array(await this.env.get(address)));
            // responses may arrive out of order: only the newest epoch counts
            if (generation !== this.generation || this.requested.get(index) !== info.epoch) return;
            // only a readable asset resets the pause: a server with unreadable assets is asked ever more slowly
            this.tries = 0;
            const n = asset.rest.length / 3;
            const seams = findCopies(asset);
            // cuts have sharp edges
            const {
                triangles,
                copies: creases,
                joined,
            } = info.sculptable
                ? splitCreases(asset.rest, asset.triangles, seams)
                : { triangles: asset.triangles, copies: NONE, joined: seams };
            const all = n + creases.length;
            const shown = shownOf(triangles, all);
            const rest = extended(asset.rest, creases, new Float32Array(3 * all), 3);
            const look = asset.look && extended(asset.look, creases, new Uint8Array(all), 1);
            const uv = asset.uv && extended(asset.uv, creases, new Float32Array(2 * all), 2);
            const originals = seams.length || creases.length ? originalsOf(n, seams, creases) : null;
            this.parts.set(index, {
                decoder: new FrameDecoder(asset),
                table: asset.triangles,
                shown,
                changed: false,
                epoch: info.epoch,
                n,
                creases,
                spare: [],
                joined,
            });
            this.env.post({ type: "part", part: index, epoch: info.epoch, rest, look, uv, originals, ...shown });
            this.decodeEarly(index);
        } catch (error) {
            if (generation === this.generation && this.requested.get(index) === info.epoch)
                this.socket?.close(CLOSE_UNREADABLE, closeReason(error));
        }
    }

    /** messages that arrived before the asset @param {number} index of the part */
    decodeEarly(index) {
        const frame = this.earlyFrames.get(index);
        const deltas = this.earlyDeltas.get(index) ?? [];
        this.earlyFrames.delete(index);
        this.earlyDeltas.delete(index);
        for (const delta of deltas) this.topologyDelta(index, delta);
        if (frame) this.frame(index, frame);
        const field = this.earlyFields.get(index);
        this.earlyFields.delete(index);
        if (field) this.field(index, field);
    }

    /** @param {number} index @param {Uint8Array} bytes */
    field(index, bytes) {
        const part = this.parts.get(index);
        const { epoch } = readFieldHead(bytes);
        if (!part || epoch > part.epoch) {
            this.earlyFields.set(index, bytes.slice());
            return;
        }
        if (epoch < part.epoch) return;
        const level = new Uint8Array(part.n + part.creases.length);
        const head = decodeField(bytes, level.subarray(0, part.n));
        fillCopies(level, part.creases, 1);
        this.env.post({ type: "field", part: index, name: head.name, low: head.low, high: head.high, level }, [
            level.buffer,
        ]);
    }

    /**
     * Applied to the table at once, shown together with the next frame.
     * @param {number} index @param {Uint8Array} bytes
     */
    topologyDelta(index, bytes) {
        const part = this.parts.get(index);
        const { epoch } = readTopologyDeltaHead(bytes);
        if (!part || epoch > part.epoch) {
            const before = this.earlyDeltas.get(index) ?? [];
            this.earlyDeltas.set(index, [
                ...before.filter((older) => readTopologyDeltaHead(older).epoch === epoch),
                bytes.slice(),
            ]);
            // an earlier frame lacks the new vertices
            this.earlyFrames.delete(index);
            return;
        }
        if (epoch < part.epoch) return;
        applyTopologyDelta(bytes, part.table, part.n);
        part.changed = true;
    }

    /** @param {number} index @param {Uint8Array} bytes */
    frame(index, bytes) {
        const part = this.parts.get(index);
        const { epoch } = readFrameHead(bytes);
        if (!part || epoch > part.epoch) {
            this.earlyFrames.set(index, bytes.slice());
            return;
        }
        if (epoch < part.epoch) return;
        const begin = this.env.now();
        const size = 3 * (part.n + part.creases.length);
        const { positions, normals } = part.spare.pop() ?? {
            positions: new Float32Array(size),
            normals: new Float32Array(size),
        };
        part.decoder.decode(bytes, positions.subarray(0, 3 * part.n));
        fillCopies(positions, part.creases, 3);
        const ms = this.env.now() - begin;
        const shown = part.changed ? shownOf(part.table, part.n) : null;
        if (shown) part.shown = shown;
        part.changed = false;
        vertexNormals(positions, part.shown.triangles, normals, part.shown.visible);
        joinNormals(part.joined, normals);
        this.decodeUs += Math.round(1000 * ms);
        this.decodeSum += ms;
        this.nDecoded++;
        this.env.post({ type: "frame", part: index, positions, normals, shown }, [positions.buffer, normals.buffer]);
    }

    /** arrays returned by the page @param {{part: number} & FrameArrays} old */
    reuse(old) {
        const part = this.parts.get(old.part);
        if (part && part.spare.length < SPARE_MAX && old.positions.length === 3 * (part.n + part.creases.length))
            part.spare.push({ positions: old.positions, normals: old.normals });
    }

    /** @param {Uint8Array} bytes */
    tools(bytes) {
        const message = readTools(bytes);
        this.socket?.send(writeAck({ cycle: message.cycle, decodeUs: this.decodeUs }));
        this.decodeUs = 0;
        const mine = message.tools[this.ownTool];
        const now = this.env.now();
        if (mine && mine.held && mine.echoSeq && mine.echoSeq !== this.echo && mine.echoSeq <= this.poseSeq) {
            this.echo = mine.echoSeq;
            const latency = now - mine.echoStampUs / 1000;
            if (latency >= 0 && latency < LATENCY_MAX_MS)
                this.latency = this.latency ? 0.9 * this.latency + 0.1 * latency : latency;
        }
        this.env.post({ type: "tools", time: message.simTimeUs / 1e6, tools: message.tools });
        if (now - this.figuresAt > FIGURES_MS) {
            const figures = {
                latency_ms: this.latency,
                rtt_ms: this.rtt,
                decode_ms: this.nDecoded ? this.decodeSum / this.nDecoded : 0,
                bytes_s: (1000 * this.bytes) / (now - this.figuresAt),
            };
            this.env.post({ type: "figures", figures });
            this.figuresAt = now;
            this.bytes = this.nDecoded = this.decodeSum = 0;
        }
    }
}
