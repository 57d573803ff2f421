// What allocate.mjs asks of the Kubernetes API, as Agones answers it: prints its port; gives the first game server of a file
// with lines "NAME PORT PID", and is UnAllocated when there is none. One that was given is there until its process has
// ended, as Agones keeps it until its pod is gone. usage: node fake_kubernetes.mjs FILE
import { readFileSync } from "node:fs";
import http from "node:http";

const [file] = process.argv.slice(2);
/** @type {Map<string, number>} of each game server that was given */
const pids = new Map();
function isThere(name) {
    try {
        return pids.has(name) && process.kill(pids.get(name), 0);
    } catch {
        return false;
    }
}
const server = http.createServer(async (request, answer) => {
    let body = "";
    for await (const chunk of request) body += chunk;
    const reply = (status, json) => {
        answer.writeHead(status, { "Content-Type": "application/json" });
        answer.end(JSON.stringify(json));
    };
    const failure = (code, message) => reply(code, { kind: "Status", status: "Failure", message, code });
    const [, asked] = /^\/apis\/agones\.dev\/v1\/namespaces\/games\/gameservers\/([^/]+)$/.exec(request.url) ?? [];
    if (asked && !isThere(asked)) return failure(404, `gameservers.agones.dev "${asked}" not found`);
    if (asked)
        return reply(200, {
            kind: "GameServer",
            apiVersion: "agones.dev/v1",
            metadata: { name: asked, namespace: "games" },
            status: { state: "Allocated" },
        });
    if (request.url !== "/apis/allocation.agones.dev/v1/namespaces/games/gameserverallocations")
        return failure(404, "the server could not find the requested resource");
    if (request.method !== "POST")
        return failure(405, "the server does not allow this method on the requested resource");
    const { kind, apiVersion, spec } = JSON.parse(body);
    if (kind !== "GameServerAllocation" || apiVersion !== "allocation.agones.dev/v1" || !spec.selectors?.length)
        return failure(422, "GameServerAllocation is invalid");
    const [name, port, pid] = readFileSync(file, "utf8").trim().split(/\s+/);
    if (name) pids.set(name, Number(pid));
    const status = name
        ? {
              state: "Allocated",
              gameServerName: name,
              address: "127.0.0.1",
              ports: [{ name: "web", port: Number(port) }],
              nodeName: "node",
          }
        : { state: "UnAllocated", gameServerName: "" };
    reply(201, { kind, apiVersion, metadata: { name, namespace: "games" }, spec, status });
});
server.listen(0, "127.0.0.1", () => console.log(`port ${server.address().port}`));
