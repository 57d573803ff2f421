// Time plots while the organ is pulled: what they show, hold and save; a picture and a video of the page; the force cue.
// usage: node plots.mjs BUILD PICTURES     ends with "N passed, N failed"
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    drag,
    grasp,
    launch,
    newPage,
    nextFrame,
    open,
    organPixel,
    pictures,
    prepare,
    run,
    serve,
    until,
} from "./common.mjs";

/** the bytes that a click saves */
async function saved(page, id) {
    const [file] = await Promise.all([page.waitForEvent("download"), page.click(id)]);
    return { name: file.suggestedFilename(), bytes: readFileSync(await file.path()) };
}
/** newest value of a chart, of the own tool */
const newest = (page, name) =>
    page.evaluate((wanted) => {
        const chart = window.palpate.plots.panel?.charts.find((c) => c.name === wanted);
        return chart?.plot.data[1]?.at(-1) ?? 0;
    }, name);
const forceLabel = (page) => page.evaluate(() => parseFloat(document.getElementById("force-value").textContent));
const nSamples = (page) => page.evaluate(() => window.palpate.plots.panel?.sampler.ring.n ?? 0);
/** width and height of the first picture of a video, as an empty page plays it */
const pictureSize = (page, bytes) =>
    page.evaluate(async (text) => {
        const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
        const video = document.createElement("video");
        video.src = URL.createObjectURL(new Blob([bytes]));
        await new Promise((resolve) => (video.onloadeddata = video.onerror = resolve));
        return video.error ? video.error.message : `${video.videoWidth} x ${video.videoHeight}`;
    }, bytes.toString("base64"));
/** saturation of the middle of the background, 0 to 1 */
const saturation = (page) =>
    page.evaluate(() => {
        const canvas = window.palpate.stage.scene.background.image;
        const [r, g, b] = canvas.getContext("2d").getImageData(0, canvas.height / 2, 1, 1).data;
        return 1 - Math.min(r, g, b) / Math.max(r, g, b);
    });
const isPng = (bytes) => bytes.subarray(1, 4).toString() === "PNG" && bytes.length > 5000;

await run(async () => {
    const server = await serve(prepare(), 0);
    const browser = await launch();
    const address = `http://127.0.0.1:${server.info.port}/`;
    const ada = await open(browser, address, "Ada", { width: 1280, height: 800 });

    const loaded = () => ada.evaluate(() => performance.getEntriesByType("resource").some((e) => /uPlot/.test(e.name)));
    check("a page without plots does not load them", !(await loaded()));
    const pale = await saturation(ada);
    await ada.keyboard.press("5");
    await until(() => nSamples(ada));
    check("the key 5 opens the plots", await ada.isVisible("#plots canvas"));

    const pixel = await organPixel(ada);
    await grasp(ada, pixel);
    await drag(ada, pixel, 7, -8, 12);
    const force = await until(
        () => newest(ada, "force_N"),
        (f) => f > 0.05,
    );
    // the plot and the label show samples of different moments: equal once the organ rests in the hand
    const pair = await until(
        async () => ({ plot: await newest(ada, "force_N"), label: await forceLabel(ada) }),
        ({ plot, label }) => plot > 0.05 && Math.abs(plot - label) <= 0.0051,
    );
    check(
        "the plotted force is that of the label",
        Math.abs(pair.plot - pair.label) <= 0.0051,
        `${force.toFixed(3)} -> ${pair.plot.toFixed(4)} N, label ${pair.label}`,
    );
    const moved = await until(
        () =>
            ada.evaluate(() => {
                const bodies = [...window.palpate.state.bodies.values()];
                const chart = window.palpate.plots.panel.charts.find((c) => c.name === "displacement_mm");
                return {
                    mm: chart.plot.data[1].at(-1),
                    largest: 1000 * Math.max(...bodies.map((b) => b.maxDisplacement())),
                };
            }),
        ({ mm, largest }) => mm > 1 && mm < 1.05 * largest,
    );
    check(
        "the displacement is one of the surface",
        moved.mm > 1 && moved.mm < 1.05 * moved.largest,
        `${moved.mm.toFixed(1)} of ${moved.largest.toFixed(1)} mm`,
    );
    // the work of a tool that pulls already
    await drag(ada, { x: pixel.x + 84, y: pixel.y - 96 }, 4, -4, 5);
    const mJ = await until(
        () => newest(ada, "work_mJ"),
        (w) => w > 0.1,
    );
    const reach = await until(
        () =>
            ada.evaluate(() => {
                const { plots, state } = window.palpate;
                const { ring, last } = plots.panel.sampler;
                const [body] = [...state.bodies.values()];
                const [x, y, z] = last[state.ownTool].position;
                let mm = Infinity;
                for (let i = 0; i < body.rest.length; i += 3)
                    mm = Math.min(mm, 1e3 * Math.hypot(body.rest[i] - x, body.rest[i + 1] - y, body.rest[i + 2] - z));
                const [, depth] = [...ring.since(-Infinity).columns].find(([key]) => key.endsWith("depth_mm"));
                return { mm, above: 1e3 * state.hello.tools[state.ownTool].radius_m - depth.at(-1) };
            }),
        ({ mm, above }) => Math.abs(above) < 1.01 * mm && Math.abs(above) > 0.85 * mm,
    );
    check(
        "the depth is that of the tool along the normal of the nearest place at rest",
        Math.abs(reach.above) < 1.01 * reach.mm && Math.abs(reach.above) > 0.85 * reach.mm,
        `${reach.above.toFixed(1)} mm, nearest vertex at rest ${reach.mm.toFixed(1)} mm`,
    );
    const energy = await until(
        () =>
            ada.evaluate(() => {
                const { panel } = window.palpate.plots;
                const { plot } = panel.charts.find((c) => c.name === "energy_mJ");
                const [, total, kinetic] = plot.data.map((column) => column.at(-1));
                return { total, kinetic, components: window.palpate.state.running };
            }),
        ({ total }) => total > 0.1,
    );
    check(
        "the pulled body has elastic energy, more than kinetic energy",
        energy.total > 0.1 && energy.kinetic >= 0 && energy.kinetic < energy.total,
        `${energy.total.toFixed(2)} mJ, ${energy.kinetic.toFixed(3)} mJ of it kinetic; ${mJ.toFixed(2)} mJ of work`,
    );
    const ms = await newest(ada, "step_ms");
    check("pulling works on the tissue", mJ > 0.1, `${mJ.toFixed(2)} mJ`);
    check("a step takes time", ms > 0, `${ms.toFixed(2)} ms`);

    const strong = await until(
        () => saturation(ada),
        (s) => s > pale + 0.1,
    );
    check("the background shows the force", strong > pale + 0.1, `${pale.toFixed(2)} -> ${strong.toFixed(2)}`);
    for (const colorScheme of ["light", "dark"]) {
        await ada.emulateMedia({ colorScheme });
        await until(
            () => saturation(ada),
            (s) => s > (colorScheme === "light" ? 0.1 : 0.6), // also a dark ground has some
        );
        await nextFrame(ada);
        await ada.screenshot({ path: join(pictures, `plots_${colorScheme}.png`) });
    }
    const choose = (on) =>
        ada.evaluate((checked) => {
            const box = document.getElementById("force-cue");
            if (box.checked !== checked) box.click();
        }, on);
    await choose(false);
    const off = await until(
        () => saturation(ada),
        (s) => s < 0.45,
    );
    check("unless it is switched off", off < 0.45, off.toFixed(2));
    await choose(true);
    await ada.mouse.up();
    await until(
        () => newest(ada, "force_N"),
        (f) => f < 0.005,
    );

    await ada.click("#plots-hold");
    const n = await nSamples(ada);
    const time = await ada.evaluate(() => window.palpate.state.status.sim_time_s);
    await until(
        () => ada.evaluate(() => window.palpate.state.status.sim_time_s),
        (t) => t > time + 0.5,
    );
    check("held plots take no samples", (await nSamples(ada)) === n, String(n));
    const chart = await ada.locator("#plots .u-over").first().boundingBox();
    await ada.mouse.move(chart.x + 0.99 * chart.width, chart.y + 10);
    const shown = await ada.textContent("#plots-time");
    check("the mouse shows the values of a time", /\d+\.\d\d s/.test(shown), shown);
    await ada.screenshot({ path: join(pictures, "plots_hover.png") });

    const csv = await saved(ada, "#plots-csv");
    const lines = csv.bytes.toString().trimEnd().split("\r\n");
    const times = lines.slice(1).map((line) => Number(line.split(",")[0]));
    check(
        "the table has a row of each sample, later from row to row",
        times.length === n && times.every((t, i) => i === 0 || t > times[i - 1]),
        `${csv.name}, ${times.length} rows from ${times[0]} to ${times.at(-1)} s`,
    );
    check(
        "its header has units",
        // in the order in which they were first known
        lines[0].startsWith("time_s,") &&
            ["force_N Ada", "displacement_mm Ada", "depth_mm Ada", "work_mJ Ada", "energy_mJ"].every((name) =>
                lines[0].split(",").includes(name),
            ),
        lines[0],
    );
    const column = lines[0].split(",").indexOf("force_N Ada");
    const largestForce = Math.max(...lines.slice(1).map((line) => Number(line.split(",")[column])));
    check("it has the force that was plotted", largestForce >= pair.plot - 1e-6, `${largestForce} N`);
    const png = await saved(ada, "#plots-png");
    check("the plots are saved as a picture", isPng(png.bytes), `${png.name}, ${png.bytes.length} bytes`);

    const picture = await saved(ada, "#capture-picture");
    writeFileSync(join(pictures, "captured.png"), picture.bytes);
    check("the page is saved as a picture", isPng(picture.bytes), `${picture.name}, ${picture.bytes.length} bytes`);
    const [wide, high] = [16, 20].map((at) => picture.bytes.readUInt32BE(at));
    check("of its own size", wide === 1280 && high === 800, `${wide} x ${high}`);

    await ada.click("#capture-video");
    await ada.waitForSelector("#capture-stop");
    await drag(ada, { x: 1000, y: 150 }, 4, 1, 5);
    // a second at least: on a busy machine nobody sees 0:01
    await ada.waitForFunction(() => !document.getElementById("capture-stop").textContent.includes("0:00"));
    await ada.screenshot({ path: join(pictures, "capture.png") });
    const video = await saved(ada, "#capture-stop");
    writeFileSync(join(pictures, video.name), video.bytes);
    const isVideo = video.name.endsWith(".webm")
        ? video.bytes.readUInt32BE(0) === 0x1a45dfa3 // EBML
        : video.bytes.subarray(4, 8).toString() === "ftyp";
    check("a video is saved", isVideo && video.bytes.length > 1000, `${video.name}, ${video.bytes.length} bytes`);
    const size = await pictureSize(await newPage(browser), video.bytes);
    check("which this browser plays", size === "1280 x 800", size);
    check("and its button is gone", await ada.isHidden("#capture-stop"));

    await ada.setViewportSize({ width: 390, height: 844 });
    await ada.click("#plots-hold");
    await nextFrame(ada);
    await ada.screenshot({ path: join(pictures, "plots_phone.png") });
    await ada.keyboard.press("5");
    check(
        "closed plots keep nothing",
        await ada.evaluate(
            () => window.palpate.plots.panel === null && document.querySelector("#plots canvas") === null,
        ),
    );

    const reduced = await newPage(browser, { reducedMotion: "reduce" });
    await reduced.goto(address);
    await reduced.waitForFunction(() => window.palpate);
    check("who wants less motion begins without the cue", !(await reduced.isChecked("#force-cue")));
    checkConsoles();
});
