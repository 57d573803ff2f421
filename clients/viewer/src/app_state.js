// What the page knows: the session as the server last described it, and the user's choices. Data only.

/**
 * @typedef {import("./control_table.js").Hello} Hello
 * @typedef {import("./control_table.js").Status} Status
 * @typedef {import("./control_table.js").Member} Member
 * @typedef {{components: string[], component_parts?: number[], component_reasons?: string[],
 *   component_required?: number[]}} Plan
 */

export class AppState {
    /** @type {Hello | null} null before the first connection */
    hello = null;
    /** @type {Status | null} null: the newest one describes an older plan */
    status = null;
    /** @type {Plan} components of `hello`, or of the last `topology` that had some */
    plan = { components: [] };
    /** @type {string[]} names of the components that run */
    running = [];
    /** @type {Map<number, Member>} by id */
    members = new Map();
    /** @type {import("./wire.js").Tool[]} */
    tools = [];
    ownId = 0;
    ownTool = -1; // -1: none
    /** @type {import("./tool_input.js").ToolTarget} null: no drag moves the tool */
    target = null;
    /** @type {Map<number, import("./body_mesh.js").BodyMesh>} shown body of each part */
    bodies = new Map();
    /** @type {Map<number, import("./body_mesh.js").BodyMesh>} of a newer topology, until its first frame */
    pendingBodies = new Map();
    field = "none"; // shown in colour
    /** @type {{low: number, high: number} | null} of the colours; null: no values yet */
    range = null;
    wireframe = false;
    figures = { fps: 0, latency_ms: 0, rtt_ms: 0, decode_ms: 0, bytes_s: 0, vertices: 0, effects: "" };

    get parts() {
        return this.hello?.parts ?? [];
    }

    /** body of the newest topology of each part, also where its first frame has not come */
    get newestBodies() {
        return new Map([...this.bodies, ...this.pendingBodies]);
    }

    /** state of the own tool, as the server sent it last */
    ownToolState() {
        return this.ownTool < 0 ? undefined : this.tools[this.ownTool];
    }

    /** may this member give the commands of a right? @param {string} right */
    may(right) {
        const own = this.members.get(this.ownId);
        return own?.role === "instructor" || (own?.rights ?? "").split(" ").includes(right);
    }

    /** does this client only watch? A viewer may stand outside the list of members */
    get watches() {
        return (this.members.get(this.ownId)?.role ?? this.hello?.you.role) === "viewer";
    }

    /** does a recording play, so that tools do not act? */
    get plays() {
        return this.status?.playback?.[0]?.plays === true;
    }

    countVertices() {
        this.figures.vertices = [...this.bodies.values()].reduce((n, body) => n + body.nOriginal(), 0);
    }
}
