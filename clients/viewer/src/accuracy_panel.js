// The panel of accuracy: the study's points, where the body stands and of what its error is made, its neighbours on each
// knob, and a slider along the front. It asks for estimates while it is open, one body at a time. One switch is under way
// at a time.
import {
  errorWords,
  frontOf,
  knobOrder,
  layOut,
  milliseconds,
  millimetres,
  neighbourWords,
  partsOf,
  placeOn,
  switchWords,
} from "./accuracy_plot.js";

/** @typedef {import("./accuracy_plot.js").Estimate} Estimate */
/** @typedef {import("./accuracy_plot.js").Point} Point */
/** @typedef {{verb: string, target: string, args: Record<string, number>}} Order */

const BOX = { left: 40, right: 302, top: 20, bottom: 172 };
const WAIT_MS = 60000; // meshes of many voxels take their time; an answer that does not come is not waited for any longer
const SVG = "http://www.w3.org/2000/svg";

export class AccuracyPanel {
  /** @param {Document} page @param {(order: Order) => void} send */
  constructor(page, send) {
    this.page = page;
    this.send = send;
    this.opened = false;
    this.body = ""; // whose estimate is asked for
    this.asked = ""; // of the server, "": of none
    /** @type {string[]} */
    this.bodies = [];
    /** @type {Point[]} */
    this.points = [];
    /** @type {Point[]} */
    this.front = [];
    /** @type {Estimate | null} */
    this.estimate = null;
    this.stepMs = 0; // of a step in real time
    /** @type {number | undefined} the study's own: below it nothing is told apart */
    this.reference = undefined;
    this.held = false; // the slider, by somebody's hand
    /** @type {{order: Order, what: string, since: number} | null} not answered yet */
    this.underWay = null;
    this.plot = /** @type {SVGSVGElement} */ (/** @type {unknown} */ (page.getElementById("cost-plot")));
    this.slider = /** @type {HTMLInputElement} */ (page.getElementById("cost-slider"));
    this.bodyList = /** @type {HTMLSelectElement} */ (page.getElementById("cost-body"));
    this.slider.oninput = () => {
      this.held = true;
      this.showSlider();
    };
    this.slider.onchange = () => this.letGo();
    this.bodyList.onchange = () => {
      this.body = this.bodyList.value;
      this.look();
    };
  }

  /** @param {string} id @returns {HTMLElement} */
  at(id) {
    return /** @type {HTMLElement} */ (this.page.getElementById("cost-" + id));
  }

  /** after hello @param {{name: string}[]} parts @param {boolean} offered by the server @param {number} stepMs a step in real time */
  begin(parts, offered, stepMs) {
    this.bodies = offered ? parts.map((p) => p.name) : [];
    if (!this.bodies.includes(this.body)) this.body = this.bodies[0] ?? "";
    this.stepMs = stepMs;
    this.asked = "";
    this.underWay = null;
    const option = (/** @type {string} */ name) =>
      Object.assign(this.page.createElement("option"), { value: name, textContent: name });
    this.bodyList.replaceChildren(...this.bodies.map(option));
    this.bodyList.value = this.body;
    this.at("bodies").hidden = this.bodies.length < 2;
    this.say("");
    this.look();
  }

  /** @param {boolean} opened */
  open(opened) {
    this.opened = opened;
    this.look();
  }

  /** asks for the estimate of the chosen body while the panel is open, and for nothing else */
  look() {
    const wanted = this.opened ? this.body : "";
    if (wanted === this.asked) return;
    if (this.asked) this.send({ verb: "estimate", target: this.asked, args: { on: 0 } });
    this.asked = wanted;
    this.points = this.front = [];
    this.estimate = null;
    if (wanted) this.send({ verb: "estimate", target: wanted, args: { on: 1 } });
    this.show();
  }

  /** @param {{body: string, step_ms?: number, reference_m?: number, points?: Point[]}} m control message `study` */
  study(m) {
    if (m.body !== this.asked) return;
    this.points = m.points ?? [];
    this.reference = m.reference_m;
    this.stepMs = m.step_ms ?? this.stepMs;
    this.front = frontOf(this.points);
    this.slider.max = String(Math.max(0, this.front.length - 1));
    this.at("front").hidden = this.front.length < 2;
    this.show();
  }

  /** @param {Estimate & {body: string}} m control message `estimate` */
  takeEstimate(m) {
    if (m.body !== this.asked) return;
    this.estimate = m;
    if (this.underWay && Date.now() - this.underWay.since > WAIT_MS) this.underWay = null;
    this.show();
  }

  /** @param {any} m control message `answer` @returns {boolean} it was for this panel */
  answer(m) {
    if (m.verb !== "point" && m.verb !== "knob") return false;
    this.underWay = null;
    this.say(switchWords(m));
    this.show();
    return true;
  }

  /** @param {string} text of an error @returns {boolean} it was for this panel */
  refused(text) {
    if (!this.underWay) return false;
    this.underWay = null;
    this.held = false;
    this.say(text);
    this.show();
    return true;
  }

  /** @param {string} text */
  say(text) {
    this.at("say").textContent = text;
  }

  /** @param {Order} order @param {string} what is being made */
  give(order, what) {
    if (this.underWay) return;
    this.underWay = { order, what, since: Date.now() };
    this.say(`Making ${what} …`);
    this.send(order);
    this.show();
  }

  letGo() {
    const point = this.front[Number(this.slider.value)];
    this.held = false;
    if (point && point.index !== this.estimate?.point)
      this.give({ verb: "point", target: this.body, args: { index: point.index } }, point.label);
    this.show();
  }

  /** @param {string} name @param {Record<string, string | number>} attributes @param {string} text */
  shape(name, attributes, text = "") {
    const shape = this.page.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) shape.setAttribute(key, String(value));
    if (text && name === "text") shape.textContent = text;
    else if (text) shape.append(Object.assign(this.page.createElementNS(SVG, "title"), { textContent: text }));
    return shape;
  }

  /** @param {ReturnType<typeof layOut>} plot */
  axes(plot) {
    const { left, right, top, bottom } = BOX;
    return [
      ...plot.xTicks.flatMap(({ at, text }) => [
        this.shape("line", { x1: at, x2: at, y1: top, y2: bottom, class: "grid" }),
        this.shape("text", { x: at, y: bottom + 13, class: "tick", "text-anchor": "middle" }, text),
      ]),
      ...plot.yTicks.flatMap(({ at, text }) => [
        this.shape("line", { x1: left, x2: right, y1: at, y2: at, class: "grid" }),
        this.shape("text", { x: left - 5, y: at + 3.5, class: "tick", "text-anchor": "end" }, text),
      ]),
      this.shape("text", { x: right, y: bottom + 26, class: "tick", "text-anchor": "end" }, "ms per step"),
      this.shape("text", { x: 2, y: top - 9, class: "tick" }, "error, mm"),
    ];
  }

  /** @param {ReturnType<typeof layOut>} plot */
  marks(plot) {
    const { top, bottom, right } = BOX,
      out = [];
    if (this.stepMs > plot.msRange.low && this.stepMs < plot.msRange.high) {
      const x = plot.x(this.stepMs);
      out.push(
        this.shape(
          "line",
          { x1: x, x2: x, y1: top, y2: bottom, class: "real-time" },
          `${milliseconds(this.stepMs)}: dearer than this is slower than real time`,
        ),
      );
    }
    if (
      this.reference !== undefined &&
      1e3 * this.reference > plot.errorRange.low &&
      1e3 * this.reference < plot.errorRange.high
    ) {
      const y = plot.y(this.reference);
      out.push(
        this.shape(
          "line",
          { x1: BOX.left, x2: right, y1: y, y2: y, class: "real-time" },
          `the reference itself: ${millimetres(this.reference)}; below it errors are of chance`,
        ),
      );
    }
    if (plot.front.length > 1)
      out.push(
        this.shape("polyline", {
          points: plot.front.map((p) => `${p.x.toFixed(1)},${p.y.toFixed(1)}`).join(" "),
          class: "front",
        }),
      );
    for (const mark of plot.marks)
      out.push(
        this.shape(
          "circle",
          {
            cx: mark.x,
            cy: mark.y,
            r: mark.point.front ? 4 : 2.8,
            fill: mark.colour,
            class: mark.point.front ? "point on-front" : "point",
          },
          `${mark.point.label}: ${milliseconds(mark.point.ms)}, ${millimetres(mark.point.error_m)}`,
        ),
      );
    const wished = this.held || this.underWay?.order.verb === "point" ? this.front[Number(this.slider.value)] : null;
    if (wished)
      out.push(this.shape("circle", { cx: plot.x(wished.ms), cy: plot.y(wished.error_m), r: 8, class: "wished" }));
    for (const near of plot.neighbours)
      out.push(
        this.shape(
          "path",
          { d: `M${near.x} ${near.y - 5}l5 5l-5 5l-5 -5z`, class: "neighbour" },
          `${near.of.label}, foreseen: ${milliseconds(near.of.ms)}, ${millimetres(near.of.error_m)}`,
        ),
      );
    if (plot.live && plot.live.y !== null) {
      out.push(
        this.shape("circle", { cx: plot.live.x, cy: plot.live.y, r: 9, class: "live-ring" }),
        this.shape("circle", { cx: plot.live.x, cy: plot.live.y, r: 4.5, class: "live" }, "now"),
      );
      // neighbours in step and tolerance stand beside it, those in resolution above and below
      const above = plot.live.y > top + 24,
        x = Math.min(Math.max(plot.live.x, BOX.left + 14), right - 14);
      out.push(
        this.shape("text", { x, y: plot.live.y + (above ? -13 : 22), class: "now", "text-anchor": "middle" }, "now"),
      );
    } else if (plot.live) {
      out.push(
        this.shape("line", { x1: plot.live.x, x2: plot.live.x, y1: top, y2: bottom, class: "live-line" }),
        this.shape("text", { x: plot.live.x + 4, y: top + 9, class: "now" }, "now"),
      );
    }
    return out;
  }

  show() {
    if (!this.opened) return;
    const e = this.estimate,
      plot = layOut(this.points, e, BOX);
    this.plot.replaceChildren(...this.axes(plot), ...this.marks(plot));
    this.at("methods").replaceChildren(
      ...plot.methods.map(({ name, colour }) => {
        const item = this.page.createElement("li");
        item.style.setProperty("--mark", colour);
        item.textContent = name.replaceAll("_", " ");
        return item;
      }),
    );
    this.at("setting").textContent = e?.setting ?? "";
    this.showError(e);
    this.showSlider();
    this.showKnobs(e);
    this.at("panel").setAttribute("aria-busy", String(this.underWay !== null));
  }

  /** the present error and its parts @param {Estimate | null} e */
  showError(e) {
    const said = errorWords(e),
      parts = e && said.known ? partsOf(e) : [];
    this.at("ms").textContent = e ? milliseconds(e.ms) : "–";
    this.at("error").textContent = said.error;
    this.at("ago").textContent = said.ago;
    this.at("bar").replaceChildren(
      ...parts
        .filter((p) => p.share > 0.004)
        .map((p) => {
          const piece = this.page.createElement("i");
          piece.style.width = 100 * p.share + "%";
          piece.style.background = p.colour;
          return piece;
        }),
    );
    this.at("parts").replaceChildren(
      ...parts.map((p) => {
        const item = this.page.createElement("li");
        item.style.setProperty("--mark", p.colour);
        item.append(p.title, Object.assign(this.page.createElement("span"), { textContent: millimetres(p.value) }));
        return item;
      }),
    );
    this.at("note").textContent = said.note;
  }

  showSlider() {
    const busy = this.underWay?.order.verb === "point";
    if (!this.held && !busy) {
      const place = placeOn(this.front, this.estimate);
      if (place >= 0) this.slider.value = String(place);
    }
    this.slider.disabled = this.underWay !== null;
    const point = this.front[Number(this.slider.value)];
    this.at("choice").textContent = point
      ? `${point.label.replaceAll("_", " ")}: ${milliseconds(point.ms)}, ${millimetres(point.error_m)}`
      : "";
    if (point) this.slider.setAttribute("aria-valuetext", this.at("choice").textContent ?? "");
    if (this.held) {
      const plot = layOut(this.points, this.estimate, BOX);
      this.plot.replaceChildren(...this.axes(plot), ...this.marks(plot));
    }
  }

  /** @param {Estimate | null} e */
  showKnobs(e) {
    const list = e?.neighbours ?? [],
      key = JSON.stringify([list, this.underWay !== null, e?.ms?.toPrecision(2), e?.error_m?.toPrecision(2)]);
    this.at("knobs").hidden = list.length === 0;
    const holder = this.at("knob-list");
    // a button that is about to be pressed is not taken away under the hand
    if (holder.dataset.key === key || (e && list.length && holder.matches(":active"))) return;
    holder.dataset.key = key;
    holder.replaceChildren(
      ...list.map((near) => {
        const button = this.page.createElement("button"),
          order = e && knobOrder(this.body, near),
          same = this.points.find((p) => p.label === near.label);
        const way = order ?? (same ? { verb: "point", target: this.body, args: { index: same.index } } : null);
        const title = this.page.createElement("b"),
          words = this.page.createElement("span");
        title.textContent = near.knob;
        words.textContent = e ? neighbourWords(e, near) : "";
        button.append(title, words);
        button.title = `${near.label}, foreseen: ${milliseconds(near.ms)}, ${millimetres(near.error_m)}`;
        button.disabled = this.underWay !== null || !way;
        if (way) button.onclick = () => this.give(way, near.label);
        return button;
      }),
    );
  }
}
