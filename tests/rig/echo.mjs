// A server that sends back what it gets, behind the rig: every byte comes back in order, and so does the end of the stream.
// usage: node echo.mjs PALPATE-RIG PROFILE BYTES; prints the bytes that came back as sent
import { spawn } from "node:child_process";
import net from "node:net";

const [program, profile, n_byte] = process.argv.slice(2);
const sent = Buffer.from(Array.from({ length: Number(n_byte) }, (_, i) => (i * i + (i >> 8)) & 255));
const server = net.createServer({ allowHalfOpen: true }, (socket) => socket.pipe(socket));
await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
const rig = spawn(program, ["--tcp", `0:127.0.0.1:${server.address().port}`, "--profile", profile, "--json"]);
const { port } = JSON.parse(await new Promise((line) => rig.stdout.once("data", line)));
const socket = net.connect({ port, host: "127.0.0.1", allowHalfOpen: true });
socket.end(sent);
const parts = [];
for await (const part of socket) parts.push(part);
const back = Buffer.concat(parts);
let same = 0;
while (same < back.length && back[same] === sent[same]) same++;
console.log(same);
server.close();
rig.kill();
