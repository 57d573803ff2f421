// Cut tissue: what shows where a control cell was deleted, or grew, has the look of the inside; undone, it is gone.
// usage: node inside.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    colourAt,
    launch,
    open,
    palpate,
    pictures,
    run,
    scratch,
    serve,
    until,
} from "./common.mjs";

/** waits for a topology after an epoch, drawn */
const drawnAfter = (page, epoch) =>
    until(
        () =>
            page.evaluate(() => {
                const body = window.palpate.state.bodies.get(0);
                const look = body.geometry.getAttribute("look")?.array ?? [];
                const inside = body.geometry.index.array.subarray(0, body.nCorner).filter((v) => look[v] === 1);
                return {
                    epoch: body.epoch,
                    drawn: body.mesh.visible && body.shown,
                    inside: inside.length / 3,
                    all: body.nCorner / 3,
                    closed: body.closed,
                    busy: document.querySelector("#sculpt").getAttribute("aria-busy"),
                };
            }),
        (s) => s.epoch > epoch && s.drawn && s.busy !== "true",
    );

/** a click of a sculpting tool at a place of the scene */
async function sculpt(page, name, place) {
    await page.click(`#sculpt-tools button[data-name=${name}]`);
    const at = await page.evaluate((p) => {
        const { stage } = window.palpate;
        return stage.project(stage.target.clone().fromArray(p));
    }, place);
    await page.mouse.click(at.x, at.y);
    await page.mouse.move(5, 300); // no highlight
}
/** share of green, which skin has much of and its inside little */
const green = (c) => c[1] / c[0];

await run(async () => {
    execFileSync(palpate, ["cells", "block", "-o", join(scratch, "block.palcells"), "--quiet"]);
    const body = {
        name: "block",
        appearance: "skin",
        cells: "block.palcells",
        supports: [{ lowest: 0.2 }],
        material: { density_kg_m3: 4000 },
        effects: [{ name: "sleep" }],
        model: { name: "subdivision_fem", levels: 1 },
    };
    writeFileSync(join(scratch, "block.json"), JSON.stringify({ name: "block", gravity_m_s2: 0, bodies: [body] }));
    const server = await serve(join(scratch, "block.json"), 0);
    const page = await open(await launch(), `http://127.0.0.1:${server.info.port}/`, "Ada", {
        width: 1000,
        height: 700,
    });
    await page.evaluate(() => (window.palpate.stage.free.elevation = 1.2));
    await page.click("#mode-sculpt");
    const begin = await drawnAfter(page, 0);
    check("at first all is outside", begin.inside === 0 && begin.closed, `${begin.all} triangles`);
    const beside = [0.03, 0.03, 0.045];
    const outer = await colourAt(page, [0, 0, 0.05]);
    await page.screenshot({ path: join(pictures, "inside_begin.png") });

    await sculpt(page, "delete", [0, 0, 0.05]);
    const open5 = await drawnAfter(page, begin.epoch);
    check("a deleted cell shows five inner faces", open5.inside === 5 * 8, `${open5.inside} of ${open5.all} triangles`);
    check("the surface is still closed", open5.closed);
    const floor = await colourAt(page, [0, 0, 0.017]);
    const rim = await colourAt(page, beside);
    const figures = [outer, rim, floor].map((c) => green(c).toFixed(2)).join(", ");
    check("the bottom of the hole has the colour of the inside", green(floor) < 0.75 * green(outer), figures);
    check("and the outside beside it its own", Math.abs(green(rim) / green(outer) - 1) < 0.1);
    await page.screenshot({ path: join(pictures, "inside_deleted.png") });

    await page.keyboard.press("Control+z");
    const undone = await drawnAfter(page, open5.epoch);
    const again = await colourAt(page, [0, 0, 0.05]);
    check("undone, all is outside", undone.inside === 0 && Math.abs(green(again) / green(outer) - 1) < 0.05);

    await sculpt(page, "extrude", [0, 0, 0.05]);
    const grown = await drawnAfter(page, undone.epoch);
    check("a cell that grew has five faces of inner tissue", grown.inside === 5 * 8, `${grown.inside} of ${grown.all}`);
    await page.screenshot({ path: join(pictures, "inside_grown.png") });
    checkConsoles();
});
