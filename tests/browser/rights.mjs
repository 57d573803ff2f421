// A server that nobody enters without a ticket: what the page of a viewer, a trainee and an instructor offers, what the
// instructor changes, and that the ticket leaves the address bar.
import { check, checkConsoles, launch, newPage, open, pictures, prepare, run, serve, until } from "./common.mjs";

const text = (page, id) => page.evaluate((name) => document.getElementById(name).textContent.trim(), id);
const disabled = (page, id) => page.evaluate((name) => document.getElementById(name).disabled, id);

await run(async () => {
    const { info } = await serve(prepare(), 0, [], []);
    const place = info.open.split("#")[0];
    const browser = await launch();
    const at = (role) => (role ? `${place}#${info.tickets[role]}` : place);
    const size = { width: 1100, height: 700 };
    const ada = await open(browser, at("instructor"), "Ada", size);
    const tim = await open(browser, at("trainee"), "Tim", size);
    const eve = await open(browser, at(""), "Eve", size);

    check("the ticket leaves the address bar", !(await ada.evaluate(() => location.href)).includes("#"));
    await ada.reload();
    await ada.waitForFunction(() => window.palpate?.state.members.get(window.palpate.state.ownId));
    check("and lasts for the tab", (await ada.evaluate(() => window.palpate.state.hello.you.role)) === "instructor");
    await until(
        () => text(eve, "hint"),
        (hint) => hint.startsWith("You are watching"),
    );
    check(
        "who has no ticket is told that it watches",
        (await text(eve, "hint")) === "You are watching. Drag to look around.",
    );
    check("and cannot pause", (await disabled(eve, "pause")) && (await disabled(eve, "reset")));
    const offered = await eve.evaluate(() =>
        ["modes", "pause", "step", "reset"].filter((id) => document.getElementById(id).offsetWidth > 0),
    );
    check("nor sees buttons of tools and of the simulation", offered.length === 0, offered.join(" "));
    check("a trainee cannot pause", await until(() => disabled(tim, "pause")));
    check(
        "and is told nothing about its ticket, which allows what the page asks for",
        await tim.evaluate(() => document.getElementById("notice").hidden),
    );
    check("but holds a tool", (await until(() => tim.evaluate(() => window.palpate.state.ownTool + 1))) > 0);
    check("an instructor can", !(await disabled(ada, "pause")));

    await ada.click("#panel-toggle");
    await until(
        () => ada.evaluate(() => document.querySelectorAll("#members .more").length),
        (n) => n === 2,
    );
    const more = ada.locator("#members li", { hasText: "Tim" });
    await more.locator(".more").click();
    await more.locator("label", { hasText: "may pause and reset" }).locator("input").click();
    check(
        "a right that the instructor gives reaches the trainee",
        await until(async () => !(await disabled(tim, "pause"))),
    );
    await tim.click("#pause");
    await until(() => tim.evaluate(() => window.palpate.state.status?.paused));
    const orders = await until(
        () => text(ada, "orders"),
        (list) => list.includes("pause"),
    );
    check("all see who paused", /^Tim\s*pause/.test(orders), orders);
    const state = await until(
        () => text(eve, "state-text"),
        (now) => now.startsWith("paused by"),
    );
    check("in the state of the simulation too", state === "paused by Tim", state);
    await ada.evaluate(() => document.getElementById("orders").scrollIntoView());
    await ada.screenshot({ path: `${pictures}/rights_instructor.png` });
    await eve.screenshot({ path: `${pictures}/rights_viewer.png` });

    await ada.locator("#tool-choices select").first().selectOption({ label: "Ada (you)" });
    check(
        "the instructor takes a tool over",
        await until(() => tim.evaluate(() => window.palpate.state.members.get(window.palpate.state.ownId).tool !== 0)),
    );
    await more.locator("button", { hasText: "Remove" }).click();
    const gone = await until(
        () => text(tim, "state-text"),
        (state) => state.includes("cannot take part"),
    );
    check("who is removed is told by whom", gone.includes("Ada has removed you"), gone);
    await tim.screenshot({ path: `${pictures}/rights_removed.png` });

    const odd = await newPage(browser, { viewport: size });
    await odd.goto(`${place}?role=admin&name=Odd`);
    await odd.waitForFunction(() => window.palpate?.state.status);
    const answer = await until(() => text(odd, "notice"));
    check("a role that does not exist is no message that the server cannot read", /only watch/.test(answer), answer);
    await odd.close();

    // a server that stands still: the page says so, dims the old picture, and takes it back
    const before = Date.now();
    process.kill(info.pid, "SIGSTOP");
    const silent = await until(
        () => text(ada, "state-text"),
        (state) => state.startsWith("no answer"),
    );
    check(
        "a server that does not answer is told",
        /^no answer from the server for \d+ s$/.test(silent),
        `${silent}, after ${Date.now() - before} ms`,
    );
    check("and the picture is dimmed", await ada.evaluate(() => document.body.classList.contains("silent")));
    await ada.screenshot({ path: `${pictures}/rights_silent.png` });
    process.kill(info.pid, "SIGCONT");
    await until(
        () => text(ada, "state-text"),
        (state) => !state.startsWith("no answer"),
    );
    check("until it answers", await until(() => ada.evaluate(() => !document.body.classList.contains("silent"))));
    checkConsoles();
});
