// The views of one page: an endoscope, saved views, two views side by side, stereo and a headset.
// usage: node views.mjs BUILD PICTURES     ends with "N passed, N failed"
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    drag,
    launch,
    nextFrame,
    open,
    organPixel,
    pictures,
    prepare,
    run,
    serve,
    settled,
    until,
} from "./common.mjs";

/** the picture as it is once everything is drawn */
async function picture(page, name) {
    const was = await page.evaluate(() => {
        const { stage } = window.palpate;
        const was = stage.pace.resolution;
        stage.pace.resolution = 1; // judged as a graphics card draws it
        stage.resize();
        return was;
    });
    await until(() => page.evaluate(() => !window.palpate.stage.dirty && window.palpate.stage.ready()));
    await page.screenshot({ path: join(pictures, `${name}.png`) });
    await page.evaluate((r) => (window.palpate.stage.pace.resolution = r), was);
}

/** brightness of the canvas at shares of its size, 0 to 255 */
const brightness = (page, points) =>
    page.evaluate((at) => {
        const { stage } = window.palpate;
        const gl = stage.renderer.getContext();
        stage.dirty = true;
        stage.draw(); // what is drawn can be read in the same turn
        return at.map(([x, y]) => {
            const pixel = new Uint8Array(4);
            const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
            gl.readPixels(Math.floor(x * w), Math.floor((1 - y) * h), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
            return Math.round((pixel[0] + pixel[1] + pixel[2]) / 3);
        });
    }, points);

/** the value of an expression of the page's parts */
const value = (page, expression) =>
    page.evaluate(
        (e) => new Function("palpate", `const {stage, state, input, views} = palpate; return ${e}`)(window.palpate),
        expression,
    );

/** how far from a pixel the point is drawn that a ray through it hits, pixels */
const pickingError = (page, pixel) =>
    page.evaluate(({ x, y }) => {
        const { stage, input } = window.palpate;
        stage.choose(x);
        const hit = input.pick(stage.ray(x, y));
        const p = hit && stage.project(hit.point);
        return p ? Math.hypot(p.x - x, p.y - y) : NaN;
    }, pixel);

/** pulls at a pixel until the organ follows, and lets go @returns how far it was pulled, m */
async function pull(page, pixel) {
    const before = await displacement(page);
    await page.mouse.move(pixel.x, pixel.y);
    await page.mouse.down();
    await until(() => value(page, "state.ownToolState()?.grasps")); // a slow server grasps late
    await drag(page, pixel, 5, -6, 10);
    const pulled = await until(
        () => displacement(page),
        (m) => m > before + 0.008,
    );
    await page.mouse.up();
    await until(
        () => displacement(page),
        (m) => m < before + 0.004,
    );
    return pulled - before;
}

async function endoscope(page) {
    const lit = await brightness(page, [[0.02, 0.5]]);
    await page.keyboard.press("e");
    await until(() => value(page, "views.scope !== null"));
    const [corner, middle] = await brightness(page, [
        [0.02, 0.5],
        [0.45, 0.5],
    ]);
    check("an endoscope has a round picture in a dark surround", corner < 12 && middle > 25, `${corner} ${middle}`);
    await page.screenshot({ path: join(pictures, "views_hint.png") });
    await page.evaluate(() => (document.getElementById("view-hint").hidden = true));
    await picture(page, "views_endoscope");
    const pixel = await organPixel(page);
    const error = await pickingError(page, pixel);
    check("a ray through a pixel of it meets what is drawn there", error < 0.5, `${error.toFixed(3)} px`);
    const pulled = await pull(page, pixel);
    check("the organ can be pulled in it", pulled > 0.008, `${(1000 * pulled).toFixed(1)} mm`);

    const yaw = await value(page, "views.scope.pose.yaw");
    await page.mouse.move(40, 400);
    await page.mouse.down();
    await drag(page, { x: 40, y: 400 }, 6, 0, 5);
    const held = await value(page, "state.target !== null");
    await page.mouse.up();
    const turned = (await value(page, "views.scope.pose.yaw")) - yaw;
    check("a drag on the surround turns it about its port", turned > 0.01 && !held, `${turned.toFixed(3)} rad`);
    const depth = await value(page, "views.scope.pose.depth");
    await page.mouse.wheel(0, -120);
    await until(async () => (await value(page, "views.scope.pose.depth")) > depth);
    check("the wheel inserts it", (await value(page, "views.scope.pose.depth")) > depth);
    for (let i = 0; i < 4; i++) {
        const before = await value(page, "views.scope.pose.depth");
        await page.evaluate(() => window.palpate.stage.zoom(0.5));
        if ((await value(page, "views.scope.pose.depth")) === before) break;
    }
    const ahead = await value(
        page,
        "(({ pose }) => views.scope.reach(stage.camera.position.toArray(), stage.camera.getWorldDirection(stage.camera.up.clone()).toArray()) / stage.size)(views.scope)",
    );
    check("but not into tissue", ahead > 0.05, `${ahead.toFixed(3)} sizes before it`);

    await page.click("#view-toggle");
    await page.click("#view-angled");
    await page.screenshot({ path: join(pictures, "views_menu.png") });
    const angle = await value(
        page,
        "stage.placeCameras() ?? stage.camera.getWorldDirection(stage.centre.clone()).angleTo(stage.camera.position.clone().sub(stage.centre.clone().fromArray(views.scope.pose.port)))",
    );
    check("angled optics look 30 degrees aside", Math.abs(angle - Math.PI / 6) < 1e-3, String(angle));
    await page.keyboard.press("Escape");
    check("Escape closes the menu", await page.locator("#view-menu").isHidden());
    await picture(page, "views_endoscope_30");
    const at = await pickingError(page, await organPixel(page));
    check("and picking is exact in them", at < 0.5, `${at.toFixed(3)} px`);
    await page.keyboard.press("e");
    await until(() => value(page, "views.scope === null"));
    const again = await brightness(page, [[0.02, 0.5]]);
    check("E leaves the endoscope, and the light is as before", Math.abs(again[0] - lit[0]) < 3, `${lit} ${again}`);
}

async function savedViews(page) {
    const camera = () => value(page, "[...stage.placeCameras() ?? stage.camera.position.toArray()]");
    const home = await camera();
    await page.keyboard.press("v");
    await page.click("#view-toggle");
    await page.click("#view-standard button:nth-child(5)");
    const up = () => value(page, "stage.camera.position.clone().sub(stage.centre).normalize().dot(stage.up)");
    check("a standard view looks from above", (await until(up, (c) => c > 0.9999)) > 0.9999);
    await page.fill("#view-name", "From above");
    await page.keyboard.press("Enter");
    const names = await page.locator("#view-saved button:first-child").allTextContents();
    check("two views are saved, by number and by name", names.join() === "View 1,From above", names.join());
    await page.screenshot({ path: join(pictures, "views_saved.png") });
    await page.keyboard.press("ArrowUp");
    await page.keyboard.press("ArrowUp");
    const focused = await page.evaluate(() => document.activeElement?.textContent);
    check("arrow keys go through the menu", focused === "From above", focused);
    await page.keyboard.press("Escape");
    check("and Escape leaves it", (await page.evaluate(() => document.activeElement?.id)) === "view-toggle");
    // the way there, picture by picture
    const way = await page.evaluate(async () => {
        const { stage } = window.palpate;
        const heights = [];
        dispatchEvent(new KeyboardEvent("keydown", { key: "!", code: "Digit1", shiftKey: true }));
        for (let i = 0; i < 300 && !(heights.length > 3 && heights.at(-1) === heights.at(-3)); i++) {
            await new Promise(requestAnimationFrame);
            stage.placeCameras();
            heights.push(stage.camera.position.clone().sub(stage.centre).dot(stage.up));
        }
        return heights;
    });
    check(
        "the way to a saved view is even",
        way.every((h, i) => i === 0 || h <= way[i - 1] + 1e-9),
        `${way.length} pictures`,
    );
    const back = await camera();
    const off = Math.hypot(...back.map((c, k) => c - home[k]));
    check("and ends there", off < 1e-9, `${off} m`);
    await page.reload();
    await page.waitForFunction(() => window.palpate?.state.bodies.size > 0 && window.palpate.state.status);
    await page.click("#view-toggle");
    const kept = await page.locator("#view-saved button:first-child").allTextContents();
    check("saved views outlast the page", kept.join() === names.join(), kept.join());
    await page.click("#view-saved li:nth-child(2) button:nth-child(2)");
    check("a saved view can be deleted", (await page.locator("#view-saved li").count()) === 1);
    await page.keyboard.press("Escape");
}

await run(async () => {
    const server = await serve(prepare(), 0);
    const browser = await launch();
    const page = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Ada", { width: 1280, height: 800 });
    await settled(page, () => 0.0005, 1);
    await endoscope(page);
    await savedViews(page);
    checkConsoles();
});
