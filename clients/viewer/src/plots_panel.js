// The panel of time plots: force, displacement, work and time per step against simulation time. Made when it opens, gone
// when it closes, with all samples: nothing is collected that nobody looks at.
import { buttonById, chooseByArrows, htmlById, markRadio } from "./dom.js";
import { download } from "./download.js";
import { forceText } from "./force_text.js";
import { NARROW } from "./layout.js";
import { cssColour } from "./plan_panel.js";
import { plotData, timeRange, valueRange } from "./plot_axes.js";
import { toCsv } from "./plot_csv.js";
import { picturePlots } from "./plot_picture.js";
import { ENERGIES, LENGTH_MAX_S, PlotSampler, STEP } from "./plot_sampler.js";
import { decimal, text } from "./text.js";
import uPlot from "./uplot.js";

/**
 * @typedef {import("./plot_sampler.js").Channel} Channel
 * @typedef {import("./plot_sampler.js").Quantity | "energy_mJ" | typeof STEP} ChartName
 * @typedef {{name: ChartName, min: number, figure: HTMLElement, plot: uPlot, values: HTMLElement, keys: string[]}} Chart
 */

/** charts from top to bottom @type {[ChartName, number][]} with the smallest range of the values, above noise at rest */
const CHARTS = [
    ["force_N", 0.1],
    ["displacement_mm", 1],
    ["depth_mm", 1],
    ["work_mJ", 0.1],
    ["energy_mJ", 0.1],
    [STEP, 0.1],
];
const LENGTHS_S = [30, LENGTH_MAX_S];
const DRAW_MS = 100; // between two pictures of the plots: they are read, not watched
const HEIGHT = 54; // of a chart, pixels: six fit beside the organ on a laptop
const HEIGHT_NARROW = 34; // six fit below the organ on a telephone
/** @type {[number, number]} width and height of a chart in a saved picture, pixels: wider than a panel */
const PICTURE = [820, 130];
const TIME_AXIS = 22; // below the lowest chart, pixels
const VALUE_AXIS = 40; // left of each chart, pixels
const FILL_SHARE = 0.3; // of the page's ink in a colour on the light theme, for contrast

export class PlotsPanel {
    /** @param {import("./app_state.js").AppState} state */
    constructor(state) {
        this.state = state;
        this.sampler = new PlotSampler();
        this.length = LENGTHS_S[0];
        this.held = false;
        this.drawnAt = -Infinity;
        /** @type {Chart[]} */
        this.charts = [];
        this.key = ""; // of the channels that the charts show
        this.light = window.matchMedia("(prefers-color-scheme: light)");
        this.restyle = () => this.build();
        this.light.addEventListener("change", this.restyle);
        this.resizer = new ResizeObserver(() => this.resize());
        this.resizer.observe(htmlById("plots-charts"));
        chooseByArrows(htmlById("plots-length"), () => LENGTHS_S.map((length) => buttonById(`plots-${length}`)));
        for (const length of LENGTHS_S) buttonById(`plots-${length}`).onclick = () => this.choose(length);
        buttonById("plots-hold").onclick = () => this.hold(!this.held);
        buttonById("plots-csv").onclick = () => this.save(new Blob([this.csv()], { type: "text/csv" }), ".csv");
        buttonById("plots-png").onclick = () => this.savePicture();
        this.hold(false);
        this.choose(this.length);
    }

    close() {
        this.light.removeEventListener("change", this.restyle);
        this.resizer.disconnect();
        for (const { plot } of this.charts) plot.destroy();
        htmlById("plots-charts").replaceChildren();
    }

    /** @param {number} time of the simulation, s @param {import("./wire.js").Tool[]} tools */
    take(time, tools) {
        if (this.held) return;
        const { state } = this;
        this.sampler.take(time, tools, {
            surfaces: [...state.bodies.values()],
            stepMs: state.status?.step_ms,
            nameOf: (tool, i) => state.members.get(tool.holder)?.name ?? state.hello?.tools[i]?.name ?? "",
            capOf: (i) => state.hello?.tools[i]?.force_cap_N,
            radiusOf: (i) => state.hello?.tools[i]?.radius_m ?? 0,
            energies: state.status?.energies,
        });
        const now = performance.now();
        if (now - this.drawnAt < DRAW_MS) return;
        this.drawnAt = now;
        this.draw();
    }

    /** @param {number} length s */
    choose(length) {
        this.length = length;
        for (const other of LENGTHS_S) markRadio(buttonById(`plots-${other}`), other === length);
        this.build();
    }

    /** held plots take no samples @param {boolean} held */
    hold(held) {
        this.held = held;
        const button = buttonById("plots-hold");
        button.setAttribute("aria-pressed", String(held));
        button.textContent = text(held ? "plots.resume" : "plots.hold");
    }

    /** colour of a member on the ground of the panel @param {number} colour */
    colourOf(colour) {
        return this.light.matches
            ? cssColour([16, 8, 0].reduce((sum, s) => sum | ((((colour >> s) & 255) * (1 - FILL_SHARE)) << s), 0))
            : cssColour(colour);
    }

    /** makes the charts of the present channels */
    build() {
        for (const { plot } of this.charts) plot.destroy();
        const channels = this.sampler.list();
        this.key = this.keyOf(channels);
        this.charts = CHARTS.map(([name, min], i) => this.makeChart(name, min, channels, i === CHARTS.length - 1));
        htmlById("plots-charts").replaceChildren(...this.charts.map(({ figure }) => figure));
        htmlById("plots-members").replaceChildren(
            ...channels.map(({ name, colour }) => {
                const item = Object.assign(document.createElement("li"), { textContent: name });
                item.style.setProperty("--mark", this.colourOf(colour));
                return item;
            }),
        );
        this.resize();
        this.draw();
    }

    /** @param {Channel[]} channels */
    keyOf(channels) {
        return JSON.stringify(channels.map(({ key, name, colour }) => [key, name, colour]));
    }

    /**
     * @param {ChartName} name @param {number} min @param {Channel[]} channels @param {boolean} lowest has the time axis
     * @returns {Chart}
     */
    makeChart(name, min, channels, lowest) {
        const style = getComputedStyle(document.documentElement);
        const [quiet, faint, ink] = ["--quiet", "--faint", "--ink"].map((v) => style.getPropertyValue(v).trim());
        const figure = document.createElement("figure");
        const caption = document.createElement("figcaption");
        const values = document.createElement("span");
        caption.append(text(`plots.${name}`), values);
        figure.append(caption);
        const lines = !ofTools(name)
            ? keysOf(name).map((_, i) => ({ stroke: i ? quiet : ink, width: 1.25 }))
            : channels.map(({ colour }) => ({ stroke: this.colourOf(colour), width: 1.75 }));
        const axis = { stroke: quiet, grid: { stroke: faint, width: 1 }, ticks: { show: false } };
        const plot = new uPlot(
            {
                width: 300,
                height: HEIGHT,
                padding: [6, 12, lowest ? 0 : 4, 0],
                legend: { show: false },
                cursor: { y: false, sync: { key: "plots" }, drag: { x: false, y: false } },
                scales: {
                    x: { time: false, range: (u) => timeRange(u.data[0], this.length) },
                    y: {
                        range: (u) =>
                            valueRange(
                                u.data.slice(1).flatMap((v) => [...v].map(Number)),
                                min,
                            ),
                    },
                },
                axes: [
                    { ...axis, size: lowest ? TIME_AXIS : 0, ...(lowest ? {} : { values: () => [] }) },
                    { ...axis, size: VALUE_AXIS, space: 22 },
                ],
                series: [{}, ...lines.map((line) => ({ ...line, points: { show: false } }))],
                hooks: { setCursor: [() => this.showValues()] },
            },
            [[], ...lines.map(() => [])],
            figure,
        );
        const keys = !ofTools(name) ? keysOf(name) : channels.map(({ key }) => `${key}:${name}`);
        return { name, min, figure, plot, values, keys };
    }

    /** pixels of the page @param {number} width @param {number} height of a chart without its time axis */
    resize(width = htmlById("plots-charts").clientWidth, height = innerWidth > NARROW ? HEIGHT : HEIGHT_NARROW) {
        this.charts.forEach(({ plot }, i) => {
            const size = { width, height: height + (i === this.charts.length - 1 ? TIME_AXIS : 0) };
            if (width > 0 && (plot.width !== size.width || plot.height !== size.height)) plot.setSize(size);
        });
    }

    draw() {
        if (this.key !== this.keyOf(this.sampler.list())) return this.build();
        const { ring } = this.sampler;
        const { times, columns } = ring.since(ring.lastTime - this.length);
        for (const { plot, keys } of this.charts) {
            const shown = keys.map((key) => columns.get(key));
            plot.setData(plotData(times, shown));
        }
        this.showValues();
    }

    /** the values under the mouse, else the newest, beside the titles; the time beside the panel's */
    showValues() {
        const hovered = this.charts[0]?.plot.cursor.idx ?? null;
        const channels = this.sampler.list();
        for (const { name, plot, values } of this.charts) {
            const at = hovered ?? plot.data[0].length - 1;
            values.replaceChildren(
                ...plot.data.slice(1).map((column, i) => {
                    const item = document.createElement("b");
                    const value = column[at];
                    const cap = name === "force_N" ? channels[i]?.cap : undefined;
                    item.textContent = typeof value === "number" ? valueText(value, cap) : "–";
                    if (ofTools(name) && channels[i]) item.style.color = this.colourOf(channels[i].colour);
                    return item;
                }),
            );
        }
        const time = hovered === null ? this.sampler.ring.lastTime : this.charts[0].plot.data[0][hovered];
        htmlById("plots-time").textContent = Number.isFinite(time)
            ? text("plots.at_time", { seconds: decimal(Number(time).toFixed(2)) })
            : "";
    }

    csv() {
        const { times, columns } = this.sampler.ring.since(-Infinity);
        const channels = this.sampler.list();
        return toCsv(
            times,
            [...columns].map(([key, values]) => {
                const channel = channels.find((c) => key.startsWith(`${c.key}:`));
                return [channel ? `${key.slice(channel.key.length + 1)} ${channel.name}` : key, values];
            }),
        );
    }

    /** @param {Blob} blob @param {string} ending */
    save(blob, ending) {
        download(blob, this.state.hello?.session ?? "", ending);
    }

    async savePicture() {
        this.resize(...PICTURE);
        await null; // uPlot draws after this turn, before the page is shown
        const canvas = picturePlots(htmlById("plots"), htmlById("title").textContent ?? "", text("plots.time"));
        this.resize();
        const blob = await new Promise((resolve) => canvas.toBlob(resolve));
        if (blob) this.save(blob, "_plots.png");
    }
}

/** are the values of a chart those of tools? @param {ChartName} name @returns {name is import("./plot_sampler.js").Quantity} */
const ofTools = (name) => name !== STEP && name !== "energy_mJ";
/** columns of a chart of the whole session @param {ChartName} name */
const keysOf = (name) => (name === STEP ? [STEP] : [...ENERGIES]);

/** a number, as the unit stands in the caption; but a force at its cap says so @param {number} value @param {number | undefined} cap N */
const valueText = (value, cap) => forceText(value, cap).replace(/^([\d.]+) N$/, "$1");
