// What the npm package answers, imported by its name. usage: ask_npm.mjs packets FOLDER | touch URL [PACKAGES] | lost URL [PACKAGES]
// with PACKAGES, the folder of node_modules/ws, over that package in place of the runtime's WebSocket
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join as joinPath } from "node:path";
import { addressOf, applyTopologyDelta, decodeAsset, decodeField, FrameDecoder, join } from "palpate-client";
import { readControl, readHaptic, readTools, WireError, writeAck, writePose } from "palpate-client";

const [part, where, packages] = process.argv.slice(2);

/** @param {string} name */
const load = (name) => new Uint8Array(readFileSync(joinPath(where, name)));
/** @param {ArrayLike<number>} values */
const f32 = (values) => Array.from(values, Math.fround);

function packets() {
    const expected = JSON.parse(new TextDecoder().decode(load("expected.json")));
    const asset = decodeAsset(load("asset.bin"));
    assert.deepEqual(f32(asset.rest), f32(expected.asset.rest));
    assert.deepEqual(Array.from(asset.triangles), expected.asset.triangles);
    const decoder = new FrameDecoder(asset);
    for (const frame of expected.frames) {
        const positions = new Float32Array(asset.rest.length);
        decoder.decode(load(`frame_${frame.name}.bin`), positions);
        assert.deepEqual(f32(positions), f32(frame.positions), frame.name);
    }
    const level = new Uint8Array(expected.field.n);
    assert.equal(decodeField(load("field.bin"), level).name, "von_mises");
    assert.deepEqual(Array.from(level), expected.field.level);
    applyTopologyDelta(load("topology_delta.bin"), asset.triangles, asset.rest.length / 3);
    assert.deepEqual(Array.from(asset.triangles), expected.topology_delta.triangles);
    assert.equal(readTools(load("tools.bin")).cycle, expected.tools.cycle);
    assert.equal(readHaptic(load("haptic.bin")).seq, expected.haptic.seq);
    assert.deepEqual(writePose(expected.pose), load("pose.bin"));
    assert.deepEqual(writeAck(expected.ack), load("ack.bin"));
    const lines = new TextDecoder().decode(load("control.jsonl")).trim().split("\n");
    assert.equal(readControl(lines[0]).type, "hello");
    assert.throws(() => readTools(load("tools.bin").subarray(1)), WireError);
    assert.deepEqual(addressOf("https://host/?session=a#T"), { url: "wss://host/ws?session=a", ticket: "T" });
    assert.throws(() => addressOf("ftp://host/"), /no address/);
}

const WS = packages && createRequire(joinPath(packages, "package.json"))("ws");
const open = WS && ((url, protocols) => new WS(url, protocols));

/** nobody answers: it is told, and tried again */
function lost() {
    const states = [];
    const session = join(
        where,
        (message) => {
            if (message.type === "state") states.push(message.state);
            if (states.length < 4) return;
            assert.deepEqual(states, ["connecting", "lost", "connecting", "lost"]);
            session.close();
        },
        { open },
    );
}

/** grasps the top of the ball and pulls it up by 10 mm, a half at a time; each step has used the pose before the next */
function touch() {
    const radius = 0.008;
    let own = -1;
    let height = 0.02;
    let lowering = true;
    let rises = 0;
    let top = 0;
    const take = (message) => {
        if (message.type === "control" && message.message.type === "hello") own = message.message.you.tool ?? -1;
        if (message.type === "frame")
            for (let i = 2; i < message.positions.length; i += 3) top = Math.max(top, message.positions[i]);
        if (message.type === "frame") session.reuse(message);
        if (message.type !== "tools" || own < 0) return;
        const { position, force, away, grasps } = message.tools[own];
        if (!away && Math.abs(position[2] - 0.04 - height) > 1e-6) return; // no step has used the pose
        if (rises === 20) {
            assert.ok(grasps && -force[2] > 0, `${force} N on a tool that pulls up`);
            if (top < 0.045) return; // m: the tissue follows
            assert.ok(top < 0.055, `top at ${top} m`);
            session.close();
            return;
        }
        if (lowering && height > 0.5 * radius) height = Math.max(0.5 * radius, height - 5e-4);
        else if (grasps) ((height += 5e-4), rises++);
        lowering &&= !grasps;
        session.move([0, 0, 0.04 + height], height <= 0.5 * radius || !lowering);
    };
    const session = join(where, take, { open });
}

({ packets, touch, lost })[part]();
