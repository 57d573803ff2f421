import assert from "node:assert/strict";
import { test } from "node:test";
import { between, smooth, nextName, readViews, withView } from "../src/saved_views.js";
import { direction } from "../src/scope_pose.js";
import { STANDARD, standardView } from "../src/standard_views.js";

/** @param {Record<string, number>} more @returns {import("../src/saved_views.js").Shot} */
const free = (more) => ({ kind: "free", values: { x: 0, y: 0, z: 0, near: 1, azimuth: 0, elevation: 0, ...more } });

test("a motion begins and ends at its views, at rest", () => {
    const [from, to] = [free({ x: 1, azimuth: 3, near: 0.5 }), free({ x: 2, azimuth: -3, near: 2 })];
    assert.deepEqual(between(from, to, 0), from);
    const end = between(from, to, 1).values;
    assert.ok(Math.abs(Math.cos(end.azimuth) - Math.cos(-3)) < 1e-12 && end.x === 2 && Math.abs(end.near - 2) < 1e-12);
    assert.ok(smooth(0) === 0 && smooth(1) === 1 && smooth(0.01) < 0.001 && 1 - smooth(0.99) < 0.001);
});

test("angles go the shorter way, distances in equal ratios", () => {
    const half = between(free({ azimuth: 3, near: 0.5 }), free({ azimuth: -3, near: 2 }), 0.5).values;
    assert.ok(Math.abs(Math.abs(half.azimuth) - Math.PI) < 1e-12);
    assert.ok(Math.abs(half.near - 1) < 1e-12);
});

test("what is stored comes back, and anything else is left out", () => {
    const views = withView(withView([], "hilum", free({ x: 1 })), "2", free({ near: 3 }));
    assert.deepEqual(readViews(JSON.stringify(views)), views);
    const bad = [
        null,
        3,
        {},
        { name: "", shot: free({}) },
        { name: "a".repeat(99), shot: free({}) },
        { name: "a", shot: { kind: "other", values: {} } },
        { name: "a", shot: free({ x: NaN }) },
        { name: "a", shot: free({ near: 0 }) },
        { name: "a", shot: { kind: "endoscope", values: free({}).values } },
    ];
    assert.deepEqual(readViews(JSON.stringify([...bad, ...views])), views);
    for (const text of [null, "", "{", "7", "{}", '"x"']) assert.deepEqual(readViews(text), []);
});

test("a name is used once", () => {
    const named = (/** @type {number} */ n) => String(n);
    let views = withView([], nextName([], named), free({}));
    views = withView(views, nextName(views, named), free({ x: 1 }));
    views = withView(views, "2", free({ x: 5 }));
    assert.deepEqual(
        views.map(({ name }) => name),
        ["1", "2"],
    );
    assert.equal(views[1].shot.values.x, 5);
    assert.equal(nextName(views.slice(1), named), "3", "2 is a name already");
});

const grounds = {
    z: { a: [1, 0, 0], b: [0, 1, 0], up: [0, 0, 1] },
    y: { a: [1, 0, 0], b: [0, 0, -1], up: [0, 1, 0] },
};
/** where the camera stands, and what is above in its picture @param {import("../src/scope_pose.js").Ground} ground */
function seen(ground, { azimuth, elevation }) {
    const away = direction(ground, azimuth, elevation);
    return { away, above: direction(ground, azimuth, elevation + Math.PI / 2) };
}
/** @param {number[]} u @param {number[]} v @param {string} what */
const near = (u, v, what) => u.forEach((c, k) => assert.ok(Math.abs(c - v[k]) < 1e-9, `${what}: ${u} is not ${v}`));

test("the six views stand at six sides, and up is above beside them", () => {
    for (const ground of Object.values(grounds)) {
        const views = STANDARD.map((side) => seen(ground, standardView(side, ground, "")));
        for (let i = 0; i < 6; i += 2)
            near(
                views[i].away,
                views[i + 1].away.map((c) => -c),
                STANDARD[i],
            );
        for (let i = 0; i < 4; i++) near(views[i].above, ground.up, STANDARD[i]);
        near(views[4].away, ground.up, "above");
        // from the front, the right side of the scene is at the right
        near(views[3].away, ground.a, "right");
    }
});

test("sides of the patient count where they are known", () => {
    const ground = grounds.z; // a patient who lies on the back: up is anterior
    const axes = "LSA";
    const view = (/** @type {typeof STANDARD[number]} */ side) => seen(ground, standardView(side, ground, axes));
    near(view("front").away, [0, 0, 1], "anterior");
    near(view("front").above, [0, 1, 0], "the head is above");
    near(view("back").above, [0, 1, 0], "the head is above");
    near(view("left").away, [1, 0, 0], "left");
    near(view("above").away, [0, 1, 0], "superior");
    near(view("above").above, [0, 0, 1], "anterior is above");
    for (const bad of ["", "LS", "LLL", "XYZ"])
        assert.deepEqual(standardView("front", ground, bad), standardView("front", ground, ""));
});
