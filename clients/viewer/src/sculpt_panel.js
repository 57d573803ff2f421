// The panel of sculpting: which tool a click uses, its settings, forces that follow their slider until they are released,
// undo, the cut, saving. One order is under way at a time.
import { boxAround, cutOrder, FORCES, orderOf, PAINTS, said, TOOLS } from "./sculpt_orders.js";

/** @typedef {import("./sculpt_orders.js").Order} Order */

const WAIT_MS = 20000; // an answer that does not come is not waited for any longer
const FINEST = 200; // steps of a slider
const STIFFNESS_N_M = 60; // of the spring that pulls a handle

export class SculptPanel {
  /**
   * @param {Document} page
   * @param {(order: Order) => void} send
   * @param {(ending: string) => void} save
   */
  constructor(page, send, save) {
    this.page = page;
    this.send = send;
    this.offered = false;
    this.tool = "extrude";
    /** @type {number[][]} clicked so far */
    this.places = [];
    /** @type {Order | null} not answered yet */
    this.underWay = null;
    this.sentAt = 0;
    /** @type {Order | null} the newest cut that waits for its turn */
    this.wantsCut = null;
    /** @type {import("./sculpt_orders.js").Box} */
    this.box = { low: [0, 0, 0], high: [0, 0, 0] };
    this.size = 0;
    /** @type {{tool: string, places: number[][], settings: import("./sculpt_orders.js").Settings} | null} the force that acts */
    this.force = null;
    this.forceMoved = false; // its slider has moved since it was sent
    this.say = /** @type {HTMLElement} */ (page.getElementById("sculpt-say"));
    this.tools = this.fill("sculpt-tools", TOOLS, (name) => this.choose(name));
    this.paints = this.fill("sculpt-paints", PAINTS, (name) => this.mark(this.paints, name));
    this.mark(this.paints, "stiffer");
    for (const verb of ["keep", "undo", "redo"])
      this.button("sculpt-" + verb).onclick = () => this.give({ verb, args: {} });
    for (const ending of ["obj", "stl", "ply"]) this.button("sculpt-" + ending).onclick = () => save(ending);
    for (const id of ["distance", "radius", "sharp"]) this.range(id).oninput = () => this.showValues();
    for (const id of ["pressure", "lift"]) this.range(id).oninput = () => this.moveForce();
    this.button("sculpt-release").onclick = () => this.give({ verb: "release", args: {} });
    this.axis = /** @type {HTMLSelectElement} */ (page.getElementById("sculpt-axis"));
    this.axis.onchange = this.range("cut").oninput = () => this.cut();
    this.choose(this.tool);
  }

  /** @param {string} id @returns {HTMLButtonElement} */
  button(id) {
    return /** @type {HTMLButtonElement} */ (this.page.getElementById(id));
  }

  /** @param {string} name @returns {HTMLInputElement} */
  range(name) {
    return /** @type {HTMLInputElement} */ (this.page.getElementById("sculpt-" + name));
  }

  /**
   * buttons of which one is chosen
   * @param {string} id @param {Record<string, {title: string}>} of @param {(name: string) => void} chosen
   * @returns {Map<string, HTMLButtonElement>}
   */
  fill(id, of, chosen) {
    const group = /** @type {HTMLElement} */ (this.page.getElementById(id)),
      buttons = new Map();
    for (const [name, { title }] of Object.entries(of)) {
      const button = this.page.createElement("button");
      button.textContent = title;
      button.dataset.name = name;
      button.setAttribute("role", "radio");
      button.onclick = () => chosen(name);
      group.append(button);
      buttons.set(name, button);
    }
    // within a radio group the arrow keys choose
    group.addEventListener("keydown", (/** @type {KeyboardEvent} */ e) => {
      if (!e.key.startsWith("Arrow")) return;
      e.preventDefault();
      e.stopPropagation();
      const all = [...buttons.values()],
        now = all.findIndex((b) => b.tabIndex === 0),
        step = e.key === "ArrowRight" || e.key === "ArrowDown" ? 1 : -1;
      const next = all[(now + step + all.length) % all.length];
      next.click();
      next.focus();
    });
    return buttons;
  }

  /** @param {Map<string, HTMLButtonElement>} buttons @param {string} name of the one that is chosen */
  mark(buttons, name) {
    for (const [key, button] of buttons) {
      button.setAttribute("aria-checked", String(key === name));
      button.tabIndex = key === name ? 0 : -1;
    }
  }

  /** @param {string} tool */
  choose(tool) {
    this.tool = tool;
    this.places = [];
    this.mark(this.tools, tool);
    for (const row of this.page.querySelectorAll("#sculpt [data-for]")) {
      /** @type {HTMLElement} */ (row).hidden = !(
        /** @type {HTMLElement} */ (row).dataset.for?.split(" ").includes(tool)
      );
    }
    this.hint();
  }

  hint() {
    this.say.textContent = TOOLS[this.tool].hints[this.places.length];
  }

  /** the scene's box, after hello @param {number[]} low @param {number[]} high */
  begin(low, high) {
    this.box = { low, high };
    this.size = Math.hypot(...low.map((v, i) => high[i] - v));
    this.underWay = this.wantsCut = null;
    this.act(null);
    this.busy();
    this.showValues();
  }

  /** the box follows what is shown @param {Float32Array} rest [n][3] */
  grow(rest) {
    this.box = boxAround(this.box, rest);
  }

  /** @returns {import("./sculpt_orders.js").Settings} */
  settings() {
    const part = (/** @type {string} */ name) => Number(this.range(name).value) / FINEST;
    const paint = [...this.paints].find(([, b]) => b.tabIndex === 0)?.[0] ?? "stiffer";
    const what = /** @type {HTMLSelectElement} */ (this.page.getElementById("sculpt-what"));
    return {
      distance_m: part("distance") * 0.5 * this.size,
      scale: 1,
      radius_m: part("radius") * 0.5 * this.size,
      paint,
      sharp: Math.round(part("sharp") * 10) / 2,
      sharpWhat: Number(what.value),
      pressure_Pa: 10 ** (1 + 3 * part("pressure")),
      lift_m: part("lift") * 0.5 * this.size,
      stiffness_N_m: STIFFNESS_N_M,
      middle: this.box.low.map((v, i) => (v + this.box.high[i]) / 2),
    };
  }

  showValues() {
    const { distance_m, radius_m, sharp, pressure_Pa, lift_m } = this.settings();
    const mm = (/** @type {number} */ m) => (1000 * m).toFixed(1) + " mm";
    /** @type {HTMLElement} */ (this.page.getElementById("sculpt-distance-value")).textContent = mm(distance_m);
    /** @type {HTMLElement} */ (this.page.getElementById("sculpt-radius-value")).textContent = mm(radius_m);
    /** @type {HTMLElement} */ (this.page.getElementById("sculpt-sharp-value")).textContent = String(sharp);
    /** @type {HTMLElement} */ (this.page.getElementById("sculpt-pressure-value")).textContent =
      Math.round(pressure_Pa) + " Pa";
    /** @type {HTMLElement} */ (this.page.getElementById("sculpt-lift-value")).textContent = mm(lift_m);
  }

  /** a place of the surface was clicked @param {number[]} at m */
  click(at) {
    if (this.waits()) return;
    this.places.push(at);
    const order = orderOf(this.tool, this.settings(), this.places);
    if (!order) {
      this.hint();
      return;
    }
    if (FORCES.includes(this.tool)) this.act({ tool: this.tool, places: this.places, settings: this.settings() });
    this.places = [];
    this.give(order);
  }

  /** the force that acts from now on, null: none @param {SculptPanel["force"]} force */
  act(force) {
    this.force = force;
    this.forceMoved = false;
    this.button("sculpt-release").disabled = !force;
  }

  /** its slider moves the force that acts: the same places again are the same brush */
  moveForce() {
    this.showValues();
    if (!this.force) return;
    const { pressure_Pa, lift_m } = this.settings();
    Object.assign(this.force.settings, { pressure_Pa, lift_m });
    this.forceMoved = true;
    this.sendForce();
  }

  sendForce() {
    if (!this.force || !this.forceMoved || this.waits()) return;
    this.forceMoved = false;
    const order = orderOf(this.force.tool, this.force.settings, this.force.places);
    if (order) this.give(order);
  }

  /** is an order under way? */
  waits() {
    return this.underWay !== null && performance.now() - this.sentAt < WAIT_MS;
  }

  /** @param {Order} order */
  give(order) {
    if (this.waits()) return;
    if (order.verb === "release") this.act(null);
    this.underWay = order;
    this.sentAt = performance.now();
    this.send(order);
    this.busy();
  }

  cut() {
    const order = cutOrder(/** @type {any} */ (this.axis.value), Number(this.range("cut").value) / FINEST, this.box);
    this.range("cut").disabled = order.verb === "uncut";
    if (this.waits()) this.wantsCut = order;
    else this.give(order);
  }

  /** another topology came: whoever made it, there may be something to undo and redo, and what was clicked means another face */
  changed() {
    this.places = [];
    this.act(null);
    this.button("sculpt-undo").disabled = this.button("sculpt-redo").disabled = false;
  }

  /** @param {{verb: string, text: string, args: Record<string, number>}} answer */
  answer(answer) {
    this.done(said(answer));
    if (answer.args?.can_undo === undefined) return;
    this.button("sculpt-undo").disabled = answer.args.can_undo === 0;
    this.button("sculpt-redo").disabled = answer.args.can_redo === 0;
  }

  /** an error of the server: was it about the order under way? @param {string} text */
  refused(text) {
    if (!this.underWay) return false;
    if (FORCES.includes(this.underWay.verb)) this.act(null);
    this.done(text);
    return true;
  }

  /** @param {string} text */
  done(text) {
    this.underWay = null;
    this.busy();
    this.say.textContent = text;
    const cut = this.wantsCut;
    this.wantsCut = null;
    if (cut) this.give(cut);
    else this.sendForce();
  }

  busy() {
    /** @type {HTMLElement} */ (this.page.getElementById("sculpt")).setAttribute(
      "aria-busy",
      String(this.underWay !== null),
    );
  }

  /** Ctrl+Z, Ctrl+Shift+Z @param {KeyboardEvent} e @returns {boolean} it was one of them */
  key(e) {
    const target = /** @type {any} */ (e.target);
    if (!this.offered || !(e.ctrlKey || e.metaKey) || e.altKey || e.repeat || e.key.toLowerCase() !== "z") return false;
    if (target?.tagName === "INPUT" && target.type !== "range") return false;
    this.give({ verb: e.shiftKey ? "redo" : "undo", args: {} });
    return true;
  }
}
