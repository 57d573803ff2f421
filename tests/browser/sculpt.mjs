// A subdivision solid: sculpted by clicks, undone by keys, painted, probed, cut, saved; a second browser shows the same.
// usage: node sculpt.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    launch,
    open,
    palpate,
    pictures,
    run,
    scratch,
    serve,
    settled,
    until,
    drawn,
} from "./common.mjs";

/** what a page shows */
const shown = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate;
        const body = [...state.bodies.values()][0];
        return {
            vertices: body.rest.length / 3,
            triangles: body.nCorner / 3,
            epoch: body.epoch,
            drawn: body.mesh.visible && body.shown,
            message: document.querySelector("#sculpt-message").textContent,
            busy: document.querySelector("#sculpt").getAttribute("aria-busy"),
        };
    });
const same = (a, b) => a.vertices === b.vertices && a.triangles === b.triangles;
/** waits for the result of a command: answered, the next epoch drawn */
const after = (page, epoch) =>
    until(
        () => shown(page),
        (s) => s.epoch > epoch && s.drawn && s.busy === "false",
    );
const summary = (s) => `${s.vertices} vertices, ${s.triangles} triangles, epoch ${s.epoch}: ${s.message}`;

/** a pixel of the organ whose normal is closest to an axis, 2: +z */
const facePixel = (page, axis) =>
    page.evaluate((k) => {
        const { stage, input } = window.palpate;
        const w = innerWidth;
        const h = innerHeight;
        let best = null;
        let max = 0.9;
        for (let x = 0.05 * w; x < w; x += w / 40)
            for (let y = 0.05 * h; y < h; y += h / 30) {
                if (document.elementFromPoint(x, y)?.id !== "view") continue;
                const hit = input.pick(stage.ray(x, y));
                if (!hit) continue;
                const n = hit.normal.toArray();
                if (n[k] > max) [best, max] = [{ x, y }, n[k]];
            }
        return best;
    }, axis);
/** what the page shows that a click at a pixel would pick, once it has looked there */
const pickedAt = async (page, { x, y }) => {
    await page.mouse.move(x, y);
    return until(() =>
        page.evaluate(
            (at) => {
                const { highlight, input, stage } = window.palpate;
                const hit = input.pick(stage.ray(at.x, at.y));
                return hit && highlight.hit && hit.point.distanceTo(highlight.hit.point) < 1e-4 && highlight.picked;
            },
            { x, y },
        ),
    );
};
/** the last answer, if it is of this verb */
const answered = (page, verb) =>
    until(
        () => page.evaluate(() => (window.palpate.sculpt.isBusy() ? null : window.palpate.sculpt.answered)),
        (a) => a?.verb === verb,
    );
const samePick = (a, b) => ["face", "cell", "edge", "vertex"].every((key) => a[key] === b[key]);
/** radius of the shown ring in pixels, and that of the brush */
const ringRadius = (page) =>
    page.evaluate(() => {
        const { highlight, sculpt, stage } = window.palpate;
        const { geometry } = highlight.marks.lines;
        const x = geometry.getAttribute("instanceStart").data.array;
        const centre = highlight.hit.point;
        const at = stage.project(centre);
        let shown = 0;
        for (let i = 0; i < 6 * geometry.instanceCount; i += 3) {
            const p = stage.project(centre.clone().fromArray(x, i));
            shown = Math.max(shown, Math.hypot(p.x - at.x, p.y - at.y));
        }
        // a metre is larger where the surface is nearer than the middle of the view
        const away = stage.camera.position.clone().sub(stage.target).normalize();
        const depth = stage.camera.position.clone().sub(centre).dot(away);
        return { shown, brush: (sculpt.settings().radius_m * stage.pixelsPerMetre() * stage.view.depth()) / depth };
    });
/** largest angle between a triangle of the cut and the normals of its corners (102 degrees without creases); null: the control cells are not there yet */
const cutTilt = (page) =>
    page.evaluate(() => {
        const { highlight, state } = window.palpate;
        const cells = highlight.cellsOf(0);
        if (!cells) return null;
        const body = state.bodies.get(0);
        const index = body.geometry.index.array;
        const at = (array, v) => highlight.stage.target.clone().fromArray(array, 3 * v);
        let n = 0;
        let tilt = 0;
        cells.faceOf.forEach((face, t) => {
            if (face >= 0) return;
            n++;
            const [a, b, c] = index.subarray(3 * t, 3 * t + 3);
            const x = body.position.array;
            const normal = at(x, b)
                .sub(at(x, a))
                .cross(at(x, c).sub(at(x, a)));
            for (const v of [a, b, c])
                tilt = Math.max(tilt, (normal.angleTo(at(body.normal.array, v)) * 180) / Math.PI);
        });
        return { n, tilt };
    });
/** stiffness that is shown in colour at a pixel, and the smallest of the body, Pa; 0: not yet; null: no such field */
const stiffnessAt = (page, { x, y }) =>
    page.evaluate(
        (at) => {
            const { input, stage, state } = window.palpate;
            if (!state.parts[0].fields.includes("young")) return null;
            const body = state.bodies.get(0);
            const { newer, uniforms, values } = body.colours;
            const hit = input.pick(stage.ray(at.x, at.y));
            if (state.field !== "young" || !values || !hit) return { there: 0, elsewhere: 0 };
            const { x: low, y: high } = uniforms.newer.value;
            const value = (v) => low + ((high - low) * newer.array[v]) / 255;
            const corners = body.triangles().subarray(3 * hit.triangle, 3 * hit.triangle + 3);
            return { there: Math.max(...corners.map(value)), elsewhere: low };
        },
        { x, y },
    );
const tool = (page, name) => page.click(`#sculpt-tools button[data-name=${name}]`);

await run(async () => {
    execFileSync(palpate, ["cells", "chair", "-o", join(scratch, "chair.palcells"), "--quiet"]);
    writeFileSync(
        join(scratch, "chair.json"),
        JSON.stringify({
            name: "chair",
            title: "Chair",
            gravity_m_s2: 0,
            tools: [{ name: "probe 1" }, { name: "probe 2" }],
            bodies: [
                {
                    name: "chair",
                    cells: "chair.palcells",
                    supports: [{ lowest: 0.2 }],
                    // fewer sub-steps, and none at rest: the server takes edits back on a machine that is too slow
                    material: { density_kg_m3: 4000 },
                    effects: [{ name: "sleep" }],
                    model: { name: "subdivision_fem", levels: 1 },
                },
            ],
        }),
    );
    const server = await serve(join(scratch, "chair.json"), 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    const browsers = [await launch(), await launch()];
    const ada = await open(browsers[0], address, "Ada", { width: 1000, height: 700 });
    const ben = await open(browsers[1], address, "Ben", { width: 480, height: 480 });
    const begin = await until(
        () => shown(ada),
        (s) => s.drawn,
    );
    check("a subdivision solid offers sculpting", await ada.isVisible("#mode-sculpt"), summary(begin));
    await ada.click("#mode-sculpt");
    check("the panel opens", await ada.isVisible("#sculpt"));
    check(
        "only the settings of the chosen tool are visible",
        (await ada.isVisible("#sculpt-distance")) &&
            !(await ada.isVisible("#sculpt-radius")) &&
            !(await ada.isVisible("#sculpt-entity")),
    );
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_begin.png") });

    check(
        "sliders say their values with units",
        /^[\d.]+ mm$/.test(await ada.getAttribute("#sculpt-distance", "aria-valuetext")),
        await ada.getAttribute("#sculpt-distance", "aria-valuetext"),
    );

    // counts pictures without a body while the topology changes
    await ada.evaluate(() => {
        window.blank = 0;
        const { state } = window.palpate;
        const look = () => {
            if (![...state.bodies.values()].some((b) => b.mesh.visible && b.mesh.parent)) window.blank++;
            requestAnimationFrame(look);
        };
        look();
    });
    const top = await until(() => facePixel(ada, 2));
    const pick = await pickedAt(ada, top);
    check("the face under the mouse is filled", await ada.evaluate(() => window.palpate.highlight.marks.fill.visible));
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_highlight.png") });
    await ada.mouse.click(top.x, top.y);
    const grown = await after(ada, begin.epoch);
    const changed = (await answered(ada, "extrude")).args;
    check("the click changes what was shown under the mouse", samePick(pick, changed), JSON.stringify([pick, changed]));
    check(
        "a click on a face extrudes a cell",
        grown.vertices > begin.vertices && grown.triangles > begin.triangles,
        summary(grown),
    );
    check("the panel displays the result", grown.message === "Extruded.", grown.message);
    const other = await until(
        () => shown(ben),
        (s) => s.epoch === grown.epoch && s.drawn,
    );
    check("the second browser shows it", same(other, grown), summary(other));
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_extruded.png") });

    await ada.keyboard.press("Control+z");
    const undone = await after(ada, grown.epoch);
    check("Ctrl+Z undoes it", same(undone, begin), summary(undone));
    await ada.keyboard.press("Control+Shift+Z");
    const redone = await after(ada, undone.epoch);
    check("Ctrl+Shift+Z repeats it", same(redone, grown), summary(redone));
    check("every picture shows the body", (await ada.evaluate(() => window.blank)) === 0);

    // page and server pick the same, all over the surface
    await ada.keyboard.press("q");
    check(
        "a letter chooses a tool, whose tooltip names it",
        (await ada.getAttribute("#sculpt-tools button[data-name=probe]", "aria-checked")) === "true" &&
            /\(Q\)$/.test(await ada.getAttribute("#sculpt-tools button[data-name=probe]", "title")),
    );
    const places = await ada.evaluate(() => {
        const { stage, input } = window.palpate;
        const out = [];
        for (let y = 0.1; y < 0.9; y += 0.11)
            for (let x = 0.3; x < 0.9; x += 0.07) {
                const at = { x: x * innerWidth, y: y * innerHeight };
                if (document.elementFromPoint(at.x, at.y)?.id === "view" && input.pick(stage.ray(at.x, at.y)))
                    out.push(at);
            }
        return out.slice(0, 12);
    });
    let agreed = 0;
    for (const place of places) {
        const there = await pickedAt(ada, place);
        await ada.evaluate(() => (window.palpate.sculpt.answered = null));
        await ada.mouse.click(place.x, place.y);
        if (samePick(there, (await answered(ada, "probe")).args)) agreed++;
    }
    check(
        "page and server pick the same everywhere",
        agreed === places.length && agreed > 5,
        `${agreed} of ${places.length}`,
    );

    const spot = await until(() => facePixel(ada, 2));
    const probe = async () => {
        await tool(ada, "probe");
        await ada.mouse.click(spot.x, spot.y);
        return (
            await until(
                () => shown(ada),
                (s) => /^Stiffness/.test(s.message),
            )
        ).message;
    };
    const soft = await probe();
    check("the probe displays the material", soft === "Stiffness 5 kPa, density 4000 kg/m³", soft);
    await tool(ada, "paint");
    await ada.click("#sculpt-paints button[data-name=stiffer]");
    await pickedAt(ada, spot);
    await drawn(ada);
    const ring = await ringRadius(ada);
    check(
        "the ring of the brush has its radius",
        Math.abs(ring.shown / ring.brush - 1) < 0.05,
        `${ring.shown.toFixed(1)} of ${ring.brush.toFixed(1)} pixels`,
    );
    await ada.screenshot({ path: join(pictures, "sculpt_ring.png") });
    await ada.mouse.click(spot.x, spot.y);
    const painted = await after(ada, redone.epoch);
    check("painting is answered", painted.message === "Painted.", painted.message);
    // the stroke is seen, though the chair sleeps
    const colours = await until(
        () => stiffnessAt(ada, spot),
        (c) => !c || c.there > 1.5 * c.elsewhere,
    );
    if (!colours) console.log("     the server does not offer the stiffness in colour");
    else {
        check(
            "the colour is that of what was painted: twice 5 kPa there, 5 kPa elsewhere",
            // means over the elements around a vertex, some of which the edge of the brush crosses
            Math.abs(colours.there / 1e4 - 1) < 0.03 && Math.abs(colours.elsewhere / 5e3 - 1) < 0.01,
            `${(1e-3 * colours.there).toFixed(1)} kPa, elsewhere ${(1e-3 * colours.elsewhere).toFixed(1)} kPa`,
        );
        await drawn(ada);
        await ada.screenshot({ path: join(pictures, "sculpt_painted.png") });
    }
    const stiff = await probe();
    check("the probe displays the painted material", stiff === "Stiffness 10 kPa, density 4000 kg/m³", stiff);

    // a force lasts until it is released, and follows its slider
    await tool(ada, "inflate");
    check("there is nothing to release", await ada.isDisabled("#sculpt-release"));
    const atRest = await displacement(ada);
    await ada.mouse.click(spot.x, spot.y);
    await until(
        () => displacement(ada),
        (m) => m > atRest + 2e-4,
    );
    const blown = await settled(ada, (m) => 0.02 * m, 0.4);
    check("inflation moves the surface", blown > atRest + 2e-4, `${(1e3 * blown).toFixed(2)} mm`);
    await ada.$eval("#sculpt-pressure", (e) => {
        e.value = String(Number(e.value) + 30);
        e.dispatchEvent(new Event("input"));
    });
    const more = await until(
        () => displacement(ada),
        (m) => m > 1.5 * blown,
    );
    check("more pressure moves it farther", more > 1.5 * blown, `${(1e3 * more).toFixed(2)} mm`);
    await until(
        () => shown(ada),
        (s) => s.busy === "false",
    );
    await ada.click("#sculpt-release");
    const back = await until(
        () => displacement(ada),
        (m) => m < 0.3 * more,
    );
    const released = await until(() => ada.isDisabled("#sculpt-release"));
    check("it returns after release", back < 0.3 * more && released, `${(1e3 * back).toFixed(2)} mm`);

    await ada.selectOption("#sculpt-axis", "x");
    const cut = await after(ada, painted.epoch);
    check("a cut hides a part", cut.triangles < painted.triangles, summary(cut));
    await ada.focus("#sculpt-cut");
    check(
        "the plane of the cut is shown while its slider is in use",
        (await until(() => ada.evaluate(() => window.palpate.highlight.marks.lines.geometry.instanceCount))) >= 4,
        await ada.getAttribute("#sculpt-cut", "aria-valuetext"),
    );
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_plane.png") });
    const flat = await until(() => cutTilt(ada));
    check(
        "no normal on the cut is tilted by what lies beyond its edge",
        flat.tilt < 45,
        `${flat.tilt.toFixed(1)} degrees, ${flat.n} triangles`,
    );
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_cut.png") });
    const [file] = await Promise.all([ada.waitForEvent("download"), ada.click("#sculpt-ply")]);
    const path = join(scratch, "saved.ply");
    await file.saveAs(path);
    check(
        "the visible surface is saved as PLY",
        file.suggestedFilename() === "chair.ply" &&
            readFileSync(path, "latin1").includes(`element face ${cut.triangles}\n`),
        file.suggestedFilename(),
    );
    await ada.selectOption("#sculpt-axis", "none");
    const whole = await after(ada, cut.epoch);
    check("the whole is shown again", same(whole, painted), summary(whole));

    // without a mouse: Enter shows the middle of the picture, and once more clicks
    await tool(ada, "sharpen");
    await ada.focus("#view");
    await ada.keyboard.press("Enter");
    const aimed = await until(() =>
        ada.evaluate(() => window.palpate.input.mouse?.byKeyboard && window.palpate.highlight.picked),
    );
    await ada.keyboard.press("Enter");
    const sharpened = (await answered(ada, "sharpen")).args;
    check(
        "Enter shows what it will change, and once more changes it",
        samePick(aimed, sharpened),
        JSON.stringify(aimed),
    );
    const sharp = await after(ada, whole.epoch);

    // a refusal is displayed in the panel and changes nothing
    await tool(ada, "merge");
    for (let i = 0; i < 2; i++) await ada.mouse.click(spot.x, spot.y);
    const refused = await until(
        () => shown(ada),
        (s) => s.busy === "false" && /two different/.test(s.message),
    );
    check(
        "an impossible command is refused with a sentence",
        refused.message === "Choose two different faces." && refused.epoch === sharp.epoch,
        refused.message,
    );
    checkConsoles();
});
