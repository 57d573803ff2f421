// The panel of accuracy: the study's plot, the error of the running configuration and its parts, its neighbours, and a
// slider along the Pareto front. While it is open it subscribes to the estimates of one body. One switch of the
// configuration is pending at a time.
import { drawChart } from "./accuracy_chart.js";
import { frontOf, neighbourArgs, positionOn } from "./accuracy_plot.js";
import {
    errorText,
    milliseconds,
    millimetres,
    neighbourText,
    partsOf,
    parameterText,
    plainLabel,
    pointText,
    switchText,
} from "./accuracy_text.js";
import { htmlById, inputById, makeOption, selectById } from "./dom.js";
import { text as textOf } from "./text.js";

/**
 * @typedef {import("./control_table.js").Estimate} Estimate
 * @typedef {import("./control_table.js").Neighbour} Neighbour
 * @typedef {import("./control_table.js").StudyPoint} StudyPoint
 * @typedef {{verb: string, target: string, args: Record<string, number>}} Command
 */

const WAIT_MS = 60000; // a switch to a mesh of many voxels takes its time; after this its answer counts as lost
const SHARE_MIN = 0.004; // of the bar, 310 pixels wide: a smaller part is below one pixel

export class AccuracyPanel {
    /** @param {Document} page @param {(command: Command) => void} send */
    constructor(page, send) {
        this.page = page;
        this.send = send;
        this.opened = false;
        this.body = ""; // chosen
        this.subscribed = ""; // body whose estimates the server sends, "" none
        /** @type {StudyPoint[]} */
        this.points = [];
        /** @type {StudyPoint[]} */
        this.front = [];
        /** @type {Estimate | null} */
        this.estimate = null;
        this.stepMs = 0; // a step of real time
        /** @type {number | undefined} error of the study's reference, m */
        this.reference = undefined;
        this.dragging = false; // the slider
        /** @type {{command: Command, since: number} | null} switch that is not answered yet */
        this.pending = null;
        this.plot = /** @type {SVGSVGElement} */ (/** @type {unknown} */ (page.getElementById("accuracy-plot")));
        this.slider = inputById("accuracy-slider", page);
        this.bodyList = selectById("accuracy-body", page);
        this.slider.oninput = () => {
            this.dragging = true;
            this.showSlider();
            this.drawPlot();
        };
        this.slider.onchange = () => this.releaseSlider();
        this.bodyList.onchange = () => {
            this.body = this.bodyList.value;
            this.subscribe();
        };
    }

    /** @param {string} id */
    at(id) {
        return htmlById("accuracy-" + id, this.page);
    }

    /**
     * After `hello`.
     * @param {{name: string}[]} parts @param {boolean} offered by the server @param {number} stepMs a step of real time
     */
    begin(parts, offered, stepMs) {
        const bodies = offered ? parts.map((part) => part.name) : [];
        if (!bodies.includes(this.body)) this.body = bodies[0] ?? "";
        this.stepMs = stepMs;
        this.subscribed = "";
        this.pending = null;
        this.bodyList.replaceChildren(...bodies.map((name) => makeOption(name)));
        this.bodyList.value = this.body;
        this.at("bodies").hidden = bodies.length < 2;
        this.report("");
        this.subscribe();
    }

    /** @param {boolean} opened */
    open(opened) {
        this.opened = opened;
        this.subscribe();
    }

    /** subscribes to the estimates of the chosen body while the panel is open, and to nothing else */
    subscribe() {
        const wanted = this.opened ? this.body : "";
        if (wanted === this.subscribed) return;
        if (this.subscribed) this.send({ verb: "estimate", target: this.subscribed, args: { enabled: 0 } });
        this.subscribed = wanted;
        this.points = this.front = [];
        this.estimate = null;
        if (wanted) this.send({ verb: "estimate", target: wanted, args: { enabled: 1 } });
        this.show();
    }

    /** @param {import("./control_table.js").Study} study */
    takeStudy(study) {
        if (study.body !== this.subscribed) return;
        this.points = study.points ?? [];
        this.reference = study.reference_m;
        this.stepMs = study.step_ms;
        this.front = frontOf(this.points);
        this.slider.max = String(Math.max(0, this.front.length - 1));
        this.at("front").hidden = this.front.length < 2;
        if (this.points.length === 0) this.report(textOf("accuracy.no_study"));
        this.show();
    }

    /** @param {Estimate} estimate */
    takeEstimate(estimate) {
        if (estimate.body !== this.subscribed) return;
        this.estimate = estimate;
        if (this.pending && Date.now() - this.pending.since > WAIT_MS) this.pending = null;
        this.show();
    }

    /** @param {import("./control_table.js").Answer} answer @returns {boolean} it belongs to this panel */
    answer(answer) {
        if (answer.verb !== "study_point" && answer.verb !== "configure") return false;
        this.pending = null;
        this.report(switchText(answer));
        this.show();
        return true;
    }

    /** @param {string} text of an error @returns {boolean} it belongs to this panel */
    refused(text) {
        if (!this.pending) return false;
        this.pending = null;
        this.dragging = false;
        this.report(text);
        this.show();
        return true;
    }

    /** @param {string} text */
    report(text) {
        this.at("message").textContent = text;
    }

    /** @param {Command} command @param {string} label of the requested configuration */
    submit(command, label) {
        if (this.pending) return;
        this.pending = { command, since: Date.now() };
        this.report(textOf("accuracy.preparing", { name: plainLabel(label) }));
        this.send(command);
        this.show();
    }

    releaseSlider() {
        const point = this.front[Number(this.slider.value)];
        this.dragging = false;
        if (point && point.index !== this.estimate?.study_point) this.submit(this.pointCommand(point), point.label);
        this.show();
    }

    /** @param {StudyPoint} point @returns {Command} */
    pointCommand(point) {
        return { verb: "study_point", target: this.body, args: { index: point.index } };
    }

    show() {
        if (!this.opened) return;
        const plot = this.drawPlot();
        this.at("methods").replaceChildren(
            ...plot.methods.map(({ name, colour }) => this.legendItem(colour, plainLabel(name))),
        );
        this.at("configuration").textContent = plainLabel(this.estimate?.configuration ?? "");
        this.showError(this.estimate);
        this.showSlider();
        this.showNeighbours(this.estimate);
        this.at("panel").setAttribute("aria-busy", String(this.pending !== null));
    }

    drawPlot() {
        const moving = this.dragging || this.pending?.command.verb === "study_point";
        const requested = moving ? (this.front[Number(this.slider.value)] ?? null) : null;
        const { estimate, points, reference, stepMs } = this;
        return drawChart(this.plot, { estimate, points, reference, requested, stepMs });
    }

    /** @param {string} colour @param {string} title @param {string} value */
    legendItem(colour, title, value = "") {
        const item = this.page.createElement("li");
        item.style.setProperty("--mark", colour);
        item.append(title);
        if (value) item.append(Object.assign(this.page.createElement("span"), { textContent: value }));
        return item;
    }

    /** the present error and its parts @param {Estimate | null} estimate */
    showError(estimate) {
        const text = errorText(estimate);
        const parts = estimate && text.known ? partsOf(estimate) : [];
        this.at("ms").textContent = estimate ? milliseconds(estimate.cost_ms) : "–";
        this.at("error").textContent = text.error;
        this.at("age").textContent = text.age;
        this.at("error").classList.toggle("old", text.age !== "");
        this.at("bar").classList.toggle("old", text.age !== "");
        this.at("note").textContent = text.note;
        this.at("parts").replaceChildren(
            ...parts.map((p) => this.legendItem(p.colour, textOf(p.title), millimetres(p.value))),
        );
        const segments = parts.filter((part) => part.share > SHARE_MIN);
        this.at("bar").hidden = segments.length === 0;
        this.at("bar").replaceChildren(
            ...segments.map(({ colour, share }) => {
                const segment = this.page.createElement("i");
                segment.style.width = 100 * share + "%";
                segment.style.background = colour;
                return segment;
            }),
        );
    }

    showSlider() {
        if (!this.dragging && this.pending?.command.verb !== "study_point") {
            const position = positionOn(this.front, this.estimate);
            if (position >= 0) this.slider.value = String(position);
        }
        this.slider.disabled = this.pending !== null;
        const point = this.front[Number(this.slider.value)];
        const text = point ? pointText(point) : "";
        this.at("choice").textContent = text;
        if (point) this.slider.setAttribute("aria-valuetext", text);
    }

    /** @param {Estimate | null} estimate */
    showNeighbours(estimate) {
        const neighbours = estimate?.neighbours ?? [];
        this.at("neighbours").hidden = neighbours.length === 0;
        const list = this.at("neighbour-list");
        const figures = [estimate?.cost_ms?.toPrecision(2), estimate?.error_m?.toPrecision(2)];
        const key = JSON.stringify([neighbours, this.pending !== null, figures]);
        // a button stays in place while it is pressed
        if (list.dataset.key === key || (neighbours.length && list.matches(":active"))) return;
        list.dataset.key = key;
        list.replaceChildren(...(estimate ? neighbours.map((near) => this.neighbourButton(estimate, near)) : []));
    }

    /** @param {Estimate} estimate @param {Neighbour} near */
    neighbourButton(estimate, near) {
        const command = this.neighbourCommand(near);
        const button = this.page.createElement("button");
        const title = Object.assign(this.page.createElement("b"), { textContent: parameterText(near.parameter) });
        const text = Object.assign(this.page.createElement("span"), { textContent: neighbourText(estimate, near) });
        button.append(title, text);
        button.title = textOf("accuracy.predicted", {
            name: plainLabel(near.label),
            ms: milliseconds(near.cost_ms),
            mm: millimetres(near.error_m),
        });
        button.disabled = this.pending !== null || !command;
        if (command) button.onclick = () => this.submit(command, near.label);
        return button;
    }

    /** the command that switches to a neighbour; null: none does @param {Neighbour} near @returns {Command | null} */
    neighbourCommand(near) {
        const args = neighbourArgs(near);
        if (args) return { verb: "configure", target: this.body, args };
        const point = this.points.find((p) => p.label === near.label);
        return point ? this.pointCommand(point) : null;
    }
}
