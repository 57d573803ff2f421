// Shared by the browser tests: arguments, a small scene, its server, real Chromium pages, waiting for conditions.
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const [build] = process.argv.slice(2);
export const pictures = process.argv[3];
export const program = (name) => join(build, "release", "bin", name);
export const palpate = program("palpate");
export const scratch = mkdtempSync(join(tmpdir(), "palpate-browser-"));
const { chromium } = createRequire(join(build, "viewer_packages", "package.json"))("playwright-core");
mkdirSync(pictures, { recursive: true });

let passed = 0;
let failed = 0;
export function check(what, good, figure = "") {
    console.log(`${good ? "ok  " : "FAIL"} ${what} ${figure}`);
    if (good) passed++;
    else failed++;
}
/** error messages in the consoles of all pages */
export const consoleErrors = [];
export function checkConsoles(errors = consoleErrors) {
    check("the consoles of the pages have no errors", errors.length === 0, errors.slice(0, 3).join(" | "));
}

const browsers = [];
const children = [];
/** ends this child process with the test */
export function endWithTest(child) {
    children.push(child);
    return child;
}
/** runs a test, closes what it has started, and ends the program with the count of checks */
export async function run(test) {
    try {
        await test();
    } catch (error) {
        check("the test runs to its end", false, String(error.stack ?? error));
    } finally {
        for (const browser of browsers) await browser.close().catch(() => {});
        for (const child of children) child.kill("SIGTERM");
    }
    rmSync(scratch, { recursive: true, force: true });
    console.log(`${passed} passed, ${failed} failed`);
    process.exit(failed ? 1 : 0);
}

const SCAN = "/usr/share/doc/libcgal-dev/data.tar.gz";
const LIVER = "data/images/liver.inr.gz";

/** scene of the liver of the CT, else of the procedural organ; coarse, so that it is fast beside two software renderers */
export function prepare() {
    const folder = join(scratch, "organ");
    const size = ["--resolution", "14", "--triangles", "12000", "--axes", "LPS", "-o", folder, "--quiet"];
    if (existsSync(SCAN)) {
        execFileSync("tar", ["-xzf", SCAN, "-C", scratch, LIVER]);
        execFileSync(palpate, [
            "prepare",
            join(scratch, LIVER),
            "--label",
            "255",
            "--up",
            "-y",
            "--hold",
            "12",
            "--title",
            "Liver, from an abdominal CT",
            ...size,
        ]);
    } else {
        console.log("     the scan is missing: the procedural organ replaces it");
        execFileSync(palpate, ["prepare", "--procedural", ...size]);
    }
    return join(folder, "scene.json");
}

/** starts a server, to which everybody may come unless `admission` says otherwise; info: its first JSON line */
export function serve(scene, port, more = [], admission = ["--open"]) {
    const child = endWithTest(
        spawn(palpate, ["serve", scene, "--port", String(port), "--json", ...admission, ...more], {
            stdio: ["ignore", "pipe", "inherit"],
        }),
    );
    return new Promise((resolve, reject) => {
        let text = "";
        child.stdout.on("data", (bytes) => {
            text += bytes;
            if (text.includes("\n")) resolve({ child, info: JSON.parse(text.split("\n")[0]) });
        });
        child.on("exit", (code) => reject(new Error(`palpate serve ended with ${code}`)));
    });
}

const FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
];
export async function launch() {
    const browser = await chromium.launch({
        executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
        args: FLAGS,
    });
    browsers.push(browser);
    return browser;
}

/** an empty page; its limit only ends what hangs: a busy machine takes more than the 30 s of Playwright for a page */
export async function newPage(browser, options = {}) {
    const page = await browser.newPage(options);
    page.setDefaultTimeout(300000);
    return page;
}

/** a page that shows the organ */
export async function open(browser, address, name, viewport) {
    const page = await newPage(browser, { viewport });
    page.on("console", (m) => m.type() === "error" && consoleErrors.push(`${name}: ${m.text()}`));
    page.on("pageerror", (e) => consoleErrors.push(`${name}: ${e.message}`));
    const [place, ticket] = address.split("#");
    await page.goto(`${place}?name=${name}${ticket ? "#" + ticket : ""}`);
    await page.waitForFunction(() => window.palpate?.state.bodies.size > 0 && window.palpate.state.status);
    return page;
}

/** largest displacement that a page shows, m */
export const displacement = (page) =>
    page.evaluate(() => Math.max(...[...window.palpate.state.bodies.values()].map((b) => b.maxDisplacement())));

/** mean colour of a few drawn pixels around a place of the scene @param {number[]} place */
export const colourAt = (page, place) =>
    page.evaluate((at) => {
        const { stage } = window.palpate;
        stage.dirty = true;
        stage.draw();
        const gl = stage.renderer.getContext();
        const { x, y } = stage.project(stage.target.clone().fromArray(at));
        const ratio = stage.renderer.getPixelRatio();
        const bytes = new Uint8Array(4 * 9);
        gl.readPixels(
            Math.round(x * ratio) - 1,
            gl.drawingBufferHeight - Math.round(y * ratio) - 1,
            3,
            3,
            gl.RGBA,
            gl.UNSIGNED_BYTE,
            bytes,
        );
        return [0, 1, 2].map((c) => bytes.reduce((sum, v, k) => sum + (k % 4 === c ? v / 9 : 0), 0));
    }, place);

/** a pixel on the organ near the middle of the picture */
export const organPixel = (page) =>
    page.evaluate(() => {
        const { stage, input } = window.palpate;
        const w = innerWidth;
        const h = innerHeight;
        for (let r = 0; r < 0.4; r += 0.04)
            for (let a = 0; a < 6.28; a += 0.5) {
                const x = w * (0.5 + r * Math.cos(a));
                const y = h * (0.5 + r * Math.sin(a));
                if (document.elementFromPoint(x, y)?.id === "view" && input.pick(stage.ray(x, y))) return { x, y };
            }
        return null;
    });

/** the next picture of the organ is drawn; one that moves is never drawn to an end */
export async function drawn(page) {
    const before = await page.evaluate(() => {
        const { stage } = window.palpate;
        stage.dirty = true;
        return stage.pictures;
    });
    await until(() =>
        page.evaluate((n) => {
            const { stage } = window.palpate;
            return stage.pictures > n && !stage.pace.drawing;
        }, before),
    );
}

const openPage = () => browsers.flatMap((b) => b.contexts().flatMap((c) => c.pages())).find((p) => !p.isClosed());
/** the next picture of a page */
export const nextFrame = (page) => page.evaluate(() => new Promise(requestAnimationFrame));

/**
 * waits until test(await read()) holds, from picture to picture of any page, and returns the last value; the limit only
 * ends what hangs
 */
export async function until(read, test = Boolean, ms = 300000) {
    const end = Date.now() + ms;
    for (;;) {
        const value = await read();
        if (test(value) || Date.now() > end) return value;
        await nextFrame(openPage());
    }
}

/** displacement, once it changes by less than tolerance(m) over so many seconds of the session */
export async function settled(page, tolerance, seconds) {
    let last = { time: -Infinity, m: NaN };
    const now = await until(async () => {
        const time = await page.evaluate(() => window.palpate.state.status.sim_time_s);
        if (time < last.time + seconds) return null;
        const before = last;
        last = { time, m: await displacement(page) };
        return Math.abs(last.m - before.m) < tolerance(last.m) ? last : null;
    });
    return now?.m ?? NaN;
}

/**
 * presses the mouse at a pixel until the tool grasps there: dragged at once, a busy machine's tool grasps what is elsewhere by
 * then
 */
export async function grasp(page, pixel) {
    await page.mouse.move(pixel.x, pixel.y);
    await page.mouse.down();
    await until(() => page.evaluate(() => window.palpate.state.ownToolState()?.grasps));
}

/** moves the pressed mouse from a pixel in steps, a picture each */
export async function drag(page, pixel, dx, dy, steps) {
    for (let i = 1; i <= steps; i++) {
        await page.mouse.move(pixel.x + dx * i, pixel.y + dy * i);
        await nextFrame(page);
    }
}
