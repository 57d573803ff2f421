// One browser pulls the organ at a pixel, a second one shows the vertices move.
// usage: node pull.mjs BUILD PICTURES     ends with "N passed, N failed"
import { join } from "node:path";
import {
    check,
    checkConsoles,
    consoleErrors,
    displacement,
    drag,
    grasp,
    launch,
    nextFrame,
    open,
    organPixel,
    palpate,
    pictures,
    prepare,
    run,
    serve,
    settled,
    until,
} from "./common.mjs";

/** share of the picture, or of a square of 8 pixels about one, that changes when an instrument is hidden */
const coverage = (page, index, middle = null) =>
    page.evaluate(
        ([tool, at]) => {
            const { marks, stage } = window.palpate;
            const gl = stage.renderer.getContext();
            stage.applySize();
            const { clientWidth, height, width } = stage.canvas;
            const scale = width / clientWidth;
            const box = at
                ? [at.x * scale - 4, height - at.y * scale - 4, 8, 8].map(Math.round)
                : [0, 0, width, height];
            const [shown, hidden] = [true, false].map((visible) => {
                marks.marks[tool].instrument.group.visible = visible;
                stage.dirty = true;
                stage.draw();
                const bytes = new Uint8Array(4 * box[2] * box[3]);
                gl.readPixels(...box, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
                return bytes;
            });
            const changed = (_, i) => [0, 1, 2].some((k) => Math.abs(shown[4 * i + k] - hidden[4 * i + k]) > 12);
            return Array.from({ length: box[2] * box[3] }, changed).filter(Boolean).length / (box[2] * box[3]);
        },
        [index, middle],
    );
/** turns the view until tissue hides the tip of an instrument; its pixel */
const hideTip = (page, index) =>
    page.evaluate((tool) => {
        const { input, marks, stage } = window.palpate;
        const tip = marks.marks[tool].ball.position;
        for (let k = 0; k < 24; k++) {
            stage.orbit(40, 0);
            stage.placeCameras();
            const pixel = stage.project(tip);
            const hit = input.pick(stage.ray(pixel.x, pixel.y));
            if (hit && hit.distance < tip.distanceTo(stage.camera.position) - 0.01) return pixel;
        }
        return null;
    }, index);
const ended = (child) => new Promise((resolve) => child.on("exit", (code) => resolve(code)));

await run(async () => {
    const scene = prepare();
    let server = await serve(scene, 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    const browsers = [await launch(), await launch()];
    const ada = await open(browsers[0], address, "Ada", { width: 1100, height: 720 });
    const ben = await open(browsers[1], address, "Ben", { width: 390, height: 780 });

    // a body without a frame has no normals and would be black
    const first = await ada.evaluate(() =>
        [...window.palpate.state.bodies.values()].every((body) => body.shown || !body.mesh.visible),
    );
    check("no body is drawn before its first frame", first);
    const title = await ada.textContent("#title");
    check("the title names the organ", title.length > 3 && title !== "Palpate", title);
    await until(
        () => ada.evaluate(() => window.palpate.state.members.size),
        (n) => n === 2,
    );
    const holders = await Promise.all([ada, ben].map((page) => page.evaluate(() => window.palpate.state.ownTool)));
    check(
        "each of two browsers holds its own tool",
        holders[0] >= 0 && holders[1] >= 0 && holders[0] !== holders[1],
        holders.join(" "),
    );

    const cube = ada.locator("#orientation");
    const seen = await cube.getAttribute("aria-label");
    check("the cube of the patient's directions says from where the organ is seen", /seen from the/.test(seen), seen);
    const turned = () => cube.locator("> div").evaluate((element) => element.style.transform);
    const turnedBefore = await turned();
    await ada.evaluate(() => window.palpate.stage.orbit(200, 0));
    await until(turned, (now) => now !== turnedBefore);
    check("and turns with the view", (await turned()) !== turnedBefore);
    await ada.evaluate(() => window.palpate.stage.home());

    // the organ settles under its weight
    const before = await settled(ben, () => 0.0005, 1.5);
    check("the organ comes to rest", before < 0.03, `${(1000 * before).toFixed(2)} mm`);

    await ada.keyboard.press("?");
    const help = ada.locator("#help");
    check("? opens the help", await help.isVisible());
    await ada.screenshot({ path: join(pictures, "help.png") });
    await ada.keyboard.press("m");
    check("which has the keyboard", (await ada.getAttribute("#mesh", "aria-pressed")) === "false");
    await ada.keyboard.press("Escape");
    check("and Escape closes it", await help.isHidden());
    await ben.click("#help-open");
    await ben.screenshot({ path: join(pictures, "help_phone.png") });
    await ben.click("#help-close");
    check("a button does both", await ben.locator("#help").isHidden());

    // light and dark by the system
    const brightness = (page) =>
        page.evaluate(() => {
            const [r, g, b] = getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number);
            return (r + g + b) / 765;
        });
    const grounds = [];
    for (const colorScheme of ["light", "dark"]) {
        await ada.emulateMedia({ colorScheme });
        grounds.push(await brightness(ada));
        await nextFrame(ada);
        await ada.screenshot({ path: join(pictures, `pull_${colorScheme}.png`) });
    }
    check("the page is light or dark as the system is", grounds[0] > 0.8 && grounds[1] < 0.2, grounds.join(" "));

    const pixel = await organPixel(ada);
    check("the organ is visible", !!pixel);
    const scale = await ada.evaluate(() => {
        const { stage } = window.palpate;
        const across = stage.target.clone().setFromMatrixColumn(stage.camera.matrixWorld, 0);
        const [a, b] = [0, 0.01].map((m) => stage.project(stage.target.clone().addScaledVector(across, m)));
        const bar = document.getElementById("scale");
        return {
            pixels: 100 * Math.hypot(b.x - a.x, b.y - a.y),
            px: parseFloat(bar.style.width),
            text: bar.textContent,
        };
    });
    check(
        "the scale bar is as long as it says",
        Math.abs(scale.px / scale.pixels / (parseFloat(scale.text) / 1000) - 1) < 0.02,
        `${scale.text} are ${scale.px} pixels, a metre ${scale.pixels.toFixed(0)}`,
    );
    await grasp(ada, pixel);
    await drag(ada, pixel, 7, -8, 12);
    const pulled = await until(
        () => displacement(ben),
        (m) => m > before + 0.01,
    );
    check(
        "the second browser shows the vertices move",
        pulled > before + 0.01,
        `${(1000 * before).toFixed(1)} -> ${(1000 * pulled).toFixed(1)} mm`,
    );
    const force = await until(
        () =>
            ada.evaluate(() => {
                const { state } = window.palpate;
                return Math.hypot(...(state.tools[state.ownTool]?.force ?? [0, 0, 0]));
            }),
        (f) => f > 0.05,
    );
    check("the pulling browser shows the force", force > 0.05 && force < 50, `${force.toFixed(2)} N`);
    // the first tool of a prepared organ is a grasper; its jaws close over the tissue
    const grasper = (page) =>
        page.evaluate((index) => {
            const { marks, state } = window.palpate;
            const { ball, instrument } = marks.marks[index];
            const { position, quaternion } = instrument.group;
            const tool = state.tools[index];
            return {
                shown: instrument.group.visible && !ball.visible,
                angle: instrument.angle,
                open: instrument.shape.open,
                held: instrument.shape.held,
                apart: Math.hypot(...position.toArray().map((v, k) => v - tool.position[k])),
                turned: Math.abs(quaternion.w) < 1,
            };
        }, holders[0]);
    const closed = await until(
        () => grasper(ben),
        (g) => g.shown && g.angle === g.held && g.apart < 1e-4,
    );
    check(
        "the other member sees a grasper, its jaws closed over the tissue",
        closed.shown && closed.turned && closed.angle === closed.held && closed.held < 0.2 * closed.open,
        `${((closed.angle * 180) / Math.PI).toFixed(1)} of ${((closed.open * 180) / Math.PI).toFixed(1)} degrees`,
    );
    check("its tip is at the tool", closed.apart < 1e-4, `${(1e6 * closed.apart).toFixed(0)} um`);
    const covered = await coverage(ben, holders[0]);
    check("and is drawn", covered > 0.002 && covered < 0.2, `${(100 * covered).toFixed(2)} % of the picture`);
    const roll = (page) =>
        page.evaluate((index) => window.palpate.marks.marks[index].instrument.group.quaternion.toArray(), holders[0]);
    const straight = await roll(ben);
    for (let k = 0; k < 3; k++) await ada.keyboard.press("w");
    // three turns of 15 degrees; the shaft stays where it is
    const turn = (a, b) =>
        (2 * Math.acos(Math.min(1, Math.abs(a.reduce((s, v, k) => s + v * b[k], 0)))) * 180) / Math.PI;
    const rolled = await until(
        async () => turn(await roll(ben), straight),
        (angle) => Math.abs(angle - 45) < 1,
    );
    check("it turns about its shaft by keys", Math.abs(rolled - 45) < 1, `${rolled.toFixed(1)} degrees`);
    const behind = await hideTip(ben, holders[0]);
    const through = behind ? await coverage(ben, holders[0], behind) : 0;
    check("also through the tissue that hides its tip", through > 0.05, `${(100 * through).toFixed(0)} % there`);
    await ben.evaluate(() => window.palpate.stage.home());
    const label = await until(
        () =>
            ben.evaluate(() =>
                [...document.querySelectorAll("#labels span")].filter((s) => !s.hidden).map((s) => s.textContent),
            ),
        (l) => l.includes("Ada"),
    );
    check("the tool of the other member is shown with its name", label.includes("Ada"), label.join(" "));
    await ada.keyboard.press("p"); // the panel, while the drag goes on
    await ada.locator("#panel").waitFor();
    await ada.screenshot({ path: join(pictures, "pull_ada.png") });
    await ben.screenshot({ path: join(pictures, "pull_ben_phone.png") });
    await ada.mouse.up();
    const back = await until(
        () => displacement(ben),
        (m) => m < before + 0.004,
    );
    check("after release the organ returns", back < before + 0.004, `${(1000 * back).toFixed(2)} mm`);

    const overflow = await ben.evaluate(() => {
        const out = [...document.querySelectorAll("button, #state, #head")].filter((e) => {
            const b = e.getBoundingClientRect();
            return b.width > 0 && (b.left < -0.5 || b.right > innerWidth + 0.5 || b.bottom > innerHeight + 0.5);
        });
        return out.map((e) => e.id).concat(document.documentElement.scrollWidth > innerWidth ? ["page"] : []);
    });
    check("at phone width all controls are within the page", overflow.length === 0, overflow.join(" "));

    // the canvas is blank from a change of its size until it is drawn
    const kept = await ben.evaluate(() => {
        const { stage } = window.palpate;
        const { width } = stage.canvas;
        stage.canvas.style.width = "50%";
        stage.resize();
        const same = stage.canvas.width === width;
        stage.dirty = true;
        stage.draw();
        const drawn = stage.canvas.width < width;
        stage.canvas.style.width = "";
        stage.resize();
        return { same, drawn };
    });
    check("a picture stays until one of the new size is drawn", kept.same && kept.drawn, JSON.stringify(kept));

    await ben.click("#pause");
    const paused = await until(() => ada.evaluate(() => window.palpate.state.status.paused));
    check("a pause by one member is shown to all", paused === true);
    await ben.click("#pause");
    await until(
        () => ada.evaluate(() => window.palpate.state.status.paused),
        (p) => !p,
    );

    const { port } = server.info;
    const nBefore = consoleErrors.length;
    server.child.kill("SIGTERM");
    const code = await ended(server.child);
    check("the server exits with 0 on SIGTERM", code === 0, String(code));
    const lost = await until(
        () => ada.getAttribute("#state", "data-state"),
        (s) => s !== "live",
    );
    check("the page reports the lost connection", lost !== "live", lost);
    server = await serve(scene, port);
    const again = await until(
        () => ada.getAttribute("#state", "data-state"),
        (s) => s === "live",
    );
    check("the page reconnects by itself", again === "live", again);
    // the browser itself logs failed connections
    checkConsoles(consoleErrors.filter((text, i) => i < nBefore || !/WebSocket|ERR_CONNECTION/.test(text)));
});
