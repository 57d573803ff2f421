// An OBJ file with two materials and their images, all made here: the images lie where the file says, across the seam
// too, and move with the tissue; on tetrahedra, and on an adaptive surface that is refined along the seam. usage: node textured.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { crc32, deflateSync } from "node:zlib";
import {
    check,
    checkConsoles,
    colourAt,
    displacement,
    drag,
    grasp,
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
const RING = 48;
const BAND = 24;
const TOP = 18; // first band of the top

/** a PNG of RGB rows @param {number} height @param {(x: number, y: number) => number[]} colour of a pixel, from the upper left corner */
function makePng(height, colour) {
    const rows = Buffer.alloc(height * (1 + 3 * WIDTH));
    for (let y = 0; y < height; y++)
        for (let x = 0; x < WIDTH; x++) rows.set(colour(x, y), y * (1 + 3 * WIDTH) + 1 + 3 * x);
    const chunk = (type, data) => {
        const bytes = Buffer.alloc(12 + data.length);
        bytes.writeUInt32BE(data.length, 0);
        bytes.write(type, 4, "latin1");
        data.copy(bytes, 8);
        bytes.writeUInt32BE(crc32(bytes.subarray(4, 8 + data.length)), 8 + data.length);
        return bytes;
    };
    const head = Buffer.from([0, 0, WIDTH >> 8, WIDTH & 255, 0, 0, height >> 8, height & 255, 8, 2, 0, 0, 0]);
    const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
    const parts = [chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))];
    return Buffer.concat([signature, ...parts]);
}

/** a lobed ball around which the image is wound: its seam runs from pole to pole at y = 0, x > 0; its top has another */
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
    for (let j = 0; j < BAND; j++) {
        if (j === TOP) lines.push("usemtl top");
        for (let i = 0; i < RING; i++) {
            if (j > 0) lines.push(`f ${corner(i, j)} ${corner(i + 1, j)} ${corner(i + 1, j + 1)}`);
            if (j < BAND - 1) lines.push(`f ${corner(i, j)} ${corner(i + 1, j + 1)} ${corner(i, j + 1)}`);
        }
    }
    return lines.join("\n") + "\n";
}

const isBlue = ([r, , b]) => b > 1.3 * r;
const isGreen = ([r, g]) => g > 1.3 * r;
const isYellow = ([r, g, b]) => Math.min(r, g) > 2 * b;
const rounded = (...colours) => colours.flat().map(Math.round).join(" ");

/** vertices, triangles, and how far copies of vertices are from what they copy, m */
const seamOf = (page) =>
    page.evaluate(() => {
        const [body] = window.palpate.state.bodies.values();
        const x = body.position.array;
        const drawn = new Set(body.geometry.index.array.subarray(0, body.nCorner));
        let copies = 0;
        let apart = 0;
        for (const v of drawn) {
            const o = body.originals[v];
            if (o === v) continue;
            copies++;
            for (let c = 0; c < 3; c++) apart = Math.max(apart, Math.abs(x[3 * v + c] - x[3 * o + c]));
        }
        return { copies, apart, triangles: body.nCorner / 3, closed: body.closed };
    });

/** places of drawn vertices on the seam between the equator and the top, where they are now @returns {Promise<number[][]>} */
const seamPlaces = (page) =>
    page.evaluate(() => {
        const [body] = window.palpate.state.bodies.values();
        const drawn = new Set(body.geometry.index.array.subarray(0, body.nCorner));
        const out = [];
        for (const v of drawn)
            if (
                body.originals[v] !== v &&
                body.rest[3 * v] > 0.03 &&
                body.rest[3 * v + 2] > 0.005 &&
                body.rest[3 * v + 2] < 0.025
            )
                out.push([...body.position.array.subarray(3 * v, 3 * v + 3)]);
        return out;
    });

/** one model from file to picture @param {string} model @param {string} obj */
async function testModel(model, obj) {
    console.log(`     model ${model}`);
    const scene = join(scratch, model);
    const size = model === "adaptive" ? ["--levels", "3"] : ["--resolution", "14"];
    const more = ["--model", model, "--units", "mm", "--title", "Ball with images", "--no-tetgen", "-o", scene];
    const text = execFileSync(palpate, ["prepare", obj, ...size, ...more]);
    check(
        "prepare says which images it shows",
        String(text).includes("2 images, the first skin.png, 512 x 256 pixels"),
    );

    const server = await serve(join(scene, "scene.json"), 0);
    const address = `http://127.0.0.1:${server.info.port}/`;
    const page = await open(await launch(), address, "Ada", { width: 1000, height: 700 });
    const paths = await page.evaluate(() => window.palpate.state.parts[0].images);
    check("there are two", paths.length === 2, String(paths.length));
    const reply = await fetch(new URL(paths[0], address));
    check(
        "an image is served as what it is",
        reply.headers.get("content-type") === "image/png" && reply.headers.get("x-content-type-options") === "nosniff",
    );
    check(
        "under a policy that lets only this server's images in",
        /img-src 'self' data:/.test(reply.headers.get("content-security-policy")),
    );

    const shown = await until(() =>
        page.evaluate(() =>
            [...window.palpate.state.bodies.values()].every(
                ({ mesh }) => mesh.visible && mesh.material.defines.TISSUE_IMAGES === "2",
            ),
        ),
    );
    check("the page shows them", shown);
    await page.evaluate(() => {
        window.palpate.stage.free.azimuth = Math.PI / 2; // from +x, where the seam is
        window.palpate.stage.free.elevation = 0.1;
    });
    const at = (u, z) => [60 * Math.cos(2 * Math.PI * u) * 1e-3, 60 * Math.sin(2 * Math.PI * u) * 1e-3, z];
    const box = await page.evaluate(() => window.palpate.state.hello.box_max_m);
    check("the scene is centred", Math.abs(box[2] - 0.045) < 0.001);
    const sides = [await colourAt(page, at(0.05, 0.015)), await colourAt(page, at(-0.05, 0.015))];
    check("the image lies right of its seam as in the file", isBlue(sides[0]), rounded(sides[0]));
    check("and left of it", isGreen(sides[1]), rounded(sides[1]));
    const near = [await colourAt(page, at(0.006, 0.015)), await colourAt(page, at(-0.006, 0.015))];
    check("the seam is sharp", isBlue(near[0]) && isGreen(near[1]), rounded(...near));
    const top = [await colourAt(page, [0.033, 0.01, 0.037]), await colourAt(page, [0.033, -0.01, 0.037])];
    check("the top has its own image, without a seam", top.every(isYellow), rounded(...top));
    await page.screenshot({ path: join(pictures, `textured_${model}.png`) });
    const before = await seamOf(page);
    check("a closed surface stays closed", before.closed && before.copies > 10, `${before.copies} copies`);

    const pixel = await organPixel(page);
    await grasp(page, pixel);
    await drag(page, pixel, 12, 2, 12);
    const moved = await until(
        () => displacement(page),
        (m) => m > 0.01,
    );
    check("the tissue moves with its image", moved > 0.01, `${(1000 * moved).toFixed(1)} mm`);
    if (model === "adaptive") {
        const finer = await until(
            () => seamOf(page),
            (s) => s.copies > before.copies,
        );
        check(
            "it is refined along the seam",
            finer.copies > before.copies && finer.triangles > before.triangles,
            `${before.copies} to ${finer.copies} copies, ${before.triangles} to ${finer.triangles} triangles`,
        );
    }
    const pulled = await seamOf(page);
    check("and does not gape at the seam", pulled.apart === 0, `${pulled.copies} copies`);
    await page.screenshot({ path: join(pictures, `textured_${model}_pulled.png`) });
    if (model === "adaptive") {
        let right = 0; // the instrument hides some
        const places = (await seamPlaces(page)).slice(0, 24);
        for (const [x, y, z] of places) {
            const [blue, green] = [await colourAt(page, [x, y + 0.004, z]), await colourAt(page, [x, y - 0.004, z])];
            right += Number(isBlue(blue) && isGreen(green));
        }
        const figures = `${right} of ${places.length}`;
        check(
            "the images meet at the seam where it is now",
            places.length > 2 && right >= 0.6 * places.length,
            figures,
        );
    }
    await page.mouse.up();
    await page.close();
    server.child.kill("SIGTERM");
}

await run(async () => {
    const folder = join(scratch, "ball");
    mkdirSync(folder);
    writeFileSync(join(folder, "ball.obj"), makeObj());
    writeFileSync(join(folder, "ball.mtl"), "newmtl skin\nmap_Kd skin.png\nnewmtl top\nmap_Kd top.png\n");
    // blue right of the seam, green left of it, above the equator; below it lines on the colour of tissue
    const lined = (x, y) => (x % 64 < 3 || y % 32 < 3 ? [245, 225, 190] : [190, 85, 72]);
    const colour = (x, y) => (y >= 128 ? lined(x, y) : x < 64 ? [30, 70, 220] : x >= 448 ? [30, 190, 60] : lined(x, y));
    writeFileSync(join(folder, "skin.png"), makePng(HEIGHT, colour));
    writeFileSync(
        join(folder, "top.png"),
        makePng(64, () => [235, 205, 40]),
    );
    await testModel("springs", join(folder, "ball.obj"));
    await testModel("adaptive", join(folder, "ball.obj"));
    checkConsoles();
});
