// The other hand of a user: a member holds one tool, so the second hand joins the session as a member of its own. It takes
// no shapes and draws nothing.
import { AppState } from "./app_state.js";
import { PoseSender } from "./pose_sender.js";

export class SecondHand {
    state = new AppState();

    /** @param {import("./link.js").Wishes} options of the join @param {() => number} size of the scene, m */
    constructor(options, size) {
        this.worker = new Worker(new URL("./socket_worker.js", import.meta.url), { type: "module" });
        const post = (/** @type {import("./link.js").WorkerMessage} */ message) => this.worker.postMessage(message);
        this.poses = new PoseSender(this.state, post, size);
        this.worker.onmessage = ({ data }) => this.take(data);
        post({ type: "connect", ...options, toolOnly: true });
    }

    /** @param {import("./link.js").PageMessage} data */
    take(data) {
        const { state } = this;
        if (data.type === "tools") state.tools = data.tools;
        else if (data.type === "state" && data.state !== "live") state.ownTool = -1;
        else if (data.type === "control" && data.message.type === "hello") {
            state.ownId = data.message.you.id;
            state.ownTool = data.message.you.tool ?? -1;
        } else if (data.type === "control" && data.message.type === "members")
            state.ownTool = data.message.members.find(({ id }) => id === state.ownId)?.tool ?? -1;
    }

    /** leaves the session, and with it the tool */
    leave() {
        this.worker.terminate();
    }
}
