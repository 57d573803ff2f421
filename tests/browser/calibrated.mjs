// A calibrated scene in a real Chromium: its error stands beside its name, and it is pressed and moves like any other.
// usage: node calibrated.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import {
    check,
    finish,
    launch,
    moved,
    open,
    organPixel,
    palpate,
    pictures,
    scratch,
    serve,
    troubles,
    until,
} from "./common.mjs";

const problem = join(dirname(fileURLToPath(import.meta.url)), "../../deploy/problems/gear.json"),
    scene = join(scratch, "gear.json");
let server, browser;
try {
    const said = JSON.parse(
        execFileSync(palpate, ["calibrate", problem, "--case", "twist", "--resolution", "12", "-o", scene, "--json"], {
            encoding: "utf8",
        }),
    );
    check(
        "calibrated",
        said.error_percent < 3 && said.error_percent < said.start_percent,
        `${said.start_percent} -> ${said.error_percent} %`,
    );
    server = await serve(scene, 0);
    browser = await launch();
    const page = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Ada", { width: 900, height: 600 });
    const shown = await page.evaluate(() => {
        const text = document.querySelector("#accuracy"),
            title = document.querySelector("#title").getBoundingClientRect(),
            box = text.getBoundingClientRect();
        return { text: text.textContent, seen: !text.hidden && box.height > 0, gap: box.top - title.bottom };
    });
    const figure = Number(/^([\d.]+) %/.exec(shown.text)?.[1]);
    check(
        "the error stands beside the name",
        shown.seen && Math.abs(shown.gap) < 20,
        `"${shown.text}", ${shown.gap} px below`,
    );
    check(
        "it is the error that was found",
        Math.abs(figure - said.error_percent) <= 0.06 * said.error_percent,
        `${figure} %`,
    );
    const rest = await moved(page),
        pixel = await until(
            () => organPixel(page),
            (p) => p,
        );
    check("it rests", rest < 1e-4, `${1000 * rest} mm`);
    await page.mouse.move(pixel.x, pixel.y);
    await page.mouse.down();
    for (let i = 1; i <= 12; i++) {
        await page.mouse.move(pixel.x + 8 * i, pixel.y - 4 * i);
        await new Promise((r) => setTimeout(r, 60));
    }
    const most = await until(
        () => moved(page),
        (m) => m > 0.02,
        90000,
    );
    check("it follows the hand", most > 0.02 && most < 3, `${1000 * most} mm`);
    await page.screenshot({ path: join(pictures, "calibrated.png") });
    await page.mouse.up();
    check("the page complains of nothing", troubles.length === 0, troubles.join(" | "));
} catch (error) {
    check("the test ran to its end", false, String(error.stack ?? error));
} finally {
    await browser?.close().catch(() => {});
    server?.child.kill("SIGTERM");
}
finish();
