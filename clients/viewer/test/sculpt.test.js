// Commands of sculpting as the panel builds them, and surfaces as files.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { joinSurfaces, toObj, toPly, toStl, WRITERS } from "../src/exporters.js";
import {
    answerText,
    boxAround,
    commandOf,
    cutCommand,
    cutOutline,
    FORCES,
    liftOf,
    PAINTS,
    TOOLS,
} from "../src/sculpt_commands.js";
import { refusalText } from "../src/sculpt_refusals.js";
import { isTextKey, text } from "../src/text.js";

const SET = {
    distance_m: 0.02,
    scale: 1,
    radius_m: 0.03,
    paint: "stiffer",
    sharpness: 2.5,
    entity: 1,
    pressure_Pa: 200,
    lift_m: 0.05,
    stiffness_N_m: 60,
    middle: [0, 0, 0],
};

test("a click becomes a command with the point and the settings of the tool", () => {
    assert.deepEqual(commandOf("extrude", SET, [[1, 2, 3]]), {
        verb: "extrude",
        args: { x_m: 1, y_m: 2, z_m: 3, distance_m: 0.02, scale: 1 },
    });
    assert.deepEqual(commandOf("delete", SET, [[1, 2, 3]]), { verb: "delete", args: { x_m: 1, y_m: 2, z_m: 3 } });
    assert.deepEqual(commandOf("sharpen", SET, [[1, 2, 3]])?.args, {
        x_m: 1,
        y_m: 2,
        z_m: 3,
        sharpness: 2.5,
        entity: 1,
    });
    assert.deepEqual(commandOf("paint", { ...SET, paint: "softer" }, [[0, 0, 0]])?.args, {
        x_m: 0,
        y_m: 0,
        z_m: 0,
        radius_m: 0.03,
        young_factor: 0.5,
        density_factor: 1,
    });
});

test("a tool that joins two faces needs two clicks", () => {
    for (const tool of ["merge", "bridge"]) {
        assert.equal(commandOf(tool, SET, [[1, 2, 3]]), null);
        assert.equal(TOOLS[tool].points, 2);
        assert.deepEqual(
            commandOf(tool, SET, [
                [1, 2, 3],
                [4, 5, 6],
            ]),
            { verb: tool, args: { x_m: 1, y_m: 2, z_m: 3, x2_m: 4, y2_m: 5, z2_m: 6 } },
        );
    }
});

test("deflate is inflate with negative pressure", () => {
    const at = { x_m: 1, y_m: 2, z_m: 3, radius_m: 0.03 };
    assert.deepEqual(commandOf("inflate", SET, [[1, 2, 3]]), { verb: "inflate", args: { ...at, pressure_Pa: 200 } });
    assert.deepEqual(commandOf("deflate", SET, [[1, 2, 3]]), { verb: "inflate", args: { ...at, pressure_Pa: -200 } });
});

test("a curve needs two ends and is pulled outward, perpendicular to itself", () => {
    assert.equal(commandOf("curve", SET, [[-1, 0, 2]]), null);
    assert.deepEqual(
        commandOf("curve", SET, [
            [-1, 0, 2],
            [1, 0, 2],
        ]),
        {
            verb: "curve",
            args: {
                x_m: -1,
                y_m: 0,
                z_m: 2,
                x2_m: 1,
                y2_m: 0,
                z2_m: 2,
                radius_m: 0.03,
                stiffness_N_m: 60,
                dx_m: 0,
                dy_m: 0,
                dz_m: 0.05,
            },
        },
    );
    for (const lift of [0.05, -0.02]) {
        const d = liftOf([1, 0, 2], [2, 3, 1], [0.2, 0.1, -0.4], lift);
        assert.ok(Math.abs(Math.hypot(...d) - Math.abs(lift)) < 1e-12);
        assert.ok(Math.abs(d[0] * 1 + d[1] * 3 + d[2] * -1) < 1e-12); // perpendicular to the curve
        assert.ok((d[0] * 1.3 + d[1] * 1.4 + d[2] * 1.9) * lift > 0); // outward if lift > 0, else inward
    }
    assert.deepEqual(liftOf([0, 0, 0], [2, 0, 0], [1, 0, 0], 0.1), [0, 0, 0.1]); // through the middle: any direction
});

test("every tool has a name, a tooltip with its key, a hint before each click, and a sentence after the last", () => {
    const keys = Object.values(TOOLS).map(({ key }) => key);
    assert.equal(new Set(keys).size, keys.length);
    for (const key of keys) assert.ok(!"RPCM ".includes(key), `${key} is used by the page`);
    for (const [tool, { points, key }] of Object.entries(TOOLS)) {
        for (let i = 0; i < points; i++) assert.ok(isTextKey(`sculpt.hint.${tool}.${i}`), tool);
        assert.ok(isTextKey(`sculpt.tool.${tool}`) && isTextKey(`sculpt.tool.tip.${tool}`), tool);
        assert.match(text(/** @type {any} */ (`sculpt.tool.tip.${tool}`), { key }), new RegExp(`\\(${key}\\)$`));
        const { verb } =
            commandOf(
                tool,
                SET,
                [
                    [1, 2, 3],
                    [4, 5, 6],
                ].slice(0, points),
            ) ?? {};
        assert.ok(isTextKey(`sculpt.done.${verb}`), tool);
    }
    for (const paint of Object.keys(PAINTS)) assert.ok(isTextKey(`sculpt.paint.tip.${paint}`), paint);
    for (const tool of FORCES) assert.ok(TOOLS[tool]);
});

test("every refusal of an edit has plain words", () => {
    const read = (/** @type {string} */ name) =>
        readFileSync(new URL(`../../../server/mesh/cells/${name}.c`, import.meta.url), "utf8");
    const source = ["cell_edit_apply", "cell_edit_divide", "cell_edit_shapes", "cell_edit_work"].map(read).join("");
    const sentences = [...source.matchAll(/pal_edit_refuse\(w, "([^"]+)"/g)].map((match) => match[1]);
    assert.ok(sentences.length > 12);
    // numbers that the panel cannot send
    const never = /must be (0|1|above 0|within)|, there are %d|is given twice/;
    for (const sentence of sentences.filter((s) => !never.test(s)))
        assert.notEqual(refusalText(`edit: ${sentence}`), `edit: ${sentence}`);
    assert.equal(refusalText("delete: nothing of chair is at 9 0 0 m"), "There is nothing to sculpt at this place.");
    assert.equal(refusalText("something new"), "something new");
});

test("a stroke and its opposite restore the material", () => {
    for (const key of /** @type {const} */ (["young_factor", "density_factor"])) {
        const all = Object.values(PAINTS).reduce((product, paint) => product * paint[key], 1);
        assert.ok(Math.abs(all - 1) < 1e-12);
    }
});

test("a cut is a plane within the box, perpendicular to its axis", () => {
    const box = { low: [-1, 0, 2], high: [1, 4, 3] };
    assert.deepEqual(cutCommand("y", 0.25, box), { verb: "cut", args: { nx: 0, ny: 1, nz: 0, offset_m: 1 } });
    assert.deepEqual(cutCommand("z", 1, box).args, { nx: 0, ny: 0, nz: 1, offset_m: 3 });
    assert.deepEqual(cutCommand("none", 0.5, box), { verb: "uncut", args: {} });
    assert.deepEqual(cutOutline("none", 0.5, box), []);
    const outline = cutOutline("y", 0.25, box);
    assert.equal(outline.length, 8);
    for (const [x, y, z] of outline) assert.ok(y === 1 && (x < -1 || x > 1) && (z < 2 || z > 3));
    assert.deepEqual(boxAround(box, Float32Array.of(-2, 1, 2.5, 0, 5, 2)), { low: [-2, 0, 2], high: [1, 5, 3] });
});

test("answers say in words what was done", () => {
    const args = { cells: 9, can_undo: 1, can_redo: 0, prepare_ms: 12.6 };
    assert.equal(answerText({ verb: "extrude", text: "extrude: 9 control cells", args }), "Extruded.");
    assert.equal(answerText({ verb: "undo", text: "", args }), "Undone.");
    assert.equal(answerText({ verb: "release", text: "release: tool 0" }), "Released.");
    assert.equal(
        answerText({ verb: "probe", text: "", args: { young_Pa: 15000, poisson: 0.4, density_kg_m3: 1234.56 } }),
        "Stiffness 15 kPa, density 1230 kg/m³",
    );
    assert.equal(answerText({ verb: "other", text: "done", args: {} }), "done");
});

/** a tetrahedron whose vertex 1 is in no triangle */
const SURFACE = {
    positions: [0, 0, 0, 9, 9, 9, 1, 0, 0, 0, 1, 0, 0, 0, 1],
    triangles: [0, 3, 2, 0, 2, 4, 0, 4, 3, 2, 3, 4],
};

test("only vertices of triangles are written, surfaces one after the other", () => {
    const one = joinSurfaces([SURFACE]);
    const two = joinSurfaces([SURFACE, SURFACE]);
    assert.equal(one.positions.length, 12);
    assert.ok(!one.positions.includes(9));
    assert.equal(two.positions.length, 24);
    assert.deepEqual(
        [...two.triangles].slice(12),
        [...one.triangles].map((v) => v + 4),
    );
    for (let e = 0; e < 12; e++)
        for (let d = 0; d < 3; d++)
            assert.equal(one.positions[3 * one.triangles[e] + d], SURFACE.positions[3 * SURFACE.triangles[e] + d]);
});

/** sixfold volume @param {number[][][]} triangles */
const volume = (triangles) =>
    triangles.reduce(
        (sum, [a, b, c]) =>
            sum +
            a[0] * (b[1] * c[2] - b[2] * c[1]) +
            a[1] * (b[2] * c[0] - b[0] * c[2]) +
            a[2] * (b[0] * c[1] - b[1] * c[0]),
        0,
    );

test("OBJ, STL and PLY hold the same surface", () => {
    const tenth = { positions: SURFACE.positions.map((v) => Math.fround(v / 10)), triangles: SURFACE.triangles };
    const lines = toObj([tenth]).split("\n");
    const v = lines.filter((l) => l.startsWith("v ")).map((l) => l.split(" ").slice(1).map(Number));
    const obj = lines
        .filter((l) => l.startsWith("f "))
        .map((l) =>
            l
                .split(" ")
                .slice(1)
                .map((i) => v[Number(i) - 1]),
        );
    const stl = new DataView(toStl([tenth]));
    assert.equal(stl.byteLength, 84 + 4 * 50);
    assert.equal(stl.getUint32(80, true), 4);
    const stlTriangles = [0, 1, 2, 3].map((k) =>
        [0, 1, 2].map((i) => [0, 1, 2].map((d) => stl.getFloat32(84 + 50 * k + 12 + 12 * i + 4 * d, true))),
    );
    const ply = toPly([tenth]);
    const head = new TextDecoder().decode(ply);
    const begin = head.indexOf("end_header\n") + 11;
    const view = new DataView(ply);
    assert.match(head, /element vertex 4\n/);
    assert.match(head, /element face 4\n/);
    assert.equal(ply.byteLength, begin + 48 + 52);
    const plyTriangles = [0, 1, 2, 3].map((k) =>
        [0, 1, 2].map((i) => {
            const at = view.getInt32(begin + 48 + 13 * k + 1 + 4 * i, true);
            return [0, 1, 2].map((d) => view.getFloat32(begin + 12 * at + 4 * d, true));
        }),
    );
    const inFloats = obj.map((t) => t.map((p) => p.map(Math.fround)));
    assert.deepEqual(stlTriangles, inFloats);
    assert.deepEqual(plyTriangles, inFloats);
    assert.ok(Math.abs(volume(stlTriangles) - 1e-3) < 1e-9);
    // normals of the STL are unit, outward
    assert.deepEqual(
        [0, 1, 2].map((d) => Number(stl.getFloat32(84 + 50 * 3 + 4 * d, true).toFixed(6))),
        [0.57735, 0.57735, 0.57735],
    );
    assert.deepEqual(Object.keys(WRITERS), ["obj", "stl", "ply"]);
});
