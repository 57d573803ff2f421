// What bodies look like, by pixels: a look for each appearance, patterns that stick to the tissue, shadows and occlusion.
// usage: node look.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { check, checkConsoles, launch, newPage, palpate, pictures, run, scratch, serve } from "./common.mjs";

/** three blocks without support: two side by side, 5 mm apart, and one that hangs above and shades them */
function makeScene() {
    const size = ["--cells", "3,2,2", "--size-m", "0.12,0.06,0.06"];
    execFileSync(palpate, ["cells", "block", ...size, "-o", join(scratch, "block.palcells"), "--quiet"]);
    const body = (name, look, origin_m) => ({
        name,
        ...look,
        origin_m,
        cells: "block.palcells",
        supports: [],
        model: { name: "subdivision_fem", levels: 1 },
        effects: [{ name: "tool_push" }, { name: "finite_guard" }, { name: "sleep" }],
    });
    const scene = join(scratch, "look.json");
    const bodies = [
        body("liver", { appearance: "liver" }, [0, 0, 0]),
        body("gall bladder", { appearance: "gall_bladder" }, [0, 0.065, 0]),
        body("lamp", { appearance: "plastic", colour: "#3a5fa0" }, [-0.05, 0.03, 0.09]),
    ];
    writeFileSync(scene, JSON.stringify({ name: "look", title: "Looks", gravity_m_s2: 0, bodies }));
    return scene;
}

async function openPage(browser, port, query) {
    const page = await newPage(browser, { viewport: { width: 480, height: 360 } });
    await page.goto(`http://127.0.0.1:${port}/?name=Ada${query}`);
    await page.waitForFunction(() => window.palpate?.state.bodies.size === 3 && window.palpate.state.status);
    // the effects that are on are there, and every body has had its frame
    await page.waitForFunction(() => {
        const { stage, state } = window.palpate;
        const effects = stage.effects;
        const loaded = !effects?.choice.on.has("occlusion") || effects.occlusion;
        return loaded && [...state.bodies.values()].every((body) => body.shown);
    });
    await page.evaluate(() => {
        const { stage, state } = window.palpate;
        stage.pace.done = function (now) {
            this.drawing = false;
            this.costMs = now - this.begun;
            return false; // full sharpness
        };
        stage.pace.resolution = 1;
        stage.resize();
        /** draws now: the picture's rows from below, RGBA */
        window.takePicture = () => {
            stage.dirty = true;
            stage.draw();
            const gl = stage.renderer.getContext();
            const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
            const pixels = new Uint8Array(4 * width * height);
            gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            return { width, height, pixels };
        };
        /** colour, 0 to 255, at pixels of the page */
        window.colourAt = ({ width, height, pixels }, x, y) => {
            const canvas = stage.canvas;
            const column = Math.min(width - 1, Math.floor((x / canvas.clientWidth) * width));
            const row = height - 1 - Math.min(height - 1, Math.floor((y / canvas.clientHeight) * height));
            return [...pixels.subarray(4 * (row * width + column), 4 * (row * width + column) + 3)];
        };
        /** share of the pixels that differ visibly */
        window.differing = (a, b) => {
            let n = 0;
            for (let i = 0; i < a.pixels.length; i += 4)
                n += [0, 1, 2].some((k) => Math.abs(a.pixels[i + k] - b.pixels[i + k]) > 6);
            return (4 * n) / a.pixels.length;
        };
        /** places of a grid that show a body: pixel, body, point */
        window.places = (step) => {
            const found = [];
            for (let y = 0; y < stage.canvas.clientHeight; y += step)
                for (let x = 0; x < stage.canvas.clientWidth; x += step) {
                    const ray = stage.ray(x + 0.5, y + 0.5);
                    let best = null;
                    for (const [part, body] of state.bodies) {
                        const hit = body.pick(ray);
                        if (hit && (!best || hit.distance < best.distance))
                            best = { x: x + 0.5, y: y + 0.5, part, distance: hit.distance, point: hit.point.toArray() };
                    }
                    if (best) found.push(best);
                }
            return found;
        };
    });
    return page;
}

/** the mean colour of each body, and whether its shader has patterns */
const looks = (page) =>
    page.evaluate(() => {
        const picture = window.takePicture();
        const sums = [0, 1, 2].map(() => ({ n: 0, colour: [0, 0, 0] }));
        for (const { x, y, part } of window.places(6)) {
            sums[part].n++;
            window.colourAt(picture, x, y).forEach((v, k) => (sums[part].colour[k] += v));
        }
        return sums.map(({ n, colour }, part) => ({
            n,
            colour: colour.map((v) => v / n),
            patterns: "TISSUE_PATTERNS" in window.palpate.state.bodies.get(part).mesh.material.defines,
        }));
    });

/** bodies and camera moved together: the picture with the patterns' positions at rest is the same */
const movedTogether = (page) =>
    page.evaluate(() => {
        const { stage, state } = window.palpate;
        const by = 0.0137; // no period of a pattern
        const move = (sign) => {
            for (const body of state.bodies.values())
                body.take(
                    body.position.array.map((v) => v + sign * by),
                    body.normal.array,
                );
            stage.target.addScalar(sign * by);
        };
        const before = window.takePicture();
        move(1);
        const after = window.takePicture();
        move(-1);
        let differ = 0;
        for (let i = 0; i < before.pixels.length; i++) differ += Math.abs(before.pixels[i] - after.pixels[i]) > 6;
        return differ / before.pixels.length;
    });

/**
 * The liver stretched by a half along x: how the colours at material points agree with those at rest, less what is smooth;
 * as correlation, once with the points that moved and once with the same places in space.
 */
const stretched = (page) =>
    page.evaluate(() => {
        const { stage, state } = window.palpate;
        const body = state.bodies.get(0); // they come in any order
        for (const other of state.bodies.values()) other.appear(other === body);
        stage.free.elevation = 1.5; // from above: the top stays level, so that light stays the same
        const points = [];
        for (let u = -1; u <= 1; u += 0.05) for (let v = -1; v <= 1; v += 0.1) points.push([u, v]);
        const top = body.position.array.reduce((max, v, i) => (i % 3 === 2 ? Math.max(max, v) : max), -1);
        const V = stage.target.constructor;
        const sample = (stretch) => {
            const picture = window.takePicture();
            const at = (u, v) => {
                const p = stage.project(new V(0.035 * u * stretch, 0.015 * v, top));
                return window.colourAt(picture, p.x, p.y)[0];
            };
            return points.map(([u, v]) => at(u, v));
        };
        const rest = sample(1);
        const original = body.position.array.slice();
        body.take(
            body.position.array.map((v, i) => (i % 3 === 0 ? 1.5 * v : v)),
            body.normal.array,
        );
        const moved = sample(1.5);
        const same = sample(1);
        body.take(original, body.normal.array);
        for (const other of state.bodies.values()) other.appear(true);
        stage.free.elevation = 0.42;
        // neighbours along u less each other
        const detail = (c) => c.slice(0, -21).map((v, i) => v - c[i + 21]);
        const correlation = (a, b) => {
            const dot = (p, q) => p.reduce((sum, v, i) => sum + v * q[i], 0);
            return dot(a, b) / Math.sqrt(dot(a, a) * dot(b, b) || 1);
        };
        return {
            moved: correlation(detail(rest), detail(moved)),
            same: correlation(detail(rest), detail(same)),
            contrast: Math.sqrt(detail(rest).reduce((sum, v) => sum + v * v, 0) / rest.length),
        };
    });

/** brightness with effects over that without, at places of the two lower blocks; apart: from the other block, m */
const darkening = (page, names) =>
    page.evaluate((on) => {
        const { effects } = window.palpate.stage;
        const brightness = (list) => {
            effects.choice.on = new Set(list);
            effects.apply();
            const picture = window.takePicture();
            return window.places(5).map(({ x, y, part, point }) => {
                const c = window.colourAt(picture, x, y);
                const apart = part === 0 ? 0.035 - point[1] : point[1] - 0.03;
                return { part, apart, light: c[0] + c[1] + c[2] };
            });
        };
        const occlusion = effects.occlusion;
        const without = brightness([]);
        effects.occlusion = on.includes("occlusion") ? occlusion : null;
        const withThem = brightness(on);
        // the addon is loaded once; it is put back for the next comparison
        effects.occlusion ??= occlusion;
        return withThem
            .map(({ part, apart, light }, i) => ({ part, apart, ratio: light / without[i].light }))
            .filter(({ part }) => part < 2);
    }, names);
/** a section that removes the body above is a picture without it; a cap is as bright as without effects */
async function checkCut(page) {
    const cutAt = (z) =>
        page.evaluate(async (height) => {
            const { inside, state } = window.palpate;
            const [low, high] = [state.hello.box_min_m[2], state.hello.box_max_m[2]];
            Object.assign(inside.planes[0], { direction: height === null ? "none" : "z" });
            inside.planes[0].at = height === null ? 0.5 : (height - low) / (high - low);
            await inside.changed();
            inside.update();
        }, z);
    const difference = await page.evaluate(async () => {
        const { effects } = window.palpate.stage;
        const lamp = window.palpate.state.bodies.get(2);
        effects.choice.on = new Set(["shadow", "occlusion"]);
        effects.apply();
        lamp.appear(false);
        window.without = window.takePicture();
        lamp.appear(true);
        window.whole = window.takePicture();
        return window.differing(window.without, window.whole);
    });
    await cutAt(0.045);
    const left = await page.evaluate(() => window.differing(window.without, window.takePicture()));
    await page.screenshot({ path: join(pictures, "look_cut_above.png") });
    check(
        "what a section removes casts no shadow and no occlusion",
        difference > 0.05 && left < 0.002,
        `${(100 * left).toFixed(2)} % of the pixels differ from those without the body, ${(100 * difference).toFixed(0)} % with it`,
    );
    await cutAt(0.01);
    const share = await page.evaluate(() => {
        const { effects, target } = window.palpate.stage;
        const { occlusion } = effects;
        const lights = (names) => {
            effects.choice.on = new Set(names);
            effects.apply();
            const picture = window.takePicture();
            const places = [-0.04, -0.02, 0, 0.02, 0.04].flatMap((x) => [-0.015, 0, 0.015].map((y) => [x, y, 0.01]));
            return places.map((place) => {
                const at = window.palpate.stage.project(target.clone().fromArray(place));
                return window.colourAt(picture, at.x, at.y).reduce((sum, c) => sum + c, 0);
            });
        };
        const before = lights([]);
        effects.occlusion = occlusion;
        const after = lights(["shadow", "occlusion"]);
        return Math.min(...after.map((light, i) => light / before[i]));
    });
    await page.evaluate(() => window.takePicture());
    await page.screenshot({ path: join(pictures, "look_cut_cap.png") });
    check("a cap in the light is everywhere as bright as without effects", share > 0.97, share.toFixed(3));
    await cutAt(null);
}
const mean = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;

await run(async () => {
    const server = await serve(makeScene(), 0);
    const browser = await launch();
    const page = await openPage(browser, server.info.port, "");
    const none = await page.evaluate(() => {
        const { stage } = window.palpate;
        return [stage.effects, stage.key.castShadow, stage.renderer.shadowMap.enabled, stage.key.shadow.map];
    });
    check(
        "software drawing has no effects, light or pass for them",
        none.every((v) => !v),
        JSON.stringify(none),
    );
    const parts = await page.evaluate(() => window.palpate.state.parts.map((p) => [p.appearance, p.colour].join(" ")));
    check(
        "the page learns what bodies look like",
        parts.join() === "liver ,gall_bladder ,plastic #3a5fa0",
        parts.join(),
    );
    const [liver, gall, lamp] = await looks(page);
    const text = ({ colour }) => colour.map((v) => v.toFixed(0)).join(" ");
    check("the liver is red brown", liver.colour[0] > 1.8 * liver.colour[1] && liver.n > 100, text(liver));
    check(
        "the gall bladder is green",
        gall.colour[1] > gall.colour[0] && gall.colour[1] > 1.2 * gall.colour[2],
        text(gall),
    );
    check("plastic has the colour that the scene gives it", lamp.colour[2] > 1.5 * lamp.colour[0], text(lamp));
    check("plastic has no patterns in its shader", liver.patterns && gall.patterns && !lamp.patterns);
    await page.screenshot({ path: join(pictures, "look_plain.png") });
    const moved = await movedTogether(page);
    check("patterns move with the tissue", moved < 0.002, `${(100 * moved).toFixed(2)} % of the pixels differ`);
    const stretch = await stretched(page);
    check(
        "patterns stretch with the tissue",
        stretch.contrast > 1 && stretch.moved > 0.6 && stretch.moved > stretch.same + 0.3,
        JSON.stringify(stretch),
    );
    await page.close();

    const full = await openPage(browser, server.info.port, "&effects=all");
    await full.evaluate(() => window.takePicture());
    await full.screenshot({ path: join(pictures, "look_effects.png") });
    const fold = await darkening(full, ["occlusion"]);
    const near = mean(fold.filter((p) => p.apart < 0.012).map((p) => p.ratio));
    const far = mean(fold.filter((p) => p.apart > 0.04).map((p) => p.ratio));
    check(
        "occlusion darkens where bodies meet",
        near < 0.95 && far > 0.97,
        `${near.toFixed(3)}, far ${far.toFixed(3)}`,
    );
    const shade = (await darkening(full, ["shadow"])).map((p) => p.ratio);
    const dark = shade.filter((ratio) => ratio < 0.75).length / shade.length;
    const lit = shade.filter((ratio) => ratio > 0.97).length / shade.length;
    check("a body above casts its shadow", dark > 0.05 && lit > 0.3, `${dark.toFixed(2)} dark, ${lit.toFixed(2)} lit`);
    await checkCut(full);
    const off = await full.evaluate(() => {
        const { effects, key, renderer } = window.palpate.stage;
        effects.choice.on.clear();
        effects.apply();
        return [effects.shadow, effects.occlusion, key.castShadow, key.shadow.map, renderer.shadowMap.enabled];
    });
    check(
        "effects that are dropped leave no pass",
        off.every((v) => !v),
        JSON.stringify(off),
    );
    await full.close();
    checkConsoles();
});
