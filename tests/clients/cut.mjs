// A relay that cuts its first websocket right behind a FRAME of cycle 50 or later, so that the TOOLS message that closes the cycle
// never comes; what connects after that goes to the second server. Prints the port it listens on, then the cycle of the cut.
// usage: node cut.mjs PORT SECOND_PORT
import { connect, createServer } from "node:net";

const FRAME = 1,
    CYCLE_AT = 24,
    MIN_CYCLE = 50;
const [port, second] = process.argv.slice(2).map(Number);
let cut = false;

/** Length of the head and of the payload of the message at the start of bytes; null: not all there. */
const measure = (bytes) => {
    if (bytes.length < 2) return null;
    const short = bytes[1] & 127,
        head = short < 126 ? 2 : short === 126 ? 4 : 10;
    if (bytes.length < head) return null;
    const size = short < 126 ? short : short === 126 ? bytes.readUInt16BE(2) : Number(bytes.readBigUInt64BE(2));
    return bytes.length < head + size ? null : { head, size };
};

createServer((client) => {
    const first = !cut,
        server = connect(first ? port : second, "127.0.0.1");
    let rest = Buffer.alloc(0),
        websocket = null;
    client.pipe(server);
    for (const socket of [client, server])
        socket.on("error", () => {}).on("close", () => (client.destroy(), server.destroy()));
    server.on("data", (bytes) => {
        if (!first || websocket === false) return void client.write(bytes);
        rest = Buffer.concat([rest, bytes]);
        if (websocket === null) {
            const end = rest.indexOf("\r\n\r\n");
            if (end < 0) return;
            websocket = rest.subarray(0, 12).toString() === "HTTP/1.1 101";
            client.write(rest.subarray(0, end + 4));
            rest = rest.subarray(end + 4);
        }
        for (
            let at = websocket ? measure(rest) : { head: 0, size: rest.length };
            at && rest.length;
            at = measure(rest)
        ) {
            const message = rest.subarray(0, at.head + at.size),
                payload = message.subarray(at.head);
            client.write(message);
            rest = rest.subarray(message.length);
            const frame = websocket && (message[0] & 15) === 2 && payload[4] === FRAME,
                cycle = frame ? payload.readUInt32LE(CYCLE_AT) : 0;
            if (cycle < MIN_CYCLE) continue;
            cut = true;
            console.log(cycle);
            server.destroy();
            return void client.end();
        }
    });
}).listen(0, "127.0.0.1", function () {
    console.log(this.address().port);
});
