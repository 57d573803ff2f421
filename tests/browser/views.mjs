// The views of one page: an endoscope, saved views, two views side by side, stereo and a headset.
// usage: node views.mjs BUILD PICTURES [sharp]     ends with "N passed, N failed"
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    drag,
    drawn,
    grasp,
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

/** sharp: pictures as a graphics card draws them; software needs seconds for each */
const sharp = process.argv[4] === "sharp";

/** the picture as it is once everything is drawn */
async function picture(page, name) {
    if (sharp)
        await page.evaluate(() => {
            const { stage } = window.palpate;
            stage.pace.resolution = 1;
            stage.resize();
        });
    await drawn(page);
    await page.screenshot({ path: join(pictures, `${name}.png`) });
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
        stage.choose({ clientX: x, clientY: y });
        const hit = input.pick(stage.ray(x, y));
        const p = hit && stage.project(hit.point);
        return p ? Math.hypot(p.x - x, p.y - y) : NaN;
    }, pixel);

/** pulls at a pixel until the organ follows, and lets go @returns how far it was pulled, m */
async function pull(page, pixel, name) {
    const before = await displacement(page);
    await grasp(page, pixel);
    await drag(page, pixel, 5, -6, 10);
    const pulled = await until(
        () => displacement(page),
        (m) => m > before + 0.008,
    );
    if (name) await picture(page, name);
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
    const before = page.viewportSize();
    for (const [width, height] of [
        [1280, 720],
        [900, 600],
        [390, 844],
    ]) {
        await page.setViewportSize({ width, height });
        const covered = await page.evaluate(() => {
            const ids = ["notice", "view-hint", "force", "head", "state", "tools"];
            const elements = ids.map((id) => document.getElementById(id));
            const notice = elements[0];
            const was = elements.map((element) => element.hidden);
            for (const element of elements) element.hidden = false;
            notice.textContent = "This browser draws 4 pictures a second. The simulation itself is not slower.";
            const boxes = elements.map((element) => element.getBoundingClientRect());
            elements.forEach((element, i) => (element.hidden = was[i]));
            notice.textContent = "";
            const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
            return ids.flatMap((id, i) =>
                ids.filter((_, k) => k < i && meet(boxes[i], boxes[k])).map((other) => `${other} ${id}`),
            );
        });
        check(`at ${width}x${height} notice, hint, force and title stand apart`, covered.length === 0, covered.join());
    }
    await page.setViewportSize(before);
    await page.evaluate(() => (document.getElementById("view-hint").hidden = true));
    await picture(page, "views_endoscope");
    const pixel = await organPixel(page);
    const error = await pickingError(page, pixel);
    check("a ray through a pixel of it meets what is drawn there", error < 0.5, `${error.toFixed(3)} px`);
    const pulled = await pull(page, pixel, "views_endoscope_pull");
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
        "stage.placeCameras() ?? (({ pose }) => views.scope.reach(stage.camera.position.toArray(), stage.camera.getWorldDirection(stage.camera.up.clone()).toArray()) / stage.size)(views.scope)",
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
    // the patient of the scan lies on the back: the front is up; without one "above" is
    const side = (await value(page, "state.hello.anatomical_axes")) ? 1 : 5;
    await page.click(`#view-standard button:nth-child(${side})`);
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

/** a pixel on the organ in a box of shares of the page */
const pixelIn = (page, [left, top, right, bottom]) =>
    page.evaluate(
        ([left, top, right, bottom]) => {
            const { stage, input } = window.palpate;
            for (let i = 1; i < 20; i++)
                for (let j = 1; j < 20; j++) {
                    const x = innerWidth * (left + ((right - left) * ((7 * i) % 20)) / 20);
                    const y = innerHeight * (top + ((bottom - top) * ((7 * j) % 20)) / 20);
                    stage.choose({ clientX: x, clientY: y });
                    if (
                        document.elementFromPoint(x, y)?.id === "view" &&
                        stage.sees(x, y) &&
                        input.pick(stage.ray(x, y))
                    )
                        return { x, y };
                }
            return null;
        },
        [left, top, right, bottom],
    );

async function splitView(page) {
    await page.click("#view-toggle");
    await page.click("#view-split");
    await until(() => value(page, "views.split && stage.panes.length === 2"));
    await page.keyboard.press("Escape");
    const [free, dark] = await brightness(page, [
        [0.01, 0.5],
        [0.99, 0.95],
    ]);
    check("two views stand side by side", free > 100 && dark < 12, `${free} ${dark}`);
    await picture(page, "views_split");
    const kinds = [];
    for (const box of [
        [0, 0.2, 0.5, 0.8],
        [0.5, 0.2, 1, 0.8],
    ]) {
        const pixel = await pixelIn(page, box);
        const error = await pickingError(page, pixel);
        const kind = await value(page, "stage.view.kind");
        const pulled = await pull(page, pixel);
        check(
            `the ${kind} view of the two is exact, and pulls`,
            error < 0.5 && pulled > 0.008,
            `${error.toFixed(3)} px`,
        );
        kinds.push(kind);
    }
    check("each has its own camera", kinds.join() === "free,endoscope", kinds.join());
    const cameras = () =>
        value(page, "stage.panes.map(({ view }) => [view.state().values.near, view.state().values.depth])");
    const before = await cameras();
    await page.mouse.move(300, 90);
    await page.mouse.wheel(0, 200);
    await until(async () => (await cameras())[0][0] !== before[0][0]);
    const after = await cameras();
    check("the wheel acts in the view under the pointer", after[1][1] === before[1][1] && after[0][0] > before[0][0]);
    await page.setViewportSize({ width: 390, height: 844 });
    await picture(page, "views_split_phone");
    const below = await pixelIn(page, [0, 0.5, 1, 0.85]);
    const error = await pickingError(page, below);
    check(
        "on a phone they are stacked",
        error < 0.5 && (await value(page, "stage.view.kind")) === "endoscope",
        String(error),
    );
    const outside = await page.evaluate(() => {
        document.getElementById("view-toggle").click();
        const { left, top, right, bottom } = document.getElementById("view-menu").getBoundingClientRect();
        return left < 0 || top < 0 || right > innerWidth || bottom > innerHeight;
    });
    check("and the menu is within the page", !outside);
    await picture(page, "views_menu_phone");
    await page.click("#view-split");
    await until(() => value(page, "stage.panes.length === 1"));
    check("one view again: the one that was worked in", (await value(page, "stage.view.kind")) === "endoscope");
    await page.keyboard.press("Escape");
    await picture(page, "views_endoscope_phone");
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.keyboard.press("e");
    await until(() => value(page, "views.scope === null"));
}

async function stereo(page) {
    await page.click("#view-toggle");
    await page.click("#view-stereo");
    await until(() => value(page, "views.stereo && stage.panes.length === 2"));
    await page.keyboard.press("Escape");
    await picture(page, "views_stereo");
    const xs = await value(
        page,
        "stage.panes.map((pane) => { stage.pane = pane; stage.placeCameras(); return [0, 0.1].map((d) => stage.project(stage.centre.clone().addScaledVector(stage.view.away(), d)).x - pane.box(stage.canvas).x) })",
    );
    const [middle, nearer] = [0, 1].map((k) => xs[0][k] - xs[1][k]);
    check(
        "the eyes meet in the middle of the scene, and see what is nearer apart",
        Math.abs(middle) < 0.01 && nearer > 2,
        `${middle.toFixed(3)} ${nearer.toFixed(1)} px`,
    );
    for (const box of [
        [0, 0.2, 0.5, 0.8],
        [0.5, 0.2, 1, 0.8],
    ]) {
        const error = await pickingError(page, await pixelIn(page, box));
        check("picking is exact in the picture of an eye", error < 0.5, `${error.toFixed(3)} px`);
    }
    await page.keyboard.press("e");
    await until(() => value(page, "views.scope !== null"));
    await picture(page, "views_stereo_endoscope");
    await page.keyboard.press("e");
    await until(() => value(page, "views.scope === null"));
    await page.evaluate(() => window.palpate.views.setStereo(false));
    check("one picture again", await value(page, "stage.panes.length === 1 && stage.camera === stage.free.camera"));
}

/** an emulated headset with two controllers, for the pages that are loaded from now on */
async function addHeadset(page) {
    await page.addInitScript({ path: join(process.argv[2], "viewer_packages/node_modules/iwer/build/iwer.min.js") });
    await page.addInitScript(() => {
        window.headset = new window.IWER.XRDevice(window.IWER.metaQuest3);
        window.headset.installRuntime({ forceInstall: true }); // in place of that of Chromium, which has no headset
    });
}

/** moves the tip of a hand to a point of the scene, m */
const moveHand = (page, side, point) =>
    page.evaluate(
        async ([side, point]) => {
            const { views } = window.palpate;
            const room = views.immersive.rig.worldToLocal(window.palpate.stage.centre.clone().fromArray(point));
            const controller = window.headset.controllers[side];
            controller.quaternion.set(0, 0, 0, 1);
            controller.position.set(room.x, room.y, room.z + 0.1);
            await new Promise(requestAnimationFrame);
        },
        [side, point],
    );
const button = (page, side, name, pressed) =>
    page.evaluate(([s, n, p]) => window.headset.controllers[s].updateButtonValue(n, p), [side, name, Number(pressed)]);

/** each hand pulls the organ at a point, and lets go */
async function pullByHand(page, side, point, out) {
    const before = await displacement(page);
    // from outside, and no faster than the tool can follow
    for (const far of [0.1, 0]) {
        await moveHand(
            page,
            side,
            point.map((c, k) => c + far * out[k]),
        );
        await until(() => value(page, "views.immersive.page.poses.every(({ behind }) => !behind)"));
    }
    await button(page, side, "trigger", true);
    const grasped = () =>
        value(page, "[state, views.immersive.second.state].filter((s) => s.ownToolState()?.grasps).length");
    await until(grasped, (n) => n === 1);
    for (let i = 1; i <= 10; i++)
        await moveHand(
            page,
            side,
            point.map((c, k) => c + 0.003 * i * out[k]),
        );
    const pulled = await until(
        () => displacement(page),
        (m) => m > before + 0.008,
    );
    check(
        `the ${side} hand pulls the organ with its trigger`,
        pulled > before + 0.008,
        `${(1000 * pulled).toFixed(1)} mm`,
    );
    await page.screenshot({ path: join(pictures, `views_headset_${side}.png`) });
    await button(page, side, "trigger", false);
    check("and lets it go", (await until(grasped, (n) => n === 0)) === 0);
    // tissue rests on a tool that stays
    for (let i = 1; i <= 5; i++)
        await moveHand(
            page,
            side,
            point.map((c, k) => c + (0.03 + 0.02 * i) * out[k]),
        );
    const back = await until(
        () => displacement(page),
        (m) => m < before + 0.005,
    );
    check("which returns", back < before + 0.005, `${(1000 * back).toFixed(1)} mm`);
}

async function headset(page) {
    const pixel = await organPixel(page);
    const { point, out } = await page.evaluate(({ x, y }) => {
        const hit = window.palpate.input.pick(window.palpate.stage.ray(x, y));
        return { point: hit.point.toArray(), out: hit.normal.toArray() };
    }, pixel);
    await page.click("#view-toggle");
    await page.click("#view-vr");
    await until(() => value(page, "views.immersive?.place && stage.immersive !== null"));
    check("a headset shows the scene", await value(page, "stage.renderer.xr.isPresenting"));
    await until(() => value(page, "views.immersive.second.state.ownTool >= 0"));
    const tools = await value(page, "[state.ownTool, views.immersive.second.state.ownTool]");
    check("each hand has a tool", tools[0] >= 0 && tools[1] >= 0 && tools[0] !== tools[1], tools.join());
    await until(() => value(page, "views.immersive.hands.every(({ source }) => source)"));
    for (const side of ["right", "left"]) await pullByHand(page, side, point, out);

    // both grips hold the scene: pulled apart it grows
    const extent = () => value(page, "stage.size / views.immersive.place.scale");
    const before = await extent();
    const centre = await value(page, "stage.centre.toArray()");
    const apart = (d) =>
        page.evaluate((d) => {
            for (const [side, sign] of [
                ["left", -1],
                ["right", 1],
            ])
                window.headset.controllers[side].position.set(sign * d, 1.2, -0.4);
        }, d);
    const twoFrames = () =>
        page.evaluate(() => new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r))));
    await apart(0.2);
    for (const side of ["left", "right"]) await button(page, side, "squeeze", true);
    await until(() => value(page, "views.immersive.held.length === 2"));
    await twoFrames();
    await apart(0.3);
    const grown = await until(extent, (e) => e > before * 1.4);
    check("two grips pulled apart enlarge the scene", Math.abs(grown / before - 1.5) < 0.01, `${before} ${grown} m`);
    check("and lift the tools", await value(page, "state.target === null"));
    for (const side of ["left", "right"]) await button(page, side, "squeeze", false);
    check("the scene itself stays where it is", (await value(page, "stage.centre.toArray()")).join() === centre.join());

    await page.evaluate(() => window.palpate.stage.renderer.xr.getSession().end());
    await until(() => value(page, "stage.immersive === null && views.immersive === null"));
    await until(() => value(page, "state.members.size === 1"));
    check("after the session the second hand is gone", await value(page, "state.members.size === 1"));
    // the emulator puts the canvas back above all else
    await page.evaluate(() => document.body.prepend(window.palpate.stage.canvas));
    await until(
        () => displacement(page),
        (m) => m < 0.002,
    );
    await picture(page, "views_after_headset");
    const error = await pickingError(page, await organPixel(page));
    check("and the page draws and picks as before", error < 0.5, `${error.toFixed(3)} px`);
}

await run(async () => {
    const server = await serve(prepare(), 0);
    const browser = await launch();
    const page = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Ada", { width: 1280, height: 800 });
    await settled(page, () => 0.0005, 1);
    check("without a headset none is offered", await page.locator("#view-vr").isHidden());
    await addHeadset(page);
    await endoscope(page);
    await savedViews(page);
    await splitView(page);
    await stereo(page);
    await headset(page);
    checkConsoles();
});
