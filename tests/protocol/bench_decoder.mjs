// Time of the viewer's decoder in a Worker: node tests/protocol/bench_decoder.mjs FOLDER, the folder of make_frames.
import { readdirSync, readFileSync } from "node:fs";
import { isMainThread, Worker, workerData } from "node:worker_threads";
import { decodeAsset } from "../../clients/viewer/src/asset.js";
import { FrameDecoder } from "../../clients/viewer/src/frame_decoder.js";

const ROUNDS = 200;

/** @param {string} folder */
function measure(folder) {
    const load = (/** @type {string} */ name) => new Uint8Array(readFileSync(`${folder}/${name}`));
    const begin = performance.now(),
        asset = decodeAsset(load("asset.bin")),
        read = performance.now() - begin;
    const decoder = new FrameDecoder(asset),
        positions = new Float32Array(asset.rest.length);
    console.log(
        `${asset.vertexOf.length} vertices, asset read in ${read.toFixed(0)} ms; decoding, ms, median / 90 % of ${ROUNDS}:`,
    );
    const names = readdirSync(folder).filter((name) => name.startsWith("frame_"));
    const times = new Map(names.map((name) => [name, /** @type {number[]} */ ([])]));
    // frames alternate, so that none is measured with code tuned to it alone
    for (let round = 0; round < ROUNDS; round++)
        for (const name of names) {
            const bytes = load(name),
                start = performance.now();
            decoder.decode(bytes, positions);
            times.get(name)?.push(performance.now() - start);
        }
    for (const [name, ms] of times) {
        ms.sort((a, b) => a - b);
        console.log(
            `${name.slice(6, -4).padEnd(10)} ${String(load(name).length).padStart(7)} bytes ${ms[ROUNDS >> 1].toFixed(2)} / ${ms[Math.floor(0.9 * ROUNDS)].toFixed(2)}`,
        );
    }
}

if (isMainThread) new Worker(new URL(import.meta.url), { workerData: process.argv[2] });
else measure(workerData);
