// The panel of sculpting: the tool of a click and its settings, forces that follow their slider until they are released,
// undo, the cut, files. One command is pending at a time.
import { buttonById, chooseByArrows, htmlById, inputById, markRadio, selectById } from "./dom.js";
import {
    answerText,
    boxAround,
    commandOf,
    cutCommand,
    cutOutline,
    FORCES,
    hintOf,
    PAINTS,
    TOOLS,
} from "./sculpt_commands.js";
import { refusalText } from "./sculpt_refusals.js";
import { decimal, text } from "./text.js";

/** @typedef {import("./sculpt_commands.js").Command} Command */
/** @typedef {import("./text.js").TextKey} TextKey */
/** @typedef {import("./tool_input.js").Hit} Hit */

const WAIT_MS = 20000; // after this an answer counts as lost
const SLIDER_STEPS = 200;
const STIFFNESS_N_M = 60; // of the spring that pulls a curve

export class SculptPanel {
    /**
     * @param {Document} page
     * @param {(command: Command & {target?: string}) => void} send
     * @param {(format: string) => void} save
     */
    constructor(page, send, save) {
        this.page = page;
        this.send = send;
        this.offered = false;
        this.tool = "extrude";
        /** @type {Hit[]} clicked so far */
        this.hits = [];
        this.aims = false; // the slider of the cut is in use
        /** called when the tool, its settings or the clicked places have changed */
        this.onChange = () => {};
        /** @type {(part: number) => string} name of a part, "" if it cannot be sculpted */
        this.nameOf = () => "";
        /** part that was clicked last, "": the first that can be sculpted */
        this.target = "";
        /** @type {import("./control_table.js").Answer | null} newest */
        this.answered = null;
        /** @type {Command | null} not answered yet */
        this.pending = null;
        this.sentAt = 0;
        /** @type {Command | null} newest cut, sent when the pending command is answered */
        this.nextCut = null;
        /** @type {import("./sculpt_commands.js").Box} */
        this.box = { low: [0, 0, 0], high: [0, 0, 0] };
        this.size = 0;
        /** @type {{tool: string, points: number[][], settings: import("./sculpt_commands.js").Settings} | null} acting force */
        this.force = null;
        this.forceChanged = false; // by its slider, since it was sent
        this.message = htmlById("sculpt-message", page);
        this.tools = this.fill("tool", Object.keys(TOOLS), (name) => this.choose(name));
        this.paints = this.fill("paint", Object.keys(PAINTS), (name) => {
            this.mark(this.paints, name);
            this.onChange();
        });
        this.mark(this.paints, "stiffer");
        selectById("sculpt-entity", page).onchange = () => this.onChange();
        for (const verb of ["set_rest_shape", "undo", "redo"])
            this.button(verb).onclick = () => this.submit({ verb, args: {} });
        for (const format of ["obj", "stl", "ply"]) this.button(format).onclick = () => save(format);
        for (const id of ["distance", "radius", "sharpness"]) this.slider(id).oninput = () => this.showValues();
        for (const id of ["pressure", "lift"]) this.slider(id).oninput = () => this.changeForce();
        this.button("release").onclick = () => this.submit({ verb: "release", args: {} });
        this.axis = selectById("sculpt-axis", page);
        this.axis.onchange = this.slider("cut").oninput = () => this.cut();
        for (const on of ["pointerenter", "focus"]) this.slider("cut").addEventListener(on, () => this.aim(true));
        for (const off of ["pointerleave", "blur"]) this.slider("cut").addEventListener(off, () => this.aim(false));
        this.choose(this.tool);
    }

    /** @param {string} name */
    button(name) {
        return buttonById("sculpt-" + name, this.page);
    }

    /** @param {string} name */
    slider(name) {
        return inputById("sculpt-" + name, this.page);
    }

    /**
     * Creates the buttons of a radio group.
     * @param {"tool" | "paint"} kind @param {string[]} names @param {(name: string) => void} onChoice
     * @returns {Map<string, HTMLButtonElement>}
     */
    fill(kind, names, onChoice) {
        const group = htmlById(`sculpt-${kind}s`, this.page);
        const buttons = new Map();
        for (const name of names) {
            const button = this.page.createElement("button");
            button.textContent = text(/** @type {TextKey} */ (`sculpt.${kind}.${name}`));
            const key = TOOLS[name]?.key ?? "";
            button.title = text(/** @type {TextKey} */ (`sculpt.${kind}.tip.${name}`), { key });
            button.ariaDescription = button.title;
            button.dataset.name = name;
            button.setAttribute("role", "radio");
            if (key) button.ariaKeyShortcuts = key;
            button.onclick = () => onChoice(name);
            group.append(button);
            buttons.set(name, button);
        }
        chooseByArrows(group, () => [...buttons.values()]);
        return buttons;
    }

    /** @param {Map<string, HTMLButtonElement>} buttons @param {string} chosen */
    mark(buttons, chosen) {
        for (const [name, button] of buttons) markRadio(button, name === chosen);
    }

    /** @param {string} tool */
    choose(tool) {
        this.tool = tool;
        this.hits = [];
        this.mark(this.tools, tool);
        for (const row of this.page.querySelectorAll("#sculpt [data-for]"))
            if (row instanceof HTMLElement) row.hidden = !row.dataset.for?.split(" ").includes(tool);
        this.hint();
        this.onChange();
    }

    hint() {
        this.message.textContent = hintOf(this.tool, this.hits.length);
    }

    /** after `hello`, with the box of the scene @param {number[]} low @param {number[]} high */
    begin(low, high) {
        this.box = { low, high };
        this.size = Math.hypot(...low.map((v, i) => high[i] - v));
        this.pending = this.nextCut = null;
        this.target = "";
        this.setForce(null);
        this.showBusy();
        this.showValues();
    }

    /** extends the box by a surface @param {Float32Array} rest [n][3] */
    grow(rest) {
        this.box = boxAround(this.box, rest);
    }

    /** what the brush does @returns {string} key of PAINTS */
    paint() {
        return [...this.paints].find(([, button]) => button.tabIndex === 0)?.[0] ?? "stiffer";
    }

    /** @returns {import("./sculpt_commands.js").Settings} */
    settings() {
        const share = (/** @type {string} */ name) => Number(this.slider(name).value) / SLIDER_STEPS;
        return {
            distance_m: share("distance") * 0.5 * this.size,
            scale: 1,
            radius_m: share("radius") * 0.5 * this.size,
            paint: this.paint(),
            sharpness: Math.round(share("sharpness") * 10) / 2,
            entity: Number(selectById("sculpt-entity", this.page).value),
            pressure_Pa: 10 ** (1 + 3 * share("pressure")),
            lift_m: share("lift") * 0.5 * this.size,
            stiffness_N_m: STIFFNESS_N_M,
            middle: this.box.low.map((v, i) => (v + this.box.high[i]) / 2),
        };
    }

    showValues() {
        const { distance_m, radius_m, sharpness, pressure_Pa, lift_m } = this.settings();
        const mm = (/** @type {number} */ m) => decimal((1000 * m).toFixed(1)) + " mm";
        const show = (/** @type {string} */ name, /** @type {string} */ value) => {
            htmlById(`sculpt-${name}-value`, this.page).textContent = value;
            this.slider(name).ariaValueText = value;
        };
        show("distance", mm(distance_m));
        show("radius", mm(radius_m));
        show("sharpness", String(sharpness));
        show("pressure", Math.round(pressure_Pa) + " Pa");
        show("lift", mm(lift_m));
        this.onChange();
    }

    /** @param {Hit} hit of the surface */
    click(hit) {
        if (this.isBusy()) return;
        this.target = this.nameOf(hit.part);
        this.hits.push(hit);
        const points = this.hits.map(({ point }) => point.toArray());
        const command = commandOf(this.tool, this.settings(), points);
        if (!command) this.hint();
        else {
            if (FORCES.includes(this.tool)) this.setForce({ tool: this.tool, points, settings: this.settings() });
            this.hits = [];
            this.submit(command);
        }
        this.onChange();
    }

    /** @param {SculptPanel["force"]} force that acts from now on, null: none */
    setForce(force) {
        this.force = force;
        this.forceChanged = false;
        this.button("release").disabled = !force;
    }

    /** a slider changes the acting force: the server takes the same points again as the same brush */
    changeForce() {
        this.showValues();
        if (!this.force) return;
        const { pressure_Pa, lift_m } = this.settings();
        Object.assign(this.force.settings, { pressure_Pa, lift_m });
        this.forceChanged = true;
        this.sendForce();
    }

    sendForce() {
        if (!this.force || !this.forceChanged || this.isBusy()) return;
        this.forceChanged = false;
        const command = commandOf(this.force.tool, this.force.settings, this.force.points);
        if (command) this.submit(command);
    }

    /** is a command pending? */
    isBusy() {
        return this.pending !== null && performance.now() - this.sentAt < WAIT_MS;
    }

    /** @param {Command} command */
    submit(command) {
        if (this.isBusy()) return;
        if (command.verb === "release") this.setForce(null);
        this.pending = command;
        this.sentAt = performance.now();
        this.send({ ...command, target: this.target });
        this.showBusy();
    }

    /** @param {boolean} on the plane of the cut is shown */
    aim(on) {
        this.aims = on && !this.slider("cut").disabled;
        this.onChange();
    }

    /** outline of the plane of the cut while its slider is in use @returns {number[][]} */
    plane() {
        const axis = /** @type {"none" | "x" | "y" | "z"} */ (this.axis.value);
        return this.aims ? cutOutline(axis, Number(this.slider("cut").value) / SLIDER_STEPS, this.box) : [];
    }

    cut() {
        const axis = /** @type {"none" | "x" | "y" | "z"} */ (this.axis.value);
        const command = cutCommand(axis, Number(this.slider("cut").value) / SLIDER_STEPS, this.box);
        const cuts = command.verb === "cut";
        this.slider("cut").disabled = !cuts;
        if (cuts)
            this.slider("cut").ariaValueText =
                `${this.axis.value} = ${decimal((1000 * command.args.offset_m).toFixed(1))} mm`;
        this.onChange();
        if (this.isBusy()) this.nextCut = command;
        else this.submit(command);
    }

    /** after `topology`, caused by any member: there may be something to undo, and clicked points mean other faces */
    changed() {
        this.hits = [];
        this.setForce(null);
        this.button("undo").disabled = this.button("redo").disabled = false;
        this.onChange();
    }

    /** @param {import("./control_table.js").Answer} answer */
    answer(answer) {
        this.answered = answer;
        this.finish(answerText(answer));
        if (answer.args?.can_undo === undefined) return;
        this.button("undo").disabled = answer.args.can_undo === 0;
        this.button("redo").disabled = answer.args.can_redo === 0;
    }

    /** @param {string} sentence of an error @returns {boolean} it belongs to this panel */
    refused(sentence) {
        if (!this.pending) return false;
        if (FORCES.includes(this.pending.verb)) this.setForce(null);
        this.finish(refusalText(sentence));
        this.message.title = sentence; // for experts
        return true;
    }

    /** @param {string} message */
    finish(message) {
        this.pending = null;
        this.showBusy();
        this.message.textContent = message;
        this.message.title = "";
        const cut = this.nextCut;
        this.nextCut = null;
        if (cut) this.submit(cut);
        else this.sendForce();
    }

    showBusy() {
        htmlById("sculpt", this.page).setAttribute("aria-busy", String(this.pending !== null));
    }

    /** Ctrl+Z, Ctrl+Shift+Z, and while the panel is open the letters of the tools @param {KeyboardEvent} e @returns {boolean} the key is one of them */
    key(e) {
        const { target } = e;
        const typing =
            target instanceof HTMLSelectElement || (target instanceof HTMLInputElement && target.type !== "range");
        if (!this.offered || typing || e.altKey || e.repeat) return false;
        const key = e.key.toUpperCase();
        if (e.ctrlKey || e.metaKey) {
            if (key === "Z") this.submit({ verb: e.shiftKey ? "redo" : "undo", args: {} });
            return key === "Z";
        }
        const tool = Object.keys(TOOLS).find((name) => TOOLS[name].key === key);
        if (!tool || e.shiftKey || htmlById("sculpt", this.page).hidden) return false;
        this.choose(tool);
        return true;
    }
}
