// The page: creates its parts, connects them, and draws. The worker owns the socket; the page keeps what it sends and
// applies it once per drawn picture.
import { AccuracyPanel } from "./accuracy_panel.js";
import { AppState } from "./app_state.js";
import { BodySet } from "./body_set.js";
import { ROLES } from "./control_table.js";
import { Capture } from "./capture.js";
import { Controls } from "./controls.js";
import { byId, htmlById, inputById } from "./dom.js";
import { download } from "./download.js";
import { WRITERS } from "./exporters.js";
import { FieldDisplay } from "./field_display.js";
import { ForceCue } from "./force_cue.js";
import { forceText } from "./force_text.js";
import { Inside } from "./inside.js";
import { Layout } from "./layout.js";
import { MembersPanel } from "./members_panel.js";
import { Messages } from "./messages.js";
import { OrientationCube } from "./orientation.js";
import { movedAddress } from "./moved_address.js";
import { OtherTools } from "./other_tools.js";
import { pressDepth, withOwnTool } from "./own_tool.js";
import { materialField, PaintColours } from "./paint_colours.js";
import { PlanPanel } from "./plan_panel.js";
import { PlaybackBar } from "./playback_bar.js";
import { Plots } from "./plots.js";
import { PoseSender } from "./pose_sender.js";
import { RelayChoice } from "./relays.js";
import { showScale } from "./scale_bar.js";
import { SculptHighlight } from "./sculpt_highlight.js";
import { SculptPanel } from "./sculpt_panel.js";
import { Stage } from "./stage.js";
import { store, stored } from "./storage.js";
import { language, text } from "./text.js";
import { roleOfTicket, takeTicket } from "./ticket.js";
import { ToolInput } from "./tool_input.js";
import { ToolMarks } from "./tool_marks.js";
import { ViewMenu } from "./view_menu.js";
import { ViewModes } from "./view_modes.js";

const FORCE_MIN_N = 0.005; // a smaller force is displayed as 0.00
const SLOW_NOTICE_MS = 12000;
const LEAVE_MS = 2000; // before a page goes to another host, which a browser asks once: the server there begins
const MARK_RADIUS = 0.006; // of the scene's size: smallest drawn radius of a tool

const worker = new Worker(new URL(`./socket_worker.js?lang=${language}`, import.meta.url), { type: "module" });
/** @param {import("./link.js").WorkerMessage} message @param {Transferable[]} transfer */
const post = (message, transfer = []) => worker.postMessage(message, transfer);
/** @param {import("./control_table.js").ClientMessage} message */
const send = (message) => post({ type: "control", message });
/** @param {import("./sculpt_commands.js").Command & {target?: string}} command */
const sendCommand = ({ verb, target = "", args }) => send({ type: "command", verb, target, args });

let ticket = takeTicket(location, history, () => sessionStorage);
const state = new AppState();
const layout = new Layout();
const stage = makeStage();
layout.stage = stage;
const bodies = new BodySet(state, stage, (part, { positions, normals }) =>
    post({ type: "reuse", part, positions, normals }, [positions.buffer, normals.buffer]),
);
const poses = new PoseSender(state, post, () => stage.size);
const ownPoses = [poses]; // of both hands in a headset
const fields = new FieldDisplay(state, stage, send, layout);
const inside = new Inside(state, stage, fields);
const marks = new ToolMarks(stage, htmlById("labels"));
const panel = new PlanPanel(document, sendCommand);
const members = new MembersPanel(document, sendCommand, () => performance.now());
const playback = new PlaybackBar(document, sendCommand);
const others = new OtherTools();
const orientation = new OrientationCube(document.body);
const accuracy = new AccuracyPanel(document, sendCommand);
const plots = new Plots(state, fields);
const cue = new ForceCue(stage, state);
const capture = new Capture(stage, state);
const sculpt = new SculptPanel(document, sendCommand, save);
const input = new ToolInput(
    stage,
    (ray) => (inside.trim(ray) ? bodies.pick(ray) : null),
    (target) => {
        state.target = target;
        if (!target && layout.pending) layout.place(false);
        stage.dirty = true;
        poses.send(true);
    },
    (tip) => marks.hand(state.ownTool, tip),
);
const highlight = new SculptHighlight(stage, state, sculpt);
const colours = new PaintColours(state, fields);
sculpt.onChange = () => {
    highlight.refresh();
    colours.show(highlight.on ? materialField(sculpt.tool, sculpt.paint()) : null);
};
sculpt.nameOf = (/** @type {number} */ part) => state.parts[part]?.name ?? "";
input.onClick = (/** @type {import("./tool_input.js").Hit} */ hit) => sculpt.click(hit);
input.onHover = (/** @type {import("./tool_input.js").Hit | null} */ hit) => highlight.hover(hit);
input.handles = () => inside.handles;
input.onFirstDrag = () => htmlById("hint").classList.add("gone");
const views = new ViewModes(
    stage,
    (ray) => bodies.pick(ray),
    () => {},
);
const viewMenu = new ViewMenu(state, stage, views);
viewMenu.offerHeadset(() => {
    input.release();
    const { name, ...rest } = joinOptions();
    const second = { ...rest, name: text("views.second_hand", { name }) };
    return { state, stage, poses: ownPoses, second, picture };
});
const showFigures = () => messages.showFigures();
const tools = { accuracy, plots, sculpt, highlight, inside, viewMenu };
const controls = new Controls({ state, stage, layout, input, fields, ...tools, send, showFigures });
const panels = { panel, members, accuracy, plots, sculpt, highlight, playback, others, controls };
const messages = new Messages({ state, stage, layout, bodies, fields, inside, input, marks, send, move, ...panels });
const relays = new RelayChoice({
    get: fetch.bind(window),
    place: location,
    ticket,
    random: Math.random,
    later: (call, ms) => setTimeout(call, ms),
    go: (address) => location.replace(address),
});
worker.onmessage = (/** @type {MessageEvent<import("./link.js").PageMessage>} */ { data }) => {
    if (data.type === "elsewhere") return void relays.refused();
    if (data.type === "state" && data.state === "live") relays.admitted();
    messages.take(data);
};

/** @returns {Stage} */
function makeStage() {
    try {
        return new Stage(byId("view", HTMLCanvasElement));
    } catch (error) {
        layout.connection("refused", text("state.no_webgl"));
        layout.notice(text("notice.no_webgl"));
        throw error;
    }
}

/** downloads the shown surfaces as a file @param {string} format key of WRITERS */
function save(format) {
    const surfaces = [...state.bodies.values()].map((body) => body.surface());
    download(new Blob([WRITERS[format](surfaces)]), state.hello?.session ?? "", `.${format}`);
}

function showForce() {
    const tool = state.ownToolState();
    const force = tool && !tool.away ? Math.hypot(...tool.force) : 0;
    htmlById("force").hidden = !(state.target || force > FORCE_MIN_N);
    htmlById("force-value").textContent = forceText(force, state.hello?.tools[state.ownTool]?.force_cap_N);
}

let nDrawn = 0;
let slowIsKnown = false; // that this browser draws slowly: once
let countedAt = performance.now();
function draw() {
    requestAnimationFrame(draw);
    if (stage.immersive) return; // the headset asks for its pictures
    input.tick();
    poses.send(false);
    picture();
}

function picture() {
    const now = performance.now();
    if (stage.ready()) {
        marks.depth = pressDepth(input.drag, state.ownToolState());
        cue.update(now);
        if (bodies.applyFrames()) {
            stage.dirty = true;
            nDrawn++;
        }
        for (const body of state.bodies.values()) if (body.colours.blend(now)) stage.dirty = true;
        if (marks.turning) stage.dirty = true;
        if (stage.dirty || others.moving(now)) {
            inside.update();
            const own = state.plays ? -1 : state.ownTool;
            marks.drawn = state.tools;
            marks.update(
                ownPoses.reduce(
                    (tools, { state: hand, last }) => withOwnTool(tools, state.plays ? -1 : hand.ownTool, last),
                    others.draw(now),
                ),
                (id, tool) =>
                    state.members.get(id)?.name ?? (state.plays ? (state.hello?.tools[tool]?.name ?? "") : ""),
                own,
                MARK_RADIUS * stage.size,
                now,
            );
            highlight.update();
            stage.draw();
            bodies.disposeRetired();
            marks.placeLabels();
            showForce();
            showScale(htmlById("scale"), stage.pixelsPerMetre());
            orientation.show(state.hello?.anatomical_axes ?? "", stage.camera.matrixWorldInverse.elements);
            capture.drawn();
        }
    }
    if (now - countedAt > 1000) {
        state.figures.fps = (1000 * nDrawn) / (now - countedAt);
        if (stage.pace.struggles && !slowIsKnown) {
            slowIsKnown = true;
            layout.notice(
                text("notice.slow_browser", { n: Math.max(1, Math.round(state.figures.fps)) }),
                SLOW_NOTICE_MS,
                "calm",
            );
        }
        nDrawn = 0;
        countedAt = now;
    }
}

/** of the join of this page @returns {import("./link.js").Wishes} */
function joinOptions() {
    const query = new URLSearchParams(location.search);
    const session = query.get("session");
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const url = `${scheme}://${location.host}/ws${session ? "?session=" + encodeURIComponent(session) : ""}`;
    const role =
        ROLES.find((known) => known === query.get("role")) ?? (ticket ? roleOfTicket(ticket) : null) ?? "trainee";
    return { url, name: inputById("name").value.trim() || text("people.guest"), role, ticket };
}

/** the session goes on elsewhere @param {import("./control_table.js").Move} to */
function move(to) {
    const place = movedAddress(to, location.search, ticket);
    if (place.host !== location.host) {
        setTimeout(() => location.assign(place), LEAVE_MS);
        return;
    }
    // the worker reconnects by itself: this is for what this page asks later
    history.replaceState(null, "", place.search + place.hash);
    ticket = takeTicket(location, history, () => sessionStorage);
}

const connect = () => post({ type: "connect", ...joinOptions() });

htmlById("lobby-link").hidden = !new URLSearchParams(location.search).has("session");
inputById("name").value =
    new URLSearchParams(location.search).get("name") ?? stored("palpate.name") ?? text("people.guest");
inputById("name").onchange = () => {
    store("palpate.name", inputById("name").value.trim());
    connect();
};
// read-only access for tests and for the console
const shown = { state, stage, input, marks, panel, accuracy, plots, capture, cue, views, sculpt, highlight, inside };
Object.defineProperty(window, "palpate", { value: shown });
connect();
draw();
