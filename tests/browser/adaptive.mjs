// An adaptive surface: pressed, its mesh is refined under the tool, for a browser that joins later as well; released, it
// returns to the initial mesh.
// usage: node adaptive.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    drag,
    grasp,
    launch,
    nextFrame,
    open,
    palpate,
    pictures,
    prepare,
    run,
    scratch,
    serve,
    until,
    drawn,
} from "./common.mjs";

/** what a page shows: counts of the panel, triangles and their vertices, open edges, shortest and longest edge */
const shown = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate;
        const body = [...state.bodies.values()][0];
        const x = body.position.array;
        const index = body.geometry.index.array.subarray(0, body.nCorner);
        const open = new Set();
        let min = Infinity;
        let max = 0;
        for (let e = 0; e < index.length; e++) {
            const a = index[e];
            const b = index[e % 3 === 2 ? e - 2 : e + 1];
            const back = `${b} ${a}`;
            if (!open.delete(back)) open.add(`${a} ${b}`);
            const length = Math.hypot(x[3 * a] - x[3 * b], x[3 * a + 1] - x[3 * b + 1], x[3 * a + 2] - x[3 * b + 2]);
            min = Math.min(min, length);
            max = Math.max(max, length);
            if (!(length < 1)) max = Infinity;
        }
        const of = state.status.active?.[0] ?? null;
        return {
            of,
            text: document.querySelector("#active").textContent,
            triangles: index.length / 3,
            vertices: new Set(index).size,
            visible: body.nVisible(),
            all: body.rest.length / 3,
            open: open.size,
            min,
            max,
            corners: [...index].join(),
        };
    });
const countsOf = (s) =>
    `${s.of?.nodes} of ${s.of?.finest_nodes} nodes, ${s.of?.springs} of ${s.of?.finest_springs} springs`;
const summary = (s) =>
    `${s.text}; ${s.triangles} triangles, edges ${(1000 * s.min).toFixed(1)} to ${(1000 * s.max).toFixed(1)} mm`;
/** do the counts of the server agree with the drawn mesh? */
const agrees = (s) => s.of && s.text === countsOf(s) && s.vertices === s.of.nodes && s.visible === s.vertices;

/** a pixel near the middle where the organ faces the camera, with the organ all around it and no panel in front */
const middlePixel = (page) =>
    page.evaluate(() => {
        const { stage, input } = window.palpate;
        const w = innerWidth;
        const h = innerHeight;
        const seen = (x, y) => (document.elementFromPoint(x, y)?.id === "view" ? input.pick(stage.ray(x, y)) : null);
        for (let r = 0; r < 0.4; r += 0.03)
            for (let a = 0; a < 6.28; a += 0.5) {
                const x = w * (0.5 + r * Math.cos(a));
                const y = h * (0.5 + r * Math.sin(a));
                const hit = seen(x, y);
                if (
                    hit &&
                    hit.normal.dot(stage.ray(x, y).direction) < -0.8 &&
                    [
                        [30, 0],
                        [-30, 0],
                        [0, 30],
                        [0, -30],
                    ].every(([u, v]) => seen(x + u, y + v))
                )
                    return { x, y };
            }
        return null;
    });
await run(async () => {
    const folder = join(scratch, "stomach");
    execFileSync(palpate, ["prepare", "--shape", "stomach", "-o", folder, "--quiet"]);
    const server = await serve(join(folder, "scene.json"), 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    const browsers = [await launch(), await launch()];
    const ada = await open(browsers[0], address, "Ada", { width: 760, height: 560 });
    await ada.keyboard.press("p");
    const rest = await until(() => shown(ada), agrees);
    check("the counts of the panel agree with the drawn mesh", agrees(rest), summary(rest));
    check(
        "at rest the mesh is coarse",
        rest.of?.nodes < 0.5 * rest.of?.finest_nodes && rest.all === rest.of?.finest_nodes,
        `${rest.visible} of ${rest.all} vertices`,
    );
    check("the mesh is closed", rest.open === 0, `${rest.open} open edges`);
    await ada.keyboard.press("m");
    const pressed = await ada.getAttribute("#mesh", "aria-pressed");
    const lines = await ada.evaluate(() => [...window.palpate.state.bodies.values()].every((b) => b.lines?.visible));
    check("key M shows the edges of the mesh and marks its button", pressed === "true" && lines);
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "adaptive_rest.png") });

    // press at a pixel of the organ
    await ada.click("#mode-press");
    const pixel = await until(() => middlePixel(ada));
    const press = async () => {
        await ada.mouse.move(pixel.x, pixel.y);
        await ada.mouse.down();
        for (let i = 0; i < 10; i++) {
            await ada.mouse.wheel(0, -20); // deeper
            await nextFrame(ada);
        }
    };
    /** presses again where a machine too busy for this browser has cost it its connection, which ends a press */
    const keepPressing = async () => {
        const lost = await ada.evaluate(() => window.palpate.input.enabled && !window.palpate.input.drag);
        if (!lost) return;
        await ada.mouse.up();
        await press();
    };
    await press();
    const fine = await until(
        () => shown(ada),
        (s) => s.of?.nodes > rest.of?.nodes && agrees(s),
    );
    check(
        "under pressure the numbers of nodes and springs grow",
        fine.of?.nodes > rest.of?.nodes && fine.of?.springs > rest.of?.springs && agrees(fine),
        summary(fine),
    );
    check(
        "the mesh is refined only locally",
        fine.of?.nodes < 0.8 * fine.of?.finest_nodes,
        `${fine.of?.nodes} of ${fine.of?.finest_nodes}`,
    );
    check(
        "the refined mesh is closed and has no degenerate edge",
        fine.triangles > rest.triangles && fine.min < 0.75 * rest.min && fine.open === 0 && fine.max < 3 * rest.max,
        `${fine.triangles} triangles after ${rest.triangles}, ${fine.open} open edges`,
    );
    const depth = await displacement(ada);
    check("the surface yields", depth > 0.002 && depth < 0.2, `${(1000 * depth).toFixed(1)} mm`);
    await ada.screenshot({ path: join(pictures, "adaptive_pressed.png") });

    const ben = await open(browsers[1], address, "Ben", { width: 480, height: 480 });
    await ben.click("#mesh");
    await ben.keyboard.press("p");
    const both = await until(
        async () => {
            await keepPressing();
            return [await shown(ada), await shown(ben)];
        },
        ([a, b]) => agrees(a) && agrees(b) && a.corners === b.corners && a.of.nodes > rest.of.nodes,
    );
    check(
        "a browser that joins later shows the same triangles and counts",
        both[0].corners === both[1].corners && both[1].text === both[0].text,
        summary(both[1]),
    );
    check("and not the initial ones", both[1].triangles > rest.triangles);
    // picking uses the refined triangles
    const hit = await ada.evaluate(({ x, y }) => {
        const { input, stage, state } = window.palpate;
        const found = input.pick(stage.ray(x, y));
        return found
            ? Math.hypot(...found.point.toArray().map((v, i) => v - state.tools[state.ownTool].position[i]))
            : null;
    }, pixel);
    check(
        "the tool is where the pointer meets the tissue",
        hit !== null && hit < 0.03,
        `${hit === null ? "-" : (1000 * hit).toFixed(1)} mm`,
    );

    // the legend ignores values of hidden vertices
    await ada.selectOption("#field", "displacement");
    const field = await until(
        () =>
            ada.evaluate(() => {
                const body = [...window.palpate.state.bodies.values()][0];
                return { values: body.colours.values, max: body.maxDisplacement() };
            }),
        (f) => f.values && Math.abs(f.values.high - f.max) < 0.1 * f.max,
    );
    check(
        "the displacement in colours is that of the visible vertices",
        field.values && Math.abs(field.values.high - field.max) < 0.1 * field.max,
        `${(1000 * field.values?.high).toFixed(1)} mm, moved ${(1000 * field.max).toFixed(1)} mm`,
    );
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "adaptive_field.png") });
    await ada.selectOption("#field", "none");

    await ada.mouse.up();
    const after = await until(
        async () => [await shown(ada), await shown(ben)],
        (pair) => pair.every((s) => agrees(s) && s.corners === rest.corners),
    );
    for (const [i, name] of [
        [0, "the pressing browser"],
        [1, "the later browser"],
    ])
        check(
            `released, the initial mesh returns in ${name}`,
            after[i].corners === rest.corners && after[i].text === rest.text,
            summary(after[i]),
        );
    const back = await until(
        () => displacement(ada),
        (m) => m < 0.001,
    );
    check("and the initial shape", back < 0.001, `${(1000 * back).toFixed(2)} mm`);
    await ada.screenshot({ path: join(pictures, "adaptive_after.png") });

    await ada.click("#mode-pull");
    await grasp(ada, pixel);
    await drag(ada, pixel, -8, -2, 10);
    const pulled = await until(
        async () => ({ ...(await shown(ada)), far: await displacement(ada) }),
        (s) => s.far > 0.01 && s.triangles > rest.triangles && agrees(s),
    );
    check(
        "pulled, the surface follows and is refined",
        pulled.far > 0.01 && pulled.triangles > rest.triangles && pulled.open === 0,
        `${(1000 * pulled.far).toFixed(1)} mm, ${summary(pulled)}`,
    );
    await ada.screenshot({ path: join(pictures, "adaptive_pulled.png") });
    await ada.mouse.up();
    const again = await until(
        () => shown(ada),
        (s) => s.corners === rest.corners,
    );
    check("released, the initial mesh returns once more", again.corners === rest.corners, summary(again));
    checkConsoles();
});
