#!/usr/bin/env node
// Draws dashboard.json without Grafana: asks a Prometheus for every panel's expressions and writes one page with the
// panels in their grid, drawn by uPlot as Grafana does. An expression that is wrong or has no data is an error.
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";

const usage = `usage: render_dashboard.mjs PROMETHEUS [flags]
  -o PAGE.html       the page (dashboard.html)
  --minutes N        of time until now (5)
  --rate DURATION    what $__rate_interval stands for, four scrapes (1m)
  --packages FOLDER  with node_modules of the viewer (build/viewer_packages)
A PNG of it: chromium --headless --no-sandbox --window-size=1500,900 --screenshot=dashboard.png dashboard.html`;
const here = path.dirname(fileURLToPath(import.meta.url));
const { values: flag, positionals } = parseArgs({
    allowPositionals: true,
    options: {
        output: { type: "string", short: "o", default: "dashboard.html" },
        minutes: { type: "string", default: "5" },
        rate: { type: "string", default: "1m" },
        packages: { type: "string", default: path.join(here, "../../build/viewer_packages") },
    },
});
const seconds = 60 * Number(flag.minutes);
if (positionals.length !== 1 || !(seconds > 0)) {
    console.error(usage);
    process.exit(2);
}

const N_MOMENTS = 300; // a panel is about 400 pixels wide
// whole milliseconds, as Prometheus counts: a fraction would cost the last moment
const step = Math.ceil((1000 * seconds) / N_MOMENTS) / 1000;
const end = Math.ceil(Date.now() / 1000);
const times = Array.from({ length: N_MOMENTS + 1 }, (_, i) => end - (N_MOMENTS - i) * step);

/** the series of one target: its legend, and a value or null at each of `times` */
async function ask({ expr, legendFormat }) {
    const query = expr.replaceAll("$__rate_interval", flag.rate).replaceAll("$pod", ".*");
    const range = { query, start: times[0].toFixed(3), end, step };
    const answer = await fetch(`${positionals[0]}/api/v1/query_range?${new URLSearchParams(range)}`);
    const { status, error, data } = await answer.json();
    if (status !== "success") throw new Error(`${query}: ${error}`);
    const series = data.result.map(({ metric, values }) => {
        const at = Array(times.length).fill(null);
        for (const [t, text] of values)
            if (Number.isFinite(Number(text))) at[Math.round((t - times[0]) / step)] = Number(text);
        return { label: legendFormat.replace(/{{\s*(\w+)\s*}}/g, (_, name) => metric[name] ?? ""), at };
    });
    if (!series.some(({ at }) => at.some((value) => value !== null))) throw new Error(`${query}: no data`);
    return series;
}

/** runs in the page, with uPlot */
function draw(title, times, panels) {
    const UNITS = { short: "", s: "s", cps: "/s", Bps: "B/s" };
    const COLOURS = ["#73bf69", "#f2cc0c", "#8ab8ff", "#ff780a", "#f2495c", "#b877d9", "#6ed0e0", "#ffffff"];
    const PREFIXES = [
        [1e9, "G"],
        [1e6, "M"],
        [1e3, "k"],
        [1, ""],
        [1e-3, "m"],
        [1e-6, "µ"],
    ];
    const shown = (value, unit) => {
        const prefixes = unit === "s" ? PREFIXES : PREFIXES.slice(0, 4);
        const [scale, prefix] = (value && prefixes.find(([least]) => Math.abs(value) >= least)) || [1, ""];
        return `${Number(((value ?? NaN) / scale).toPrecision(3))} ${prefix}${unit}`;
    };
    const clock = (tick) => new Date(1000 * tick).toTimeString().slice(0, 8);
    document.title = title;
    for (const { title, description, unit, min, place, series } of panels) {
        const suffix = UNITS[unit];
        const box = document.body.appendChild(document.createElement("section"));
        box.style.gridArea = `${place.y + 1} / ${place.x + 1} / span ${place.h} / span ${place.w}`;
        box.appendChild(document.createElement("h2")).textContent = title;
        box.title = description ?? "";
        const legend = box.appendChild(document.createElement("p"));
        series.forEach(({ label, at }, k) => {
            const entry = legend.appendChild(document.createElement("span"));
            entry.style.borderLeftColor = COLOURS[k % COLOURS.length];
            entry.textContent = `${label}: ${shown(
                at.findLast((value) => value !== null),
                suffix,
            )}`;
        });
        const axis = { stroke: "#ccccdc", grid: { stroke: "#2c3235" }, ticks: { stroke: "#2c3235" } };
        const options = {
            width: box.clientWidth - 16,
            height: box.clientHeight - 50 - legend.offsetHeight,
            legend: { show: false },
            scales: { y: { range: (_, low, high) => [Math.min(min, low), high > min ? 1.1 * high : min + 1] } },
            axes: [
                { ...axis, size: 30, values: (_, ticks) => ticks.map(clock) },
                { ...axis, size: 70, values: (_, ticks) => ticks.map((tick) => shown(tick, suffix)) },
            ],
            series: [{}, ...series.map((_, k) => ({ stroke: COLOURS[k % COLOURS.length], width: 1.5 }))],
        };
        new uPlot(options, [times, ...series.map(({ at }) => at)], box);
    }
}

const STYLE = `body { margin: 8px; background: #111217; color: #ccccdc; font: 13px sans-serif; display: grid;
    grid-template-columns: repeat(24, 1fr); grid-auto-rows: 34px; gap: 4px }
section { background: #181b1f; border: 1px solid #2c3235; padding: 8px; min-width: 0; overflow: hidden }
h2 { margin: 0 0 4px; font-size: 14px } p { margin: 0; font-size: 12px }
p span { display: inline-block; border-left: 12px solid; padding-left: 5px; margin: 2px 14px 2px 0; line-height: 12px }`;

try {
    const { title, panels } = JSON.parse(readFileSync(path.join(here, "dashboard.json"), "utf8"));
    const drawn = [];
    for (const { title, description, gridPos: place, fieldConfig, targets } of panels) {
        const series = (await Promise.all(targets.map(ask))).flat();
        drawn.push({ title, description, ...fieldConfig.defaults, place, series });
    }
    const uplot = (file) => readFileSync(path.join(flag.packages, "node_modules/uplot/dist", file), "utf8");
    const data = [title, times, drawn].map((one) => JSON.stringify(one).replaceAll("<", "\\u003c")).join(", ");
    writeFileSync(
        flag.output,
        `<!doctype html><meta charset="utf-8"><style>${uplot("uPlot.min.css")}${STYLE}</style><body></body>
<script>${uplot("uPlot.iife.min.js")}</script><script>(${draw})(${data})</script>\n`,
    );
} catch (error) {
    console.error(`render_dashboard: ${error.cause?.code ? `${error.message}: ${error.cause.code}` : error.message}`);
    process.exit(1);
}
