// A calibrated scene: its error is displayed below its title, and it is pulled like any other.
// usage: node calibrated.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import {
    check,
    checkConsoles,
    displacement,
    drag,
    grasp,
    launch,
    open,
    organPixel,
    palpate,
    pictures,
    run,
    scratch,
    serve,
    until,
} from "./common.mjs";

const problem = join(dirname(fileURLToPath(import.meta.url)), "../../deploy/problems/gear.json");
const scene = join(scratch, "gear.json");
await run(async () => {
    const result = JSON.parse(
        execFileSync(palpate, ["calibrate", problem, "--case", "twist", "--resolution", "12", "-o", scene, "--json"], {
            encoding: "utf8",
        }),
    );
    check(
        "calibration reduces the error below 3 %",
        result.error_percent < 3 && result.error_percent < result.start_percent,
        `${result.start_percent} -> ${result.error_percent} %`,
    );
    const server = await serve(scene, 0);
    const browser = await launch();
    const page = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Ada", { width: 900, height: 600 });
    const shown = await page.evaluate(() => {
        const text = document.querySelector("#accuracy");
        const title = document.querySelector("#title").getBoundingClientRect();
        const box = text.getBoundingClientRect();
        return { text: text.textContent, seen: !text.hidden && box.height > 0, gap: box.top - title.bottom };
    });
    const figure = Number(/^([\d.]+) %/.exec(shown.text)?.[1]);
    check(
        "the error is displayed below the title",
        shown.seen && Math.abs(shown.gap) < 20,
        `"${shown.text}", ${shown.gap} px below`,
    );
    check(
        "the displayed error is that of the calibration",
        Math.abs(figure - result.error_percent) <= 0.06 * result.error_percent,
        `${figure} %`,
    );
    const rest = await displacement(page);
    const pixel = await until(() => organPixel(page));
    check("the body is at rest", rest < 1e-4, `${1000 * rest} mm`);
    await grasp(page, pixel);
    await drag(page, pixel, 8, -4, 12);
    const max = await until(
        () => displacement(page),
        (m) => m > 0.02,
    );
    check("the body follows the tool", max > 0.02 && max < 3, `${1000 * max} mm`);
    await page.screenshot({ path: join(pictures, "calibrated.png") });
    await page.mouse.up();
    checkConsoles();
});
