// A surface that adapts in real Chromium pages: pressed, its mesh becomes finer under the tool and the panel's counts grow,
// for one who comes late as well; let go, the mesh of the beginning is back.
// usage: node adaptive.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { join } from "node:path";
import { check, finish, launch, moved, open, palpate, pictures, scratch, serve, troubles, until } from "./common.mjs";

/** what a page shows: counts of the panel, triangles and their vertices, edges that lie open, shortest and longest edge */
const shown = (page) =>
    page.evaluate(() => {
        const { state } = window.palpate,
            body = [...state.bodies.values()][0];
        const x = body.position.array,
            index = body.geometry.index.array.subarray(0, body.nCorner),
            open = new Set();
        let least = Infinity,
            most = 0;
        for (let e = 0; e < index.length; e++) {
            const a = index[e],
                b = index[e % 3 === 2 ? e - 2 : e + 1],
                back = `${b} ${a}`;
            if (!open.delete(back)) open.add(`${a} ${b}`);
            const length = Math.hypot(x[3 * a] - x[3 * b], x[3 * a + 1] - x[3 * b + 1], x[3 * a + 2] - x[3 * b + 2]);
            least = Math.min(least, length);
            most = Math.max(most, length);
            if (!(length < 1)) most = Infinity;
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
            least,
            most,
            corners: [...index].join(),
        };
    });
const told = (s) => `${s.of?.nodes} of ${s.of?.of_nodes} nodes, ${s.of?.springs} of ${s.of?.of_springs} springs`;
const sayShort = (s) =>
    `${s.text}; ${s.triangles} triangles, edges ${(1000 * s.least).toFixed(1)} to ${(1000 * s.most).toFixed(1)} mm`;
/** counts of the server and what is drawn agree */
const agrees = (s) => s.of && s.text === told(s) && s.vertices === s.of.nodes && s.visible === s.vertices;

/** a pixel with the organ all around it, towards the eye, free of the page's own boxes; and the nearer the middle the better */
const middlePixel = (page) =>
    page.evaluate(() => {
        const { stage, input } = window.palpate,
            w = innerWidth,
            h = innerHeight;
        const seen = (x, y) => (document.elementFromPoint(x, y)?.id === "view" ? input.pick(stage.ray(x, y)) : null);
        for (let r = 0; r < 0.4; r += 0.03)
            for (let a = 0; a < 6.28; a += 0.5) {
                const x = w * (0.5 + r * Math.cos(a)),
                    y = h * (0.5 + r * Math.sin(a)),
                    hit = seen(x, y);
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
/** pictures are drawn when something changes: waits for the one that shows it; while frames come it is never the last */
const drawn = (page) =>
    until(
        () => page.evaluate(() => !window.palpate.stage.dirty && window.palpate.stage.ready()),
        (last) => last,
        3000,
    );

let server;
const browsers = [];
try {
    const folder = join(scratch, "stomach");
    execFileSync(palpate, ["prepare", "--shape", "stomach", "-o", folder, "--quiet"]);
    server = await serve(join(folder, "scene.json"), 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    browsers.push(await launch(), await launch());
    const ada = await open(browsers[0], address, "Ada", { width: 760, height: 560 });
    await ada.keyboard.press("p");
    const rest = await until(() => shown(ada), agrees);
    check("the panel says what is active, and that is what is drawn", agrees(rest), sayShort(rest));
    check(
        "at rest it is coarse",
        rest.of?.nodes < 0.5 * rest.of?.of_nodes && rest.all === rest.of?.of_nodes,
        `${rest.visible} of ${rest.all} vertices`,
    );
    check("it is closed", rest.open === 0, `${rest.open} open edges`);
    await ada.keyboard.press("m");
    const pressed = await ada.getAttribute("#mesh", "aria-pressed");
    const lines = await ada.evaluate(() => [...window.palpate.state.bodies.values()].every((b) => b.lines?.visible));
    check("the key M shows the mesh over the body, and its button says so", pressed === "true" && lines);
    await drawn(ada);
    await ada.screenshot({ path: join(pictures, "adaptive_rest.png") });

    // press where nothing but the organ is
    await ada.click("#mode-press");
    const pixel = await until(
        () => middlePixel(ada),
        (p) => p,
    );
    await ada.mouse.move(pixel.x, pixel.y);
    await ada.mouse.down();
    for (let i = 0; i < 10; i++) {
        await ada.mouse.wheel(0, -20); // deeper
        await new Promise((r) => setTimeout(r, 60));
    }
    const fine = await until(
        () => shown(ada),
        (s) => s.of?.nodes > rest.of?.nodes && agrees(s),
    );
    check(
        "pressed, nodes and springs become more",
        fine.of?.nodes > rest.of?.nodes && fine.of?.springs > rest.of?.springs && agrees(fine),
        sayShort(fine),
    );
    check(
        "not all of them: only where it is pressed",
        fine.of?.nodes < 0.8 * fine.of?.of_nodes,
        `${fine.of?.nodes} of ${fine.of?.of_nodes}`,
    );
    check(
        "the mesh is finer, closed, and of no wild edge",
        fine.triangles > rest.triangles &&
            fine.least < 0.75 * rest.least &&
            fine.open === 0 &&
            fine.most < 3 * rest.most,
        `${fine.triangles} triangles after ${rest.triangles}, ${fine.open} open edges`,
    );
    const depth = await moved(ada);
    check("it gives way", depth > 0.002 && depth < 0.2, `${(1000 * depth).toFixed(1)} mm`);
    await ada.screenshot({ path: join(pictures, "adaptive_pressed.png") });

    const ben = await open(browsers[1], address, "Ben", { width: 480, height: 480 });
    await ben.click("#mesh");
    await ben.keyboard.press("p");
    const both = await until(
        async () => [await shown(ada), await shown(ben)],
        ([a, b]) => agrees(a) && agrees(b) && a.corners === b.corners && a.of.nodes > rest.of.nodes,
    );
    check(
        "one who comes late sees the same triangles and counts",
        both[0].corners === both[1].corners && both[1].text === both[0].text,
        sayShort(both[1]),
    );
    check("and not those of the beginning", both[1].triangles > rest.triangles);
    // what is refined is hit where it is drawn
    const hit = await ada.evaluate(({ x, y }) => {
        const { input, stage, state } = window.palpate,
            found = input.pick(stage.ray(x, y));
        return found
            ? Math.hypot(...found.point.toArray().map((v, i) => v - state.tools[state.ownTool].position[i]))
            : null;
    }, pixel);
    check(
        "the tool is where the pointer meets the tissue",
        hit !== null && hit < 0.03,
        `${hit === null ? "-" : (1000 * hit).toFixed(1)} mm`,
    );

    // colours: the legend's values are of what is drawn, whatever hidden vertices have
    await ada.selectOption("#field", "displacement");
    const field = await until(
        () =>
            ada.evaluate(() => {
                const body = [...window.palpate.state.bodies.values()][0];
                return { values: body.colours.values, most: body.maxDisplacement() };
            }),
        (f) => f.values && Math.abs(f.values.high - f.most) < 0.1 * f.most,
    );
    check(
        "displacement in colours is that of the drawn vertices",
        field.values && Math.abs(field.values.high - field.most) < 0.1 * field.most,
        `${(1000 * field.values?.high).toFixed(1)} mm, moved ${(1000 * field.most).toFixed(1)} mm`,
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
        [0, "the one who pressed"],
        [1, "the one who came late"],
    ])
        check(
            `let go, the mesh of the beginning is back for ${name}`,
            after[i].corners === rest.corners && after[i].text === rest.text,
            sayShort(after[i]),
        );
    const back = await until(
        () => moved(ada),
        (m) => m < 0.001,
    );
    check("and its shape", back < 0.001, `${(1000 * back).toFixed(2)} mm`);
    await ada.screenshot({ path: join(pictures, "adaptive_after.png") });

    await ada.click("#mode-pull");
    await ada.mouse.move(pixel.x, pixel.y);
    await ada.mouse.down();
    for (let i = 1; i <= 10; i++) {
        await ada.mouse.move(pixel.x - 8 * i, pixel.y - 2 * i);
        await new Promise((r) => setTimeout(r, 60));
    }
    const pulled = await until(
        async () => ({ ...(await shown(ada)), far: await moved(ada) }),
        (s) => s.far > 0.01 && s.triangles > rest.triangles && agrees(s),
    );
    check(
        "pulled, it follows and refines",
        pulled.far > 0.01 && pulled.triangles > rest.triangles && pulled.open === 0,
        `${(1000 * pulled.far).toFixed(1)} mm, ${sayShort(pulled)}`,
    );
    await ada.screenshot({ path: join(pictures, "adaptive_pulled.png") });
    await ada.mouse.up();
    const again = await until(
        () => shown(ada),
        (s) => s.corners === rest.corners,
    );
    check("and is as at first when let go", again.corners === rest.corners, sayShort(again));
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
