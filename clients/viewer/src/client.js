// The way in for other pages and programs: a joined session by one call. The viewer itself runs the same link in a
// worker (socket_worker.js); package/ makes an npm package of this file and what it imports.
import { Link, REPEAT_MS } from "./link.js";

export { decodeAsset } from "./asset.js";
export { readControl } from "./control_reader.js";
export { CLIENT_MESSAGES, ROLES, SERVER_MESSAGES } from "./control_table.js";
export { decodeField, FIELD_NAMES, readFieldHead } from "./field_decoder.js";
export { FrameDecoder, readFrameHead } from "./frame_decoder.js";
export { decodeInterior, readInteriorHead, tetrahedraOf } from "./interior_decoder.js";
export { Link } from "./link.js";
export { lz4Decode } from "./lz4.js";
export { applyTopologyDelta, readTopologyDeltaHead, shownOf } from "./topology_delta.js";
export {
    KIND,
    POSE_FLAG,
    PROTOCOL,
    readHaptic,
    readHead,
    readTools,
    TOOL_FLAG,
    WireError,
    writeAck,
    writePose,
} from "./wire.js";

/**
 * @typedef {import("./link.js").PageMessage} Message
 * @typedef {import("./link.js").Environment} Environment
 * @typedef {{name?: string, role?: import("./control_table.js").Role, ticket?: string, open?: Environment["open"],
 *   get?: Environment["get"]}} Options name: of the member; role: trainee unless said; ticket: else that behind the #
 *   of the address; open, get: where the runtime has no WebSocket or fetch
 */

/**
 * Address of the websocket and ticket, from the address that the server prints.
 * @param {string} url ws[s]:// or http[s]://host[:port][/path][?session=NAME][#TICKET]
 * @returns {{url: string, ticket: string}}
 */
export function addressOf(url) {
    const at = new URL(url);
    at.protocol = at.protocol.replace(/^http/, "ws");
    if (!/^wss?:$/.test(at.protocol)) throw new Error(`${url} is no address such as ws://127.0.0.1:8090/ws`);
    const ticket = at.hash.slice(1);
    at.hash = "";
    if (at.pathname === "/") at.pathname = "/ws";
    return { url: at.href, ticket };
}

/** @param {string} url */
async function fetched(url) {
    const response = await fetch(url);
    if (!response.ok) throw new Error(`${url}: ${response.status}`);
    return response.arrayBuffer();
}

/**
 * Joins a session, and again after every lost connection until close() or a refusal. `take` gets decoded messages:
 * state, control (hello, status, ...), part (rest shape and triangles), frame (positions and normals [n][3]), field,
 * tools. Lengths are m, forces N, in the scene's axes.
 * @param {string} url @param {(message: Message) => void} take @param {Options} [options]
 */
export function join(url, take, options = {}) {
    const { url: address, ticket } = addressOf(url);
    const link = new Link({
        open: options.open ?? ((to, protocols) => new WebSocket(to, protocols)),
        get: options.get ?? fetched,
        post: take,
        now: () => performance.now(),
        later: (call, ms) => setTimeout(call, ms),
    });
    const repeat = setInterval(() => link.repeatPose(), REPEAT_MS);
    link.connect({
        url: address,
        name: options.name ?? "JavaScript",
        role: options.role ?? "trainee",
        ticket: options.ticket ?? ticket,
    });
    return {
        /**
         * Moves the own tool; without a call for 3 s it is lifted.
         * @param {number[]} position m @param {boolean} [grasp] closed @param {number[]} [quaternion] w x y z
         */
        move(position, grasp = false, quaternion) {
            if (link.ownTool >= 0) link.pose({ tool: link.ownTool, position, quaternion, grasp, away: false });
        },
        /** takes the own tool out of the scene */
        lift() {
            if (link.ownTool >= 0) link.pose({ tool: link.ownTool, position: null, grasp: false, away: true });
        },
        /** a text message, such as an order @param {import("./control_table.js").ClientMessage} message */
        send: (message) => link.send(message),
        /** hands back the arrays of a frame that is no longer used @param {Parameters<Link["reuse"]>[0]} frame */
        reuse: (frame) => link.reuse(frame),
        close() {
            clearInterval(repeat);
            link.close();
        },
    };
}
