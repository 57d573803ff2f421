// The worker: owns the socket and the decoders, hands decoded arrays to the page without copying.
import { BEAT_MS, Link } from "./link.js";

const scope = /** @type {any} */ (globalThis);
const link = new Link({
  open: (url, protocol) => new WebSocket(url, protocol),
  get: async (url) => {
    const answer = await fetch(url);
    if (!answer.ok) throw new Error(`${url}: ${answer.status}`);
    return answer.arrayBuffer();
  },
  post: (message, transfer) => scope.postMessage(message, transfer ?? []),
  now: () => performance.now(),
  later: (call, ms) => setTimeout(call, ms),
});
setInterval(() => link.beat(), BEAT_MS);

scope.onmessage = (/** @type {MessageEvent} */ { data }) => {
  switch (data.type) {
    case "connect":
      link.connect(data);
      break;
    case "pose":
      link.myTool = data.tool;
      link.pose(data);
      break;
    case "control":
      link.send(data.message);
      break;
    case "reuse":
      link.reuse(data);
      break;
  }
};
