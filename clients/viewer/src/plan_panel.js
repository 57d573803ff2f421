// The panel: figures, the plan's rows with their milliseconds and switches, bodies that were stopped, rescued or sleep,
// what is active of bodies that adapt, what nobody looks at, members.

/** @param {number} bytes per second */
function rate(bytes) {
  return bytes >= 1e6 ? (bytes / 1e6).toFixed(2) + " MB/s" : (bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0) + " kB/s";
}

/** with commas from five figures on; engines before 2022 do not know that grouping by its name
 * @param {number} n */
const count = (n) => (n < 10000 ? String(n) : n.toLocaleString("en"));

/**
 * What is active of each body that adapts: a sentence each, with the body's name when there are several.
 * @param {{part: number, nodes: number, springs: number, of_nodes: number, of_springs: number}[]} active of `status`
 * @param {{name: string}[]} parts of `hello`
 */
export function activeLines(active, parts) {
  return active.map((a) => {
    const name = parts.length > 1 ? `${parts[a.part]?.name ?? a.part}: ` : "";
    return `${name}${count(a.nodes)} of ${count(a.of_nodes)} nodes, ${count(a.springs)} of ${count(a.of_springs)} springs`;
  });
}

/** @typedef {{name: string, part: number, why: string, fixed: boolean, planned: boolean, on: boolean, ms: number | null}} Row of the panel; fixed: it cannot be switched; planned: the scene called for it; ms: index in `row_ms`, null: off */

/**
 * The rows to list: those of the plan in order, then those that were switched off.
 * @param {{rows: string[], row_parts?: number[], row_whys?: string[], row_fixed?: number[]}} plan of `hello` or `topology`
 * @param {{rows?: string[], row_parts?: number[], off?: {row: string, part: number}[]} | null} status
 * @returns {Row[]}
 */
export function rowsOf(plan, status) {
  const key = (/** @type {string} */ name, /** @type {number} */ part) => `${name} ${part}`;
  const why = new Map(plan.rows.map((name, i) => [key(name, plan.row_parts?.[i] ?? 0), plan.row_whys?.[i] ?? ""]));
  const fixed = new Map(plan.rows.map((name, i) => [key(name, plan.row_parts?.[i] ?? 0), plan.row_fixed?.[i] === 1]));
  const now = status?.rows?.length ? status : plan;
  const row = (/** @type {string} */ name, /** @type {number} */ part) => ({
    name,
    part,
    why: why.get(key(name, part)) ?? "",
    fixed: fixed.get(key(name, part)) ?? plan.row_fixed !== undefined,
    planned: why.has(key(name, part)),
  }); // what came while it runs goes with who looks
  const on = (now.rows ?? []).map((name, i) => ({ ...row(name, now.row_parts?.[i] ?? 0), on: true, ms: i }));
  const off = (status?.off ?? []).map((o) => ({ ...row(o.row, o.part), on: false, ms: null }));
  return [...on, ...off];
}

/**
 * Bodies of which there is something to tell, in sentences.
 * @param {{part: number, frozen?: boolean, asleep?: boolean, why?: string, rescues?: number, rescue_ms?: number}[]} states `parts` of `status`
 * @param {{name: string}[]} parts of `hello`
 */
export function bodyLines(states, parts) {
  return states.map((s) => {
    const said = s.frozen ? [s.why || "It left its bounds."] : [];
    if (s.rescues)
      said.push(
        `${count(s.rescues)} ${s.rescues === 1 ? "rescue" : "rescues"}, ${(s.rescue_ms ?? 0).toFixed(s.rescue_ms && s.rescue_ms < 1 ? 3 : 1)} ms in all.`,
      );
    const name = parts[s.part]?.name ?? String(s.part);
    return { name, frozen: s.frozen === true, mark: s.frozen ? "stopped" : s.asleep ? "asleep" : "", said };
  });
}

/**
 * What is not computed because nobody looks, one sentence; empty when all of it is.
 * @param {{field: boolean, estimate: boolean, estimates: boolean, unwatched: number}} looked
 */
export function unwatchedLine({ field, estimate, estimates, unwatched }) {
  const idle = [...(field ? [] : ["colours"]), ...(estimate || !estimates ? [] : ["errors"])];
  const said = idle.length ? `Not computed, nobody looks here: ${idle.join(", ")}.` : "";
  const skins = unwatched > 0 ? `${count(unwatched)} steps were not skinned while nobody watched.` : "";
  return [said, skins].filter(Boolean).join(" ");
}

const LEAST_BAR_MS = 0.01; // a bar that would be longer than its figure says is none: a plan asleep has rows of nothing

/** the parts of the longest bar that the rows' bars are, 0: none @param {number[]} ms of rows */
export function barsOf(ms) {
  const most = Math.max(LEAST_BAR_MS, ...ms);
  return ms.map((v) => (v < 0.0005 ? 0 : v / most));
}

/** why a row has no switch @param {Row} row */
export function fixedWhy({ planned }) {
  return planned
    ? "It cannot be switched off: it moves the body, shows it, or alone holds it together."
    : "It cannot be switched off: it came while the scene runs, and goes with what called for it.";
}

export class PlanPanel {
  /**
   * @param {Document} page
   * @param {(verb: string, target: string, args?: Record<string, number>) => void} order
   */
  constructor(page, order = () => {}) {
    this.order = order;
    this.bodies = /** @type {HTMLElement} */ (page.getElementById("bodies"));
    this.unwatched = /** @type {HTMLElement} */ (page.getElementById("unwatched"));
    this.told = ""; // of bodies
    this.figures = /** @type {HTMLElement} */ (page.getElementById("figures"));
    this.rows = /** @type {HTMLTableSectionElement} */ (page.querySelector("#rows tbody"));
    this.active = /** @type {HTMLElement} */ (page.getElementById("active"));
    this.members = /** @type {HTMLElement} */ (page.getElementById("members"));
    /** @type {Map<string, HTMLElement>} */
    this.values = new Map();
    /** @type {{bar: HTMLElement, value: HTMLElement, ms: number | null}[]} */
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

  /** @param {Row[]} rows @param {{name: string}[]} parts @param {boolean} switches may this member switch them? */
  plan(rows, parts, switches) {
    this.rows.replaceChildren();
    this.bars = rows.map((it) => {
      const { name, part, why, on, ms } = it;
      const row = this.rows.insertRow();
      row.title = why;
      row.className = on ? "" : "off";
      if (switches) row.append(this.switchOf(it));
      const title = row.insertCell();
      title.textContent = name.replaceAll("_", " ");
      if (parts.length > 1 && parts[part])
        title.append(" ", Object.assign(document.createElement("small"), { textContent: parts[part].name }));
      const cell = row.insertCell();
      cell.className = "bar";
      const bar = document.createElement("i");
      if (on) cell.append(bar);
      const value = row.insertCell();
      value.textContent = on ? "–" : "off";
      return { bar, value, ms };
    });
  }

  /** @param {Row} row */
  switchOf(row) {
    const { name, part, on, fixed } = row;
    const cell = document.createElement("td"),
      box = Object.assign(document.createElement("input"), { type: "checkbox", checked: on });
    cell.className = "switch";
    box.setAttribute("aria-label", `${name} is part of the plan`);
    box.disabled = fixed;
    cell.title = box.title = fixed ? fixedWhy(row) : on ? "Switch it off" : "Switch it on";
    box.onchange = () => {
      this.order("row", name, { part, on: box.checked ? 1 : 0 });
      // it is as the server says: what it refuses stays
      box.checked = on;
      box.disabled = true;
      box.title = "The server is asked";
      setTimeout(() => {
        box.disabled = false;
        box.title = on ? "Switch it off" : "Switch it on";
      }, 3000);
    };
    cell.append(box);
    return cell;
  }

  /** @param {ReturnType<typeof bodyLines>} lines */
  bodyStates(lines) {
    const told = JSON.stringify(lines);
    if (told === this.told) return;
    this.told = told;
    this.bodies.replaceChildren(
      ...lines.map(({ name, frozen, mark, said }) => {
        const item = document.createElement("li"),
          title = document.createElement("b");
        item.className = mark;
        if (frozen) item.classList.add("frozen");
        title.textContent = name;
        item.append(
          title,
          mark ? ` ${mark}` : "",
          ...said.map((text) => Object.assign(document.createElement("p"), { textContent: text })),
        );
        if (frozen) {
          const reset = Object.assign(document.createElement("button"), { textContent: `Reset ${name}` });
          reset.onclick = () => this.order("reset", name);
          item.append(reset);
        }
        return item;
      }),
    );
  }

  /**
   * @param {any} s control message `status`
   * @param {{fps: number, latency_ms: number, rtt_ms: number, decode_ms: number, bytes_s: number, vertices: number}} here
   * @param {{name: string}[]} parts of `hello`
   */
  status(s, here, parts) {
    this.figure("steps per second", s.paused ? "paused" : s.step_rate_hz.toFixed(0));
    this.figure(
      "time goes",
      s.paused ? "–" : s.slowdown <= 1.02 ? "in real time" : s.slowdown.toFixed(2) + " × slower",
    );
    this.figure("one step", s.step_ms.toFixed(2) + " ms");
    this.figure("sub-steps", String(s.substeps));
    this.figure("round trip", here.rtt_ms > 0 ? here.rtt_ms.toFixed(1) + " ms" : "–");
    this.figure("tool to picture", here.latency_ms > 0 ? here.latency_ms.toFixed(1) + " ms" : "–");
    this.figure("frames drawn", here.fps.toFixed(0) + " /s");
    this.figure("decoding", here.decode_ms.toFixed(2) + " ms");
    this.figure("received", rate(here.bytes_s));
    this.figure("vertices shown", here.vertices.toLocaleString("en"));
    this.activity(activeLines(s.active ?? [], parts));
    this.bodyStates(bodyLines(s.parts ?? [], parts));
    const lengths = barsOf(s.row_ms);
    this.bars.forEach(({ bar, value, ms: at }) => {
      if (at === null) return;
      const ms = s.row_ms[at] ?? 0;
      bar.style.width = 100 * (lengths[at] ?? 0) + "%";
      bar.hidden = !lengths[at];
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
    this.members.replaceChildren(
      ...list.map((member) => {
        const item = document.createElement("li"),
          name = document.createElement("span"),
          role = document.createElement("small");
        item.style.color = "#" + member.colour.toString(16).padStart(6, "0");
        name.textContent = member.name + (member.id === me ? " (you)" : "");
        role.textContent =
          "  " +
          (member.tool === null || member.tool < 0 ? (member.role === "viewer" ? "looking" : "no tool") : member.role);
        item.append(name, role);
        return item;
      }),
    );
  }
}
