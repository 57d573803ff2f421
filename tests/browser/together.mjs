// Bridge, two browsers and lcm-logger on one organ, in a network namespace of its own: nobody drags, the bridge presses,
// both browsers see the vertices move and the tool with its name, and the LCM record has what they were shown.
// usage: node together.mjs BUILD PICTURES     ends with "N passed, N failed"
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { check, finish, launch, moved, open, palpate, pictures, prepare, program, scratch, serve, until } from "./common.mjs";

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
  const pages = [await open(browsers[0], address, "Ada", { width: 900, height: 640 }), await open(browsers[1], address, "Ben", { width: 640, height: 480 })];
  const before = Math.max(...(await Promise.all(pages.map(moved))));
  check("the organ rests quietly", before < 0.001, `${(1000 * before).toFixed(2)} mm`);

  // the bridge places itself over the part's top and presses once a second, until both have seen it
  const bridge = start(program("palpate-bridge"), ["--server", `ws://127.0.0.1:${server.info.port}/ws`, "--name", "Bridge",
    "--device", "virtual:touch", "--script", "cycle", "--options", "depth=12,wait=4", "--json"]);
  const names = (page) => page.evaluate(() => [...window.palpate.state.members.values()].map((m) => m.name));
  const seen = await Promise.all(pages.map((page) => until(() => names(page), (l) => l.includes("Bridge"))));
  const most = await Promise.all(pages.map((page) => until(() => moved(page), (m) => m > before + 0.002)));
  for (const i of [0, 1]) {
    check(`browser ${i + 1} knows the bridge by its name`, seen[i].includes("Bridge"), seen[i].join(" "));
    check(`browser ${i + 1} sees the vertices move under the bridge's tool`, most[i] > before + 0.002, `${(1000 * most[i]).toFixed(2)} mm`);
  }
  await pages[0].screenshot({ path: join(pictures, "together.png") });
  // the first press may come before its first contact model: a few more
  await new Promise((done) => setTimeout(done, 3000));
  bridge.kill("SIGINT");
  await bridge.ended;
  const felt = JSON.parse(bridge.text);
  check("the bridge's forces keep their cap", felt.force_max_N <= 3.0001, `${felt.force_max_N} N`);
  // a servo loop that cores shared with two renderers make late takes its forces off, as it must
  check("and are felt, unless the loop was late", felt.force_max_N > 0.05 || felt.forces !== "full", felt.forces);
  logger.kill("SIGINT");
  await logger.ended;
  const log = readFileSync(record).toString("latin1"), name = server.info.sessions?.[0]?.name ?? "";
  for (const channel of ["BODY/0", "STATUS"])
    check(`the record has ${channel}`, log.includes(`PALPATE1/`) && new RegExp(`PALPATE1/[a-z0-9_-]+/${channel}`).test(log), name);
} catch (error) {
  check("the test ran to its end", false, String(error.stack ?? error));
} finally {
  for (const browser of browsers) await browser.close().catch(() => {});
  for (const child of children) child.kill("SIGTERM");
}
finish();
