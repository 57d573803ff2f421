#!/usr/bin/env node
// Opens a scene on a game server of the fleet: prints its address and a ticket. The Kubernetes API is reached through
// `kubectl proxy`; the ticket is made by palpate, so the key file is that of the fleet. The session's name is put into the
// map of HAProxy (deploy/haproxy.cfg), so that ?session=NAME leads to its server. A name that has been in use goes on with
// its recording: this is how a session is opened again after its server has ended, and what --keep does by itself.
import { execFileSync } from "node:child_process";
import { randomBytes } from "node:crypto";
import { readFileSync } from "node:fs";
import net from "node:net";
import path from "node:path";
import { parseArgs } from "node:util";

const usage = `usage: allocate.mjs SCENE [flags]
  --session NAME     name of the session (the scene's, with six random letters)
  --api URL          Kubernetes API (http://127.0.0.1:8001, of kubectl proxy)
  --namespace NAME   of the fleet (default)
  --allocation FILE  the GameServerAllocation (allocation.json beside this file)
  --keys FILE        key file of the fleet's tickets (needed)
  --palpate PROGRAM  that makes tickets (palpate)
  --role ROLE        of the ticket that is printed (trainee)
  --site URL         where browsers find the gateway (http://ADDRESS:PORT of the server)
  --admin SOCKET     of HAProxy, and --map FILE as its configuration names it (no map)
  --keep             stay, and open the session on another server whenever its own has ended and somebody was in it;
                     ends with the session
Prints one JSON object for each server: address, session, ticket, server.`;
const POLL_MS = 500; // between two questions about the session
const EMPTY_POLLS = 4; // a server that ends has dropped its members up to a second before
const ANSWER_MS = 5000; // for an answer
const within = () => ({ signal: AbortSignal.timeout(ANSWER_MS) });
const text = (value) => ({ type: "string", default: value });
const { values: flag, positionals } = parseArgs({
    allowPositionals: true,
    options: {
        session: text(""),
        api: text("http://127.0.0.1:8001"),
        namespace: text("default"),
        allocation: text(path.join(import.meta.dirname ?? path.dirname(process.argv[1]), "allocation.json")),
        keys: text(""),
        palpate: text("palpate"),
        role: text("trainee"),
        site: text(""),
        admin: text(""),
        map: text(""),
        keep: { type: "boolean", default: false },
    },
});
if (positionals.length !== 1 || !flag.keys || !flag.admin !== !flag.map) {
    console.error(usage);
    process.exit(2);
}
const [scene] = positionals;
const session = flag.session || `${scene.replace(/\..*/, "").slice(0, 16)}-${randomBytes(3).toString("hex")}`;

/** a ticket for any number of members and so long, s @param {string} role @param {number} expires @param {string[]} more */
function makeTicket(role, expires, ...more) {
    const flags = ["--keys", flag.keys, "--role", role, "--expires", `${expires}`, "--uses", "0", ...more];
    return execFileSync(flag.palpate, ["ticket", ...flags, "--quiet"], { encoding: "utf8" }).trim();
}

/** the answer of a POST, as JSON */
async function post(url, body, headers = {}) {
    const answer = await fetch(url, {
        method: "POST",
        headers: { "Content-Type": "application/json", ...headers },
        body: JSON.stringify(body),
        ...within(),
    });
    const json = await answer.json().catch(() => ({}));
    if (!answer.ok) throw new Error(`${url}: ${answer.status} ${json.error ?? json.message ?? ""}`);
    return json;
}

/** a server with a place for one session more, as the allocation chooses */
async function allocate() {
    const wanted = JSON.parse(readFileSync(flag.allocation, "utf8"));
    const url = `${flag.api}/apis/allocation.agones.dev/v1/namespaces/${flag.namespace}/gameserverallocations`;
    const { status } = await post(url, wanted);
    if (status?.state !== "Allocated") throw new Error(`no game server is free: ${status?.state ?? "no state"}`);
    return { name: status.gameServerName, at: `${status.address}:${status.ports[0].port}` };
}

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

/** what the server lists of the session @param {string} at @param {Record<string, string>} headers */
async function find(at, headers = {}) {
    const { sessions } = await (await fetch(`http://${at}/sessions`, { headers, ...within() })).json();
    return sessions.find((one) => one.name === session);
}

/**
 * The session runs when the server lists it; its opening takes as long as the scene and its recording take to load. Tried a
 * second time, it may have been opened by a request whose answer was lost.
 */
async function open(at, isRetry) {
    const headers = { Authorization: `Bearer ${makeTicket("instructor", 300)}` };
    const before = isRetry && (await find(at, headers));
    if (!before || before.state === "failed")
        await post(`http://${at}/sessions`, { open: scene, name: session }, headers);
    for (;;) {
        const own = await find(at, headers);
        if (!own || own.state === "failed") throw new Error(`${scene} cannot be opened: ${own?.text ?? "it is gone"}`);
        if (own.state !== "opening") return;
        await wait(100);
    }
}

/** one command of HAProxy's runtime API */
const admin = (command) =>
    new Promise((done, fail) => {
        let answer = "";
        const socket = net.connect(flag.admin, () => socket.end(`${command}\n`));
        socket.on("data", (data) => (answer += data));
        socket.on("end", () => done(answer.trim()));
        socket.on("error", fail);
    });

async function route(at) {
    // in one step where the map has the name: a member who asked in between would be led to the first server
    if (!(await admin(`set map ${flag.map} ${session} ${at}`))) return;
    const answer = await admin(`add map ${flag.map} ${session} ${at}`);
    if (answer) throw new Error(`HAProxy: ${answer}`);
}

/** opens the session there and says where it is */
async function start(server, isRetry = false) {
    await open(server.at, isRetry);
    if (flag.admin) await route(server.at);
    const address = `${flag.site || `http://${server.at}`}/?session=${session}`;
    const ticket = makeTicket(flag.role, 3600, "--session", session);
    console.log(JSON.stringify({ address, session, ticket, server: server.name }));
    return server;
}

/** status of Agones' answer about a game server, 0: none; 404: it has ended @param {string} name */
const statusOf = (name) =>
    fetch(`${flag.api}/apis/agones.dev/v1/namespaces/${flag.namespace}/gameservers/${name}`, within())
        .then((answer) => answer.status)
        .catch(() => 0);

/**
 * Waits until the session needs another server: true; or none any more, since it was ended or had nobody: false. A server
 * has ended when Agones has none of that name: it keeps the object until the pod is gone, so two never record one session.
 */
async function needsAnother({ name, at }) {
    for (let nEmpty = 0; ; await wait(POLL_MS)) {
        const own = await find(at).catch(() => null); // null: no answer
        if (own) {
            nEmpty = own.members + own.viewers > 0 ? 0 : nEmpty + 1;
            if (nEmpty === EMPTY_POLLS) console.error(`allocate: nobody is in ${session}`);
            continue;
        }
        const status = await statusOf(name);
        if (status === 404) return nEmpty < EMPTY_POLLS;
        if (status === 200 && own !== null) return false;
    }
}

const report = (error) =>
    console.error(`allocate: ${error.cause?.code ? `${error.message}: ${error.cause.code}` : error.message}`);

/** the same on another server, as soon as there is one; on a third one only when that has ended */
async function startAgain() {
    for (let server = null, tried = null; ; await wait(POLL_MS))
        try {
            server ??= await allocate();
            return await start(server, server === tried);
        } catch (error) {
            report(error);
            tried = server;
            if (server && (await statusOf(server.name)) === 404) server = null;
        }
}

try {
    let server = await start(await allocate());
    while (flag.keep && (await needsAnother(server))) server = await startAgain();
} catch (error) {
    report(error);
    process.exit(1);
}
