// The binary messages of palpate.v2 except the bodies of FRAME, FIELD and TOPOLOGY_DELTA (protocol/README.md;
// protocol/wire.c). Pure: bytes in, plain objects out; anything that is not exactly one known message throws WireError.

export const PROTOCOL = "palpate.v2";
export const VERSION = 2;
export const MAGIC = 0x314c4150;
export const KIND = Object.freeze({
    FRAME: 1,
    TOOLS: 2,
    HAPTIC: 3,
    FIELD: 4,
    TOPOLOGY_DELTA: 5,
    INTERIOR: 6,
    POSE: 16,
    ACK: 17,
});
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
export const TOOL_FLAG = Object.freeze({ HELD: 1, CONTACT: 2, GRASPS: 4, STALE: 8, AWAY: 16 });
export const TOOL_MAX = 32;
export const PART_MAX = 16;
export const CONTACT_PATCH_MAX = 8;
export const VERTEX_MAX = 1 << 22;

/** A refused message; `code` is the name of the same refusal in C (protocol/refusal.h). */
export class WireError extends Error {
    /** @param {string} code @param {string} text */
    constructor(code, text) {
        super(`${code}: ${text}`);
        this.code = code;
    }
}

/**
 * Reads the fields of one message in order. Numbers must be finite; a u64 must be exact as a double.
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
        const low = this.u32();
        const high = this.u32();
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

/**
 * A check that throws WireError unless its first argument is true.
 * @param {string} subject of its sentences
 * @returns {(good: boolean, code: string, text: string) => void}
 */
export const checkOf = (subject) => (good, code, text) => {
    if (!good) throw new WireError(code, `${subject}: ${text}`);
};
const need = checkOf("message");

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
 * Index in the head of a message of this kind, which has no flags.
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
 *   holder: number, flags: number, held: boolean, contact: boolean, grasps: boolean, stale: boolean, away: boolean,
 *   colour: number, radius: number, position: number[], quaternion: number[], force: number[],
 *   echoSeq: number, holdUs: number, echoStampUs: number
 * }} Tool one tool: SI, world frame, quaternion w x y z, force of the tissue on the tool
 * @typedef {{cycle: number, simTimeUs: number, tools: Tool[]}} Tools
 */

/** @param {Reader} r @returns {Tool} */
function readTool(r) {
    const holder = r.u16();
    const flags = r.u16();
    const colour = r.u32();
    const radius = r.f32();
    const position = r.floats(3);
    const quaternion = r.floats(4);
    const force = r.floats(3);
    const echoSeq = r.u32();
    const holdUs = r.u32();
    const echoStampUs = r.u64();
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
        contact: (flags & TOOL_FLAG.CONTACT) !== 0,
        grasps: (flags & TOOL_FLAG.GRASPS) !== 0,
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
    const cycle = r.u32();
    const zero = r.u32();
    const simTimeUs = r.u64();
    need(zero === 0, "RANGE", "reserved field");
    return { cycle, simTimeUs, tools: Array.from({ length: n }, () => readTool(r)) };
}

/**
 * @typedef {{id: number, group: number, p: number[], n: number[], v: number[], k1: number, k2: number, b: number,
 *   kt: number, muS: number, muD: number, radius: number}} ContactPatch
 * @typedef {{tool: number, seq: number, flags: number, stampUs: number, echoStampUs: number, echoSeq: number,
 *   holdUs: number, frameUs: number, origin: number[], fRef: number[],
 *   torqueRef: number[],
 *   grasp: {x0: number[], f0: number[], k: number[], b: number, arm: number[]} | null, contactPatches: ContactPatch[]}} Haptic
 */

/** @param {Reader} r @returns {ContactPatch} */
function readContactPatch(r) {
    const id = r.u16();
    const group = r.u16();
    const p = r.floats(3);
    const n = r.floats(3);
    const v = r.floats(3);
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
    need(bytes.length >= 164, "SHORT", `${bytes.length} bytes of 164`);
    const r = new Reader(bytes, 8);
    const seq = r.u32();
    const flags = r.u32();
    const stampUs = r.u64();
    const echoStampUs = r.u64();
    const echoSeq = r.u32();
    const holdUs = r.u32();
    const frameUs = r.u32();
    const nPatch = r.u32();
    need(nPatch <= CONTACT_PATCH_MAX, "COUNT", `${nPatch} patches`);
    exactly(bytes, 164 + 68 * nPatch);
    const origin = r.doubles(3);
    const fRef = r.floats(3);
    const torqueRef = r.floats(3);
    const hasGrasp = r.u32();
    const grasp = { x0: r.floats(3), f0: r.floats(3), k: r.floats(6), b: r.f32(), arm: r.floats(3) };
    need(flags < 8, "FLAGS", `haptic flags ${flags}`);
    need(tool < TOOL_MAX && hasGrasp <= 1 && grasp.b >= 0, "RANGE", "tool or grasp");
    const contactPatches = Array.from({ length: nPatch }, () => readContactPatch(r));
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
        torqueRef,
        grasp: hasGrasp ? grasp : null,
        contactPatches,
    };
}

/**
 * @param {number} kind @param {number} index @param {number} length
 * @returns {{bytes: Uint8Array<ArrayBuffer>, view: DataView}}
 */
function begin(kind, index, length) {
    const bytes = new Uint8Array(length);
    const view = new DataView(bytes.buffer);
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
 *   velocity?: number[], omega?: number[], force?: number[], torque?: number[], gripper?: number, buttons?: number,
 *   modelSeq?: number, modelAgeUs?: number, modelStampUs?: number
 * }} Pose missing fields are 0, the quaternion is 1 0 0 0
 */

/**
 * POSE of the own tool.
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
    view.setFloat32(128, pose.gripper ?? 0, true);
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
