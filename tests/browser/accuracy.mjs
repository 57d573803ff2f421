// What accuracy costs in real Chromium pages: a study's points and where the body stands, a slider along the front that
// switches the running body, rows switched off and on; who looks on sees the same.
// usage: node accuracy.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
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

/** what a page shows of the accuracy panel */
const shown = (page) =>
    page.evaluate(() => {
        const { accuracy, state } = window.palpate,
            body = [...state.bodies.values()][0],
            at = (id) => document.querySelector("#accuracy-" + id);
        return {
            visible: !at("panel").hidden,
            points: accuracy.points.length,
            front: accuracy.front.map((p) => p.index),
            marks: document.querySelectorAll("#accuracy-plot circle.point").length,
            line: document.querySelectorAll("#accuracy-plot polyline.front").length,
            live: document.querySelectorAll("#accuracy-plot .live, #accuracy-plot .live-line").length,
            neighbours: document.querySelectorAll("#accuracy-neighbour-list button").length,
            estimate: accuracy.estimate,
            slider: Number(at("slider").value),
            most: Number(at("slider").max),
            choice: at("choice").textContent,
            said: at("message").textContent,
            busy: accuracy.pending !== null,
            setting: at("configuration").textContent,
            epoch: body.epoch,
            drawn: body.mesh.visible && body.shown,
            tick: state.status?.tick ?? 0,
        };
    });
/** what a page shows of the plan */
const plan = (page) =>
    page.evaluate(() => ({
        on: [...document.querySelectorAll("#components tr:not(.off)")].map((r) => r.textContent),
        off: [...document.querySelectorAll("#components tr.off")].map((r) => r.textContent),
        switches: document.querySelectorAll("#components input").length,
        why: document.querySelector("#components tr")?.title ?? "",
        rows: window.palpate.state.components,
        row_ms: window.palpate.state.status?.row_ms.length ?? 0,
        unwatched: document.querySelector("#idle").textContent,
        off_wire: window.palpate.state.status?.off ?? [],
    }));
/** moves the slider to a place and lets it go, as a hand does; what the panel shows at that moment: a switch may take 40 ms */
const slide = (page, place) =>
    page.evaluate((value) => {
        const slider = document.querySelector("#accuracy-slider");
        slider.value = String(value);
        slider.dispatchEvent(new Event("input"));
        slider.dispatchEvent(new Event("change"));
        return {
            busy: window.palpate.accuracy.pending !== null,
            said: document.querySelector("#accuracy-message").textContent,
        };
    }, place);
/** colours that a page offers and shows; every notice that it gave since the first call */
const colours = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate,
            notice = document.querySelector("#notice");
        if (!window.told) {
            window.told = [];
            new MutationObserver(() => window.told.push(notice.textContent)).observe(notice, {
                childList: true,
                characterData: true,
                subtree: true,
            });
        }
        return {
            options: [...document.querySelector("#field").options].map((o) => o.value),
            chosen: document.querySelector("#field").value,
            field: state.field,
            legend: !document.querySelector("#legend").hidden,
            note: document.querySelector("#field-note").textContent,
            told: window.told,
            values: [...state.bodies.values()][0].colours.values !== null,
            row: state.components.includes("field_output"),
        };
    });
const choose = async (page, name) => {
    await colours(page);
    await page.evaluate((value) => {
        const list = document.querySelector("#field");
        list.value = value;
        list.dispatchEvent(new Event("change"));
    }, name);
};
/** where the organ is drawn between the open panels, and where the hint stands, pixels */
const places = (page) =>
    page.evaluate(() => {
        const { stage, state } = window.palpate,
            { rest } = [...state.bodies.values()][0],
            xs = [];
        for (let i = 0; i < rest.length; i += 3)
            xs.push(stage.project(stage.target.clone().set(rest[i], rest[i + 1], rest[i + 2])).x);
        const box = (id) => document.querySelector(id).getBoundingClientRect(),
            hint = box("#hint");
        return {
            organ: [Math.min(...xs), Math.max(...xs)],
            hint: [hint.left, hint.right],
            free: [box("#accuracy-panel").right, box("#panel").left],
            dirty: stage.dirty,
        };
    });
const flip = (page, row) => page.click(`#components input[aria-label="Component ${row}"]`);

/** the study's page as a file: a row's button puts a command on the clipboard that writes this row's scene */
async function pressRow(browser, file) {
    const page = await browser.newPage({ viewport: { width: 1200, height: 800 } });
    page.on("pageerror", (e) => troubles.push(`study.html: ${e.message}`));
    await page.goto(pathToFileURL(file).href);
    const buttons = page.locator("tbody button"),
        rows = await buttons.count();
    const row = await buttons.nth(rows - 1).textContent();
    await buttons.nth(rows - 1).click();
    const said = await until(
        () => page.locator("#copied").textContent(),
        (text) => text.includes("copied:"),
    );
    // what the clipboard has is what is pasted
    await page.evaluate(() => document.body.append(document.createElement("textarea")));
    await page.locator("textarea").focus();
    await page.keyboard.press("Control+V");
    const pasted = await page.locator("textarea").inputValue();
    check(
        "a row's button copies the command that writes its scene",
        /^palpate study .*--pick \d+ -o NEW$/.test(pasted) &&
            pasted.includes(`--pick ${row} `) &&
            said === `copied: ${pasted}`,
        pasted,
    );
    const words = [...pasted.matchAll(/'([^']*)'|(\S+)/g)].map((m) => m[1] ?? m[2]),
        made = join(scratch, "picked");
    execFileSync(palpate, [...words.slice(1, -1), made, "--quiet"], { stdio: ["ignore", "ignore", "inherit"] });
    check("the command does what it says", existsSync(join(made, "scene.json")), made);
    await page.close();
}

let server;
const browsers = [];
try {
    const folder = join(scratch, "organ"),
        scene = join(folder, "scene.json");
    execFileSync(palpate, [
        "prepare",
        "--procedural",
        "--resolution",
        "10",
        "--triangles",
        "4000",
        "--model",
        "fem",
        "-o",
        folder,
        "--quiet",
    ]);
    execFileSync(palpate, ["study", scene, "--quick", "--seconds", "0.1", "--methods", "fem,tet_springs", "--quiet"], {
        stdio: ["ignore", "ignore", "inherit"],
    });
    browsers.push(await launch());
    await pressRow(browsers[0], join(folder, "study.html"));
    server = await serve(scene, 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    browsers.push(await launch());
    const ada = await open(browsers[0], address, "Ada&role=instructor", { width: 1200, height: 800 });
    const ben = await open(browsers[1], address, "Ben", { width: 900, height: 700 });

    const closed = await shown(ada);
    check("nobody looks, so nothing is sent", !closed.visible && closed.points === 0 && closed.estimate === null);
    await ada.keyboard.press("4");
    const begin = await until(
        () => shown(ada),
        (s) => s.points > 2 && s.estimate?.tick > 0,
    );
    check(
        "key 4 opens the plot with the study's points and its front",
        begin.visible && begin.marks === begin.points && begin.line === 1 && begin.front.length >= 2,
        `${begin.points} points, ${begin.front.length} on the front`,
    );
    check("the body has its place there", begin.live >= 1 && /fem/.test(begin.setting), begin.setting);
    check("the slider goes along the front", begin.most === begin.front.length - 1, begin.choice);
    const other = await shown(ben);
    check("who has not asked is not told", other.points === 0 && other.estimate === null);

    // under load there is something to be wrong about
    const pixel = await until(
        () => organPixel(ada),
        (p) => p,
    );
    await ada.mouse.move(pixel.x, pixel.y);
    await ada.mouse.down();
    await ada.mouse.move(pixel.x + 60, pixel.y - 60, { steps: 8 });
    const loaded = await until(
        () => shown(ada),
        (s) => s.estimate?.error_m > 1e-7,
    );
    check(
        "a pulled body has an error, of parts",
        loaded.estimate?.error_m > 1e-7 && (await ada.locator("#accuracy-parts li").count()) >= 1,
        JSON.stringify(loaded.estimate).slice(0, 300),
    );
    await until(
        () => ada.evaluate(() => !window.palpate.stage.dirty),
        (still) => still,
        3000,
    );
    await ada.screenshot({ path: join(pictures, "accuracy_plot.png") });
    await ada.mouse.up();
    await until(
        () => moved(ada),
        (m) => m < 1e-3,
    );

    await ben.keyboard.press("4");
    await until(
        () => shown(ben),
        (s) => s.points > 2 && s.estimate,
    );
    await choose(ben, "displacement");
    // to the other end of the front, and back: springs that were fitted have no knobs
    for (const [place, what] of [
        [0, "the cheapest"],
        [begin.most, "the most accurate"],
        [0, "the cheapest again"],
    ]) {
        const before = await shown(ada);
        if (before.front[place] === before.estimate?.point) continue;
        // a colour that this method alone has goes with it, one that both have stays
        const own = /springs/.test(before.setting) ? "stiffness" : "von_mises";
        await choose(ada, own);
        const making = await slide(ada, place);
        check(
            `let go at ${what}, the panel says what is made`,
            making.busy && /^Preparing /.test(making.said),
            making.said,
        );
        const after = await until(
            () => shown(ada),
            (s) =>
                !s.busy &&
                s.epoch > before.epoch &&
                s.drawn &&
                s.estimate?.point === s.front[place] &&
                s.tick >= before.tick,
        );
        check(
            `${what} runs, and what the switch did is said`,
            /^Switched: energy [+−][\d.]+ %/.test(after.said) && after.estimate?.point === after.front[place],
            `${after.said} ${after.setting}`,
        );
        const seen = await until(
            () => shown(ben),
            (s) => s.epoch === after.epoch && s.drawn && s.estimate?.point === after.front[place],
        );
        check(
            "who looks on sees the same setting and shape",
            seen.epoch === after.epoch && seen.setting === after.setting,
            seen.setting,
        );
        check("no time was lost", after.tick >= before.tick, `${before.tick} to ${after.tick}`);
        const springs = /springs/.test(after.setting),
            gone = springs !== (own === "stiffness");
        const offer = await until(
            () => colours(ada),
            (c) => c.options.includes("stiffness") === springs && c.options.includes("von_mises") === !springs,
        );
        check(
            "the colours offered are those of the method that runs now",
            offer.options.includes("stiffness") === springs &&
                offer.options.includes("von_mises") === !springs &&
                (offer.note !== "") === springs,
            `${offer.options.join()} ${offer.note}`,
        );
        check(
            `${own} ${gone ? "goes with its method, and that is told" : "stays"}`,
            gone
                ? offer.field === "none" &&
                      offer.chosen === "none" &&
                      !offer.legend &&
                      offer.told.some((text) => /not available with this method/.test(text))
                : offer.field === own && offer.legend,
            `${before.setting} -> ${after.setting}: ${offer.told.join(" | ")}`,
        );
        const kept = await until(
            () => colours(ben),
            (c) => c.field === "displacement" && c.values && c.row && c.options.includes("stiffness") === springs,
        );
        check(
            "who looks on keeps a colour that both methods have",
            kept.field === "displacement" &&
                kept.legend &&
                kept.values &&
                kept.row &&
                kept.options.includes("stiffness") === springs,
            kept.options.join(),
        );
    }
    for (const page of [ada, ben]) await choose(page, "none");
    await until(
        () => ada.evaluate(() => !window.palpate.stage.dirty),
        (still) => still,
        3000,
    );
    await ada.screenshot({ path: join(pictures, "accuracy_switched.png") });

    // the knobs: every kind of button is pressed once, and goes where it says
    const pressed = new Set();
    for (let press = 0; press < 3; press++) {
        const left = (s) => s.estimate?.neighbours?.find((n) => !pressed.has(n.knob));
        const before = await until(
                () => shown(ada),
                (s) => left(s) && !s.busy,
                40000,
            ),
            near = left(before);
        if (!near) break;
        pressed.add(near.knob);
        const button = ada.locator("#accuracy-neighbour-list button:enabled", { hasText: near.knob }).first(),
            title = await button.getAttribute("title");
        await button.click();
        const after = await until(
            () => shown(ada),
            (s) => !s.busy && s.epoch > before.epoch && s.drawn && title.startsWith(`${s.setting},`),
        );
        check(
            `the button of the knob ${near.knob} goes to its neighbour`,
            after.setting !== before.setting && title.startsWith(`${after.setting},`),
            `${before.setting} -> ${after.setting}; ${title}`,
        );
        check(
            "it says what jumped, and against which bound",
            /^Switched: energy [+−][\d.]+ %, surface moves .* \(bound .*\), .* per frame, prepared in/.test(after.said),
            after.said,
        );
    }
    check("there were knobs to press", pressed.size >= 2, [...pressed].join());
    await ada.locator("#accuracy-panel").screenshot({ path: join(pictures, "accuracy_panel.png") });
    await ada.keyboard.press("p");
    for (const width of [1000, 1100, 1600]) {
        await ada.setViewportSize({ width, height: 800 });
        const within = (p) =>
            !p.dirty &&
            [...p.organ, ...p.hint].every((x) => x >= p.free[0] - 1 && x <= p.free[1] + 1) &&
            p.free[1] < width;
        const at = await until(() => places(ada), within, 20000);
        check(`${width} pixels wide, organ and hint stand between the panels`, within(at), JSON.stringify(at));
    }
    await ada.setViewportSize({ width: 1200, height: 800 });
    await ada.keyboard.press("p");
    await ada.keyboard.press("4");
    check("the panel closes", !(await shown(ada)).visible);

    // rows: the instructor has switches, others see what is off
    for (const page of [ada, ben]) await page.keyboard.press("p");
    // the row that eases the last switch in goes by itself after ten steps
    const rows = await until(
        () => plan(ada),
        (p) => p.switches > 0 && !p.rows.includes("blend"),
    );
    check(
        "an instructor has a switch for every row, others none",
        rows.switches === rows.on.length && (await plan(ben)).switches === 0,
        rows.on.join(" | "),
    );
    check("a row says what called for it", rows.why !== "", rows.why);
    const name = rows.rows.includes("viscous") ? "viscous" : rows.rows[0];
    await flip(ada, name);
    const off = await until(
        () => plan(ada),
        (p) => p.off.length === 1 && p.row_ms === rows.on.length - 1,
    );
    check(
        `${name} off: it is gone from the plan, with its cost`,
        off.row_ms === rows.on.length - 1 && off.off_wire[0]?.row === name && !off.rows.includes(name),
        off.off.join(),
    );
    const seenOff = await until(
        () => plan(ben),
        (p) => p.off.length === 1,
    );
    check("who looks on sees that it is off", seenOff.off.length === 1, seenOff.off.join());
    await ada.screenshot({ path: join(pictures, "accuracy_row_off.png") });
    await until(
        () => ada.isEnabled(`#components input[aria-label="Component ${name}"]`),
        (e) => e,
    );
    await flip(ada, name);
    const on = await until(
        () => plan(ada),
        (p) => p.off.length === 0 && p.row_ms === rows.on.length,
    );
    check("on again: the plan is what it was", on.rows.join() === rows.rows.join(), on.rows.join(" "));
    check("what nobody looks at is said not to be computed", /field values/.test(on.unwatched), on.unwatched);
    check(
        "nothing was complained of in the browsers' consoles",
        troubles.length === 0,
        troubles.slice(0, 3).join(" | "),
    );
} catch (error) {
    check("the test ran to its end", false, String(error.stack ?? error));
} finally {
    for (const browser of browsers) await browser.close().catch(() => {});
    server?.child.kill("SIGTERM");
}
finish();
