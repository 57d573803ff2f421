// The buttons at the foot of the page and the keys that do the same.
import { buttonById, byId, chooseByArrows, htmlById, markRadio } from "./dom.js";
import { KeyboardTool } from "./keyboard_tool.js";
import { keyMap } from "./keys.js";
import { text } from "./text.js";

const KEYS_MS = 8000; // how long the keys that move the tool are named
const ROLL_RAD = Math.PI / 12; // turn of the instrument for a key press

/** @typedef {"pull" | "press" | "sculpt"} Mode what a drag does */

/**
 * @typedef {{
 *   state: import("./app_state.js").AppState, stage: import("./stage.js").Stage, layout: import("./layout.js").Layout,
 *   input: import("./tool_input.js").ToolInput, fields: import("./field_display.js").FieldDisplay,
 *   inside: import("./inside.js").Inside,
 *   accuracy: import("./accuracy_panel.js").AccuracyPanel, plots: import("./plots.js").Plots,
 *   sculpt: import("./sculpt_panel.js").SculptPanel,
 *   highlight: import("./sculpt_highlight.js").SculptHighlight,
 *   viewMenu: import("./view_menu.js").ViewMenu,
 *   send: (message: import("./control_table.js").ClientMessage) => void, showFigures: () => void
 * }} Page the parts of the page that the controls act on
 */

export class Controls {
    /** @param {Page} page */
    constructor(page) {
        this.page = page;
        for (const mode of /** @type {const} */ (["pull", "press", "sculpt"]))
            buttonById("mode-" + mode).onclick = () => this.setMode(mode);
        chooseByArrows(htmlById("modes"), () => this.modes().map((mode) => buttonById("mode-" + mode)));
        buttonById("pause").onclick = () => this.togglePause();
        buttonById("step").onclick = () => this.command("step");
        buttonById("reset").onclick = () => this.command("reset");
        buttonById("mesh").onclick = () => this.toggleMesh();
        buttonById("accuracy-toggle").onclick = () => this.openAccuracy(!page.accuracy.opened);
        buttonById("plots-toggle").onclick = () => this.openPlots(!page.plots.opened);
        buttonById("panel-toggle").onclick = () => this.togglePanel();
        buttonById("help-open").onclick = () => this.openHelp();
        this.addKeys();
        // who has clicked goes on with the keys of the page: Space pauses, and does not click once more
        document.addEventListener("click", ({ detail, target }) => {
            const clicked = detail > 0 && target instanceof HTMLElement ? target : null;
            if (clicked?.matches("button, [type=checkbox]") && !clicked.closest("dialog, [role=dialog]"))
                clicked.blur();
        });
        window.addEventListener("resize", () => this.place());
    }

    addKeys() {
        const { accuracy, fields, input, layout, plots, sculpt, stage, viewMenu } = this.page;
        const keyboard = new KeyboardTool(stage, input, () => {
            htmlById("hint").classList.add("gone");
            layout.notice(text("hint.keys"), KEYS_MS, "calm");
        });
        const actionOf = keyMap(
            {
                1: () => this.setMode("pull"),
                2: () => this.setMode("press"),
                3: () => this.setMode("sculpt"),
                4: () => this.openAccuracy(!accuracy.opened),
                5: () => this.openPlots(!plots.opened),
                " ": () => this.togglePause(),
                r: () => this.command("reset"),
                p: () => this.togglePanel(),
                c: () => fields.chooseNext(),
                m: () => this.toggleMesh(),
                q: () => input.roll(-ROLL_RAD),
                w: () => input.roll(ROLL_RAD),
                i: () => this.page.inside.toggle(),
                e: () => viewMenu.toggleEndoscope(),
                v: () => viewMenu.save(),
                "?": () => this.openHelp(),
                f1: () => this.openHelp(),
                escape: () => this.closePanels(),
            },
            stage,
        );
        window.addEventListener("keydown", (e) => {
            // an open dialog has the keyboard; it closes with Escape by itself
            if (byId("help", HTMLDialogElement).open) return;
            const handled = keyboard.key(e) || sculpt.key(e) || viewMenu.goByKey(e);
            const action = handled ? () => {} : actionOf(e);
            if (!action) return;
            e.preventDefault();
            action();
        });
    }

    closePanels() {
        if (!htmlById("panel").hidden) this.togglePanel();
        if (!htmlById("inside").hidden) this.page.inside.toggle();
        this.openAccuracy(false);
        this.openPlots(false);
    }

    openHelp() {
        byId("help", HTMLDialogElement).showModal();
    }

    /** @param {string} verb */
    command(verb) {
        this.page.send({ type: "command", verb });
    }

    place() {
        this.page.layout.place(this.page.state.target !== null);
    }

    /** modes that the session offers @returns {Mode[]} */
    modes() {
        return this.page.sculpt.offered ? ["pull", "press", "sculpt"] : ["pull", "press"];
    }

    /** @param {Mode} mode */
    setMode(mode) {
        const { input, sculpt } = this.page;
        if (mode === "sculpt" && !sculpt.offered) return;
        if (mode === "sculpt") this.clearLeft();
        input.mode = mode;
        input.release();
        htmlById("sculpt").hidden = mode !== "sculpt";
        this.page.highlight.enable(mode === "sculpt");
        this.makeRoom(mode === "sculpt");
        if (mode === "sculpt") htmlById("hint").classList.add("gone");
        for (const name of ["pull", "press", "sculpt"]) markRadio(buttonById("mode-" + name), mode === name);
    }

    /** the mode of sculpting exists while a part can be sculpted */
    offerSculpting() {
        const { input, sculpt, state } = this.page;
        sculpt.offered = state.may("sculpt") && state.parts.some((part) => part.sculptable);
        buttonById("mode-sculpt").hidden = !sculpt.offered;
        if (!sculpt.offered && input.mode === "sculpt") this.setMode("pull");
    }

    /** a button that the server would refuse cannot be pressed */
    showRights() {
        const { state } = this.page;
        const may = state.may("steer");
        // who only watches has no tools to choose and nothing to control
        for (const id of ["modes", "pause", "reset"]) htmlById(id).hidden = state.watches;
        const frozen = state.status?.frozen === true;
        for (const id of ["pause", "step"]) buttonById(id).disabled = !may;
        buttonById("reset").disabled = !may && !frozen;
    }

    togglePause() {
        this.command(this.page.state.status?.paused ? "resume" : "pause");
    }

    /** @param {boolean} paused */
    showPaused(paused) {
        buttonById("pause").textContent = text(paused ? "tools.resume" : "tools.pause");
        buttonById("pause").setAttribute("aria-pressed", String(paused));
        buttonById("step").hidden = !paused || this.page.state.watches;
        this.showRights();
    }

    toggleMesh() {
        const { stage, state } = this.page;
        state.wireframe = !state.wireframe;
        buttonById("mesh").setAttribute("aria-pressed", String(state.wireframe));
        for (const body of state.bodies.values()) body.wireframe(state.wireframe);
        stage.dirty = true;
    }

    togglePanel() {
        const panel = htmlById("panel");
        panel.hidden = !panel.hidden;
        buttonById("panel-toggle").setAttribute("aria-expanded", String(!panel.hidden));
        if (!panel.hidden && !this.page.layout.hasRoom()) this.clearLeft();
        this.place();
        this.page.showFigures();
    }

    /** @param {boolean} opened */
    openAccuracy(opened) {
        const { accuracy, state } = this.page;
        if (opened && !state.hello?.estimates) return;
        if (opened) this.clearLeft();
        htmlById("accuracy-panel").hidden = !opened;
        buttonById("accuracy-toggle").setAttribute("aria-expanded", String(opened));
        accuracy.open(opened);
        this.makeRoom(opened);
    }

    /** where two panels leave no room for the organ, one that opens closes the other @param {boolean} opened */
    makeRoom(opened) {
        if (opened && !htmlById("panel").hidden && !this.page.layout.hasRoom()) this.togglePanel();
        this.place();
    }

    /** @param {boolean} opened */
    openPlots(opened) {
        if (opened) this.clearLeft();
        buttonById("plots-toggle").setAttribute("aria-expanded", String(opened));
        // its height is known when the charts exist
        this.page.plots.open(opened).then(() => this.makeRoom(opened));
    }

    /** accuracy, plots and sculpting stand in the same place: one at a time */
    clearLeft() {
        if (this.page.accuracy.opened) this.openAccuracy(false);
        if (this.page.plots.opened) this.openPlots(false);
        if (this.page.input.mode === "sculpt") this.setMode("pull");
    }
}
