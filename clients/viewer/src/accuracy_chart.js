// Draws the plot of error against cost as SVG: axes, the study's points and its Pareto front, the running configuration.
import { layOutPlot } from "./accuracy_plot.js";
import { milliseconds, millimetres, plainLabel, pointText } from "./accuracy_text.js";
import { text as textOf } from "./text.js";

const BOX = { left: 40, right: 302, top: 20, bottom: 172 };
const SVG = "http://www.w3.org/2000/svg";

/**
 * @typedef {import("./accuracy_plot.js").Plot} Plot
 * @typedef {{points: import("./control_table.js").StudyPoint[], estimate: import("./control_table.js").Estimate | null,
 *   requested: import("./control_table.js").StudyPoint | null, stepMs: number, reference?: number}} Contents requested:
 *   point under the slider or being prepared; stepMs: a step of real time; reference: error of the reference, m
 */

/** @param {string} name @param {Record<string, string | number>} attributes @param {string} text label or tooltip */
function shape(name, attributes, text = "") {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
    if (text && name === "text") element.textContent = text;
    else if (text) element.append(Object.assign(document.createElementNS(SVG, "title"), { textContent: text }));
    return element;
}

/** @param {Plot} plot */
function drawAxes(plot) {
    const { left, right, top, bottom } = BOX;
    return [
        ...plot.xTicks.flatMap(({ at, text }) => [
            shape("line", { x1: at, x2: at, y1: top, y2: bottom, class: "grid" }),
            shape("text", { x: at, y: bottom + 15, class: "tick", "text-anchor": "middle" }, text),
        ]),
        ...plot.yTicks.flatMap(({ at, text }) => [
            shape("line", { x1: left, x2: right, y1: at, y2: at, class: "grid" }),
            shape("text", { x: left - 5, y: at + 3.5, class: "tick", "text-anchor": "end" }, text),
        ]),
        shape("text", { x: right, y: bottom + 28, class: "tick", "text-anchor": "end" }, textOf("accuracy.axis.cost")),
        shape(
            "text",
            { x: 2, y: top - 9, class: "tick" },
            textOf(plot.studied ? "accuracy.axis.study" : "accuracy.axis.now"),
        ),
    ];
}

/** real time, and the error of the reference @param {Plot} plot @param {Contents} contents */
function drawLimits(plot, { stepMs, reference }) {
    const { left, right, top, bottom } = BOX;
    const out = [];
    if (stepMs > plot.msRange.low && stepMs < plot.msRange.high) {
        const x = plot.x(stepMs);
        const text = textOf("accuracy.real_time.tip", { ms: milliseconds(stepMs) });
        out.push(shape("line", { x1: x, x2: x, y1: top, y2: bottom, class: "limit" }, text));
        // beside the line, where there is room
        const isLeft = x < (left + right) / 2;
        const at = {
            x: x + (isLeft ? 3 : -3),
            y: bottom - 4,
            class: "limit-name",
            "text-anchor": isLeft ? "start" : "end",
        };
        out.push(shape("text", at, textOf("state.real_time")));
    }
    if (reference !== undefined && 1e3 * reference > plot.errorRange.low && 1e3 * reference < plot.errorRange.high) {
        const y = plot.y(reference);
        const text = textOf("accuracy.reference.tip", { mm: millimetres(reference) });
        out.push(shape("line", { x1: left, x2: right, y1: y, y2: y, class: "limit" }, text));
        out.push(shape("text", { x: left + 3, y: y - 3, class: "limit-name" }, textOf("accuracy.reference")));
    }
    return out;
}

/** @param {Plot} plot @param {Contents} contents */
function drawPoints(plot, { requested }) {
    const out = [];
    if (plot.front.length > 1) {
        const points = plot.front.map((p) => `${p.x.toFixed(1)},${p.y.toFixed(1)}`).join(" ");
        out.push(shape("polyline", { points, class: "front" }));
    }
    for (const { x, y, point, colour } of plot.marks) {
        const text = pointText(point);
        const style = point.pareto_optimal ? { r: 4, class: "point on-front" } : { r: 2.8, class: "point" };
        out.push(shape("circle", { cx: x, cy: y, fill: colour, ...style }, text));
    }
    if (requested)
        out.push(
            shape("circle", { cx: plot.x(requested.cost_ms), cy: plot.y(requested.error_m), r: 8, class: "requested" }),
        );
    for (const { x, y, of } of plot.neighbours) {
        const text = textOf("accuracy.predicted", {
            name: plainLabel(of.label),
            ms: milliseconds(of.cost_ms),
            mm: millimetres(of.error_m),
        });
        out.push(shape("path", { d: `M${x} ${y - 5}l5 5l-5 5l-5 -5z`, class: "neighbour" }, text));
    }
    return out;
}

const LABEL_PX = 40; // room for "now" in any language

/** the running configuration @param {Plot} plot */
function drawLive({ live }) {
    const { left, right, top, bottom } = BOX;
    if (!live) return [];
    if (live.y === null)
        return [
            shape("line", { x1: live.x, x2: live.x, y1: top, y2: bottom, class: "live-line" }),
            live.x < right - LABEL_PX
                ? shape("text", { x: live.x + 4, y: top + 9, class: "now" }, textOf("accuracy.mark_now"))
                : shape(
                      "text",
                      { x: live.x - 4, y: top + 9, class: "now", "text-anchor": "end" },
                      textOf("accuracy.mark_now"),
                  ),
        ];
    // the label stands above or below: neighbours in time step and tolerance lie to the left and right
    const y = live.y + (live.y > top + 24 ? -13 : 22);
    const x = Math.min(Math.max(live.x, left + 14), right - 14);
    return [
        shape("circle", { cx: live.x, cy: live.y, r: 9, class: "live-ring" }),
        shape("circle", { cx: live.x, cy: live.y, r: 4.5, class: "live" }, textOf("accuracy.mark_now")),
        shape("text", { x, y, class: "now", "text-anchor": "middle" }, textOf("accuracy.mark_now")),
    ];
}

/** @param {Element} svg @param {Contents} contents @returns {Plot} */
export function drawChart(svg, contents) {
    const plot = layOutPlot(contents.points, contents.estimate, BOX);
    svg.replaceChildren(
        ...[...drawAxes(plot), ...drawLimits(plot, contents), ...drawPoints(plot, contents), ...drawLive(plot)],
    );
    return plot;
}
