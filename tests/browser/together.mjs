// Bridge, two browsers and lcm-logger on one organ, in a network namespace of its own: nobody drags, the bridge presses,
// both browsers see the vertices move and the tool with its name, and the LCM record has what they were shown.
// usage: node together.mjs BUILD PICTURES     ends with "N passed, N failed"
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    finish,
    launch,
    moved,
    open,
    palpate,
    pictures,
    prepare,
    program,
    scratch,
    serve,
    until,
} from "./common.mjs";

const BUS = "udpm://239.255.76.67:7667?ttl=0";
const children = [];
const start = (command, args, options = {}) => {
    const child = spawn(command, args, { stdio: ["ignore", "pipe", "inherit"], ...options });
    children.push(child);
    child.text = "";
    child.stdout.on("data", (bytes) => (child.text += bytes));
    child.ended = new Promise((resolve) => child.on("exit", resolve));
    return child;
};

let browsers = [];
try {
    const scene = prepare();
    const record = join(scratch, "record");
    const server = await serve(scene, 0, ["--lcm", BUS]);
    children.push(server.child);
    const logger = start("lcm-logger", [`--lcm-url=${BUS}`, "-f", record]);
    const address = `http://127.0.0.1:${server.info.port}/`;
    browsers = [await launch(), await launch()];
    const pages = [
        await open(browsers[0], address, "Ada", { width: 900, height: 640 }),
        await open(browsers[1], address, "Ben", { width: 640, height: 480 }),
    ];
    const before = Math.max(...(await Promise.all(pages.map(moved))));
    check("the organ rests quietly", before < 0.001, `${(1000 * before).toFixed(2)} mm`);

    // the bridge places itself over the part's top and presses once a second, until both have seen it and it has felt it
    const names = (page) => page.evaluate(() => [...window.palpate.state.members.values()].map((m) => m.name));
    const press = async (wait_ms) => {
        const bridge = start(program("palpate-bridge"), [
            "--server",
            `ws://127.0.0.1:${server.info.port}/ws`,
            "--name",
            "Bridge",
            "--device",
            "virtual:touch",
            "--script",
            "cycle",
            "--options",
            "depth=12,wait=4",
            "--json",
        ]);
        const seen = await Promise.all(
            pages.map((page) =>
                until(
                    () => names(page),
                    (l) => l.includes("Bridge"),
                ),
            ),
        );
        const most = await Promise.all(
            pages.map((page) =>
                until(
                    () => moved(page),
                    (m) => m > before + 0.002,
                ),
            ),
        );
        await pages[0].screenshot({ path: join(pictures, "together.png") });
        await new Promise((done) => setTimeout(done, wait_ms));
        bridge.kill("SIGINT");
        await bridge.ended;
        return { seen, most, felt: JSON.parse(bridge.text) };
    };
    // Cores shared with two renderers: the first presses may come before a contact model does, and a servo loop that is
    // late takes its forces off, as it must. So it is given more time, four times; it says how often.
    let tries = 1,
        last = await press(3000);
    for (; last.felt.force_max_N <= 0.05 && tries < 4; tries++) {
        console.log(
            `     felt ${last.felt.force_max_N} N of ${last.felt.models} models, forces ${last.felt.forces}: once more`,
        );
        last = await press(6000 * tries);
    }
    for (const i of [0, 1]) {
        check(`browser ${i + 1} knows the bridge by its name`, last.seen[i].includes("Bridge"), last.seen[i].join(" "));
        check(
            `browser ${i + 1} sees the vertices move under the bridge's tool`,
            last.most[i] > before + 0.002,
            `${(1000 * last.most[i]).toFixed(2)} mm`,
        );
    }
    check("the bridge's forces keep their cap", last.felt.force_max_N <= 3.0001, `${last.felt.force_max_N} N`);
    check(
        "and are felt, unless the loop was late to the end",
        last.felt.force_max_N > 0.05 || last.felt.forces !== "full",
        `${last.felt.force_max_N} N, ${last.felt.forces}, try ${tries}`,
    );
    logger.kill("SIGINT");
    await logger.ended;
    const log = readFileSync(record).toString("latin1"),
        name = server.info.sessions?.[0]?.name ?? "";
    for (const channel of ["BODY/0", "STATUS"])
        check(
            `the record has ${channel}`,
            log.includes(`PALPATE1/`) && new RegExp(`PALPATE1/[a-z0-9_-]+/${channel}`).test(log),
            name,
        );
} catch (error) {
    check("the test ran to its end", false, String(error.stack ?? error));
} finally {
    for (const browser of browsers) await browser.close().catch(() => {});
    for (const child of children) child.kill("SIGTERM");
}
finish();
