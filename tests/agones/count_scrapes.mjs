// Stands between a Prometheus and the /metrics of a server: prints its port, then at the beginning of each scrape how many
// before it were answered in time: these are stored. usage: node count_scrapes.mjs PORT_OF_SERVER
import http from "node:http";

const [port] = process.argv.slice(2);
let n = 0;
const proxy = http.createServer(async (request, answer) => {
    console.log(`stored ${n}`);
    const metrics = await fetch(`http://127.0.0.1:${port}${request.url}`);
    answer.on("finish", () => n++);
    answer.writeHead(metrics.status, { "Content-Type": metrics.headers.get("content-type") });
    answer.end(await metrics.text());
});
proxy.listen(0, "127.0.0.1", () => console.log(`port ${proxy.address().port}`));
