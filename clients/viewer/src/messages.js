// What each message of the worker changes on the page.
import { UNSEEN } from "./body_set.js";
import { buttonById, htmlById } from "./dom.js";
import { componentsOf, idleText } from "./plan_list.js";
import { effectsText } from "./picture_effects.js";
import { speedText } from "./plan_panel.js";
import { playbackText } from "./playback_bar.js";
import { refusalText, text as textOf } from "./text.js";
import { sameTools } from "./tool_marks.js";

/**
 * @typedef {import("./control_table.js").ServerMessage} ServerMessage
 * @typedef {import("./link.js").PageMessage} PageMessage
 * @typedef {{
 *   state: import("./app_state.js").AppState, stage: import("./stage.js").Stage, layout: import("./layout.js").Layout,
 *   bodies: import("./body_set.js").BodySet, fields: import("./field_display.js").FieldDisplay,
 *   inside: import("./inside.js").Inside,
 *   input: import("./tool_input.js").ToolInput, marks: import("./tool_marks.js").ToolMarks,
 *   panel: import("./plan_panel.js").PlanPanel, members: import("./members_panel.js").MembersPanel,
 *   accuracy: import("./accuracy_panel.js").AccuracyPanel, plots: import("./plots.js").Plots,
 *   sculpt: import("./sculpt_panel.js").SculptPanel, playback: import("./playback_bar.js").PlaybackBar,
 *   highlight: import("./sculpt_highlight.js").SculptHighlight,
 *   others: import("./other_tools.js").OtherTools, controls: import("./controls.js").Controls,
 *   move: (to: import("./control_table.js").Move) => void,
 *   send: (message: import("./control_table.js").ClientMessage) => void
 * }} Page the parts of the page that messages act on
 */
/** @template {ServerMessage["type"]} T @typedef {Extract<ServerMessage, {type: T}>} Of message of one type */

const NOTICE_MS = 4000;
const RECENT_S = 2; // an order that is news
const RADIUS_SHARE = 0.02; // of the scene's size: tool radius if the server has none
const REAL_TIME = 1.05; // slowdown that still counts as real time
/** codes of `error` that answer a pending command of a panel */
const COMMAND_ERRORS = ["refused", "args", "role", "busy", "target"];

export class Messages {
    /** @param {Page} page */
    constructor(page) {
        this.page = page;
        this.listed = ""; // components as the panel shows them
        this.pausedBy = ""; // name of the member, "" unknown
    }

    /** @param {PageMessage} data */
    take(data) {
        const { bodies, fields, input, layout, marks, sculpt, stage, state } = this.page;
        switch (data.type) {
            case "state":
                layout.connection(data.state, data.text);
                if (data.state === "live") break;
                // the server has to describe all tools again
                input.release();
                input.enabled = false;
                state.tools = [];
                this.page.others.take([], performance.now());
                stage.dirty = true;
                break;
            case "control":
                this.control(data.message);
                break;
            case "part":
                sculpt.grow(data.rest);
                bodies.takePart(data);
                break;
            case "frame":
                bodies.takeFrame(data);
                break;
            case "field":
                fields.takeField(data);
                break;
            case "interior_mesh":
                this.page.inside.takeMesh(data);
                break;
            case "interior":
                this.page.inside.takeValues(data);
                break;
            case "tools":
                if (!sameTools(marks.drawn, data.tools, UNSEEN * stage.size)) stage.dirty = true;
                state.tools = data.tools;
                this.page.others.take(data.tools, performance.now());
                this.page.plots.take(data.time, data.tools);
                break;
            case "silence":
                layout.silence(data.seconds);
                break;
            case "figures":
                Object.assign(state.figures, data.figures);
                break;
        }
    }

    /** @param {ServerMessage} message */
    control(message) {
        const { accuracy, sculpt } = this.page;
        switch (message.type) {
            case "hello":
                return this.hello(message);
            case "topology":
                return this.topology(message);
            case "status":
                return this.status(message);
            case "members":
                return this.members(message);
            case "orders":
                return this.orders(message);
            case "error":
                return this.error(message);
            case "answer":
                this.page.playback.answered();
                if (!accuracy.answer(message)) sculpt.answer(message);
                return;
            case "study":
                return accuracy.takeStudy(message);
            case "estimate":
                return accuracy.takeEstimate(message);
            case "move":
                return this.page.move(message);
        }
    }

    /** @param {Of<"hello">} message */
    hello(message) {
        const { accuracy, bodies, controls, fields, input, marks, sculpt, stage, state } = this.page;
        const scene = (/** @type {import("./app_state.js").Hello | null} */ h) =>
            [h?.session, h?.box_min_m, h?.box_max_m, h?.up].join();
        const sameScene = scene(state.hello) === scene(message);
        if (state.hello?.started && message.started !== state.hello.started)
            this.page.layout.notice(textOf("notice.restarted"), NOTICE_MS, "calm");
        state.hello = message;
        state.ownId = message.you.id;
        state.ownTool = message.you.tool ?? -1;
        if (!sameScene) stage.frameBox([message.box_min_m, message.box_max_m], message.up);
        input.radius = message.tools[Math.max(0, state.ownTool)]?.radius_m ?? RADIUS_SHARE * stage.size;
        marks.begin(message);
        bodies.truncate(message.parts.length);
        this.page.members.begin();
        this.pausedBy = "";
        this.page.playback.begin(message.marks ?? []);
        state.plan = message;
        state.status = null;
        this.showComponents();
        accuracy.begin(message.parts, message.estimates === true, 1000 / message.step_rate_hz);
        buttonById("accuracy-toggle").hidden = !message.estimates;
        sculpt.begin(message.box_min_m, message.box_max_m);
        this.page.highlight.begin();
        controls.offerSculpting();
        fields.offer(true);
        this.showTitle();
        this.showHint();
    }

    /** @param {Of<"topology">} message */
    topology(message) {
        const { bodies, controls, fields, sculpt, state } = this.page;
        if (!state.hello) return;
        state.hello.parts = message.parts;
        if (message.components?.length) {
            state.plan = { ...message, components: message.components };
            state.status = null; // it describes the former plan
            this.showComponents();
            state.hello.accuracy = ""; // it describes the former method
            this.showTitle();
        }
        sculpt.changed();
        void this.page.highlight.load();
        bodies.truncate(message.parts.length);
        controls.offerSculpting();
        fields.offer(false);
    }

    /** @param {Of<"orders">} message */
    orders(message) {
        this.page.members.takeOrders(message);
        for (const { id, name, verb, target, age_s } of message.orders) {
            if (verb === "pause") this.pausedBy = name;
            if (verb === "resume") this.pausedBy = "";
            // what everybody sees happen has a name; older ones stand in the list
            if (verb === "reset" && id !== this.page.state.ownId && age_s < RECENT_S)
                this.page.layout.notice(
                    textOf("notice.reset", { name, target: target || textOf("notice.scene") }),
                    NOTICE_MS,
                    "calm",
                );
        }
    }

    /** @param {Of<"status">} message */
    status(message) {
        const { controls, layout, state } = this.page;
        state.status = message;
        this.showComponents();
        controls.showPaused(message.paused);
        if (message.frozen) layout.notice(this.stoppedText(message));
        else layout.clearNotice();
        const slow = message.slowdown > REAL_TIME;
        const playback = message.playback?.[0];
        this.page.playback.show(playback, state.may("steer"));
        this.showHint();
        const text = playback?.plays
            ? playbackText(playback, message.paused)
            : message.paused
              ? this.pausedBy
                  ? textOf("state.paused_by", { name: this.pausedBy })
                  : textOf("state.paused")
              : slow
                ? speedText(message.slowdown)
                : textOf("state.live");
        layout.connection(message.frozen ? "lost" : "live", text);
        this.showFigures();
    }

    /** @param {Of<"members">} message */
    members(message) {
        const { controls, members: panel, send, stage, state } = this.page;
        const { members, locked_tools } = message;
        state.members = new Map(members.map((member) => [member.id, member]));
        const own = state.members.get(state.ownId);
        state.ownTool = own?.tool ?? -1;
        const taken = new Set(members.map((member) => member.tool));
        const instructs = own?.role === "instructor";
        const free = (state.hello?.tools ?? []).some(
            (_, i) => !taken.has(i) && (instructs || !locked_tools?.includes(i)),
        );
        if (own && state.ownTool < 0 && own.role !== "viewer" && !own.muted && free)
            send({ type: "take_tool", tool: -1 });
        panel.show(message, state.ownId, state.hello?.tools ?? []);
        controls.showRights();
        controls.offerSculpting();
        this.showComponents();
        this.showHint();
        stage.dirty = true; // names beside tools
    }

    /** @param {Of<"error">} message */
    error({ code, text: sentence }) {
        const { accuracy, fields, layout, sculpt, state } = this.page;
        const text = refusalText(code, sentence);
        if (code === "tool_taken") return;
        this.page.playback.answered();
        if (COMMAND_ERRORS.includes(code) && (sculpt.refused(text) || accuracy.refused(text))) return;
        if (code === "field" && state.field !== "none") fields.choose("none");
        layout.notice(text, NOTICE_MS);
    }

    /** @param {Of<"status">} status @returns {string} */
    stoppedText(status) {
        const { state } = this.page;
        const stopped = status.parts?.filter((part) => part.frozen) ?? [];
        const names = stopped.map(({ part }) => state.parts[part]?.name ?? String(part));
        const reason = stopped[0]?.reason ?? textOf("notice.diverged");
        const who = names.length ? textOf("notice.stopped", { names: names.join(", ") }) : "";
        return [who, reason, state.hello?.relay ? "" : textOf("notice.reset_helps")].filter(Boolean).join(" ");
    }

    showTitle() {
        const { hello } = this.page.state;
        if (!hello) return;
        document.title = `${hello.title} · Palpate`;
        htmlById("title").textContent = hello.title;
        htmlById("about-source").textContent =
            hello.organ && textOf("about.source", { source: hello.organ.replace(/\.$/, "") });
        htmlById("accuracy").textContent = hello.accuracy ?? "";
        htmlById("accuracy").hidden = !hello.accuracy;
    }

    /** the hint disappears for good with the first drag, but a user without a tool learns why nothing moves */
    showHint() {
        const { input, state } = this.page;
        input.enabled = state.ownTool >= 0 && !state.plays;
        const hint = htmlById("hint");
        if (!input.enabled && (state.watches || state.members.has(state.ownId))) {
            hint.classList.remove("gone");
            hint.textContent = this.watchingText();
        } else if (!hint.classList.contains("gone")) hint.textContent = textOf("hint.drag");
    }

    /** why a member without a tool moves nothing @returns {string} */
    watchingText() {
        const own = this.page.state.members.get(this.page.state.ownId);
        if (this.page.state.plays) return textOf("hint.recording");
        if (this.page.state.watches) return textOf("hint.watching");
        if (own?.muted) return textOf("hint.muted");
        return textOf("hint.full");
    }

    /** components come and go with fields, switches and other methods */
    showComponents() {
        const { panel, state } = this.page;
        const components = componentsOf(state.plan, state.status);
        const switches = state.may("component") && state.plan.component_parts !== undefined;
        const key = JSON.stringify([components, switches]);
        if (key === this.listed) return;
        this.listed = key;
        state.running = components.filter((component) => component.on).map((component) => component.name);
        panel.showComponents(components, state.parts, switches);
    }

    showFigures() {
        const { accuracy, panel, stage, state } = this.page;
        if (htmlById("panel").hidden || !state.status) return;
        this.page.members.showOrders();
        state.figures.effects = effectsText(stage.effects);
        panel.showStatus(state.status, state.figures, state.parts, !state.hello?.relay);
        htmlById("idle").textContent = idleText({
            field: state.field !== "none",
            estimate: accuracy.opened,
            estimates: state.hello?.estimates === true,
            unobserved: state.status.unobserved_steps ?? 0,
        });
    }
}
