// The lists of the plan panel: components, bodies with a remark, what is not computed.
import assert from "node:assert/strict";
import { test } from "node:test";
import { barLengths, bodyRemarks, componentsOf, fixedReason, idleText } from "../src/plan_list.js";

test("disabled components stay on the list, with their body and reason", () => {
    const plan = {
        components: ["gravity", "hex_elastic", "hex_elastic"],
        component_parts: [0, 0, 1],
        component_reasons: ["gravity_m_s2", "bodies[0].model", "bodies[1].model"],
    };
    assert.deepEqual(
        componentsOf(plan, null).map((r) => [r.name, r.part, r.on, r.index, r.reason]),
        [
            ["gravity", 0, true, 0, "gravity_m_s2"],
            ["hex_elastic", 0, true, 1, "bodies[0].model"],
            ["hex_elastic", 1, true, 2, "bodies[1].model"],
        ],
    );
    const off = componentsOf(plan, {
        components: ["hex_elastic", "hex_elastic", "field_output"],
        component_parts: [0, 1, 1],
        disabled: [{ component: "gravity", part: 0 }],
    });
    assert.deepEqual(
        off.map((r) => [r.name, r.part, r.on, r.index, r.reason]),
        [
            ["hex_elastic", 0, true, 0, "bodies[0].model"],
            ["hex_elastic", 1, true, 1, "bodies[1].model"],
            ["field_output", 1, true, 2, ""],
            ["gravity", 0, false, null, "gravity_m_s2"],
        ],
    );
    const fixed = componentsOf(
        { ...plan, component_required: [0, 1, 1] },
        {
            components: ["hex_elastic", "hex_elastic", "field_output"],
            component_parts: [0, 1, 1],
            disabled: [{ component: "gravity", part: 0 }],
        },
    );
    assert.deepEqual(
        fixed.map((r) => [r.name, r.fixed]),
        [
            ["hex_elastic", true],
            ["hex_elastic", true],
            ["field_output", true],
            ["gravity", false],
        ],
        "fixed components have no switch",
    );
    assert.deepEqual(
        off.map((r) => r.fixed),
        [false, false, false, false],
        "without component_required",
    );
    assert.deepEqual(
        componentsOf({ components: ["a"] }, { components: [] }).map((r) => [r.name, r.part, r.reason]),
        [["a", 0, ""]],
        "without component_parts",
    );
});

test("a fixed component has a reason, and a bar is proportional to its time", () => {
    const components = componentsOf(
        { components: ["verlet"], component_parts: [0], component_required: [1] },
        { components: ["verlet", "field_output"], component_parts: [0, 0] },
    );
    assert.deepEqual(
        components.map((c) => [c.fixed, c.planned]),
        [
            [true, true],
            [true, false],
        ],
    );
    assert.match(fixedReason(components[0]), /moves the body/);
    assert.match(fixedReason(components[1]), /while something else needs it/);
    assert.deepEqual(barLengths([1, 0.5, 0.0004]), [1, 0.5, 0]);
    assert.deepEqual(barLengths([0.0004, 0.0001]), [0, 0], "asleep");
    assert.deepEqual(
        barLengths([0.001]).map((v) => Number(v.toFixed(2))),
        [0.1],
    );
    assert.deepEqual(barLengths([]), []);
});

test("a stopped body has its reason, a corrected one the number and time of corrections", () => {
    const parts = [{ name: "liver" }, { name: "kidney" }];
    assert.deepEqual(
        bodyRemarks(
            [
                { part: 1, frozen: true, reason: "node 512 moves at 3,200 m/s", safeguards: 1, safeguard_ms: 0.25 },
                { part: 0, asleep: true },
            ],
            parts,
        ),
        [
            {
                name: "kidney",
                frozen: true,
                state: "stopped",
                text: ["node 512 moves at 3,200 m/s", "1 step corrected by a safeguard, 0.250 ms in total."],
            },
            { name: "liver", frozen: false, state: "asleep", text: [] },
        ],
    );
    assert.deepEqual(bodyRemarks([{ part: 0, safeguards: 1234567, safeguard_ms: 88.44 }], parts)[0].text, [
        "1,234,567 steps corrected by a safeguard, 88.4 ms in total.",
    ]);
    assert.deepEqual(bodyRemarks([], parts), []);
});

test("what no client displays is not computed", () => {
    assert.equal(
        idleText({ field: false, estimate: false, estimates: true, unobserved: 0 }),
        "Not displayed, therefore not computed: field values, error estimates.",
    );
    assert.equal(
        idleText({ field: true, estimate: false, estimates: false, unobserved: 12345 }),
        "12,345 steps were simulated without any viewer.",
    );
    assert.equal(idleText({ field: true, estimate: true, estimates: true, unobserved: 0 }), "");
});
