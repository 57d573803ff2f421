// The lobby: sessions with people and pictures, scenes that an instructor opens and sessions that it ends.
// usage: node lobby.mjs BUILD PICTURES     ends with "N passed, N failed"
import { execFileSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import {
    check,
    checkConsoles,
    launch,
    newPage,
    nextFrame,
    palpate,
    pictures,
    prepare,
    run,
    scratch,
    serve,
    until,
} from "./common.mjs";

const cards = (page) =>
    page.evaluate(() =>
        [...document.querySelectorAll("#lobby-sessions li")].map((card) => ({
            name: card.dataset.name,
            state: card.querySelector(".state").textContent,
            people: card.querySelector(".people").textContent,
            actions: [...card.querySelectorAll(".actions > *")].map((e) => e.textContent).join(" "),
        })),
    );
/** share of a card's picture that is drawn */
const drawn = (page, name) =>
    page.evaluate((session) => {
        const canvas = document.querySelector(`#lobby-sessions li[data-name="${session}"] canvas`);
        if (!canvas) return 0;
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let n = 0;
        for (let i = 3; i < data.length; i += 4) n += data[i] > 0;
        return n / (canvas.width * canvas.height);
    }, name);

await run(async () => {
    const scene = prepare();
    const folder = join(scratch, "scenes");
    execFileSync("mkdir", ["-p", folder]);
    execFileSync(palpate, ["cells", "chair", "-o", join(folder, "chair.palcells"), "--quiet"]);
    writeFileSync(join(folder, "broken.json"), '{"name":');
    const { info } = await serve(scene, 0, ["--scenes", folder], []);
    const place = info.open.split("#")[0];
    const browser = await launch();
    const page = async (role, name, size, path = "") => {
        const p = await newPage(browser, { viewport: size });
        await p.goto(`${place}${path}?name=${name}${role ? "#" + info.tickets[role] : ""}`);
        return p;
    };

    // one session and no right to open others: nothing to choose
    const tim = await page("trainee", "Tim", { width: 900, height: 640 });
    await tim.waitForFunction(() => window.palpate?.state.members.size > 0);
    check("a trainee is in the only session at once", true);

    const ada = await page("instructor", "Ada", { width: 1100, height: 760 });
    await ada.waitForSelector("#lobby-sessions li");
    const first = await until(
        () => cards(ada),
        (list) => list[0]?.people === "Tim",
    );
    check("an instructor sees the session and who is in it", first[0].people === "Tim", JSON.stringify(first[0]));
    check("and may join, watch or end it", first[0].actions === "Join Watch End", first[0].actions);
    const liver = first[0].name;
    const share = await until(
        () => drawn(ada, liver),
        (s) => s > 0.1,
    );
    check("its picture shows the organ", share > 0.1 && share < 0.9, share.toFixed(2));

    await ada.click("text=broken.json");
    await ada.click("text=chair.palcells");
    const opened = await until(
        () => cards(ada),
        (list) => list.some((c) => c.name === "chair" && c.actions.startsWith("Join")),
    );
    const broken = opened.find((c) => c.name === "broken");
    check("a scene is opened beside it", opened.length === 3, opened.map((c) => c.name).join(" "));
    check("a broken one says what is wrong", /cannot be opened: .*not JSON/.test(broken?.state ?? ""), broken?.state);
    await until(
        () => drawn(ada, "chair"),
        (s) => s > 0.05,
    );
    for (const colorScheme of ["light", "dark"]) {
        await ada.emulateMedia({ colorScheme });
        await ada.screenshot({ path: join(pictures, `lobby_${colorScheme}.png`) });
    }
    await ada.emulateMedia({ colorScheme: "light" });

    const eve = await page("", "Eve", { width: 390, height: 780 });
    await eve.waitForSelector("#lobby-sessions li");
    const seen = await until(
        () => cards(eve),
        (list) => list.length === 3,
    );
    check("who has no ticket sees no names", !JSON.stringify(seen).includes("Tim"), seen[0].people);
    check("nor what it may not do", seen[0].actions === "Join Watch" && (await eve.locator("#lobby-open").isHidden()));
    await eve.screenshot({ path: join(pictures, "lobby_phone.png") });

    // by keyboard into the new session; the ticket comes along
    await ada.locator('a[aria-label="Join chair"]').focus();
    await ada.keyboard.press("Enter");
    await ada.waitForFunction(() => window.palpate?.state.members.size > 0);
    const you = await ada.evaluate(
        () => window.palpate.state.hello.you.role + " " + window.palpate.state.hello.session,
    );
    check("a link leads into it, with the ticket", you === "instructor chair", you);
    await ada.waitForFunction(() => [...window.palpate.state.bodies.values()].some((body) => body.shown));
    await nextFrame(ada);
    check("and back", await ada.locator("#lobby-link").isVisible());
    await ada.screenshot({ path: join(pictures, "lobby_joined.png") });
    const zoe = await page("trainee", "Zoe", { width: 900, height: 640 });
    await zoe.waitForSelector('a[aria-label="Join chair"]');
    await zoe.click('a[aria-label="Join chair"]');
    await zoe.waitForFunction(() => window.palpate?.state.members.size === 2);

    await ada.click("#lobby-link");
    await ada.click('button[aria-label="End chair"]');
    await ada.click('button[aria-label="End chair"]');
    const left = await until(
        () => cards(ada),
        (list) => !list.some((c) => c.name === "chair"),
    );
    check("an instructor ends it", !left.some((c) => c.name === "chair"), left.map((c) => c.name).join(" "));
    const text = await until(
        () => zoe.textContent("#state-text"),
        (text) => text.includes("ended"),
    );
    check("who was in it is told", text === "the session was ended by an instructor", text);
    const alive = await tim.evaluate(() => window.palpate.state.status.sim_time_s);
    const later = await until(
        () => tim.evaluate(() => window.palpate.state.status.sim_time_s),
        (s) => s > alive + 0.5,
    );
    check("and the other session has gone on", later > alive + 0.5);
    checkConsoles();
});
