// A full server: a page that only watches goes on to a relay by itself, and sees there what the server simulates.
// usage: node relays.mjs BUILD PICTURES     ends with "N passed, N failed"
import { spawn } from "node:child_process";
import { createServer } from "node:net";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    endWithTest,
    launch,
    open,
    pictures,
    prepare,
    program,
    run,
    serve,
    until,
} from "./common.mjs";

const freePort = () =>
    new Promise((resolve) => {
        const server = createServer().listen(0, "127.0.0.1", () => {
            const { port } = server.address();
            server.close(() => resolve(port));
        });
    });
/** its first JSON line */
const relayOf = (upstream, more) =>
    new Promise((resolve, reject) => {
        const args = [upstream, "--port", "0", "--json", ...more];
        const child = endWithTest(spawn(program("palpate-relay"), args, { stdio: ["ignore", "pipe", "inherit"] }));
        child.stdout.once("data", (line) => resolve(JSON.parse(line)));
        child.on("exit", (code) => reject(new Error(`palpate-relay ended with ${code}`)));
    });

await run(async () => {
    const scene = prepare();
    const page = join(program(".."), "share", "palpate", "viewer");
    // the server names the relay, which calls it until it is there and then has its one place
    const port = await freePort();
    const relay = await relayOf(`ws://127.0.0.1:${port}/ws`, ["--viewer", page]);
    const { info } = await serve(scene, port, ["--max-viewers", "1", "--relays", relay.url], []);
    const end = Date.now() + 120000;
    while ((await fetch(new URL("readyz", relay.url))).status !== 200 && Date.now() < end)
        await new Promise((resolve) => setTimeout(resolve, 50));

    const browser = await launch();
    const place = info.open.split("#")[0];
    const eve = await open(browser, `${place}#`, "Eve", { width: 700, height: 500 });
    check("who watches and finds no place is at the relay", eve.url().startsWith(relay.url), eve.url());
    check("its address kept what was asked for", new URL(eve.url()).searchParams.get("name") === "Eve");
    const role = await eve.evaluate(() => window.palpate.state.hello.you.role);
    check("there it watches", role === "viewer", role);
    const tim = await open(browser, `${place}#${info.tickets.trainee}`, "Tim", { width: 700, height: 500 });
    check("a trainee is at the server", tim.url().startsWith(place), tim.url().split("?")[0]);
    await eve.waitForFunction(() => [...window.palpate.state.members.values()].some(({ name }) => name === "Tim"));
    check("and the viewer at the relay sees that it is there", true);

    // what a relay shows: fields, asked for upstream while somebody looks
    const shown = (page, id) => page.evaluate((name) => document.getElementById(name).offsetWidth > 0, id);
    await eve.selectOption("#field", "displacement");
    await eve.waitForFunction(() => [...window.palpate.state.bodies.values()][0]?.colours.values);
    const computes = (page) => page.evaluate(() => (window.palpate.state.status?.components ?? []).join());
    check("a viewer at the relay sees the displacement in colours", true);
    check(
        "which the server computes for it",
        await until(
            () => computes(tim),
            (list) => list.includes("field_output"),
        ),
    );
    await eve.screenshot({ path: join(pictures, "relay.png") });
    await eve.selectOption("#field", "none");
    const idle = await until(
        () => computes(tim),
        (list) => !list.includes("field_output"),
    );
    check("and no more when nobody looks", !idle.includes("field_output"), idle);
    // what it refuses is not offered: estimates, and the reset of a body that stands
    await tim.click("#panel-toggle");
    await eve.click("#panel-toggle");
    check("the server's page offers estimates", await shown(tim, "accuracy-toggle"));
    check("the relay's does not", !(await shown(eve, "accuracy-toggle")));
    const resets = (page) =>
        page.evaluate(() => {
            const { panel, state } = window.palpate;
            const parts = [{ part: 0, frozen: true, asleep: false, reason: "It diverged.", safeguards: 0 }];
            panel.showStatus({ ...state.status, parts }, state.figures, state.parts, !state.hello.relay);
            return document.querySelectorAll("#bodies button").length;
        });
    check("the server's page offers to reset a body that stands", (await resets(tim)) === 1);
    check("the relay's does not", (await resets(eve)) === 0);
    const refused = await eve.evaluate(() => document.getElementById("notice").hidden);
    check("nothing that the page of the relay has done was refused", refused);
    checkConsoles();
});
