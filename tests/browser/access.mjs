// For every hand and every page: no serious finding of axe-core, the tool by keyboard, another language, panels that
// leave the organ free on a telephone, on its side and at 200 %.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    launch,
    nextFrame,
    open,
    pictures,
    prepare,
    run,
    serve,
    until,
} from "./common.mjs";

const AXE = join(process.argv[2], "viewer_packages", "node_modules", "axe-core", "axe.min.js");
/** findings of axe-core that keep people out: "rule: element, element" */
async function findings(page) {
    await page.evaluate(readFileSync(AXE, "utf8"));
    return page.evaluate(async () => {
        const { violations } = await window.axe.run(document);
        return violations
            .filter(({ impact }) => impact === "serious" || impact === "critical")
            .map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.target.join(" ")).join(", ")}`);
    });
}

/** how far the organ's picture reaches under open panels, or out of the page, pixels */
const hidden = (page) =>
    page.evaluate(() => {
        const { stage, state } = window.palpate;
        let [left, right, top, bottom] = [Infinity, -Infinity, Infinity, -Infinity];
        for (const body of state.bodies.values()) {
            const x = body.surface().positions;
            const at = stage.target.clone();
            for (let i = 0; i < x.length; i += 3) {
                const p = stage.project(at.set(x[i], x[i + 1], x[i + 2]));
                if (!p) continue;
                [left, right] = [Math.min(left, p.x), Math.max(right, p.x)];
                [top, bottom] = [Math.min(top, p.y), Math.max(bottom, p.y)];
            }
        }
        let far = Math.max(-left, right - innerWidth, -top, bottom - innerHeight);
        for (const panel of document.querySelectorAll("aside:not([hidden])")) {
            const box = panel.getBoundingClientRect();
            const across = Math.min(right, box.right) - Math.max(left, box.left);
            const down = Math.min(bottom, box.bottom) - Math.max(top, box.top);
            if (across > 0 && down > 0) far = Math.max(far, Math.min(across, down));
        }
        return Math.round(far);
    });

await run(async () => {
    const server = await serve(prepare(), 0);
    const browser = await launch();
    const ada = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Ada", { width: 1280, height: 800 });
    await until(() => ada.evaluate(() => window.palpate.input.enabled));

    // a browser that draws slowly says so, once
    await ada.evaluate(() => {
        const notice = document.getElementById("notice");
        window.noticed = [notice.textContent];
        new MutationObserver(() => window.noticed.push(notice.textContent)).observe(notice, { childList: true });
        window.palpate.stage.pace.struggles = true;
    });
    const slow = await until(() => ada.evaluate(() => window.noticed.find((n) => n.startsWith("This browser draws"))));
    check("a browser that draws slowly says so", /pictures a second: \d/.test(slow ?? ""), slow);

    // who has clicked a button goes on with the keys of the page
    await ada.click("#mesh");
    await ada.keyboard.press("Space");
    const paused = await until(() => ada.evaluate(() => window.palpate.state.status?.paused));
    const meshed = await ada.getAttribute("#mesh", "aria-pressed");
    check("Space pauses after a click, and does not click once more", paused === true && meshed === "true");
    await ada.click("#mesh");
    await ada.keyboard.press("Space");
    await until(() => ada.evaluate(() => !window.palpate.state.status?.paused));

    // the tool by keyboard, without a touch of the mouse
    const rest = await displacement(ada);
    await ada.focus("#view");
    await ada.keyboard.press("Enter");
    const grasps = await until(() => ada.evaluate(() => window.palpate.state.ownToolState()?.grasps));
    check("Enter puts the tool on the organ, which it grasps", grasps === true);
    for (let i = 0; i < 12; i++) {
        await ada.keyboard.press("ArrowUp");
        await nextFrame(ada);
    }
    const pulled = await until(
        () => displacement(ada),
        (m) => m > rest + 0.01,
    );
    check("arrow keys pull", pulled > rest + 0.01, `${(1000 * pulled).toFixed(1)} mm`);
    await ada.keyboard.press("Escape");
    const away = await until(() => ada.evaluate(() => window.palpate.state.ownToolState()?.away));
    check("Escape lets go", away === true);

    await ada.click("#panel-toggle");
    await ada.check("#expert");
    await until(() => ada.locator("#figures dt").count());
    let found = await findings(ada);
    check("axe-core finds nothing serious on the page with its panel", found.length === 0, found.join(" | "));
    const shown = await ada.locator("#figures dt.expert").first().isVisible();
    await ada.uncheck("#expert");
    const kept = await ada.locator("#figures dt.expert").first().isVisible();
    check("figures for makers of scenes show on demand", shown && !kept);
    const names = await ada
        .locator("#components tr")
        .evaluateAll((rows) => rows.map((row) => [row.title, row.innerText]));
    const push = names.find(([title]) => title.startsWith("tool_push"));
    check("effects have plain names, with that of the code as tooltip", /^Contact/.test(push?.[1] ?? ""), String(push));
    await ada.keyboard.press("Escape");
    check("Escape closes the panel", await ada.locator("#panel").isHidden());
    await ada.keyboard.press("5");
    await ada.waitForSelector("#plots canvas");
    found = await findings(ada);
    check("nor on the page with its plots", found.length === 0, found.join(" | "));
    await ada.keyboard.press("Escape");
    await ada.keyboard.press("?");
    found = await findings(ada);
    check("nor in the help", found.length === 0, found.join(" | "));
    check("where About names the organ's source", (await ada.textContent("#about-source")) !== "");
    await ada.keyboard.press("Escape");

    // pages of other shapes
    for (const [name, width, height] of [
        ["a narrow window", 900, 600],
        ["a telephone", 390, 844],
        ["a telephone on its side", 844, 390],
        ["a page at 200 %", 640, 360],
    ]) {
        await ada.setViewportSize({ width, height });
        const outside = await ada.evaluate(() =>
            [...document.querySelectorAll("#tools *")]
                .map((e) => e.getBoundingClientRect())
                .filter((r) => r.width && (r.left < 0 || r.right > innerWidth || r.bottom > innerHeight)),
        );
        check(`${name}: all buttons are on the page`, outside.length === 0, JSON.stringify(outside));
        for (const id of ["panel-toggle", "accuracy-toggle", "plots-toggle", "inside-toggle"]) {
            await ada.click(`#${id}`);
            // loaded when they first open
            if (id === "plots-toggle") await ada.waitForSelector("#plots canvas");
            await nextFrame(ada);
            await nextFrame(ada);
            const px = await hidden(ada);
            check(`${name}: the organ is free beside what ${id} opens`, px <= 8, `${px} px hidden`);
            await ada.screenshot({ path: join(pictures, `access_${width}_${id}.png`) });
            await ada.keyboard.press("Escape");
        }
    }
    const small = await ada.evaluate(() =>
        [...document.querySelectorAll("button, input, select, a")]
            .filter((e) => e.offsetWidth && !e.closest("#playback-marks"))
            .filter((e) => Math.min(e.offsetWidth, e.offsetHeight) < 24)
            .map((e) => e.id || e.outerHTML.slice(0, 40)),
    );
    check("targets are at least 24 pixels high and wide", small.length === 0, small.join());

    await ada.goto(`http://127.0.0.1:${server.info.port}/?lang=de`);
    await ada.waitForFunction(() => window.palpate?.state.bodies.size > 0);
    const german = await ada.evaluate(() => [document.documentElement.lang, document.getElementById("hint").innerText]);
    check("the page speaks German", german[0] === "de" && german[1].startsWith("Ziehen Sie"), german.join());
    const english = await ada.evaluate(() => document.body.innerText.match(/\b(the|drag|pull|reset|mesh)\b/i)?.[0]);
    check("and nothing else", english === undefined, english);
    checkConsoles();
});
