// Fields in colours: offered by the model, computed while they are displayed.
// usage: node fields.mjs BUILD PICTURES [springs|fem]     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    drag,
    grasp,
    launch,
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

const figures = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate;
        const body = [...state.bodies.values()][0];
        return {
            field: state.field,
            range: state.range,
            values: body?.colours.values ?? null,
            mix: body?.colours.uniforms.mix.value,
            components: state.running,
            wanted: state.status?.components ?? [],
            ticks: [...document.querySelectorAll("#legend-ticks span")].map((t) => t.textContent),
            state: document.querySelector("#legend-state").textContent,
            unit: document.querySelector("#legend-unit").textContent,
            legend: !document.querySelector("#legend").hidden,
            options: [...document.querySelectorAll("#field option:enabled")].map((o) => o.value),
            note: document.querySelector("#field option:disabled")?.textContent ?? "",
        };
    });
/** the newest values and colours are in the picture: it has been drawn twice since */
const drawn = async (page) => {
    const count = () =>
        page.evaluate(() => {
            window.palpate.stage.dirty = true;
            return window.palpate.stage.renderer.info.render.frame;
        });
    const before = await count();
    await until(count, (now) => now > before + 1);
};
const choose = (page, name) =>
    page.evaluate((value) => {
        const list = document.querySelector("#field");
        list.value = value;
        list.dispatchEvent(new Event("change"));
    }, name);
const pull = async (page, pixel, steps) => {
    await grasp(page, pixel);
    await drag(page, pixel, 7, -8, steps);
};

/** the n-th section plane: a direction, and a place from 0 to 1 */
const setPlane = (page, n, direction, at) =>
    page.evaluate(
        ([i, chosen, place]) => {
            const row = document.querySelectorAll("#inside-planes div")[i];
            const [list, slider] = [row.querySelector("select"), row.querySelector("input")];
            list.value = chosen;
            list.dispatchEvent(new Event("change"));
            slider.value = String(place);
            slider.dispatchEvent(new Event("input"));
        },
        [n, direction, at],
    );
const insideNow = (page) =>
    page.evaluate(() => {
        const { inside, state } = window.palpate;
        const interior = [...inside.interiors.values()][0];
        const caps = [...(inside.section?.caps.values() ?? [])];
        // in a displacement, each node's value is its distance from rest
        let off = 0;
        for (let i = 0; interior && i < interior.value.length; i++) {
            const d = [0, 1, 2].map((c) => interior.x[3 * i + c] - interior.rest[3 * i + c]);
            off = Math.max(off, Math.abs(Math.hypot(...d) - interior.value[i]));
        }
        return {
            field: interior?.field,
            wanted: state.field,
            off,
            bound: interior ? (interior.high - interior.low) / 255 + 4e-4 : 0,
            caps: caps.length,
            corners: caps.map((cap) => cap.sliced?.n ?? 0),
            clipped: [...state.bodies.values()].map((body) => body.mesh.material.clippingPlanes?.length ?? 0),
        };
    });

/**
 * The first plane and its handle. arrow: a pixel on it that no other part of the handle covers; ahead: the pixel of the
 * point that is so many m further along the normal; metre: pixels of a metre there, along the normal
 */
const handleNow = (page, forward = 0) =>
    page.evaluate((m) => {
        const { inside, stage, input, state } = window.palpate;
        const plane = inside.section?.where(0);
        const handle = inside.handles?.handles[0];
        if (!plane || !handle?.arrow.object) return null;
        const along = inside.handles.along(0);
        const { anchor, arrow } = handle;
        const on = (d) => {
            const { x, y } = stage.project(anchor.position.clone().addScaledVector(along, d));
            return { x, y };
        };
        const picks = (control, at) => inside.handles.hover({ clientX: at.x, clientY: at.y }) === control;
        const start = [0.02, 0.025, 0.03, 0.035, 0.015, 0.01].find((d) => picks(arrow, on(d)));
        const base = on(start ?? 0);
        const next = on((start ?? 0) + 0.001);
        return {
            offset: plane.normal.reduce((sum, n, c) => sum + n * along.toArray()[c], 0) * -plane.constant,
            along: along.toArray(),
            arrow: start === undefined ? null : base,
            ahead: on((start ?? 0) + m),
            metre: 1000 * Math.hypot(next.x - base.x, next.y - base.y),
            target: state.target,
            dragging: input.drag !== null,
            slider: Number(document.querySelector("#inside-planes input").value),
            direction: document.querySelector("#inside-planes select").value,
            box: [state.hello.box_min_m, state.hello.box_max_m],
            view: [stage.free.azimuth, stage.free.elevation],
        };
    }, forward);
/** a place on a ring of the first plane's handle, where nothing else of it is in front; null: none */
const ringPixel = (page) =>
    page.evaluate(() => {
        const { inside, stage } = window.palpate;
        const { anchor, rings } = inside.handles.handles[0];
        const at = stage.project(anchor.position);
        for (let r = 20; r < 120; r += 4)
            for (let a = 0; a < 6.28; a += 0.2) {
                const x = at.x + r * Math.cos(a);
                const y = at.y + r * Math.sin(a);
                if (document.elementFromPoint(x, y)?.id !== "view") continue;
                if (inside.handles.hover({ clientX: x, clientY: y }) === rings) return { x, y };
            }
        return null;
    });
/** a touch of one finger that moves from one pixel to another */
async function swipe(page, from, to, steps) {
    const device = await page.context().newCDPSession(page);
    const send = (type, points) => device.send("Input.dispatchTouchEvent", { type, touchPoints: points });
    await send("touchStart", [from]);
    for (let i = 1; i <= steps; i++)
        await send("touchMove", [
            { x: from.x + ((to.x - from.x) * i) / steps, y: from.y + ((to.y - from.y) * i) / steps },
        ]);
    await send("touchEnd", []);
    await device.detach();
}

/** planes moved and turned by their handles */
async function checkHandles(name, address) {
    const browser = await launch();
    const page = await open(browser, address, "Eve", { width: 900, height: 600 });
    await page.keyboard.press("i");
    await setPlane(page, 0, "x", 0.5);
    await until(() => handleNow(page));
    const forward = 0.02;
    for (const device of ["mouse", "touch"]) {
        await drawn(page);
        const before = await handleNow(page, device === "mouse" ? forward : -forward);
        check(`${name}: the plane has an arrow that can be dragged (${device})`, before.arrow !== null);
        let held = null;
        if (device === "mouse") {
            await page.mouse.move(before.arrow.x, before.arrow.y);
            await page.mouse.down();
            const [dx, dy] = [(before.ahead.x - before.arrow.x) / 5, (before.ahead.y - before.arrow.y) / 5];
            await drag(page, before.arrow, dx, dy, 5);
            held = await handleNow(page);
            await page.screenshot({ path: join(pictures, `handles_${name}.png`) });
            await page.mouse.up();
        } else await swipe(page, before.arrow, before.ahead, 5);
        const after = await handleNow(page);
        const moved = after.offset - before.offset;
        const wanted = device === "mouse" ? forward : -forward;
        check(
            `${name}: dragged by ${device}, its offset changes by the way along the normal, to a pixel`,
            Math.abs(moved - wanted) * before.metre <= 1,
            `${(1e3 * moved).toFixed(3)} of ${1e3 * wanted} mm, ${(Math.abs(moved - wanted) * before.metre).toFixed(2)} px`,
        );
        const [low, high] = before.box;
        const at = (after.offset - low[0]) / (high[0] - low[0]);
        check(
            `${name}: the slider stands where the plane is (${device})`,
            Math.abs(at - after.slider) <= 0.0011, // half of its step
            `${at.toFixed(4)} and ${after.slider}`,
        );
        check(
            `${name}: nothing is grasped, and the view stays (${device})`,
            !held?.dragging && !held?.target && !after.target && `${after.view}` === `${before.view}`,
        );
    }
    await drawn(page);
    const ring = await ringPixel(page);
    const before = await handleNow(page);
    check(`${name}: the plane has rings`, ring !== null);
    await page.mouse.move(ring.x, ring.y);
    await page.mouse.down();
    await drag(page, ring, 6, 4, 5);
    await page.mouse.up();
    await drawn(page);
    await page.screenshot({ path: join(pictures, `handles_${name}_turned.png`) });
    const after = await handleNow(page);
    const cos = after.along.reduce((sum, a, c) => sum + a * before.along[c], 0);
    const degrees = (180 / Math.PI) * Math.acos(Math.min(1, cos));
    check(
        `${name}: a ring turns it`,
        after.direction === "turned" && degrees > 5 && degrees < 90 && !after.target,
        `${degrees.toFixed(1)} degrees`,
    );
    await setPlane(page, 0, "turned", 0.75);
    const moved = await handleNow(page);
    const kept = moved.along.reduce((sum, a, c) => sum + a * after.along[c], 0);
    check(
        `${name}: the slider moves a turned plane along its normal`,
        kept > 1 - 1e-9 && moved.offset > after.offset,
        `${(1e3 * after.offset).toFixed(1)} -> ${(1e3 * moved.offset).toFixed(1)} mm`,
    );
    await page.keyboard.press("i");
    await drawn(page);
    check(`${name}: a closed panel has no handles`, (await handleNow(page)) === null);
    await browser.close();
}

/** sections of a body that is being pulled, with its displacement inside */
async function checkInside(page, name) {
    // the mouse pulls: buttons are pressed by the page, and a slow machine may not let go meanwhile
    const press = (id) => page.evaluate((button) => document.querySelector(button).click(), id);
    await press("#pause");
    await until(() => page.evaluate(() => window.palpate.state.status.paused));
    await choose(page, "displacement");
    await page.keyboard.press("i");
    check(`${name}: key I opens the section planes`, await page.isVisible("#inside"));
    let now = await insideNow(page);
    check(`${name}: without a plane nothing is loaded or cut`, now.caps === 0 && now.field === undefined);
    await setPlane(page, 0, "view", 0.5);
    now = await until(
        () => insideNow(page),
        (i) => i.field === "displacement" && i.corners[0] > 0,
    );
    check(
        `${name}: a plane that faces the viewer cuts the body, and its cap has values from inside`,
        now.caps === 1 && now.clipped[0] === 1 && now.corners[0] > 30,
        `${now.corners[0]} corners`,
    );
    check(`${name}: nodes inside moved by their displacement`, now.off <= now.bound, `${now.off} m`);
    await choose(page, name === "fem" ? "von_mises" : "strain");
    await until(
        () => insideNow(page),
        (i) => i.field === i.wanted,
    );
    await drawn(page);
    await page.screenshot({ path: join(pictures, `inside_${name}.png`) });
    await setPlane(page, 1, "x", 0.55);
    await setPlane(page, 2, "z", 0.4);
    now = await until(
        () => insideNow(page),
        (i) => i.caps === 3 && i.clipped[0] === 3,
    );
    check(`${name}: three planes remove a corner`, now.caps === 3 && now.clipped[0] === 3);
    await drawn(page);
    await page.screenshot({ path: join(pictures, `inside_${name}_corner.png`) });
    for (const n of [0, 1, 2]) await setPlane(page, n, "none", 0.5);
    const cloud = () =>
        page.evaluate(() => {
            const { inside, state } = window.palpate;
            const [shown] = [...(inside.cloud?.clouds.values() ?? [])];
            return { texture: shown?.texture !== undefined, surface: [...state.bodies.values()][0].mesh.visible };
        });
    await press("#inside-volume");
    let shape = await until(cloud, (c) => c.texture && !c.surface);
    check(`${name}: a cloud takes the place of the surface`, shape.texture && !shape.surface);
    await drawn(page);
    await page.screenshot({ path: join(pictures, `cloud_${name}.png`) });
    await press("#inside-volume");
    shape = await until(cloud, (c) => !c.texture && c.surface);
    check(`${name}: without it the surface is back`, !shape.texture && shape.surface);
    now = await until(
        () => insideNow(page),
        (i) => i.caps === 0,
    );
    check(`${name}: without planes the body is whole again`, now.caps === 0 && now.clipped[0] === 0);
    await page.keyboard.press("i");
    check(`${name}: key I closes the section planes`, await page.isHidden("#inside"));
    await press("#pause");
    await until(() => page.evaluate(() => !window.palpate.state.status.paused));
}

/** pulls the organ and displays fields of its model; the pictures have its name */
async function checkFields(name, scene, wanted, offered = wanted) {
    const server = await serve(scene, 0);
    const browser = await launch();
    const address = `http://127.0.0.1:${server.info.port}/`;
    await checkHandles(name, address);
    const page = await open(browser, address, "Ada", { width: 900, height: 600 });
    let f = await figures(page);
    check(
        `${name}: the fields of the model are offered`,
        f.options.join() === ["none", ...offered].join(),
        f.options.join(" "),
    );
    check(`${name}: missing fields are explained`, (f.note !== "") === !wanted.includes("von_mises"), f.note);
    check(
        `${name}: without a choice there is no component, legend or colour`,
        !f.components.includes("field_output") && !f.legend && f.mix === 0 && f.wanted.length === 0,
    );
    await page.keyboard.press("c");
    f = await until(
        () => figures(page),
        (g) => g.values,
    );
    check(
        `${name}: key C colours the first field; a body at rest keeps its natural colour, and the legend says so`,
        f.field === offered[0] && f.legend && f.mix === 0 && /0\.25.*mm/.test(f.state),
        f.state,
    );
    const pixel = await until(() => organPixel(page));
    await pull(page, pixel, 9);
    for (const field of wanted) {
        await choose(page, field);
        f = await until(
            () => figures(page),
            (g) => g.values && g.mix === 1 && g.components.includes("field_output"),
        );
        check(
            `${name}: ${field} is displayed when chosen, with its component in the plan`,
            f.values !== null && f.components.includes("field_output") && f.legend && f.mix === 1,
            `${f.ticks.join(" ")} ${f.unit}, values ${f.values?.low.toPrecision(3)} to ${f.values?.high.toPrecision(3)}`,
        );
        check(
            `${name}: ${field} is within the range of the legend, which has five ticks in one unit`,
            f.values &&
                f.values.high > 0 &&
                f.values.high <= f.range.high + 1e-4 * Math.abs(f.range.high) &&
                f.values.low >= f.range.low - 1e-4 * Math.abs(f.range.low) &&
                f.ticks.length === 5 &&
                f.unit !== "",
        );
        await drawn(page);
        await page.screenshot({ path: join(pictures, `field_${name}_${field}.png`) });
    }
    await checkInside(page, name);
    // a long pull: the range follows
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
        `${f.ticks.at(-1)} ${f.unit} (before ${before.ticks.at(-1)} ${before.unit})`,
    );
    await page.screenshot({ path: join(pictures, `field_${name}_long.png`) });
    await page.mouse.up();
    await choose(page, "none");
    f = await until(
        () => figures(page),
        (g) => !g.components.includes("field_output"),
    );
    check(
        `${name}: without a choice the component and the colours disappear`,
        !f.components.includes("field_output") && !f.legend && f.mix === 0 && f.values === null,
        f.components.join(" "),
    );
    // values arrive while the simulation is paused
    await page.click("#pause");
    await until(() => page.evaluate(() => window.palpate.state.status.paused));
    await choose(page, wanted.at(-1));
    f = await until(
        () => figures(page),
        (g) => g.values,
    );
    check(`${name}: a paused body shows its field`, f.values !== null);
    await page.close();
    const metrics = async () => {
        const text = await (await fetch(`http://127.0.0.1:${server.info.port}/metrics`)).text();
        const members = [...text.matchAll(/palpate_clients\{.*\} (\d+)/g)].reduce((sum, m) => sum + Number(m[1]), 0);
        return { members, sent: Number(/palpate_fields_sent_total (\d+)/.exec(text)[1]) };
    };
    // the server notices the closed connection with its next message
    let left = await metrics();
    for (const end = Date.now() + 300000; left.members > 0 && Date.now() < end; ) left = await metrics();
    // each answer is a turn of the network thread, which would send
    let after = left;
    for (let turn = 0; turn < 1000; turn++) after = await metrics();
    check(
        `${name}: nothing is sent after the page is closed`,
        left.members === 0 && left.sent > 0 && after.sent === left.sent,
        `${after.sent} sent`,
    );
    await browser.close();
    server.child.kill("SIGTERM");
}

/** scene of the procedural organ as finite elements; null if this build cannot prepare it */
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
            `     no scene with finite elements: ${
                String(error.stderr ?? error)
                    .trim()
                    .split("\n")[0]
            }`,
        );
        return null;
    }
}

await run(async () => {
    const only = process.argv[4];
    if (only !== "fem")
        await checkFields(
            "springs",
            prepare(),
            ["displacement", "stiffness"],
            ["displacement", "energy", "stiffness", "density", "damping", "strain", "distortion"],
        );
    const fem = only === "springs" ? null : prepareFem();
    if (fem)
        await checkFields(
            "fem",
            fem,
            ["displacement", "von_mises", "energy", "distortion"],
            ["displacement", "von_mises", "energy", "young", "density", "damping", "strain", "distortion"],
        );
    checkConsoles();
});
