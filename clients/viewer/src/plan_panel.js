// The panel of figures: rates and times, the components of the plan with their times and switches, bodies that are
// stopped or asleep, activity of bodies that adapt.
import { htmlById, inputById } from "./dom.js";
import { activeText, barLengths, bodyRemarks, fixedReason, rateText } from "./plan_list.js";
import { store, stored } from "./storage.js";
import { decimal, isTextKey, language, text as textOf } from "./text.js";

/**
 * @typedef {import("./plan_list.js").Component} Component
 * @typedef {{verb: string, target: string, args: Record<string, number>}} Command
 */

const ANSWER_MS = 3000; // a switch is enabled again if the server has not answered by then

/** @param {number} colour 0xRRGGBB */
export const cssColour = (colour) => "#" + colour.toString(16).padStart(6, "0");

/** what an effect is called; the name of the code stands in the tooltip @param {string} name */
const effectName = (name) => {
    const key = `effect.name.${name}`;
    return isTextKey(key) ? textOf(key) : name.replaceAll("_", " ");
};

/** @param {number} slowdown real time over simulated time */
export const speedText = (slowdown) => textOf("state.speed", { speed: decimal((1 / slowdown).toFixed(2)) });

export class PlanPanel {
    /** @param {Document} page @param {(command: Command) => void} send */
    constructor(page, send) {
        this.page = page;
        this.send = send;
        this.shownRemarks = "";
        this.figures = htmlById("figures", page);
        this.bodies = htmlById("bodies", page);
        this.components = /** @type {HTMLTableSectionElement} */ (page.querySelector("#components tbody"));
        this.active = htmlById("active", page);
        const expert = inputById("expert", page);
        expert.checked = stored("palpate.expert") === "1";
        expert.onchange = () => {
            store("palpate.expert", expert.checked ? "1" : "");
            htmlById("panel", page).classList.toggle("all", expert.checked);
        };
        htmlById("panel", page).classList.toggle("all", expert.checked);
        /** @type {Map<string, HTMLElement>} */
        this.values = new Map();
        /** @type {{bar: HTMLElement, value: HTMLElement, index: number | null}[]} */
        this.bars = [];
    }

    /**
     * @param {import("./text.js").TextKey} name @param {string} text
     * @param {boolean} expert only those who develop scenes read it
     */
    figure(name, text, expert = false) {
        let value = this.values.get(name);
        if (!value) {
            const term = document.createElement("dt");
            value = document.createElement("dd");
            term.textContent = textOf(name);
            term.classList.toggle("expert", expert);
            value.classList.toggle("expert", expert);
            this.figures.append(term, value);
            this.values.set(name, value);
        }
        value.textContent = text;
    }

    /** @param {Component[]} components @param {{name: string}[]} parts @param {boolean} switches may be used */
    showComponents(components, parts, switches) {
        this.components.replaceChildren();
        this.bars = components.map((component) => {
            const { name, part, reason, on, index } = component;
            const row = this.components.insertRow();
            row.title = reason ? textOf("effect.required", { name, reason }) : name;
            row.className = on ? "" : "off";
            if (switches) row.append(this.switchOf(component));
            const title = row.insertCell();
            title.textContent = effectName(name);
            if (parts.length > 1 && parts[part])
                title.append(" ", Object.assign(document.createElement("small"), { textContent: parts[part].name }));
            const cell = row.insertCell();
            cell.className = "bar";
            const bar = document.createElement("i");
            if (on) cell.append(bar);
            const value = row.insertCell();
            value.textContent = on ? "–" : textOf("effect.off");
            return { bar, value, index };
        });
    }

    /** @param {Component} component */
    switchOf(component) {
        const { name, part, on, fixed } = component;
        const cell = document.createElement("td");
        const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: on });
        const action = textOf(on ? "effect.disable" : "effect.enable");
        cell.className = "switch";
        box.setAttribute("aria-label", effectName(name));
        box.disabled = fixed;
        cell.title = box.title = fixed ? fixedReason(component) : action;
        box.onchange = () => {
            this.send({ verb: "component", target: name, args: { part, enabled: box.checked ? 1 : 0 } });
            // the box shows the state of the server, which may refuse
            box.checked = on;
            box.disabled = true;
            box.title = textOf("wait.server");
            setTimeout(() => {
                box.disabled = false;
                box.title = action;
            }, ANSWER_MS);
        };
        cell.append(box);
        return cell;
    }

    /** @param {import("./plan_list.js").BodyRemark[]} remarks @param {boolean} resets a body that stands may be reset */
    showBodies(remarks, resets) {
        const key = JSON.stringify([remarks, resets]);
        if (key === this.shownRemarks) return;
        this.shownRemarks = key;
        this.bodies.replaceChildren(
            ...remarks.map(({ name, frozen, state, text }) => {
                const item = document.createElement("li");
                const title = document.createElement("b");
                item.className = state;
                if (frozen) item.classList.add("frozen");
                title.textContent = name;
                item.append(title, state ? ` ${textOf(state === "stopped" ? "body.stopped" : "body.asleep")}` : "");
                item.append(...text.map((line) => Object.assign(document.createElement("p"), { textContent: line })));
                if (frozen && resets) {
                    const reset = Object.assign(document.createElement("button"), {
                        textContent: textOf("body.reset", { name }),
                    });
                    reset.onclick = () => this.send({ verb: "reset", target: name, args: {} });
                    item.append(reset);
                }
                return item;
            }),
        );
    }

    /**
     * @param {import("./control_table.js").Status} status
     * @param {import("./app_state.js").AppState["figures"]} figures of this page
     * @param {{name: string}[]} parts of `hello`
     * @param {boolean} resets a body that stands may be reset
     */
    showStatus(status, figures, parts, resets) {
        const { paused, slowdown } = status;
        const ms = (/** @type {number} */ v, /** @type {number} */ digits) => `${decimal(v.toFixed(digits))} ms`;
        const speed = paused ? "–" : slowdown <= 1.02 ? textOf("state.real_time") : speedText(slowdown);
        this.figure("details.speed", speed);
        this.figure("details.step_time", ms(status.step_ms, 2));
        this.figure("details.latency", figures.latency_ms > 0 ? ms(figures.latency_ms, 1) : "–");
        this.figure("details.pictures", figures.fps.toFixed(0));
        this.figure("details.steps", paused ? textOf("state.paused") : status.step_rate_hz.toFixed(0), true);
        this.figure("details.substeps", String(status.substeps), true);
        this.figure("details.round_trip", figures.rtt_ms > 0 ? ms(figures.rtt_ms, 1) : "–", true);
        this.figure("details.decoding", ms(figures.decode_ms, 2), true);
        this.figure("details.picture_effects", figures.effects, true);
        this.figure("details.received", rateText(figures.bytes_s), true);
        this.figure("details.vertices", figures.vertices.toLocaleString(language), true);
        this.showActivity(activeText(status.active ?? [], parts));
        this.showBodies(bodyRemarks(status.parts ?? [], parts), resets);
        const lengths = barLengths(status.component_ms);
        for (const { bar, value, index } of this.bars) {
            if (index === null) continue;
            bar.style.width = 100 * (lengths[index] ?? 0) + "%";
            bar.hidden = !lengths[index];
            value.textContent = decimal((status.component_ms[index] ?? 0).toFixed(3));
        }
    }

    /** @param {string[]} lines */
    showActivity(lines) {
        while (this.active.children.length > lines.length) this.active.lastElementChild?.remove();
        while (this.active.children.length < lines.length) this.active.append(document.createElement("p"));
        lines.forEach((line, i) => (this.active.children[i].textContent = line));
    }
}
