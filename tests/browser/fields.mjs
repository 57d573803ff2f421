// Colours of fields in a real Chromium: offered as the model gives them, there when asked for, gone when not.
// usage: node fields.mjs BUILD PICTURES [springs|fem]     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { join } from "node:path";
import {
    check,
    finish,
    launch,
    open,
    organPixel,
    palpate,
    pictures,
    prepare,
    scratch,
    serve,
    troubles,
    until,
} from "./common.mjs";

const figures = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate,
            body = [...state.bodies.values()][0];
        return {
            field: state.field,
            range: state.range,
            values: body?.colours.values ?? null,
            mix: body?.colours.uniforms.mix.value,
            components: state.components,
            wanted: state.status?.rows ?? [],
            low: document.querySelector("#legend-low").textContent,
            high: document.querySelector("#legend-high").textContent,
            unit: document.querySelector("#legend-unit").textContent,
            legend: !document.querySelector("#legend").hidden,
            options: [...document.querySelector("#field").options].map((o) => o.value),
            note: document.querySelector("#field-note").textContent,
        };
    });
const choose = (page, name) =>
    page.evaluate((value) => {
        const list = document.querySelector("#field");
        list.value = value;
        list.dispatchEvent(new Event("change"));
    }, name);
const pull = async (page, pixel, steps) => {
    await page.mouse.move(pixel.x, pixel.y);
    await page.mouse.down();
    for (let i = 1; i <= steps; i++) {
        await page.mouse.move(pixel.x + 7 * i, pixel.y - 8 * i);
        await new Promise((r) => setTimeout(r, 60));
    }
};

/** pulls the organ and looks at fields of those that its model gives; pictures are named after it */
async function look(name, scene, wanted, offered = wanted) {
    const server = await serve(scene, 0);
    const browser = await launch();
    try {
        const page = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Ada", { width: 900, height: 600 });
        let f = await figures(page);
        check(
            `${name}: offered is what the model gives`,
            f.options.join() === ["none", ...offered].join(),
            f.options.join(" "),
        );
        check(`${name}: what is missing is said`, (f.note !== "") === !wanted.includes("von_mises"), f.note);
        check(
            `${name}: nobody asked, so there is no row, no legend, no colour`,
            !f.components.includes("field_output") && !f.legend && f.mix === 0 && f.wanted.length === 0,
        );
        const pixel = await until(
            () => organPixel(page),
            (p) => p,
        );
        await pull(page, pixel, 9);
        for (const field of wanted) {
            await choose(page, field);
            f = await until(
                () => figures(page),
                (g) => g.values && g.values.high > 0.3 * g.range.high && g.components.includes("field_output"),
            );
            check(
                `${name}: ${field} comes when asked for, with its row in the plan`,
                f.values !== null && f.components.includes("field_output") && f.legend && f.mix === 1,
                `${f.low} to ${f.high} ${f.unit}, values ${f.values?.low.toPrecision(3)} to ${f.values?.high.toPrecision(3)}`,
            );
            check(
                `${name}: ${field} lies within its legend`,
                f.values &&
                    f.values.high > 0 &&
                    f.values.high <= f.range.high * 1.0001 &&
                    f.values.low >= f.range.low * 0.9999,
            );
            await page.screenshot({ path: join(pictures, `field_${name}_${field}.png`) });
        }
        // a long pull: the range goes along
        await choose(page, "displacement");
        await page.mouse.move(pixel.x + 160, pixel.y - 200, { steps: 8 });
        const before = f;
        f = await until(
            () => figures(page),
            (g) => g.field === "displacement" && g.values && g.values.high > 0.02,
        );
        check(
            `${name}: the range follows a long pull`,
            f.values && f.values.high <= f.range.high * 1.0001 && f.range.high < 2.5 * f.values.high,
            `${f.high} ${f.unit} (before ${before.high} ${before.unit})`,
        );
        await page.screenshot({ path: join(pictures, `field_${name}_long.png`) });
        await page.mouse.up();
        await choose(page, "none");
        f = await until(
            () => figures(page),
            (g) => !g.components.includes("field_output"),
        );
        check(
            `${name}: looked away, the row and the colours are gone`,
            !f.components.includes("field_output") && !f.legend && f.mix === 0 && f.values === null,
            f.rows.join(" "),
        );
        // paused: values come at once all the same
        await page.click("#pause");
        await until(
            () => page.evaluate(() => window.palpate.state.status.paused),
            (p) => p,
        );
        await choose(page, wanted.at(-1));
        f = await until(
            () => figures(page),
            (g) => g.values,
        );
        check(`${name}: a paused body shows its field`, f.values !== null);
        await page.close();
        const metrics = async () =>
            Number(
                /palpate_fields_sent_total (\d+)/.exec(
                    await (await fetch(`http://127.0.0.1:${server.info.port}/metrics`)).text(),
                )[1],
            );
        // the server learns of it when it comes to it
        const sent = await until(
            async () => {
                const before = await metrics();
                await new Promise((r) => setTimeout(r, 1000));
                return { before, after: await metrics() };
            },
            (s) => s.after === s.before,
        );
        check(
            `${name}: nothing is sent once the page is closed`,
            sent.before > 0 && sent.after === sent.before,
            `${sent.after} sent`,
        );
    } finally {
        await browser.close().catch(() => {});
        server.child.kill("SIGTERM");
    }
}

/** the same organ of finite elements; null when this build cannot make it */
function prepareFem() {
    const folder = join(scratch, "fem");
    try {
        execFileSync(
            palpate,
            [
                "prepare",
                "--procedural",
                "--resolution",
                "12",
                "--triangles",
                "12000",
                "--model",
                "fem",
                "-o",
                folder,
                "--quiet",
            ],
            { stdio: "pipe" },
        );
        return join(folder, "scene.json");
    } catch (error) {
        console.log(
            `     no scene of finite elements: ${
                String(error.stderr ?? error)
                    .trim()
                    .split("\n")[0]
            }`,
        );
        return null;
    }
}

try {
    const only = process.argv[4];
    if (only !== "fem") await look("springs", prepare(), ["displacement", "stiffness"]);
    const fem = only === "springs" ? null : prepareFem();
    if (fem)
        await look(
            "fem",
            fem,
            ["displacement", "von_mises", "energy"],
            ["displacement", "von_mises", "energy", "strain", "distortion"],
        );
    check(
        "nothing was complained of in the browser's console",
        troubles.length === 0,
        troubles.slice(0, 3).join(" | "),
    );
} catch (error) {
    check("the test ran to its end", false, String(error.stack ?? error));
}
finish();
