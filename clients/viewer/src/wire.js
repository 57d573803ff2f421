// The binary messages of palpate.v1 except FRAME's body: protocol/README.md, mirrored by protocol/wire.c. Pure: bytes in,
// plain objects out; anything that is not exactly one known message throws WireError.

export const PROTOCOL = "palpate.v1";
export const VERSION = 1;
export const MAGIC = 0x314c4150;
export const KIND = Object.freeze({ FRAME: 1, TOOLS: 2, HAPTIC: 3, FIELD: 4, PATCH: 5, POSE: 16, ACK: 17 });
export const POSE_FLAG = Object.freeze({
    CONTACT: 1,
    CLUTCHED: 2,
    FORCES_ON: 4,
    SATURATED: 8,
    STIFF_CLAMPED: 16,
    STALE: 32,
    ESTOP: 64,
    POSE_ONLY: 128,
    AWAY: 256,
});
export const TOOL_FLAG = Object.freeze({ HELD: 1, TOUCHES: 2, GRABS: 4, STALE: 8, AWAY: 16 });
export const TOOL_MAX = 32;
export const PART_MAX = 16;
export const PATCH_MAX = 8;
export const VERTEX_MAX = 1 << 22;

/** Why a message was refused; `code` is the name of the same refusal in C (protocol/refusal.h). */
export class WireError extends Error {
    /** @param {string} code @param {string} text */
    constructor(code, text) {
        super(`${code}: ${text}`);
        this.code = code;
    }
}

/**
 * Walks the fields of one message. Numbers must be finite; u64 must fit a double exactly.
 */
class Reader {
    /** @param {Uint8Array} bytes @param {number} at */
    constructor(bytes, at) {
        this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
        this.at = at;
    }

    u16() {
        this.at += 2;
        return this.view.getUint16(this.at - 2, true);
    }

    u32() {
        this.at += 4;
        return this.view.getUint32(this.at - 4, true);
    }

    u64() {
        const low = this.u32(),
            high = this.u32();
        if (high >= 1 << 21) throw new WireError("RANGE", "u64 above 2^53");
        return high * 4294967296 + low;
    }

    f32() {
        this.at += 4;
        return finite(this.view.getFloat32(this.at - 4, true));
    }

    f64() {
        this.at += 8;
        return finite(this.view.getFloat64(this.at - 8, true));
    }

    /** @param {number} n */
    floats(n) {
        return Array.from({ length: n }, () => this.f32());
    }

    /** @param {number} n */
    doubles(n) {
        return Array.from({ length: n }, () => this.f64());
    }
}

/** @param {number} value */
function finite(value) {
    if (!Number.isFinite(value)) throw new WireError("NAN", "a number is not finite");
    return value;
}

/** @param {boolean} good @param {string} code @param {string} text */
function need(good, code, text) {
    if (!good) throw new WireError(code, text);
}

/** @param {Uint8Array} bytes @param {number} length */
function exactly(bytes, length) {
    need(bytes.length >= length, "SHORT", `${bytes.length} bytes of ${length}`);
    need(bytes.length <= length, "LONG", `${bytes.length} bytes of ${length}`);
}

/**
 * Head of any binary message.
 * @param {Uint8Array} bytes
 * @returns {{kind: number, flags: number, index: number}}
 */
export function readHead(bytes) {
    need(bytes.length >= 8, "SHORT", "message without a head");
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    need(view.getUint32(0, true) === MAGIC, "MAGIC", "message does not begin with PAL1");
    const kind = view.getUint8(4);
    need(
        Object.values(KIND).some((known) => known === kind),
        "KIND",
        `message kind ${kind}`,
    );
    return { kind, flags: view.getUint8(5), index: view.getUint16(6, true) };
}

/**
 * Head of a message of this kind that has no flags; returns its index.
 * @param {Uint8Array} bytes @param {number} kind
 */
function indexOf(bytes, kind) {
    const head = readHead(bytes);
    need(head.kind === kind, "KIND", `message kind ${head.kind} instead of ${kind}`);
    need(head.flags === 0, "FLAGS", `flags ${head.flags}`);
    return head.index;
}

/**
 * @typedef {{
 *   holder: number, flags: number, held: boolean, touches: boolean, grabs: boolean, stale: boolean, away: boolean,
 *   colour: number, radius: number, position: number[], quaternion: number[], force: number[],
 *   echoSeq: number, holdUs: number, echoStampUs: number
 * }} Tool one tool: SI, world frame, quaternion w x y z, force of the tissue on the tool
 * @typedef {{cycle: number, simTimeUs: number, tools: Tool[]}} Tools
 */

/** @param {Reader} r @returns {Tool} */
function readTool(r) {
    const holder = r.u16(),
        flags = r.u16(),
        colour = r.u32(),
        radius = r.f32();
    const position = r.floats(3),
        quaternion = r.floats(4),
        force = r.floats(3);
    const echoSeq = r.u32(),
        holdUs = r.u32(),
        echoStampUs = r.u64();
    need(flags < 32, "FLAGS", `tool flags ${flags}`);
    need(radius >= 0 && colour <= 0xffffff, "RANGE", "tool radius or colour");
    return {
        holder,
        flags,
        colour,
        radius,
        position,
        quaternion,
        force,
        echoSeq,
        holdUs,
        echoStampUs,
        held: (flags & TOOL_FLAG.HELD) !== 0,
        touches: (flags & TOOL_FLAG.TOUCHES) !== 0,
        grabs: (flags & TOOL_FLAG.GRABS) !== 0,
        stale: (flags & TOOL_FLAG.STALE) !== 0,
        away: (flags & TOOL_FLAG.AWAY) !== 0,
    };
}

/**
 * TOOLS, which closes a cycle.
 * @param {Uint8Array} bytes
 * @returns {Tools}
 */
export function readTools(bytes) {
    const n = indexOf(bytes, KIND.TOOLS);
    need(n <= TOOL_MAX, "COUNT", `${n} tools`);
    exactly(bytes, 24 + 68 * n);
    const r = new Reader(bytes, 8);
    const cycle = r.u32(),
        zero = r.u32(),
        simTimeUs = r.u64();
    need(zero === 0, "RANGE", "reserved field");
    return { cycle, simTimeUs, tools: Array.from({ length: n }, () => readTool(r)) };
}

/**
 * @typedef {{id: number, group: number, p: number[], n: number[], v: number[], k1: number, k2: number, b: number,
 *   kt: number, muS: number, muD: number, radius: number}} Patch
 * @typedef {{tool: number, seq: number, flags: number, stampUs: number, echoStampUs: number, echoSeq: number,
 *   holdUs: number, frameUs: number, origin: number[], fRef: number[],
 *   grip: {x0: number[], f0: number[], k: number[], b: number} | null, patches: Patch[]}} Haptic
 */

/** @param {Reader} r @returns {Patch} */
function readPatch(r) {
    const id = r.u16(),
        group = r.u16(),
        p = r.floats(3),
        n = r.floats(3),
        v = r.floats(3);
    const [k1, k2, b, kt, muS, muD, radius] = r.floats(7);
    const passive = Math.min(k1, b, kt, muS, muD, radius) >= 0;
    need(passive && Math.abs(n[0] ** 2 + n[1] ** 2 + n[2] ** 2 - 1) <= 1e-3, "RANGE", "contact patch");
    return { id, group, p, n, v, k1, k2, b, kt, muS, muD, radius };
}

/**
 * HAPTIC, the contact model of one tool.
 * @param {Uint8Array} bytes
 * @returns {Haptic}
 */
export function readHaptic(bytes) {
    const tool = indexOf(bytes, KIND.HAPTIC);
    need(bytes.length >= 140, "SHORT", `${bytes.length} bytes of 140`);
    const r = new Reader(bytes, 8);
    const seq = r.u32(),
        flags = r.u32(),
        stampUs = r.u64(),
        echoStampUs = r.u64(),
        echoSeq = r.u32();
    const holdUs = r.u32(),
        frameUs = r.u32(),
        nPatch = r.u32();
    need(nPatch <= PATCH_MAX, "COUNT", `${nPatch} patches`);
    exactly(bytes, 140 + 68 * nPatch);
    const origin = r.doubles(3),
        fRef = r.floats(3),
        hasGrip = r.u32();
    const grip = { x0: r.floats(3), f0: r.floats(3), k: r.floats(6), b: r.f32() };
    need(flags < 8, "FLAGS", `haptic flags ${flags}`);
    need(tool < TOOL_MAX && hasGrip <= 1 && grip.b >= 0, "RANGE", "tool or grip");
    const patches = Array.from({ length: nPatch }, () => readPatch(r));
    return {
        tool,
        seq,
        flags,
        stampUs,
        echoStampUs,
        echoSeq,
        holdUs,
        frameUs,
        origin,
        fRef,
        grip: hasGrip ? grip : null,
        patches,
    };
}

/**
 * @param {number} kind @param {number} index @param {number} length
 * @returns {{bytes: Uint8Array<ArrayBuffer>, view: DataView}}
 */
function begin(kind, index, length) {
    const bytes = new Uint8Array(length),
        view = new DataView(bytes.buffer);
    view.setUint32(0, MAGIC, true);
    view.setUint8(4, kind);
    view.setUint16(6, index, true);
    return { bytes, view };
}

/** @param {DataView} view @param {number} at @param {number} value */
function setU64(view, at, value) {
    view.setUint32(at, value % 4294967296, true);
    view.setUint32(at + 4, Math.floor(value / 4294967296), true);
}

/**
 * @typedef {{
 *   tool: number, seq: number, stampUs: number, position: number[], flags?: number, quaternion?: number[],
 *   velocity?: number[], omega?: number[], force?: number[], torque?: number[], grip?: number, buttons?: number,
 *   modelSeq?: number, modelAgeUs?: number, modelStampUs?: number
 * }} Pose what is left out is 0, the quaternion 1 0 0 0
 */

/**
 * POSE of the tool this client holds.
 * @param {Pose} pose
 * @returns {Uint8Array<ArrayBuffer>}
 */
export function writePose(pose) {
    const { bytes, view } = begin(KIND.POSE, pose.tool, 152);
    view.setUint32(8, pose.seq, true);
    view.setUint32(12, pose.flags ?? 0, true);
    setU64(view, 16, pose.stampUs);
    pose.position.forEach((v, i) => view.setFloat64(24 + 8 * i, v, true));
    (pose.quaternion ?? [1, 0, 0, 0]).forEach((v, i) => view.setFloat64(48 + 8 * i, v, true));
    [pose.velocity, pose.omega, pose.force, pose.torque].forEach((vector, k) =>
        vector?.forEach((v, i) => view.setFloat32(80 + 12 * k + 4 * i, v, true)),
    );
    view.setFloat32(128, pose.grip ?? 0, true);
    view.setUint32(132, pose.buttons ?? 0, true);
    view.setUint32(136, pose.modelSeq ?? 0, true);
    view.setUint32(140, pose.modelAgeUs ?? 0, true);
    setU64(view, 144, pose.modelStampUs ?? 0);
    return bytes;
}

/**
 * ACK of a TOOLS message.
 * @param {{cycle: number, decodeUs: number}} ack
 * @returns {Uint8Array<ArrayBuffer>}
 */
export function writeAck(ack) {
    const { bytes, view } = begin(KIND.ACK, 0, 16);
    view.setUint32(8, ack.cycle, true);
    view.setUint32(12, Math.min(4294967295, Math.max(0, Math.round(ack.decodeUs))), true);
    return bytes;
}
