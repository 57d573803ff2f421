// A recording is played to an instructor and a viewer: play, seek, marks, speed, go on live and back.
// usage: node debrief.mjs BUILD PICTURES     ends with "N passed, N failed"
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    drag,
    grasp,
    launch,
    open,
    organPixel,
    pictures,
    prepare,
    run,
    scratch,
    serve,
    until,
} from "./common.mjs";

const ended = (child) => new Promise((resolve) => child.on("exit", (code) => resolve(code)));
/** the recording as a page knows it */
const playback = (page) => page.evaluate(() => window.palpate.state.status?.playback?.[0] ?? null);
const text = (page) => page.textContent("#state-text");

await run(async () => {
    const scene = prepare();
    const log = join(scratch, "run.log");
    const browser = await launch();

    // a session of ten seconds: the organ settles, is pulled for a while, becomes stiffer
    let server = await serve(scene, 0, ["--record", log]);
    const eve = await open(browser, `http://127.0.0.1:${server.info.port}/`, "Eve", { width: 900, height: 640 });
    const time = () => eve.evaluate(() => window.palpate.state.status.sim_time_s);
    const pixel = await organPixel(eve);
    await until(time, (s) => s > 4);
    const rest = await displacement(eve);
    await grasp(eve, pixel);
    await drag(eve, pixel, 6, -6, 12);
    await until(
        () => displacement(eve),
        (m) => m > rest + 0.01,
    );
    const begin = await time();
    await until(time, (s) => s > begin + 2);
    const pulled = await displacement(eve);
    const pulledAt = await time();
    await eve.mouse.up();
    await until(time, (s) => s > pulledAt + 3);
    await eve.close();
    server.child.kill("SIGTERM");
    check("the recorded server exits with 0", (await ended(server.child)) === 0);

    server = await serve(scene, 0, ["--replay", log, "--record", join(scratch, "branch.log")], []);
    const { tickets, port } = server.info;
    const ada = await open(browser, `http://127.0.0.1:${port}/#${tickets.instructor}`, "Ada", {
        width: 1100,
        height: 720,
    });
    const ben = await open(browser, `http://127.0.0.1:${port}/#${tickets.viewer}`, "Ben", { width: 390, height: 780 });
    check("the recording waits at its beginning", /^recording, paused/.test(await text(ada)), await text(ada));
    const { length_s } = await playback(ada);
    check("its length is shown", length_s > pulledAt, await ada.textContent("#playback-text"));
    check("a viewer's bar has no effect", await ben.locator("#playback-time").isDisabled());

    await ada.click("#pause");
    await until(
        () => playback(ben),
        (p) => p.time_s > 1.5,
    );
    check("it plays for everybody", (await text(ben)) === "recording", await text(ben));
    await ada.selectOption("#playback-speed", "4");
    const fast = await until(
        () => playback(ben),
        (p) => p.speed === 4,
    );
    check("faster for everybody", fast.speed === 4);
    await ada.selectOption("#playback-speed", "1");

    // to the moment when the organ was pulled
    const bar = ada.locator("#playback-time");
    const seek = async (s) => {
        await bar.evaluate((element, value) => {
            element.value = String(Math.round(10 * value));
            element.dispatchEvent(new Event("change"));
        }, s);
        return until(
            () => playback(ada),
            (p) => p && Math.abs(p.time_s - s) < 1,
        );
    };
    await ada.click("#pause");
    await until(
        () => text(ada),
        (t) => t === "recording, paused",
    );
    const there = await seek(pulledAt - 0.2);
    check("a seek leads there", Math.abs(there.time_s - pulledAt + 0.2) < 0.15, `${there.time_s} of ${pulledAt}`);
    const shown = await until(
        () => displacement(ben),
        (m) => Math.abs(m - pulled) < 0.25 * pulled,
    );
    check(
        "and shows the pulled organ to all",
        Math.abs(shown - pulled) < 0.25 * pulled,
        `${(1000 * shown).toFixed(1)} mm, pulled ${(1000 * pulled).toFixed(1)} mm`,
    );
    const tool = await until(() =>
        ben.evaluate(() => {
            const label = [...document.querySelectorAll("#labels span")].find((span) => !span.hidden);
            return label?.textContent ?? "";
        }),
    );
    check("with the recorded tool by its name", tool.length > 0 && tool !== "you", tool);
    await ada.screenshot({ path: join(pictures, "debrief_ada.png") });
    await ben.screenshot({ path: join(pictures, "debrief_ben_phone.png") });

    // what if
    await ada.click("#playback-branch");
    await until(
        () => playback(ada),
        (p) => p && !p.plays,
    );
    const waits = await until(
        () => text(ada),
        (t) => t.startsWith("paused"),
    );
    check("one click leaves the recording there, and says that the session is paused", /^paused/.test(waits), waits);
    await ada.click("#pause");
    const goes = await until(
        () => text(ada),
        (t) => t === "live" || /of real time/.test(t),
    );
    check("the next one goes on live", goes === "live" || /of real time/.test(goes), goes);
    const hold = await organPixel(ada);
    await grasp(ada, hold);
    await drag(ada, hold, -6, -6, 10);
    const own = await until(
        () => ada.evaluate(() => window.palpate.state.ownToolState()?.grasps),
        (g) => g === true,
    );
    check("where the member's own tool grasps", own === true);
    await ada.screenshot({ path: join(pictures, "debrief_live.png") });
    await ada.mouse.up();
    await ada.click("#playback-branch");
    const back = await until(
        () => playback(ben),
        (p) => p?.plays === true,
    );
    check("and back to the recording, for everybody", back.plays === true);
    checkConsoles();
});
