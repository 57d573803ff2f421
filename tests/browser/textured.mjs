// An OBJ file with an image, both made here: the image lies where the file says, across the seam too, and moves with
// the tissue. usage: node textured.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { crc32, deflateSync } from "node:zlib";
import {
    check,
    checkConsoles,
    displacement,
    drag,
    launch,
    open,
    organPixel,
    palpate,
    pictures,
    run,
    scratch,
    serve,
    until,
} from "./common.mjs";

const WIDTH = 512;
const HEIGHT = 256;
const RING = 64;
const BAND = 40;

/** a PNG of RGB rows @param {(x: number, y: number) => number[]} colour of a pixel, from the upper left corner */
function makePng(colour) {
    const rows = Buffer.alloc(HEIGHT * (1 + 3 * WIDTH));
    for (let y = 0; y < HEIGHT; y++)
        for (let x = 0; x < WIDTH; x++) rows.set(colour(x, y), y * (1 + 3 * WIDTH) + 1 + 3 * x);
    const chunk = (type, data) => {
        const bytes = Buffer.alloc(12 + data.length);
        bytes.writeUInt32BE(data.length, 0);
        bytes.write(type, 4, "latin1");
        data.copy(bytes, 8);
        bytes.writeUInt32BE(crc32(bytes.subarray(4, 8 + data.length)), 8 + data.length);
        return bytes;
    };
    const head = Buffer.from([0, 0, WIDTH >> 8, WIDTH & 255, 0, 0, HEIGHT >> 8, HEIGHT & 255, 8, 2, 0, 0, 0]);
    const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
    const parts = [chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))];
    return Buffer.concat([signature, ...parts]);
}

/** a lobed ball around which the image is wound: its seam runs from pole to pole at y = 0, x > 0 */
function makeObj() {
    const lines = ["mtllib ball.mtl", "usemtl skin"];
    for (let j = 0; j <= BAND; j++)
        for (let i = 0; i <= RING; i++) {
            const a = (2 * Math.PI * (i % RING)) / RING;
            const b = (Math.PI * j) / BAND;
            const r = 55 * (1 + 0.12 * Math.cos(3 * a) * Math.sin(b) ** 2) * Math.sin(b);
            const place = [r * Math.cos(a), r * Math.sin(a), -45 * Math.cos(b)];
            lines.push(`v ${place.map((x) => x.toFixed(5)).join(" ")}`, `vt ${i / RING} ${j / BAND}`);
        }
    const corner = (i, j) => `${j * (RING + 1) + i + 1}/${j * (RING + 1) + i + 1}`;
    for (let j = 0; j < BAND; j++)
        for (let i = 0; i < RING; i++) {
            if (j > 0) lines.push(`f ${corner(i, j)} ${corner(i + 1, j)} ${corner(i + 1, j + 1)}`);
            if (j < BAND - 1) lines.push(`f ${corner(i, j)} ${corner(i + 1, j + 1)} ${corner(i, j + 1)}`);
        }
    return lines.join("\n") + "\n";
}

/** mean colour of a few drawn pixels around a place of the scene @param {number[]} place */
const colourAt = (page, place) =>
    page.evaluate((at) => {
        const { stage } = window.palpate;
        stage.dirty = true;
        stage.draw();
        const gl = stage.renderer.getContext();
        const { x, y } = stage.project(stage.target.clone().fromArray(at));
        const ratio = stage.renderer.getPixelRatio();
        const bytes = new Uint8Array(4 * 9);
        gl.readPixels(
            Math.round(x * ratio) - 1,
            gl.drawingBufferHeight - Math.round(y * ratio) - 1,
            3,
            3,
            gl.RGBA,
            gl.UNSIGNED_BYTE,
            bytes,
        );
        return [0, 1, 2].map((c) => bytes.reduce((sum, v, k) => sum + (k % 4 === c ? v / 9 : 0), 0));
    }, place);
const isBlue = ([r, , b]) => b > 1.3 * r;
const isGreen = ([r, g]) => g > 1.3 * r;

await run(async () => {
    const folder = join(scratch, "ball");
    mkdirSync(folder);
    writeFileSync(join(folder, "ball.obj"), makeObj());
    writeFileSync(join(folder, "ball.mtl"), "newmtl skin\nmap_Kd skin.png\n");
    // blue right of the seam, green left of it, above the equator; below it lines on the colour of tissue
    const lined = (x, y) => (x % 64 < 3 || y % 32 < 3 ? [245, 225, 190] : [190, 85, 72]);
    const colour = (x, y) =>
        y >= 128 || y < 32 ? lined(x, y) : x < 64 ? [30, 70, 220] : x >= 448 ? [30, 190, 60] : lined(x, y);
    writeFileSync(join(folder, "skin.png"), makePng(colour));
    const scene = join(scratch, "scene");
    const text = execFileSync(palpate, [
        "prepare",
        join(folder, "ball.obj"),
        "--units",
        "mm",
        "--resolution",
        "14",
        "--title",
        "Ball with an image",
        "--no-tetgen",
        "-o",
        scene,
    ]);
    check("prepare says which image it shows", String(text).includes("image skin.png, 512 x 256 pixels"));

    const server = await serve(join(scene, "scene.json"), 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    const page = await open(await launch(), address, "Ada", { width: 1000, height: 700 });
    const path = await page.evaluate(() => window.palpate.state.parts[0].image);
    const reply = await fetch(new URL(path, address));
    check(
        "the image is served as what it is",
        reply.headers.get("content-type") === "image/png" && reply.headers.get("x-content-type-options") === "nosniff",
    );
    check(
        "under a policy that lets only this server's images in",
        /img-src 'self' data:/.test(reply.headers.get("content-security-policy")),
    );

    const shown = await until(() =>
        page.evaluate(() =>
            [...window.palpate.state.bodies.values()].every(({ mesh }) => mesh.visible && mesh.material.map),
        ),
    );
    check("the page shows it", shown);
    await page.evaluate(() => {
        window.palpate.stage.free.azimuth = Math.PI / 2; // from +x, where the seam is
        window.palpate.stage.free.elevation = 0.1;
    });
    const at = (u, z) => [60 * Math.cos(2 * Math.PI * u) * 1e-3, 60 * Math.sin(2 * Math.PI * u) * 1e-3, z];
    const box = await page.evaluate(() => window.palpate.state.hello.box_max_m);
    check("the scene is centred", Math.abs(box[2] - 0.045) < 0.001);
    const sides = [await colourAt(page, at(0.05, 0.015)), await colourAt(page, at(-0.05, 0.015))];
    check("the image lies right of its seam as in the file", isBlue(sides[0]), sides[0].map(Math.round).join(" "));
    check("and left of it", isGreen(sides[1]), sides[1].map(Math.round).join(" "));
    const near = [await colourAt(page, at(0.006, 0.015)), await colourAt(page, at(-0.006, 0.015))];
    check("the seam is sharp", isBlue(near[0]) && isGreen(near[1]), near.flat().map(Math.round).join(" "));
    await page.screenshot({ path: join(pictures, "textured.png") });

    const pixel = await organPixel(page);
    await page.mouse.move(pixel.x, pixel.y);
    await page.mouse.down();
    await drag(page, pixel, 12, 2, 12);
    const moved = await until(
        () => displacement(page),
        (m) => m > 0.01,
    );
    check("the tissue moves with its image", moved > 0.01, `${(1000 * moved).toFixed(1)} mm`);
    const apart = await page.evaluate(() => {
        const [body] = window.palpate.state.bodies.values();
        const first = new Map();
        let farthest = 0;
        for (let v = 0; v < body.rest.length / 3; v++) {
            const key = body.rest.subarray(3 * v, 3 * v + 3).join();
            const o = first.get(key) ?? v;
            first.set(key, o);
            for (let c = 0; c < 3; c++)
                farthest = Math.max(
                    farthest,
                    Math.abs(body.position.array[3 * v + c] - body.position.array[3 * o + c]),
                );
        }
        return farthest;
    });
    check("and does not gape at the seam", apart === 0, String(apart));
    await page.screenshot({ path: join(pictures, "textured_pulled.png") });
    await page.mouse.up();
    checkConsoles();
});
