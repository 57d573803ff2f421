// Shared by the browser tests: arguments, a small scene, a server on it, real Chromium pages, conditions waited for.
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

let passed = 0,
    failed = 0;
export function check(what, good, figure = "") {
    console.log(`${good ? "ok  " : "FAIL"} ${what} ${figure}`);
    if (good) passed++;
    else failed++;
}
export function finish() {
    rmSync(scratch, { recursive: true, force: true });
    console.log(`${passed} passed, ${failed} failed`);
    process.exit(failed ? 1 : 0);
}

const SCAN = "/usr/share/doc/libcgal-dev/data.tar.gz",
    LIVER = "data/images/liver.inr.gz";

/** the CT's liver, else (said) our own organ; coarse, so that it steps quickly beside two software renderers */
export function prepare() {
    const folder = join(scratch, "organ"),
        size = ["--resolution", "14", "--triangles", "12000", "-o", folder, "--quiet"];
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
        console.log("     the scan is not there: our own organ serves");
        execFileSync(palpate, ["prepare", "--procedural", ...size]);
    }
    return join(folder, "scene.json");
}

/** starts the server, resolves with its first JSON line */
export function serve(scene, port, more = []) {
    const child = spawn(palpate, ["serve", scene, "--port", String(port), "--json", ...more], {
        stdio: ["ignore", "pipe", "inherit"],
    });
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
/** what the pages complained of in their consoles */
export const troubles = [];
export const launch = () =>
    chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: FLAGS });

/** a page that shows the organ */
export async function open(browser, address, name, viewport) {
    const page = await browser.newPage({ viewport });
    page.setDefaultTimeout(180000);
    page.on("console", (m) => m.type() === "error" && troubles.push(`${name}: ${m.text()}`));
    page.on("pageerror", (e) => troubles.push(`${name}: ${e.message}`));
    await page.goto(`${address}?name=${name}`);
    await page.waitForFunction(() => window.palpate?.state.bodies.size > 0 && window.palpate.state.status);
    return page;
}

/** largest displacement of what a page shows, m */
export const moved = (page) =>
    page.evaluate(() => Math.max(...[...window.palpate.state.bodies.values()].map((b) => b.maxDisplacement())));

/** a pixel on the organ near the middle of the picture */
export const organPixel = (page) =>
    page.evaluate(() => {
        const { stage, input } = window.palpate,
            w = innerWidth,
            h = innerHeight;
        for (let r = 0; r < 0.4; r += 0.04)
            for (let a = 0; a < 6.28; a += 0.5) {
                const x = w * (0.5 + r * Math.cos(a)),
                    y = h * (0.5 + r * Math.sin(a));
                if (document.elementFromPoint(x, y)?.id === "view" && input.pick(stage.ray(x, y))) return { x, y };
            }
        return null;
    });

/** waits until test(await read()) or the time is over, gives the last value; long, for machines whose cores others have too */
export async function until(read, test, ms = 90000) {
    const end = Date.now() + ms;
    for (;;) {
        const value = await read();
        if (test(value) || Date.now() > end) return value;
        await new Promise((r) => setTimeout(r, 60));
    }
}
