// The worker: owns the socket and the decoders and transfers decoded arrays to the page without copying.
import { Link, REPEAT_MS } from "./link.js";

/** @typedef {import("./link.js").WorkerMessage} WorkerMessage */

/**
 * The global scope of a worker; the types of the page do not include it.
 * @typedef {{postMessage: (message: import("./link.js").PageMessage, transfer: Transferable[]) => void,
 *   onmessage: ((event: MessageEvent<WorkerMessage>) => void) | null}} WorkerScope
 */
const scope = /** @type {WorkerScope} */ (/** @type {unknown} */ (globalThis));
const link = new Link({
    open: (url, protocols) => new WebSocket(url, protocols),
    get: async (url) => {
        const response = await fetch(url);
        if (!response.ok) throw new Error(`${url}: ${response.status}`);
        return response.arrayBuffer();
    },
    post: (message, transfer) => scope.postMessage(message, transfer ?? []),
    now: () => performance.now(),
    later: (call, ms) => setTimeout(call, ms),
});
setInterval(() => link.repeatPose(), REPEAT_MS);

scope.onmessage = (/** @type {MessageEvent<WorkerMessage>} */ { data }) => {
    switch (data.type) {
        case "connect":
            link.connect(data);
            break;
        case "pose":
            link.ownTool = data.tool;
            link.pose(data);
            break;
        case "control":
            link.send(data.message);
            break;
        case "reuse":
            link.reuse(data);
            break;
    }
};
