// The haptic bridge, two browsers and lcm-logger on one organ, in a network namespace of its own: the bridge presses, both
// browsers show the vertices move and the tool with its name, and the LCM log contains the same messages.
// usage: node together.mjs BUILD PICTURES     ends with "N passed, N failed"
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    displacement,
    endWithTest,
    launch,
    open,
    pictures,
    prepare,
    program,
    scratch,
    serve,
    until,
    run,
} from "./common.mjs";

const BUS = "udpm://239.255.76.67:7667?ttl=0";
const start = (command, args, options = {}) => {
    const child = endWithTest(spawn(command, args, { stdio: ["ignore", "pipe", "inherit"], ...options }));
    child.text = "";
    child.stdout.on("data", (bytes) => (child.text += bytes));
    child.ended = new Promise((resolve) => child.on("exit", resolve));
    return child;
};

await run(async () => {
    const scene = prepare();
    const record = join(scratch, "record");
    const server = await serve(scene, 0, ["--lcm", BUS]);
    const logger = start("lcm-logger", [`--lcm-url=${BUS}`, "-f", record]);
    const address = `http://127.0.0.1:${server.info.port}/`;
    const browsers = [await launch(), await launch()];
    const pages = [
        await open(browsers[0], address, "Ada", { width: 900, height: 640 }),
        await open(browsers[1], address, "Ben", { width: 640, height: 480 }),
    ];
    const before = Math.max(...(await Promise.all(pages.map(displacement))));
    check("the organ is at rest", before < 0.001, `${(1000 * before).toFixed(2)} mm`);

    // the bridge places itself over the top of the body and presses once a second, until both browsers show it and it
    // renders a force; its device lives in time of its own, so that two renderers beside it cannot make it late
    const names = (page) => page.evaluate(() => [...window.palpate.state.members.values()].map((m) => m.name));
    const bridge = start(
        program("palpate-bridge"),
        [
            ["--server", `ws://127.0.0.1:${server.info.port}/ws`],
            ["--name", "Bridge"],
            ["--device", "virtual:touch,clock=steps"],
            ["--script", "cycle"],
            ["--options", "depth=12,wait=4"],
        ].flat(),
        { stdio: ["ignore", "pipe", "pipe"] },
    );
    let report = "";
    const touched = new Promise((resolve) =>
        bridge.stderr.on("data", (bytes) => (report += bytes).includes("info touch: ") && resolve()),
    );
    const seen = await Promise.all(
        pages.map((page) =>
            until(
                () => names(page),
                (l) => l.includes("Bridge"),
            ),
        ),
    );
    const max = await Promise.all(
        pages.map((page) =>
            until(
                () => displacement(page),
                (m) => m > before + 0.002,
            ),
        ),
    );
    await pages[0].screenshot({ path: join(pictures, "together.png") });
    await Promise.race([touched, bridge.ended]);
    bridge.kill("SIGINT");
    await bridge.ended;
    const force = Number(/force N: max ([\d.]+)/.exec(bridge.text)?.[1] ?? NaN);
    for (const i of [0, 1]) {
        check(`browser ${i + 1} shows the bridge by its name`, seen[i].includes("Bridge"), seen[i].join(" "));
        check(
            `browser ${i + 1} shows the vertices move under the tool of the bridge`,
            max[i] > before + 0.002,
            `${(1000 * max[i]).toFixed(2)} mm`,
        );
    }
    // it says so above 0.05 N, and reports hundredths
    check("the bridge renders forces", force >= 0.05, `${force} N`);
    check("the forces of the bridge stay below their limit", force <= 3.0001, `${force} N`);
    logger.kill("SIGINT");
    await logger.ended;
    const log = readFileSync(record).toString("latin1");
    const name = server.info.sessions?.[0]?.name ?? "";
    for (const channel of ["BODY/0", "STATUS"])
        check(
            `the log contains ${channel}`,
            log.includes(`PALPATE1/`) && new RegExp(`PALPATE1/[a-z0-9_-]+/${channel}`).test(log),
            name,
        );
    checkConsoles();
});
