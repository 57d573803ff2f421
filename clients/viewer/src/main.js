// The page: joins the worker's messages to stage, tools and panel. The socket lives in the worker; what it sends is kept
// here and applied once per drawn picture.
import { AccuracyPanel } from "./accuracy_panel.js";
import { BodyMesh } from "./body_mesh.js";
import { WRITERS } from "./exporters.js";
import { keyMap } from "./keys.js";
import { FIELDS, labels, missing, offered, rangeOf } from "./legend.js";
import { PlanPanel, rowsOf, unwatchedLine } from "./plan_panel.js";
import { SculptPanel } from "./sculpt_panel.js";
import { Stage } from "./stage.js";
import { ToolInput } from "./tool_input.js";
import { sameTools, ToolMarks } from "./tool_marks.js";

/** @param {string} id @returns {any} */
const byId = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
const POSE_MS = 16; // poses while a tool moves
const HOLD_MS = 50; // and while it rests: a silent tool is let go by the server
const GRAB_MS = 1500; // longest wait for the server to take hold
const NEAR = 2e-5; // of the scene's size: what moves less is drawn as it was
const LEAST_ROOM = 260; // pixels between panels that the organ can stand in
const TOLD_MS = 4000; // how long the server's answer to a refused wish is shown
/** the organ stands where the panels leave room */
let beside = true;
/** timer of a notice that goes by itself, 0: none */
let told = 0;

const stage = makeStage();
const marks = new ToolMarks(stage, byId("labels"));
const panel = new PlanPanel(document, (verb, target, args = {}) => {
  order({ verb, target, args });
});
const cost = new AccuracyPanel(document, (wish) => order(wish));
const sculpt = new SculptPanel(document, ({ verb, args }) => order({ verb, target: "", args }), save);
const worker = new Worker(new URL("./socket_worker.js", import.meta.url), { type: "module" });

const state = {
  /** @type {any} */ hello: null,
  /** @type {any} */ status: null,
  /** @type {Map<number, BodyMesh>} */ bodies: new Map(),
  /** @type {Map<number, BodyMesh>} bodies of another topology, until their first frame */ coming: new Map(),
  /** @type {BodyMesh[]} whose place was taken, until the next picture: what they share with the renderer is kept */ going:
    [],
  /** @type {Map<number, {positions: Float32Array, normals: Float32Array, shown: import("./patch_decoder.js").Shown | null}>} newest undrawn frame of
   * each part, with the triangles that came since the last drawn one */ frames: new Map(),
  /** @type {import("./wire.js").Tool[]} */ tools: [],
  /** @type {Map<number, any>} */ members: new Map(),
  me: 0,
  myTool: -1,
  /** @type {import("./tool_input.js").ToolWish} */ wish: null,
  /** @type {{position: number[], since: number} | null} where the present grab began */ anchor: null,
  away: true,
  poseAt: 0,
  drawn: 0,
  here: { fps: 0, latency_ms: 0, rtt_ms: 0, decode_ms: 0, bytes_s: 0, vertices: 0 },
  field: "none", // shown in colour
  wires: false, // lines of the triangles are shown
  /** @type {{low: number, high: number} | null} what the colours mean, null: no values yet */ range: null,
  /** @type {string[]} names of the plan's rows as the panel has them */ rows: [],
  /** @type {{rows: string[], row_parts?: number[], row_whys?: string[], row_fixed?: number[]}} of hello or the last topology that had rows */ plan: {
    rows: [],
  },
};

const input = new ToolInput(
  stage,
  (ray) => {
    let best = null;
    for (const body of state.bodies.values()) {
      const hit = body.pick(ray);
      if (hit && (!best || hit.distance < best.distance)) best = hit;
    }
    return best;
  },
  (wish) => {
    state.wish = wish;
    if (!wish && !beside) standBeside();
    stage.dirty = true;
    sendPose(true);
  },
);
input.onClick = (/** @type {number[]} */ at) => sculpt.click(at);
input.touchedOnce = () => byId("hint").classList.add("gone");

/**
 * Where to send the tool: to the wish, but a grab stays where it began until the server holds the tissue there. The
 * newest pose wins on its way, so a quick hand would otherwise close beside the organ.
 * @param {{position: number[], grab: boolean}} wish @param {number} t ms
 */
function destination(wish, t) {
  if (!wish.grab) state.anchor = null;
  else if (!state.anchor) state.anchor = { position: wish.position, since: t };
  if (!state.anchor) return wish.position;
  const mine = state.tools[state.myTool];
  const waits = t - state.anchor.since < GRAB_MS && !(mine?.held && mine.grabs);
  if (!waits) state.anchor.since = -Infinity;
  return waits ? state.anchor.position : wish.position;
}

/** @param {boolean} now do not wait for the next turn */
function sendPose(now) {
  if (state.myTool < 0) return;
  const t = performance.now();
  if (state.wish) {
    if (!now && t - state.poseAt < HOLD_MS) return;
    if (now && t - state.poseAt < POSE_MS / 2 && !state.away) return;
    worker.postMessage({
      type: "pose",
      tool: state.myTool,
      position: destination(state.wish, t),
      grab: state.wish.grab,
      away: false,
    });
    state.away = false;
    state.poseAt = t;
  } else if (!state.away) {
    worker.postMessage({ type: "pose", tool: state.myTool, position: null, grab: false, away: true });
    state.away = true;
    state.anchor = null;
  }
}

/** @param {string} word @param {string} text */
function showState(word, text) {
  byId("state").dataset.state = word;
  byId("state-text").textContent = text;
}

/** the organ and what is said of it stand beside the panels, where these leave room; on a narrow page they lie below */
function standBeside() {
  // not under a hand that holds tissue: its place would be another one
  beside = state.wish === null;
  if (!beside) return;
  const covers = (/** @type {string[]} */ ids) =>
    Math.max(0, ...ids.map((id) => byId(id).offsetWidth && byId(id).offsetWidth + 18));
  const covered = [covers(["cost-panel", "sculpt"]), covers(["panel"])],
    room = innerWidth > 640 && innerWidth - covered[0] - covered[1] >= LEAST_ROOM;
  const [left, right] = room ? covered : [0, 0],
    style = document.documentElement.style;
  style.setProperty("--left", `${left}px`);
  style.setProperty("--middle", `calc(50% + ${(left - right) / 2}px)`);
  style.setProperty("--free", `calc(100vw - ${left + right}px)`);
  stage.beside(left, right);
}

/** @param {string} text empty hides it @param {number} ms goes by itself after this, 0: stays */
function notice(text, ms = 0) {
  clearTimeout(told);
  told = ms ? window.setTimeout(() => notice(""), ms) : 0;
  // written anew only when it changes: it is read aloud each time
  if (byId("notice").textContent !== text) byId("notice").textContent = text;
  byId("notice").hidden = !text;
}

/** @returns {Stage} */
function makeStage() {
  try {
    return new Stage(byId("view"));
  } catch (error) {
    showState("refused", "cannot draw");
    notice("This browser gives the page no WebGL 2, so the organ cannot be drawn.");
    throw error;
  }
}

/** parts beyond the session's are gone @param {number} n */
function keepParts(n) {
  for (const [part, body] of state.bodies) {
    if (part < n) continue;
    body.dispose();
    state.coming.get(part)?.dispose();
    state.bodies.delete(part);
    state.coming.delete(part);
    state.frames.delete(part);
  }
  stage.dirty = true;
}

/** what is shown, as a file of that ending @param {string} ending of WRITERS */
function save(ending) {
  const pieces = [...state.bodies.values()].map((body) => body.piece());
  const name = (state.hello?.session ?? "palpate").replace(/[^\w-]+/g, "_");
  const link = Object.assign(document.createElement("a"), {
    href: URL.createObjectURL(new Blob([WRITERS[ending](pieces)])),
    download: `${name}.${ending}`,
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** sculpting is offered when a part takes it */
function offerSculpt() {
  sculpt.offered = state.hello.parts.some((/** @type {any} */ part) => part.sculpts);
  byId("mode-sculpt").hidden = !sculpt.offered;
  if (!sculpt.offered && input.mode === "sculpt") setMode("pull");
}

function showTitle() {
  document.title = state.hello.title + " · Palpate";
  byId("title").textContent = state.hello.title;
  byId("source").textContent = state.hello.organ;
  byId("accuracy").textContent = state.hello.accuracy ?? "";
  byId("accuracy").hidden = !state.hello.accuracy;
}

function showTool() {
  input.enabled = state.myTool >= 0;
  const hint = byId("hint");
  const me = state.members.get(state.me);
  if (state.myTool < 0 && me) {
    hint.classList.remove("gone");
    hint.textContent = "All tools are in use. You are looking on; a tool is yours as soon as one is free.";
  } else if (!hint.classList.contains("gone"))
    hint.textContent = "Drag the organ to pull it. Drag beside it to look around.";
}

/** asks for the chosen field of every part that gives it, and for none of the others */
function askField() {
  state.hello?.parts.forEach((/** @type {any} */ part, /** @type {number} */ i) => {
    // a server of before fields would take the wish for a mistake of ours
    if (!part.fields) return;
    const field = part.fields.includes(state.field) ? state.field : "none";
    worker.postMessage({ type: "control", message: { type: "view", part: i, field } });
  });
}

function showLegend() {
  byId("legend").hidden = state.field === "none";
  if (state.field === "none") return;
  const { low, high, unit } = state.range ? labels(state.field, state.range) : { low: "", high: "", unit: "" };
  byId("legend-title").textContent = FIELDS[state.field].title;
  byId("legend-unit").textContent = unit;
  byId("legend-low").textContent = low;
  byId("legend-high").textContent = high;
  byId("legend-wait").hidden = state.range !== null;
}

/** @param {string} name of the field to show from now on, "none": tissue */
function chooseField(name) {
  state.field = name;
  state.range = null;
  byId("field").value = name;
  for (const body of state.bodies.values()) body.dropField();
  askField();
  showLegend();
  stage.dirty = true;
}

/**
 * What there is to choose, after hello and with another method; what was chosen stays if it can.
 * @param {boolean} anew nothing was asked for on this connection
 */
function offerFields(anew) {
  const names = offered(state.hello.parts),
    note = missing(state.hello.parts),
    chosen = state.field;
  const option = (/** @type {string} */ value, /** @type {string} */ text) =>
    Object.assign(document.createElement("option"), { value, textContent: text });
  byId("field").replaceChildren(option("none", "Tissue"), ...names.map((name) => option(name, FIELDS[name].title)));
  byId("field-note").textContent = note;
  byId("field-note").hidden = !note;
  const stays = chosen === "none" || names.includes(chosen);
  if (anew || !stays) chooseField(stays ? chosen : "none");
  else {
    byId("field").value = chosen;
    askField(); // of a part that has it only now
  }
  if (!stays) notice(`${FIELDS[chosen].title} is not there with this method: tissue is shown.`, TOLD_MS);
}

/** the range of the colours follows the values of all parts */
function followField() {
  const values = [...state.bodies.values()].flatMap((body) => body.values ?? []);
  if (values.length === 0) return;
  const range = rangeOf(
    state.field,
    Math.min(...values.map((v) => v.low)),
    Math.max(...values.map((v) => v.high)),
    state.range,
  );
  const same = state.range && range.low === state.range.low && range.high === state.range.high;
  state.range = range;
  for (const body of state.bodies.values()) body.colourRange(range);
  if (!same) showLegend();
}

let shownRows = "";
/** rows come and go with fields, switches and other methods */
function showRows() {
  const rows = rowsOf(state.plan, state.status),
    mayswitch = state.hello.you.role === "instructor" && state.plan.row_parts !== undefined;
  const key = JSON.stringify([rows, mayswitch]);
  if (key === shownRows) return;
  shownRows = key;
  state.rows = rows.filter((row) => row.on).map((row) => row.name);
  panel.plan(rows, state.hello.parts, mayswitch);
}

/** @param {{verb: string, target: string, args: Record<string, number>}} wish */
function order({ verb, target, args }) {
  worker.postMessage({ type: "control", message: { type: "command", verb, target, args } });
}

/** @param {any} m status in which a body stands still */
function stopped(m) {
  const still = m.parts?.filter((/** @type {any} */ p) => p.frozen) ?? [];
  const names = still.map((/** @type {any} */ p) => state.hello.parts[p.part]?.name ?? p.part).join(", ");
  return still.length
    ? `${names}: stopped. ${still[0].why ?? ""} Reset brings it back.`
    : "The body diverged and was frozen. Reset brings it back.";
}

function showFigures() {
  if (byId("panel").hidden || !state.status) return;
  panel.status(state.status, state.here, state.hello.parts);
  byId("unwatched").textContent = unwatchedLine({
    field: state.field !== "none",
    estimate: cost.opened,
    estimates: state.hello.estimates === true,
    unwatched: state.status.unwatched ?? 0,
  });
}

/** @type {Record<string, (m: any) => void>} */
const control = {
  hello(m) {
    const place = (/** @type {any} */ h) => [h?.session, h?.box_min_m, h?.box_max_m, h?.up].join();
    const again = place(state.hello) === place(m);
    state.hello = m;
    state.me = m.you.id;
    state.myTool = m.you.tool ?? -1;
    if (!again) stage.frameBox([m.box_min_m, m.box_max_m], m.up);
    input.radius = m.tools[Math.max(0, state.myTool)]?.radius_m ?? 0.02 * stage.size;
    keepParts(m.parts.length);
    state.plan = m;
    state.status = null;
    showRows();
    cost.begin(m.parts, m.estimates === true, 1000 / m.step_rate_hz);
    byId("cost-toggle").hidden = !m.estimates;
    sculpt.begin(m.box_min_m, m.box_max_m);
    offerSculpt();
    offerFields(true);
    showTitle();
    showTool();
  },
  topology(m) {
    state.hello.parts = m.parts;
    if (m.rows?.length) {
      state.plan = m;
      state.status = null; // its rows were those of the plan before
      showRows();
      // how far off it is was said of the body before
      state.hello.accuracy = "";
      showTitle();
    }
    sculpt.changed();
    keepParts(m.parts.length);
    offerSculpt();
    offerFields(false);
  },
  answer(m) {
    if (!cost.answer(m)) sculpt.answer(m);
  },
  study(m) {
    cost.study(m);
  },
  estimate(m) {
    cost.takeEstimate(m);
  },
  status(m) {
    state.status = m;
    showRows();
    byId("pause").textContent = m.paused ? "Go on" : "Pause";
    byId("pause").setAttribute("aria-pressed", String(m.paused));
    byId("step").hidden = !m.paused;
    if (m.frozen) notice(stopped(m));
    else if (!told) notice("");
    const slow = m.paused ? "paused" : m.slowdown > 1.05 ? m.slowdown.toFixed(1) + "× slower than real time" : "live";
    showState(m.frozen ? "lost" : "live", slow);
    showFigures();
  },
  members(m) {
    state.members = new Map(m.members.map((/** @type {any} */ p) => [p.id, p]));
    const me = state.members.get(state.me);
    state.myTool = me?.tool ?? -1;
    const held = new Set(m.members.map((/** @type {any} */ p) => p.tool));
    const free =
      state.hello && state.hello.tools.findIndex((/** @type {any} */ _, /** @type {number} */ i) => !held.has(i));
    if (me && state.myTool < 0 && me.role !== "viewer" && free >= 0)
      worker.postMessage({ type: "control", message: { type: "take", tool: -1 } });
    panel.people(m.members, state.me);
    showTool();
    stage.dirty = true; // names beside tools
  },
  error(m) {
    if (m.code === "tool_taken") return;
    if (
      ["refused", "args", "role", "busy", "target"].includes(m.code) &&
      (sculpt.refused(m.text) || cost.refused(m.text))
    )
      return;
    if (m.code === "field" && state.field !== "none") chooseField("none");
    notice(m.text, TOLD_MS);
  },
};

worker.onmessage = (/** @type {MessageEvent} */ { data }) => {
  switch (data.type) {
    case "state":
      showState(data.state, data.text);
      if (data.state !== "live") {
        // nobody's tools are known until the server speaks again
        input.letGo();
        input.enabled = false;
        state.tools = [];
        stage.dirty = true;
      }
      break;
    case "control":
      control[data.message.type]?.(data.message);
      break;
    case "part": {
      // a body that is shown stays until the first frame of the new one
      state.coming.get(data.part)?.dispose();
      const body = new BodyMesh(stage.scene, data.rest, data.triangles, data.visible),
        waits = state.bodies.has(data.part);
      state.frames.delete(data.part); // of the body before
      sculpt.grow(data.rest);
      body.epoch = data.epoch;
      body.appear(!waits);
      state.coming.delete(data.part);
      if (waits) state.coming.set(data.part, body);
      else showBody(data.part, body);
      break;
    }
    case "frame": {
      const older = state.frames.get(data.part);
      if (older) giveBack(data.part, older);
      state.frames.set(data.part, {
        positions: data.positions,
        normals: data.normals,
        shown: data.shown ?? older?.shown ?? null,
      });
      break;
    }
    case "field": {
      const body = state.bodies.get(data.part);
      // values that were on their way when another field was chosen are nobody's
      if (data.name !== state.field || !body || 3 * data.level.length !== body.rest.length) break;
      body.takeField(data.level, data.low, data.high, performance.now());
      followField();
      stage.dirty = true;
      break;
    }
    case "tools":
      if (!sameTools(marks.drawn, data.tools, NEAR * stage.size)) stage.dirty = true;
      state.tools = data.tools;
      break;
    case "figures":
      Object.assign(state.here, data.figures);
      break;
  }
};

function showForce() {
  const mine = state.tools[state.myTool];
  const force = mine && !mine.away ? Math.hypot(...mine.force) : 0;
  byId("force").hidden = !(state.wish || force > 0.005);
  byId("force-value").textContent = force.toFixed(2);
}

/** arrays that the worker may fill anew @param {number} part @param {{positions: Float32Array, normals: Float32Array}} arrays */
function giveBack(part, { positions, normals }) {
  worker.postMessage({ type: "reuse", part, positions, normals }, [positions.buffer, normals.buffer]);
}

function countVertices() {
  state.here.vertices = [...state.bodies.values()].reduce((n, body) => n + body.nVisible(), 0);
}

/** in the place of the body before, if there was one @param {number} part @param {BodyMesh} body */
function showBody(part, body) {
  const before = state.bodies.get(part);
  if (before) {
    before.appear(false);
    state.going.push(before);
  }
  body.appear(true);
  body.wireframe(state.wires);
  state.bodies.set(part, body);
  countVertices();
  stage.dirty = true;
}

/** the newest frames, where they differ from what is shown @returns {boolean} some do */
function takeFrames() {
  let fresh = false;
  for (const [part, frame] of state.frames) {
    const next = state.coming.get(part);
    if (next) {
      state.coming.delete(part);
      showBody(part, next);
    }
    const body = state.bodies.get(part);
    if (!body || body.rest.length !== frame.positions.length) continue;
    state.frames.delete(part);
    const differs = frame.shown !== null || !body.near(frame.positions, NEAR * stage.size);
    if (frame.shown) {
      body.reshape(frame.shown);
      countVertices();
    }
    giveBack(part, differs ? body.take(frame.positions, frame.normals) : frame);
    fresh ||= differs;
  }
  return fresh;
}

let fpsSince = performance.now();
function picture() {
  requestAnimationFrame(picture);
  input.tick();
  sendPose(false);
  const now = performance.now();
  if (stage.ready()) {
    if (takeFrames()) {
      stage.dirty = true;
      state.drawn++;
    }
    for (const body of state.bodies.values()) if (body.blend(now)) stage.dirty = true;
    if (stage.dirty) {
      marks.update(state.tools, (id) => state.members.get(id)?.name ?? "", state.myTool, 0.006 * stage.size);
      stage.draw();
      for (const body of state.going.splice(0)) body.dispose();
      marks.placeLabels();
      showForce();
    }
  }
  if (now - fpsSince > 1000) {
    state.here.fps = (1000 * state.drawn) / (now - fpsSince);
    state.drawn = 0;
    fpsSince = now;
  }
}

/** what dragging may do now @returns {("pull" | "press" | "sculpt")[]} */
const modes = () => (sculpt.offered ? ["pull", "press", "sculpt"] : ["pull", "press"]);

/** @param {"pull" | "press" | "sculpt"} mode */
function setMode(mode) {
  if (!modes().includes(mode) && mode === "sculpt") return;
  input.mode = mode;
  if (mode === "sculpt") openCost(false);
  input.letGo();
  byId("sculpt").hidden = mode !== "sculpt";
  standBeside();
  byId("hint").classList.toggle("gone", mode === "sculpt" || byId("hint").classList.contains("gone"));
  for (const name of ["pull", "press", "sculpt"]) {
    const button = byId("mode-" + name);
    button.setAttribute("aria-checked", String(mode === name));
    button.tabIndex = mode === name ? 0 : -1;
  }
}

/** @param {string} verb */
const command = (verb) => worker.postMessage({ type: "control", message: { type: "command", verb } });
const togglePause = () => command(state.status?.paused ? "resume" : "pause");
const togglePanel = () => {
  byId("panel").hidden = !byId("panel").hidden;
  byId("panel-toggle").setAttribute("aria-expanded", String(!byId("panel").hidden));
  standBeside();
  showFigures();
};
/** @param {boolean} opened */
const openCost = (opened) => {
  if (opened && !state.hello?.estimates) return;
  if (opened && input.mode === "sculpt") setMode("pull"); // both stand at the left
  byId("cost-panel").hidden = !opened;
  byId("cost-toggle").setAttribute("aria-expanded", String(opened));
  cost.open(opened);
  standBeside();
};
const toggleCost = () => openCost(!cost.opened);
window.addEventListener("resize", standBeside);
byId("cost-toggle").onclick = toggleCost;
byId("mode-pull").onclick = () => setMode("pull");
byId("mode-press").onclick = () => setMode("press");
byId("mode-sculpt").onclick = () => setMode("sculpt");
// within a radio group the arrow keys choose
byId("modes").addEventListener("keydown", (/** @type {KeyboardEvent} */ e) => {
  if (!e.key.startsWith("Arrow")) return;
  e.preventDefault();
  e.stopPropagation();
  const all = modes(),
    step = e.key === "ArrowLeft" || e.key === "ArrowUp" ? all.length - 1 : 1;
  setMode(all[(all.indexOf(input.mode) + step) % all.length]);
  byId("mode-" + input.mode).focus();
});
byId("pause").onclick = togglePause;
byId("step").onclick = () => command("step");
byId("reset").onclick = () => command("reset");
byId("panel-toggle").onclick = togglePanel;
byId("field").onchange = () => chooseField(byId("field").value);
/** the next of the fields that there are */
const nextField = () => {
  const names = [...byId("field").options].map((o) => o.value);
  chooseField(names[(names.indexOf(state.field) + 1) % names.length]);
};
const toggleWires = () => {
  state.wires = !state.wires;
  byId("mesh").setAttribute("aria-pressed", String(state.wires));
  for (const body of state.bodies.values()) body.wireframe(state.wires);
  stage.dirty = true;
};
byId("mesh").onclick = toggleWires;
const actionOf = keyMap(
  {
    1: () => setMode("pull"),
    2: () => setMode("press"),
    3: () => setMode("sculpt"),
    4: toggleCost,
    " ": togglePause,
    r: () => command("reset"),
    p: togglePanel,
    c: nextField,
    m: toggleWires,
  },
  stage,
);
window.addEventListener("keydown", (e) => {
  const action = sculpt.key(e) ? () => {} : actionOf(e);
  if (action) {
    e.preventDefault();
    action();
  }
});

/** @returns {string} */
function remembered() {
  try {
    return localStorage.getItem("palpate.name") ?? "Guest";
  } catch {
    return "Guest";
  }
}
function connect() {
  const query = new URLSearchParams(location.search);
  const session = query.get("session");
  const url = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws${session ? "?session=" + encodeURIComponent(session) : ""}`;
  worker.postMessage({
    type: "connect",
    url,
    name: byId("name").value.trim() || "Guest",
    role: query.get("role") ?? "trainee",
  });
}
byId("name").value = new URLSearchParams(location.search).get("name") ?? remembered();
byId("name").onchange = () => {
  try {
    localStorage.setItem("palpate.name", byId("name").value.trim());
  } catch {
    // a browser that keeps nothing still shows the organ
  }
  connect();
};
// for tests and curious people: what the page shows, without touching it
Object.defineProperty(window, "palpate", { value: { state, stage, input, cost } });
connect();
picture();
