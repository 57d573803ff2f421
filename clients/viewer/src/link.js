// The connection of one viewer: join, assets, frames, credit, reconnecting. Socket, fetch, clock and output are handed
// in, so that the same code runs in the worker and under node --test.
import { decodeAsset } from "./asset.js";
import { decodeField, readFieldHead } from "./field_decoder.js";
import { FrameDecoder, readFrameHead } from "./frame_decoder.js";
import { vertexNormals } from "./normals.js";
import { applyPatch, readPatchHead, shownOf } from "./patch_decoder.js";
import { KIND, POSE_FLAG, PROTOCOL, readHead, readTools, writeAck, writePose } from "./wire.js";

const RETRY_MS = 500,
  RETRY_MOST_MS = 5000;
const BEAT_MS = 50; // a resting tool is said again this often: the server lets a silent one go
const PAGE_MS = 3000; // unless the page itself has been silent for so long
/** close codes after which trying again makes no sense, with what to tell people */
const FINAL = new Map([
  [1002, "the server refused what this page sent"],
  [1008, "not allowed here"],
  [1009, "the server refused what this page sent"],
  [4001, "this page sent too much"],
  [4003, "the session is full"],
  [4004, "this session does not exist"],
]);

/**
 * @typedef {{
 *   open: (url: string, protocol: string) => WebSocket,
 *   get: (url: string) => Promise<ArrayBuffer>,
 *   post: (message: any, transfer?: Transferable[]) => void,
 *   now: () => number,
 *   later: (call: () => void, ms: number) => any,
 * }} Surroundings
 * @typedef {{decoder: FrameDecoder, table: Uint32Array, shown: import("./patch_decoder.js").Shown, patched: boolean, epoch: number, n: number,
 *   spare: {positions: Float32Array, normals: Float32Array}[]}} Part table: of triangles, as patched; shown: of the table, but for the patches since
 *   the last frame (patched)
 */

export { BEAT_MS };

/** of a close: at most 123 bytes @param {unknown} error */
const reason = (error) =>
  String(error)
    .replace(/[^ -~]/g, "?")
    .slice(0, 100);

export class Link {
  /** @type {WebSocket | null} */
  socket = null;
  want = { url: "", name: "Guest", role: "trainee" };
  tries = 0;
  generation = 0; // of the connection: what belongs to an older one is ignored
  poseSeq = 0;
  /** @type {{tool: number, position: number[] | null, grab: boolean, away: boolean} | null} what the tool does now */
  held = null;
  heldAt = 0; // when the page last said so
  saidAt = 0; // when the server was last told
  /** @type {number[]} */
  lastPosition = [0, 0, 0];
  figuresAt = 0;
  /** @type {Map<number, Part>} */
  parts = new Map();
  /** @type {Map<number, number>} epoch that was asked for last */
  wanted = new Map();
  /** @type {Map<number, Uint8Array>} newest frame of a part whose asset is not here yet */
  kept = new Map();
  /** @type {Map<number, Uint8Array>} the same for fields */
  keptField = new Map();
  /** @type {Map<number, Uint8Array[]>} and all patches: each is relative to the one before */
  keptPatches = new Map();
  decodeUs = 0;
  nDecoded = 0;
  decodeSum = 0;
  bytes = 0;
  myTool = -1;
  latency = 0;
  rtt = 0;
  echo = 0;

  /** @param {Surroundings} around */
  constructor(around) {
    this.around = around;
    this.figuresAt = around.now();
  }

  fresh() {
    this.held = null;
    this.parts.clear();
    this.wanted.clear();
    this.kept.clear();
    this.keptField.clear();
    this.keptPatches.clear();
    this.decodeUs = this.nDecoded = this.decodeSum = this.bytes = 0;
    this.latency = this.rtt = this.echo = 0;
    this.myTool = -1;
  }

  /** @param {{url: string, name: string, role: string}} want */
  connect(want) {
    this.want = want;
    this.tries = 0;
    const old = this.socket;
    this.socket = null;
    this.generation++;
    old?.close(1000);
    this.dial();
  }

  dial() {
    const generation = this.generation;
    this.fresh();
    this.say("connecting", this.tries ? "connecting again" : "connecting");
    const socket = this.around.open(this.want.url, PROTOCOL);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      if (generation !== this.generation) return;
      this.send({
        type: "join",
        name: this.want.name,
        role: this.want.role,
        tool: this.want.role === "viewer" ? null : -1,
        patches: true,
      });
    };
    socket.onmessage = (event) => {
      if (generation !== this.generation) return;
      try {
        this.received(event.data);
      } catch (error) {
        // a message we cannot read is the server's mistake: say so and start over
        socket.close(4900, reason(error));
      }
    };
    socket.onclose = (event) => {
      if (generation !== this.generation) return;
      this.generation++;
      this.socket = null;
      const final = FINAL.get(event.code);
      if (final) {
        this.say("refused", event.reason ? `${final}: ${event.reason}` : final);
        return;
      }
      const pause = Math.min(RETRY_MOST_MS, RETRY_MS * 2 ** this.tries++);
      this.say("lost", "connection lost, trying again");
      const next = this.generation;
      this.around.later(() => next === this.generation && this.dial(), pause);
    };
  }

  /** @param {string} state @param {string} text */
  say(state, text) {
    this.around.post({ type: "state", state, text });
  }

  /** @param {any} message */
  send(message) {
    if (this.socket?.readyState === 1) this.socket.send(JSON.stringify(message));
  }

  /** @param {{tool: number, position: number[] | null, grab: boolean, away: boolean}} pose */
  pose(pose) {
    this.held = pose.away ? null : pose;
    this.heldAt = this.around.now();
    this.sendPose(pose);
  }

  /** called every BEAT_MS: drawing may hold the page up for longer than the server waits for a tool */
  beat() {
    const now = this.around.now();
    if (!this.held || now - this.saidAt < 0.8 * BEAT_MS) return;
    if (now - this.heldAt < PAGE_MS) this.sendPose(this.held);
    else this.pose({ ...this.held, position: null, grab: false, away: true });
  }

  /** @param {{tool: number, position: number[] | null, grab: boolean, away: boolean}} pose */
  sendPose(pose) {
    if (this.socket?.readyState !== 1) return;
    this.saidAt = this.around.now();
    this.lastPosition = pose.position ?? this.lastPosition;
    this.socket.send(
      writePose({
        tool: pose.tool,
        seq: ++this.poseSeq,
        flags: POSE_FLAG.POSE_ONLY | (pose.away ? POSE_FLAG.AWAY : 0),
        stampUs: Math.round(this.around.now() * 1000),
        position: this.lastPosition,
        buttons: pose.grab ? 1 : 0,
      }),
    );
  }

  /** @param {string | ArrayBuffer} data */
  received(data) {
    if (typeof data === "string") {
      this.bytes += data.length;
      this.control(JSON.parse(data));
      return;
    }
    const bytes = new Uint8Array(data);
    this.bytes += bytes.length;
    const head = readHead(bytes);
    if (head.kind === KIND.FRAME) this.frame(head.index, bytes);
    else if (head.kind === KIND.TOOLS) this.tools(bytes);
    else if (head.kind === KIND.FIELD) this.field(head.index, bytes);
    else if (head.kind === KIND.PATCH) this.patch(head.index, bytes);
  }

  /** @param {any} message */
  control(message) {
    if (message.type === "hello") {
      this.myTool = message.you.tool ?? -1;
      message.parts.forEach((/** @type {any} */ part, /** @type {number} */ i) => this.loadPart(i, part));
      this.say("live", "live");
      this.ping();
    } else if (message.type === "topology")
      message.parts.forEach((/** @type {any} */ part, /** @type {number} */ i) => this.loadPart(i, part));
    else if (message.type === "pong") this.rtt = this.around.now() - message.stamp_ms;
    this.around.post({ type: "control", message });
  }

  ping() {
    const generation = this.generation;
    this.send({ type: "ping", stamp_ms: this.around.now() });
    this.around.later(() => generation === this.generation && this.ping(), 1000);
  }

  /** @param {number} index @param {{epoch: number, asset: string}} info */
  async loadPart(index, info) {
    if (this.wanted.get(index) === info.epoch) return;
    this.wanted.set(index, info.epoch);
    const generation = this.generation;
    const address = new URL(info.asset, this.want.url.replace(/^ws/, "http")).href;
    try {
      const asset = await decodeAsset(new Uint8Array(await this.around.get(address)));
      // answers may overtake one another: only the newest epoch's counts
      if (generation !== this.generation || this.wanted.get(index) !== info.epoch) return;
      // a server whose assets cannot be read is asked again ever more slowly
      this.tries = 0;
      const n = asset.rest.length / 3,
        shown = shownOf(asset.triangles, n);
      this.parts.set(index, {
        decoder: new FrameDecoder(asset),
        table: asset.triangles,
        shown,
        patched: false,
        epoch: info.epoch,
        n,
        spare: [],
      });
      this.around.post({ type: "part", part: index, epoch: info.epoch, rest: asset.rest.slice(), ...shown });
      this.laterMessages(index);
    } catch (error) {
      if (generation === this.generation && this.wanted.get(index) === info.epoch)
        this.socket?.close(4900, reason(error));
    }
  }

  /** what came before the asset @param {number} index of the part that is there now */
  laterMessages(index) {
    const kept = this.kept.get(index),
      patches = this.keptPatches.get(index) ?? [];
    this.kept.delete(index);
    this.keptPatches.delete(index);
    for (const patch of patches) this.patch(index, patch);
    if (kept) this.frame(index, kept);
    const keptField = this.keptField.get(index);
    this.keptField.delete(index);
    if (keptField) this.field(index, keptField);
  }

  /** @param {number} index @param {Uint8Array} bytes */
  field(index, bytes) {
    const part = this.parts.get(index),
      { epoch } = readFieldHead(bytes);
    if (!part || epoch > part.epoch) {
      this.keptField.set(index, bytes.slice());
      return;
    }
    if (epoch < part.epoch) return;
    const level = new Uint8Array(part.n),
      head = decodeField(bytes, level);
    this.around.post({ type: "field", part: index, name: head.name, low: head.low, high: head.high, level }, [
      level.buffer,
    ]);
  }

  /** into the table at once, shown together with the frame that follows @param {number} index @param {Uint8Array} bytes */
  patch(index, bytes) {
    const part = this.parts.get(index),
      { epoch } = readPatchHead(bytes);
    if (!part || epoch > part.epoch) {
      const before = this.keptPatches.get(index) ?? [];
      this.keptPatches.set(index, [...before.filter((older) => readPatchHead(older).epoch === epoch), bytes.slice()]);
      // a frame from before does not know the new vertices
      this.kept.delete(index);
      return;
    }
    if (epoch < part.epoch) return;
    applyPatch(bytes, part.table, part.n);
    part.patched = true;
  }

  /** @param {number} index @param {Uint8Array} bytes */
  frame(index, bytes) {
    const part = this.parts.get(index),
      { epoch } = readFrameHead(bytes);
    if (!part || epoch > part.epoch) {
      this.kept.set(index, bytes.slice());
      return;
    }
    if (epoch < part.epoch) return;
    const begin = this.around.now();
    const { positions, normals } = part.spare.pop() ?? {
      positions: new Float32Array(3 * part.n),
      normals: new Float32Array(3 * part.n),
    };
    part.decoder.decode(bytes, positions);
    const ms = this.around.now() - begin,
      shown = part.patched ? shownOf(part.table, part.n) : null;
    if (shown) part.shown = shown;
    part.patched = false;
    vertexNormals(positions, part.shown.triangles, normals, part.shown.visible);
    this.decodeUs += Math.round(1000 * ms);
    this.decodeSum += ms;
    this.nDecoded++;
    this.around.post({ type: "frame", part: index, positions, normals, shown }, [positions.buffer, normals.buffer]);
  }

  /** arrays come back from the page @param {{part: number, positions: Float32Array, normals: Float32Array}} old */
  reuse(old) {
    const part = this.parts.get(old.part);
    if (part && part.spare.length < 4 && old.positions.length === 3 * part.n)
      part.spare.push({ positions: old.positions, normals: old.normals });
  }

  /** @param {Uint8Array} bytes */
  tools(bytes) {
    const message = readTools(bytes);
    this.socket?.send(writeAck({ cycle: message.cycle, decodeUs: this.decodeUs }));
    this.decodeUs = 0;
    const mine = message.tools[this.myTool];
    const now = this.around.now();
    if (mine && mine.held && mine.echoSeq && mine.echoSeq !== this.echo && mine.echoSeq <= this.poseSeq) {
      this.echo = mine.echoSeq;
      const latency = now - mine.echoStampUs / 1000;
      if (latency >= 0 && latency < 10000) this.latency = this.latency ? 0.9 * this.latency + 0.1 * latency : latency;
    }
    this.around.post({ type: "tools", tools: message.tools });
    if (now - this.figuresAt > 500) {
      const figures = {
        latency_ms: this.latency,
        rtt_ms: this.rtt,
        decode_ms: this.nDecoded ? this.decodeSum / this.nDecoded : 0,
        bytes_s: (1000 * this.bytes) / (now - this.figuresAt),
      };
      this.around.post({ type: "figures", figures });
      this.figuresAt = now;
      this.bytes = this.nDecoded = this.decodeSum = 0;
    }
  }
}
