// The panel of accuracy: the points of a study and the running configuration, a slider along the Pareto front that switches
// the running body, components disabled and enabled; a second browser shows the same.
// usage: node accuracy.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import {
    check,
    checkConsoles,
    consoleErrors,
    displacement,
    grasp,
    launch,
    newPage,
    open,
    organPixel,
    palpate,
    pictures,
    prepare,
    run,
    scratch,
    serve,
    until,
} from "./common.mjs";

/** contents of the accuracy panel */
const shown = (page) =>
    page.evaluate(() => {
        const { accuracy, state } = window.palpate;
        const body = [...state.bodies.values()][0];
        const at = (id) => document.querySelector("#accuracy-" + id);
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
            sliderMax: Number(at("slider").max),
            choice: at("choice").textContent,
            message: at("message").textContent,
            busy: accuracy.pending !== null,
            configuration: at("configuration").textContent,
            epoch: body.epoch,
            drawn: body.mesh.visible && body.shown,
            tick: state.status?.tick ?? 0,
        };
    });
/** contents of the list of components */
const plan = (page) =>
    page.evaluate(() => ({
        on: [...document.querySelectorAll("#components tr:not(.off)")].map((r) => r.textContent),
        off: [...document.querySelectorAll("#components tr.off")].map((r) => r.textContent),
        switches: document.querySelectorAll("#components input").length,
        reason: document.querySelector("#components tr")?.title ?? "",
        names: window.palpate.state.running,
        component_ms: window.palpate.state.status?.component_ms.length ?? 0,
        idle: document.querySelector("#idle").textContent,
        disabled: window.palpate.state.status?.disabled ?? [],
    }));
/** moves the slider and releases it, as a hand does; returns what the panel shows at once: a switch may take only 40 ms */
const slide = (page, position) =>
    page.evaluate((value) => {
        const slider = document.querySelector("#accuracy-slider");
        slider.value = String(value);
        slider.dispatchEvent(new Event("input"));
        slider.dispatchEvent(new Event("change"));
        return {
            busy: window.palpate.accuracy.pending !== null,
            message: document.querySelector("#accuracy-message").textContent,
        };
    }, position);
/** fields that a page offers and shows; every notice since the first call */
const colours = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate;
        const notice = document.querySelector("#notice");
        if (!window.notices) {
            window.notices = [];
            new MutationObserver(() => window.notices.push(notice.textContent)).observe(notice, {
                childList: true,
                characterData: true,
                subtree: true,
            });
        }
        return {
            options: [...document.querySelectorAll("#field option:enabled")].map((o) => o.value),
            chosen: document.querySelector("#field").value,
            field: state.field,
            legend: !document.querySelector("#legend").hidden,
            note: document.querySelector("#field option:disabled")?.textContent ?? "",
            notices: window.notices,
            values: [...state.bodies.values()][0].colours.values !== null,
            component: state.running.includes("field_output"),
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
/** horizontal extent of the organ, of the hint and of the space between the panels, pixels */
const extents = (page) =>
    page.evaluate(() => {
        const { stage, state } = window.palpate;
        const { rest } = [...state.bodies.values()][0];
        const xs = [];
        for (let i = 0; i < rest.length; i += 3)
            xs.push(stage.project(stage.target.clone().set(rest[i], rest[i + 1], rest[i + 2])).x);
        const box = (id) => document.querySelector(id).getBoundingClientRect();
        const hint = box("#hint");
        return {
            organ: [Math.min(...xs), Math.max(...xs)],
            hint: [hint.left, hint.right],
            free: [box("#accuracy-panel").right, box("#panel").left],
            dirty: stage.dirty,
        };
    });
const flip = (page, name) => page.click(`#components tr[title^="${name}"] input`);

/** the report of the study: the button of a row copies the command that writes the scene of this row */
async function pressRow(browser, file) {
    const page = await newPage(browser, { viewport: { width: 1200, height: 800 } });
    page.on("pageerror", (e) => consoleErrors.push(`study.html: ${e.message}`));
    await page.goto(pathToFileURL(file).href);
    const buttons = page.locator("tbody button");
    const rows = await buttons.count();
    const row = await buttons.nth(rows - 1).textContent();
    await buttons.nth(rows - 1).click();
    const copied = await until(
        () => page.locator("#copied").textContent(),
        (text) => text.includes("copied:"),
    );
    // reads the clipboard by pasting
    await page.evaluate(() => document.body.append(document.createElement("textarea")));
    await page.locator("textarea").focus();
    await page.keyboard.press("Control+V");
    const pasted = await page.locator("textarea").inputValue();
    check(
        "the button of a row copies the command that writes its scene",
        /^palpate study .*--pick \d+ -o NEW$/.test(pasted) &&
            pasted.includes(`--pick ${row} `) &&
            copied === `copied: ${pasted}`,
        pasted,
    );
    const args = [...pasted.matchAll(/'([^']*)'|(\S+)/g)].map((m) => m[1] ?? m[2]);
    const folder = join(scratch, "picked");
    execFileSync(palpate, [...args.slice(1, -1), folder, "--quiet"], { stdio: ["ignore", "ignore", "inherit"] });
    check("the command writes the scene", existsSync(join(folder, "scene.json")), folder);
    await page.close();
}

/** replaces measured times by nodes x sub-steps: then the Pareto front is the same on every machine, from the finite
 * elements with the fewest nodes to the springs with the most sub-steps */
function costByNodes(file) {
    const study = JSON.parse(readFileSync(file, "utf8"));
    for (const point of study.points) point.ms = (point.nodes * point.substeps) / 1e4;
    writeFileSync(file, JSON.stringify(study));
}

await run(async () => {
    const folder = join(scratch, "organ");
    const scene = join(folder, "scene.json");
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
    const browsers = [await launch()];
    await pressRow(browsers[0], join(folder, "study.html"));
    costByNodes(join(folder, "study.json"));
    const server = await serve(scene, 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    browsers.push(await launch());
    const ada = await open(browsers[0], address, "Ada&role=instructor", { width: 1200, height: 800 });
    const ben = await open(browsers[1], address, "Ben", { width: 900, height: 700 });

    const closed = await shown(ada);
    check("a closed panel receives nothing", !closed.visible && closed.points === 0 && closed.estimate === null);
    await ada.keyboard.press("4");
    const begin = await until(
        () => shown(ada),
        (s) => s.points > 2 && s.estimate?.tick > 0,
    );
    check(
        "key 4 opens the plot with the points of the study and its Pareto front",
        begin.visible && begin.marks === begin.points && begin.line === 1 && begin.front.length >= 2,
        `${begin.points} points, ${begin.front.length} on the front`,
    );
    check(
        "the running configuration is in the plot",
        begin.live >= 1 && /fem/.test(begin.configuration),
        begin.configuration,
    );
    check(
        "the slider has a position for every point of the Pareto front",
        begin.sliderMax === begin.front.length - 1,
        begin.choice,
    );
    const other = await shown(ben);
    check("a browser that has not subscribed receives nothing", other.points === 0 && other.estimate === null);

    // a load causes an error
    const pixel = await until(() => organPixel(ada));
    await grasp(ada, pixel);
    await ada.mouse.move(pixel.x + 60, pixel.y - 60, { steps: 8 });
    const loaded = await until(
        () => shown(ada),
        (s) => s.estimate?.error_m > 1e-7,
    );
    check(
        "a pulled body has an error with its parts",
        loaded.estimate?.error_m > 1e-7 && (await ada.locator("#accuracy-parts li").count()) >= 1,
        JSON.stringify(loaded.estimate).slice(0, 300),
    );
    await until(
        () => ada.evaluate(() => !window.palpate.stage.dirty),
        (idle) => idle,
        3000,
    );
    await ada.screenshot({ path: join(pictures, "accuracy_plot.png") });
    await ada.mouse.up();
    await until(
        () => displacement(ada),
        (m) => m < 1e-3,
    );

    await ben.keyboard.press("4");
    await until(
        () => shown(ben),
        (s) => s.points > 2 && s.estimate,
    );
    await choose(ben, "displacement");
    // to the other end of the Pareto front and back: calibrated springs have no neighbours
    for (const [position, what] of [
        [0, "the cheapest"],
        [begin.sliderMax, "the most accurate"],
        [0, "the cheapest again"],
    ]) {
        const before = await shown(ada);
        if (before.front[position] === before.estimate?.study_point) continue;
        // a field of this method alone disappears with it, a field of both stays
        const own = /springs/.test(before.configuration) ? "stiffness" : "von_mises";
        await choose(ada, own);
        const making = await slide(ada, position);
        check(
            `released at ${what}, the panel displays what is prepared`,
            making.busy && /^Preparing /.test(making.message),
            making.message,
        );
        const after = await until(
            () => shown(ada),
            (s) =>
                !s.busy &&
                s.epoch > before.epoch &&
                s.drawn &&
                s.estimate?.study_point === s.front[position] &&
                s.tick >= before.tick,
        );
        check(
            `${what} runs, and the effects of the switch are displayed`,
            /^Switched in [\d.]+ m?s, surface moved/.test(after.message) &&
                after.estimate?.study_point === after.front[position],
            `${after.message} ${after.configuration}`,
        );
        const seen = await until(
            () => shown(ben),
            (s) => s.epoch === after.epoch && s.drawn && s.estimate?.study_point === after.front[position],
        );
        check(
            "the second browser shows the same configuration and shape",
            seen.epoch === after.epoch && seen.configuration === after.configuration,
            seen.configuration,
        );
        check("simulated time never goes back", after.tick >= before.tick, `${before.tick} to ${after.tick}`);
        const springs = /springs/.test(after.configuration);
        const gone = springs !== (own === "stiffness");
        const offer = await until(
            () => colours(ada),
            (c) => c.options.includes("stiffness") === springs && c.options.includes("von_mises") === !springs,
        );
        check(
            "the fields of the running method are offered",
            offer.options.includes("stiffness") === springs &&
                offer.options.includes("von_mises") === !springs &&
                (offer.note !== "") === springs,
            `${offer.options.join()} ${offer.note}`,
        );
        check(
            `${own} ${gone ? "disappears with its method, with a notice" : "stays"}`,
            gone
                ? offer.field === "none" &&
                      offer.chosen === "none" &&
                      !offer.legend &&
                      offer.notices.some((text) => /not available with this method/.test(text))
                : offer.field === own && offer.legend,
            `${before.configuration} -> ${after.configuration}: ${offer.notices.join(" | ")}`,
        );
        const kept = await until(
            () => colours(ben),
            (c) =>
                c.field === "displacement" &&
                c.legend &&
                c.values &&
                c.component &&
                c.options.includes("stiffness") === springs,
        );
        check(
            "the second browser keeps a field of both methods",
            kept.field === "displacement" &&
                kept.legend &&
                kept.values &&
                kept.component &&
                kept.options.includes("stiffness") === springs,
            JSON.stringify(kept),
        );
    }
    for (const page of [ada, ben]) await choose(page, "none");
    await until(
        () => ada.evaluate(() => !window.palpate.stage.dirty),
        (idle) => idle,
        3000,
    );
    await ada.screenshot({ path: join(pictures, "accuracy_switched.png") });

    // each kind of neighbour is chosen once
    const pressed = new Set();
    for (let press = 0; press < 3; press++) {
        const left = (s) => s.estimate?.neighbours?.find((n) => !pressed.has(n.parameter));
        const before = await until(
            () => shown(ada),
            (s) => left(s) && !s.busy,
        );
        const near = left(before);
        if (!near) break;
        pressed.add(near.parameter);
        const button = ada.locator("#accuracy-neighbour-list button:enabled", { hasText: near.parameter }).first();
        const title = await button.getAttribute("title");
        await button.click();
        const after = await until(
            () => shown(ada),
            (s) => !s.busy && s.epoch > before.epoch && s.drawn && title.startsWith(`${s.configuration},`),
        );
        check(
            `the button for ${near.parameter} switches to its neighbour`,
            after.configuration !== before.configuration && title.startsWith(`${after.configuration},`),
            `${before.configuration} -> ${after.configuration}; ${title}`,
        );
        check(
            "how far the surface moved is displayed",
            /^Switched in [\d.]+ m?s, surface moved .* mm\.$/.test(after.message),
            after.message,
        );
    }
    check("there were neighbours to choose", pressed.size >= 2, [...pressed].join());
    await ada.locator("#accuracy-panel").screenshot({ path: join(pictures, "accuracy_panel.png") });
    await ada.keyboard.press("p");
    for (const width of [1000, 1100, 1600]) {
        await ada.setViewportSize({ width, height: 800 });
        const within = (p) =>
            !p.dirty &&
            [...p.organ, ...p.hint].every((x) => x >= p.free[0] - 1 && x <= p.free[1] + 1) &&
            p.free[1] < width;
        const at = await until(() => extents(ada), within);
        check(`${width} pixels wide, the organ and the hint are between the panels`, within(at), JSON.stringify(at));
    }
    await ada.setViewportSize({ width: 1200, height: 800 });
    await ada.keyboard.press("p");
    await ada.keyboard.press("4");
    check("the panel closes", !(await shown(ada)).visible);

    // components: the instructor has switches, others see what is disabled
    for (const page of [ada, ben]) await page.keyboard.press("p");
    // the component that blends the last switch ends by itself after ten steps
    const all = await until(
        () => plan(ada),
        (p) => p.switches > 0 && !p.names.includes("blend"),
    );
    check(
        "an instructor has a switch for every component, others have none",
        all.switches === all.on.length && (await plan(ben)).switches === 0,
        all.on.join(" | "),
    );
    check("a component displays what requires it", all.reason !== "", all.reason);
    const name = all.names.includes("viscous") ? "viscous" : all.names[0];
    await flip(ada, name);
    const off = await until(
        () => plan(ada),
        (p) => p.off.length === 1 && p.component_ms === all.on.length - 1,
    );
    check(
        `${name} disabled: it leaves the plan with its cost`,
        off.component_ms === all.on.length - 1 && off.disabled[0]?.component === name && !off.names.includes(name),
        off.off.join(),
    );
    const seenOff = await until(
        () => plan(ben),
        (p) => p.off.length === 1,
    );
    check("the second browser shows that it is disabled", seenOff.off.length === 1, seenOff.off.join());
    await ada.screenshot({ path: join(pictures, "accuracy_component_off.png") });
    await until(() => ada.isEnabled(`#components tr[title^="${name}"] input`));
    await flip(ada, name);
    const on = await until(
        () => plan(ada),
        (p) => p.off.length === 0 && p.component_ms === all.on.length,
    );
    check("enabled again: the plan is the same as before", on.names.join() === all.names.join(), on.names.join(" "));
    check("the panel displays what is not computed", /field values/.test(on.idle), on.idle);
    checkConsoles();
});
