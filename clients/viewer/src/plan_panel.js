// The panel: figures, the plan's rows with their milliseconds, what is active of bodies that adapt, members.

/** @param {number} bytes per second */
function rate(bytes) {
  return bytes >= 1e6 ? (bytes / 1e6).toFixed(2) + " MB/s" : (bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0) + " kB/s";
}

/** grouped from five digits on */
const COUNT = new Intl.NumberFormat("en", { useGrouping: /** @type {any} */ ("min2") });

/**
 * What is active of each body that adapts: a sentence each, with the body's name when there are several.
 * @param {{part: number, nodes: number, springs: number, of_nodes: number, of_springs: number}[]} active of `status`
 * @param {{name: string}[]} parts of `hello`
 */
export function activeLines(active, parts) {
  const n = (/** @type {number} */ value) => COUNT.format(value);
  return active.map((a) => {
    const name = parts.length > 1 ? `${parts[a.part]?.name ?? a.part}: ` : "";
    return `${name}${n(a.nodes)} of ${n(a.of_nodes)} nodes, ${n(a.springs)} of ${n(a.of_springs)} springs`;
  });
}

export class PlanPanel {
  /** @param {Document} page */
  constructor(page) {
    this.figures = /** @type {HTMLElement} */ (page.getElementById("figures"));
    this.rows = /** @type {HTMLTableSectionElement} */ (page.querySelector("#rows tbody"));
    this.active = /** @type {HTMLElement} */ (page.getElementById("active"));
    this.members = /** @type {HTMLElement} */ (page.getElementById("members"));
    /** @type {Map<string, HTMLElement>} */
    this.values = new Map();
    /** @type {{bar: HTMLElement, value: HTMLElement}[]} */
    this.bars = [];
  }

  /** @param {string} name @param {string} text */
  figure(name, text) {
    let value = this.values.get(name);
    if (!value) {
      const term = document.createElement("dt");
      value = document.createElement("dd");
      term.textContent = name;
      this.figures.append(term, value);
      this.values.set(name, value);
    }
    value.textContent = text;
  }

  /** @param {string[]} names rows of the plan in order */
  plan(names) {
    this.rows.replaceChildren();
    this.bars = names.map((name) => {
      const row = this.rows.insertRow();
      row.insertCell().textContent = name.replaceAll("_", " ");
      const cell = row.insertCell();
      cell.className = "bar";
      const bar = document.createElement("i");
      cell.append(bar);
      const value = row.insertCell();
      value.textContent = "–";
      return { bar, value };
    });
  }

  /**
   * @param {any} s control message `status`
   * @param {{fps: number, latency_ms: number, rtt_ms: number, decode_ms: number, bytes_s: number, vertices: number}} here
   * @param {{name: string}[]} parts of `hello`
   */
  status(s, here, parts) {
    this.figure("steps per second", s.paused ? "paused" : s.step_rate_hz.toFixed(0));
    this.figure("time goes", s.paused ? "–" : s.slowdown <= 1.02 ? "in real time" : s.slowdown.toFixed(2) + " × slower");
    this.figure("one step", s.step_ms.toFixed(2) + " ms");
    this.figure("sub-steps", String(s.substeps));
    this.figure("round trip", here.rtt_ms > 0 ? here.rtt_ms.toFixed(1) + " ms" : "–");
    this.figure("tool to picture", here.latency_ms > 0 ? here.latency_ms.toFixed(1) + " ms" : "–");
    this.figure("frames drawn", here.fps.toFixed(0) + " /s");
    this.figure("decoding", here.decode_ms.toFixed(2) + " ms");
    this.figure("received", rate(here.bytes_s));
    this.figure("vertices shown", here.vertices.toLocaleString("en"));
    this.activity(activeLines(s.active ?? [], parts));
    const most = Math.max(1e-6, ...s.row_ms);
    this.bars.forEach(({ bar, value }, i) => {
      const ms = s.row_ms[i] ?? 0;
      bar.style.width = (100 * ms) / most + "%";
      value.textContent = ms.toFixed(3);
    });
  }

  /** @param {string[]} lines */
  activity(lines) {
    while (this.active.children.length > lines.length) this.active.lastElementChild?.remove();
    while (this.active.children.length < lines.length) this.active.append(document.createElement("p"));
    lines.forEach((line, i) => (this.active.children[i].textContent = line));
  }

  /** @param {{id: number, name: string, role: string, tool: number | null, colour: number}[]} list @param {number} me */
  people(list, me) {
    this.members.replaceChildren(...list.map((member) => {
      const item = document.createElement("li"), name = document.createElement("span"), role = document.createElement("small");
      item.style.color = "#" + member.colour.toString(16).padStart(6, "0");
      name.textContent = member.name + (member.id === me ? " (you)" : "");
      role.textContent = "  " + (member.tool === null || member.tool < 0 ? (member.role === "viewer" ? "looking" : "no tool") : member.role);
      item.append(name, role);
      return item;
    }));
  }
}
