// Real Chromium opens the page, grabs the organ at a pixel, and a second Chromium sees the vertices move.
// usage: node pull.mjs BUILD PICTURES     ends with "N passed, N failed"
import { spawn, execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const [build, pictures] = process.argv.slice(2);
const { chromium } = createRequire(join(build, "viewer_packages", "package.json"))("playwright-core");
const palpate = join(build, "release", "bin", "palpate");
const scratch = mkdtempSync(join(tmpdir(), "palpate-browser-"));
mkdirSync(pictures, { recursive: true });

let passed = 0, failed = 0;
const check = (what, good, figure = "") => {
  console.log(`${good ? "ok  " : "FAIL"} ${what} ${figure}`);
  if (good) passed++;
  else failed++;
};

/** starts the server, resolves with its first JSON line */
function serve(scene, port) {
  const child = spawn(palpate, ["serve", scene, "--port", String(port), "--json"], { stdio: ["ignore", "pipe", "inherit"] });
  return new Promise((resolve, reject) => {
    let text = "";
    child.stdout.on("data", (bytes) => {
      text += bytes;
      if (text.includes("\n")) resolve({ child, info: JSON.parse(text.split("\n")[0]) });
    });
    child.on("exit", (code) => reject(new Error(`palpate serve ended with ${code}`)));
  });
}
const ended = (child) => new Promise((resolve) => child.on("exit", (code) => resolve(code)));

const FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
  "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
const troubles = [];
async function open(address, name, viewport) {
  const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: FLAGS });
  const page = await browser.newPage({ viewport });
  page.on("console", (m) => m.type() === "error" && troubles.push(`${name}: ${m.text()}`));
  page.on("pageerror", (e) => troubles.push(`${name}: ${e.message}`));
  await page.goto(`${address}?name=${name}`);
  await page.waitForFunction(() => window.palpate?.state.bodies.size > 0 && window.palpate.state.status, null, { timeout: 90000 });
  return { browser, page };
}
const moved = (page) => page.evaluate(() => Math.max(...[...window.palpate.state.bodies.values()].map((b) => b.moved())));
/** waits until test(await read()) or the time is over, gives the last value */
async function until(read, test, ms = 15000) {
  const end = Date.now() + ms;
  for (;;) {
    const value = await read();
    if (test(value) || Date.now() > end) return value;
    await new Promise((r) => setTimeout(r, 60));
  }
}
/** a pixel on the organ near the middle of the picture */
const organPixel = (page) => page.evaluate(() => {
  const { stage, input } = window.palpate, w = innerWidth, h = innerHeight;
  for (let r = 0; r < 0.4; r += 0.04)
    for (let a = 0; a < 6.28; a += 0.5) {
      const x = w * (0.5 + r * Math.cos(a)), y = h * (0.5 + r * Math.sin(a));
      if (document.elementFromPoint(x, y)?.id === "view" && input.pick(stage.ray(x, y))) return { x, y };
    }
  return null;
});

let server;
const browsers = [];
try {
  const scene = join(scratch, "organ");
  execFileSync(palpate, ["prepare", "--procedural", "--resolution", "14", "--triangles", "12000", "-o", scene, "--quiet"]);
  server = await serve(join(scene, "scene.json"), 0);
  const address = `http://127.0.0.1:${server.info.port}/`;
  const ada = await open(address, "Ada", { width: 1100, height: 720 });
  browsers.push(ada.browser);
  const ben = await open(address, "Ben", { width: 390, height: 780 });
  browsers.push(ben.browser);

  const title = await ada.page.textContent("#title");
  check("the page says which organ it shows", title.length > 3 && title !== "Palpate", title);
  await until(() => ada.page.evaluate(() => window.palpate.state.members.size), (n) => n === 2);
  const holders = await Promise.all([ada, ben].map(({ page }) => page.evaluate(() => window.palpate.state.myTool)));
  check("each of two browsers holds a tool of its own", holders[0] >= 0 && holders[1] >= 0 && holders[0] !== holders[1], holders.join(" "));

  const settled = await until(() => moved(ben.page), (m) => Number.isFinite(m), 4000);
  await new Promise((r) => setTimeout(r, 1500)); // the organ sinks a little under its own weight
  const before = await moved(ben.page);
  check("the organ rests quietly", Number.isFinite(settled) && before < 0.03, `${(1000 * before).toFixed(2)} mm`);

  const pixel = await organPixel(ada.page);
  check("a pixel of the picture shows the organ", !!pixel);
  await ada.page.mouse.move(pixel.x, pixel.y);
  await ada.page.mouse.down();
  for (let i = 1; i <= 12; i++) {
    await ada.page.mouse.move(pixel.x + 7 * i, pixel.y - 8 * i);
    await new Promise((r) => setTimeout(r, 40));
  }
  const pulled = await until(() => moved(ben.page), (m) => m > before + 0.01);
  check("the second browser sees the vertices move", pulled > before + 0.01, `${(1000 * before).toFixed(1)} -> ${(1000 * pulled).toFixed(1)} mm`);
  const force = await until(() => ada.page.evaluate(() => {
    const { state } = window.palpate;
    return Math.hypot(...(state.tools[state.myTool]?.force ?? [0, 0, 0]));
  }), (f) => f > 0.05);
  check("the one who pulls sees the force", force > 0.05 && force < 50, `${force.toFixed(2)} N`);
  const label = await until(() => ben.page.evaluate(() => [...document.querySelectorAll("#labels span")].filter((s) => !s.hidden).map((s) => s.textContent)), (l) => l.includes("Ada"));
  check("the other's tool is shown with its name", label.includes("Ada"), label.join(" "));
  await ada.page.keyboard.press("p"); // the panel, without letting go
  await new Promise((r) => setTimeout(r, 1500));
  await ada.page.screenshot({ path: join(pictures, "pull_ada.png") });
  await ben.page.screenshot({ path: join(pictures, "pull_ben_phone.png") });
  await ada.page.mouse.up();
  const back = await until(() => moved(ben.page), (m) => m < before + 0.004);
  check("let go, the organ returns", back < before + 0.004, `${(1000 * back).toFixed(2)} mm`);

  const overflow = await ben.page.evaluate(() => {
    const out = [...document.querySelectorAll("button, #state, #head")].filter((e) => {
      const b = e.getBoundingClientRect();
      return b.width > 0 && (b.left < -0.5 || b.right > innerWidth + 0.5 || b.bottom > innerHeight + 0.5);
    });
    return out.map((e) => e.id).concat(document.documentElement.scrollWidth > innerWidth ? ["page"] : []);
  });
  check("at phone width everything is within the page", overflow.length === 0, overflow.join(" "));

  await ben.page.click("#pause");
  const paused = await until(() => ada.page.evaluate(() => window.palpate.state.status.paused), (p) => p);
  check("pause by one is seen by all", paused === true);
  await ben.page.click("#pause");
  await until(() => ada.page.evaluate(() => window.palpate.state.status.paused), (p) => !p);

  const { port } = server.info;
  const quiet = troubles.length;
  server.child.kill("SIGTERM");
  const code = await ended(server.child);
  check("the server ends cleanly on SIGTERM", code === 0, String(code));
  const lost = await until(() => ada.page.getAttribute("#state", "data-state"), (s) => s !== "live");
  check("the page says that the connection is lost", lost !== "live", lost);
  server = await serve(join(scene, "scene.json"), port);
  const again = await until(() => ada.page.getAttribute("#state", "data-state"), (s) => s === "live", 20000);
  check("and comes back by itself", again === "live", again);
  const said = troubles.slice(0, quiet).concat(troubles.slice(quiet).filter((t) => !/WebSocket|ERR_CONNECTION/.test(t)));
  check("nothing was complained of in the browsers' consoles", said.length === 0, said.slice(0, 3).join(" | "));
} catch (error) {
  check("the test ran to its end", false, String(error.stack ?? error));
} finally {
  for (const browser of browsers) await browser.close().catch(() => {});
  server?.child.kill("SIGTERM");
  rmSync(scratch, { recursive: true, force: true });
}
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed ? 1 : 0);
