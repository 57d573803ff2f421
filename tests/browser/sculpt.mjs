// A solid of control cells in real Chromium pages: sculpted by clicks on it, undone by keys, painted, probed, cut, saved;
// who looks on sees the same. usage: node sculpt.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { check, finish, launch, moved, open, palpate, pictures, scratch, serve, troubles, until } from "./common.mjs";

/** what a page shows */
const shown = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate,
            body = [...state.bodies.values()][0];
        return {
            vertices: body.rest.length / 3,
            triangles: body.nCorner / 3,
            epoch: body.epoch,
            drawn: body.mesh.visible && body.shown,
            said: document.querySelector("#sculpt-message").textContent,
            busy: document.querySelector("#sculpt").getAttribute("aria-busy"),
        };
    });
const same = (a, b) => a.vertices === b.vertices && a.triangles === b.triangles;
/** waits for what an order brings: the next epoch, drawn, answered */
const after = (page, epoch) =>
    until(
        () => shown(page),
        (s) => s.epoch > epoch && s.drawn && s.busy === "false",
    );
/** what has moved, when it hardly moves any more */
const settled = async (page) => {
    let before = -1;
    return until(
        async () => {
            await page.waitForTimeout(400);
            return moved(page);
        },
        (m) => {
            const still = Math.abs(m - before) < 0.02 * m;
            before = m;
            return still;
        },
    );
};
const say = (s) => `${s.vertices} vertices, ${s.triangles} triangles, epoch ${s.epoch}: ${s.said}`;

/** a free pixel of the organ whose face looks most to a side, +z: 2 */
const facePixel = (page, axis) =>
    page.evaluate((k) => {
        const { stage, input } = window.palpate,
            w = innerWidth,
            h = innerHeight;
        let best = null,
            most = 0.9;
        for (let x = 0.05 * w; x < w; x += w / 40)
            for (let y = 0.05 * h; y < h; y += h / 30) {
                if (document.elementFromPoint(x, y)?.id !== "view") continue;
                const hit = input.pick(stage.ray(x, y));
                if (!hit) continue;
                const n = hit.normal.toArray();
                if (n[k] > most) [best, most] = [{ x, y }, n[k]];
            }
        return best;
    }, axis);
const tool = (page, name) => page.click(`#sculpt-tools button[data-name=${name}]`);
const drawn = async (page) =>
    until(
        () => page.evaluate(() => !window.palpate.stage.dirty && window.palpate.stage.ready()),
        (ready) => ready,
    );

let server;
const browsers = [];
try {
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
                    model: { name: "subdivision_fem", levels: 1 },
                },
            ],
        }),
    );
    server = await serve(join(scratch, "chair.json"), 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    browsers.push(await launch(), await launch());
    const ada = await open(browsers[0], address, "Ada", { width: 1000, height: 700 });
    const ben = await open(browsers[1], address, "Ben", { width: 480, height: 480 });
    const begin = await until(
        () => shown(ada),
        (s) => s.drawn,
    );
    check("a solid offers to be sculpted", await ada.isVisible("#mode-sculpt"), say(begin));
    await ada.click("#mode-sculpt");
    check("its panel opens", await ada.isVisible("#sculpt"));
    check(
        "with the settings of the chosen tool alone",
        (await ada.isVisible("#sculpt-distance")) &&
            !(await ada.isVisible("#sculpt-radius")) &&
            !(await ada.isVisible("#sculpt-what")),
    );
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_begin.png") });

    // no picture without a body while the topology changes
    await ada.evaluate(() => {
        window.blank = 0;
        const { state } = window.palpate,
            look = () => {
                if (![...state.bodies.values()].some((b) => b.mesh.visible && b.mesh.parent)) window.blank++;
                requestAnimationFrame(look);
            };
        look();
    });
    const top = await until(
        () => facePixel(ada, 2),
        (p) => p,
    );
    await ada.mouse.click(top.x, top.y);
    const grown = await after(ada, begin.epoch);
    check(
        "a click on a face lets a cell grow",
        grown.vertices > begin.vertices && grown.triangles > begin.triangles,
        say(grown),
    );
    check("and says so", /^Extrude: 77 cells/.test(grown.said), grown.said);
    const other = await until(
        () => shown(ben),
        (s) => s.epoch === grown.epoch && s.drawn,
    );
    check("who looks on sees it", same(other, grown), say(other));
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_extruded.png") });

    await ada.keyboard.press("Control+z");
    const undone = await after(ada, grown.epoch);
    check("Ctrl+Z brings back what was", same(undone, begin), say(undone));
    await ada.keyboard.press("Control+Shift+Z");
    const redone = await after(ada, undone.epoch);
    check("Ctrl+Shift+Z does it again", same(redone, grown), say(redone));
    check("no picture was without the body", (await ada.evaluate(() => window.blank)) === 0);

    const spot = await until(
        () => facePixel(ada, 2),
        (p) => p,
    );
    const probe = async () => {
        await tool(ada, "probe");
        await ada.mouse.click(spot.x, spot.y);
        return (
            await until(
                () => shown(ada),
                (s) => /Pa,/.test(s.said),
            )
        ).said; // not "Paint"
    };
    const soft = await probe();
    check("a probe tells the material", soft === "5 kPa, 1000 kg/m³", soft);
    await tool(ada, "paint");
    await ada.click("#sculpt-paints button[data-name=stiffer]");
    await ada.mouse.click(spot.x, spot.y);
    const painted = await after(ada, redone.epoch);
    check("paint is answered", /^Paint: 77 cells/.test(painted.said), painted.said);
    const stiff = await probe();
    check("and found by the probe", stiff === "10 kPa, 1000 kg/m³", stiff);

    // a force lasts until it is released, and follows its slider
    await tool(ada, "inflate");
    check("nothing to release yet", await ada.isDisabled("#sculpt-release"));
    const still = await moved(ada);
    await ada.mouse.click(spot.x, spot.y);
    await until(
        () => moved(ada),
        (m) => m > still + 2e-4,
    );
    const blown = await settled(ada);
    check("what is inflated moves", blown > still + 2e-4, `${(1e3 * blown).toFixed(2)} mm`);
    await ada.$eval("#sculpt-pressure", (e) => {
        e.value = String(Number(e.value) + 30);
        e.dispatchEvent(new Event("input"));
    });
    const more = await until(
        () => moved(ada),
        (m) => m > 1.5 * blown,
    );
    check("farther with more pressure", more > 1.5 * blown, `${(1e3 * more).toFixed(2)} mm`);
    await until(
        () => shown(ada),
        (s) => s.busy === "false",
    );
    await ada.click("#sculpt-release");
    const back = await until(
        () => moved(ada),
        (m) => m < 0.3 * more,
    );
    const released = await until(
        () => ada.isDisabled("#sculpt-release"),
        (d) => d,
    );
    check("and goes back when it is released", back < 0.3 * more && released, `${(1e3 * back).toFixed(2)} mm`);

    await ada.selectOption("#sculpt-axis", "x");
    const cut = await after(ada, painted.epoch);
    check("a cut shows less of it", cut.triangles < painted.triangles, say(cut));
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "sculpt_cut.png") });
    const [file] = await Promise.all([ada.waitForEvent("download"), ada.click("#sculpt-ply")]);
    const path = join(scratch, "saved.ply");
    await file.saveAs(path);
    check(
        "what is shown is saved as PLY",
        file.suggestedFilename() === "chair.ply" &&
            readFileSync(path, "latin1").includes(`element face ${cut.triangles}\n`),
        file.suggestedFilename(),
    );
    await ada.selectOption("#sculpt-axis", "none");
    const whole = await after(ada, cut.epoch);
    check("and it is whole again", same(whole, painted), say(whole));

    // a refusal is a sentence where the panel speaks, and changes nothing
    await tool(ada, "merge");
    for (let i = 0; i < 2; i++) await ada.mouse.click(spot.x, spot.y);
    const refused = await until(
        () => shown(ada),
        (s) => s.busy === "false" && /merge/.test(s.said),
    );
    check(
        "what cannot be done is refused with a sentence",
        /merge/.test(refused.said) && refused.epoch === whole.epoch,
        refused.said,
    );
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
