// What each visual feature costs a picture: prints a table. In software drawing the processor time of Chromium's drawing
// process is measured, which other load on the machine changes little; with a graphics card the time until the picture is
// finished would be. usage: node effects.mjs BUILD PICTURES [WIDTHxHEIGHT]
import { check, launch, newPage, prepare, run, serve } from "./common.mjs";

const PICTURES = 6; // a sample; the first two of a variant compile its shaders and do not count

/** processor time of the drawing process so far, ms */
async function drawingMs(session) {
    const { processInfo } = await session.send("SystemInfo.getProcessInfo");
    return 1000 * processInfo.filter(({ type }) => type === "GPU").reduce((sum, { cpuTime }) => sum + cpuTime, 0);
}

/** draws so many pictures and waits until they are finished */
const draw = (page, n) =>
    page.evaluate(async (pictures) => {
        const { stage } = window.palpate;
        for (let i = 0; i < pictures; i++) {
            stage.dirty = true;
            stage.draw();
            while (stage.pace.drawing) await new Promise((resolve) => setTimeout(resolve, 2));
        }
    }, n);

/** features in the order in which they are added to a plain body */
const FEATURES = [
    ["physical material, no film", { film: false, defines: [], effects: [] }],
    ["+ wet film", { film: true, defines: [], effects: [] }],
    ["+ mottling, cells and bumps", { film: true, defines: ["TISSUE_PATTERNS"], effects: [] }],
    ["+ vessels", { film: true, defines: ["TISSUE_PATTERNS", "TISSUE_VESSELS"], effects: [] }],
    ["+ shadows", { film: true, defines: ["TISSUE_PATTERNS", "TISSUE_VESSELS"], effects: ["shadow"] }],
    [
        "+ ambient occlusion",
        { film: true, defines: ["TISSUE_PATTERNS", "TISSUE_VESSELS"], effects: ["shadow", "occlusion"] },
    ],
];

const choose = (page, feature) =>
    page.evaluate(async ({ film, defines, effects }) => {
        const { stage, state } = window.palpate;
        for (const { mesh } of state.bodies.values()) {
            mesh.material.clearcoat = film ? mesh.material.userData.wet.clearcoat : 0;
            for (const name of ["TISSUE_PATTERNS", "TISSUE_VESSELS"]) delete mesh.material.defines[name];
            for (const name of defines) mesh.material.defines[name] = "";
            mesh.material.needsUpdate = true;
        }
        stage.effects.choice.on = new Set(effects);
        stage.effects.apply();
        while (effects.includes("occlusion") && !stage.effects.occlusion)
            await new Promise((resolve) => setTimeout(resolve, 5));
    }, feature);

await run(async () => {
    const [width, height] = (process.argv[4] ?? "1280x800").split("x").map(Number);
    const server = await serve(prepare(), 0);
    const browser = await launch();
    const session = await browser.newBrowserCDPSession();
    const page = await newPage(browser, { viewport: { width, height } });
    await page.goto(`http://127.0.0.1:${server.info.port}/?name=Ada&effects=all`);
    await page.waitForFunction(
        () => window.palpate?.state.bodies.size && [...window.palpate.state.bodies.values()][0].shown,
    );
    await page.evaluate(() => {
        const { stage } = window.palpate;
        stage.pace.ready = () => false; // only what is asked for is drawn
        stage.pace.done = function () {
            this.drawing = false;
            return false;
        };
        stage.pace.resolution = 1;
        stage.resize();
    });
    let before = 0;
    console.log(`| feature | ms a picture | more |\n| --- | --- | --- |`);
    for (const [name, feature] of FEATURES) {
        await choose(page, feature);
        await draw(page, 2);
        const start = await drawingMs(session);
        await draw(page, PICTURES);
        const ms = ((await drawingMs(session)) - start) / PICTURES;
        console.log(`| ${name} | ${ms.toFixed(0)} | ${before ? (ms - before).toFixed(0) : ""} |`);
        check(`${name} is drawn`, ms > 0);
        before = ms;
    }
    await page.close();
});
