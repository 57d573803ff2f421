// The menu of views: a button that opens it, what it offers, and its keys.
import { buttonById, byId, htmlById, inputById } from "./dom.js";
import { nextName, readViews, withView } from "./saved_views.js";
import { STANDARD } from "./standard_views.js";
import { store, stored } from "./storage.js";
import { text } from "./text.js";

/** @param {string} textContent */
const makeButton = (textContent) => Object.assign(document.createElement("button"), { type: "button", textContent });
/** @param {number} number */
const named = (number) => text("views.numbered", { number });
const HINT_MS = 7000; // two sentences are read
const DEGREE = Math.PI / 180;

export class ViewMenu {
    explained = false; // how an endoscope is moved
    hintTimer = 0;
    unstored = "[]"; // saved views where the browser stores nothing

    /**
     * @param {import("./app_state.js").AppState} state @param {import("./stage.js").Stage} stage
     * @param {import("./view_modes.js").ViewModes} modes
     */
    constructor(state, stage, modes) {
        this.state = state;
        this.stage = stage;
        this.modes = modes;
        this.menu = htmlById("view-menu");
        this.opener = buttonById("view-toggle");
        this.opener.onclick = () => this.open(this.menu.hidden);
        this.menu.addEventListener("keydown", (e) => this.key(e));
        // a press beside the menu closes it, and does what it does there
        document.addEventListener("pointerdown", ({ target }) => {
            if (target instanceof Node && !this.menu.contains(target) && !this.opener.contains(target))
                this.open(false);
        });
        buttonById("view-endoscope").onclick = () => this.toggleEndoscope();
        buttonById("view-angled").onclick = () => modes.setAngle(modes.scope?.pose.angle ? 0 : 30);
        buttonById("view-split").onclick = () => modes.setSplit(!modes.split);
        buttonById("view-stereo").onclick = () => modes.setStereo(!modes.stereo);
        window.addEventListener("resize", () => this.show());
        for (const key of /** @type {const} */ (["turn", "roll"]))
            inputById("view-" + key).oninput = () => {
                modes.scope?.take({ ...modes.scope.pose, [key]: Number(inputById("view-" + key).value) * DEGREE });
                stage.dirty = true;
            };
        htmlById("view-standard").append(
            ...STANDARD.map((from) => {
                const button = makeButton(text(`views.standard.${from}`));
                button.onclick = () => modes.goStandard(from, state.hello?.anatomical_axes ?? "");
                return button;
            }),
        );
        byId("view-save", HTMLFormElement).onsubmit = (e) => {
            e.preventDefault();
            this.save(inputById("view-name").value.trim());
        };
        modes.changed = () => this.show();
    }

    /** where the browser has a headset @param {() => import("./xr_view.js").XrPage} page */
    async offerHeadset(page) {
        const button = buttonById("view-vr");
        button.hidden = !(await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false));
        button.onclick = async () => {
            this.open(false);
            try {
                const { XrView } = await import("./xr_view.js");
                this.modes.immersive = await XrView.start(page(), () => (this.modes.immersive = null));
            } catch (error) {
                this.hint(text("views.vr.refused", { reason: String(error) }));
            }
        };
    }

    /** @param {boolean} opened */
    open(opened) {
        if (opened === !this.menu.hidden) return;
        this.menu.hidden = !opened;
        this.opener.setAttribute("aria-expanded", String(opened));
        this.show();
        if (opened) this.items()[0].focus();
    }

    /** what the arrow keys go through @returns {HTMLElement[]} */
    items() {
        const all = /** @type {NodeListOf<HTMLElement>} */ (this.menu.querySelectorAll("button, input"));
        return [...all].filter((item) => item.offsetWidth > 0);
    }

    /** @param {KeyboardEvent} e */
    key(e) {
        if (e.key === "Escape") {
            this.open(false);
            this.opener.focus();
        } else if (e.key === "ArrowDown" || e.key === "ArrowUp") {
            const items = this.items();
            const now = items.indexOf(/** @type {HTMLElement} */ (document.activeElement));
            items[(now + (e.key === "ArrowDown" ? 1 : items.length - 1)) % items.length].focus();
        } else {
            if (e.target instanceof HTMLInputElement) e.stopPropagation(); // typing is no command
            return;
        }
        e.preventDefault();
        e.stopPropagation();
    }

    async toggleEndoscope() {
        await this.modes.toggleEndoscope();
        if (this.explained || !this.modes.scope) return;
        this.explained = true;
        this.hint(text("views.endoscope.how"));
    }

    /** @param {string} sentence */
    hint(sentence) {
        const hint = htmlById("view-hint");
        hint.textContent = sentence;
        hint.hidden = false;
        clearTimeout(this.hintTimer);
        this.hintTimer = window.setTimeout(() => (hint.hidden = true), HINT_MS);
    }

    get storage() {
        return `palpate.views.${this.state.hello?.session ?? ""}`;
    }

    /** without storage they last as long as the page @returns {import("./saved_views.js").Saved[]} */
    saved() {
        return readViews(stored(this.storage) ?? this.unstored);
    }

    /** @param {import("./saved_views.js").Saved[]} views */
    keep(views) {
        this.unstored = JSON.stringify(views);
        store(this.storage, this.unstored);
        this.showSaved();
    }

    /** @param {string} wanted "" : the next number */
    save(wanted = "") {
        const views = this.saved();
        const name = wanted || nextName(views, named);
        this.keep(withView(views, name, this.modes.shot()));
        inputById("view-name").value = "";
        this.hint(text("views.saved.done", { name }));
    }

    /** Shift and a digit go to a saved view @param {KeyboardEvent} e @returns {boolean} it was that */
    goByKey(e) {
        const digit = e.shiftKey && !(e.target instanceof HTMLInputElement) ? /^Digit([1-9])$/.exec(e.code) : null;
        if (!digit) return false;
        const view = this.saved()[Number(digit[1]) - 1];
        if (view) this.modes.go(view.shot);
        return true;
    }

    showSaved() {
        htmlById("view-saved").replaceChildren(
            ...this.saved().map(({ name, shot }) => {
                const go = makeButton(name);
                go.onclick = () => this.modes.go(shot);
                const remove = makeButton("×");
                remove.ariaLabel = remove.title = text("views.delete", { name });
                remove.onclick = () => {
                    this.keep(this.saved().filter((view) => view.name !== name));
                    inputById("view-name").focus();
                };
                const [item, row] = [document.createElement("li"), document.createElement("div")];
                row.append(go, remove);
                item.append(row);
                return item;
            }),
        );
        inputById("view-name").placeholder = nextName(this.saved(), named);
    }

    /** the state of the views */
    show() {
        if (!this.menu.hidden) this.showSaved();
        const { scope } = this.modes;
        buttonById("view-endoscope").setAttribute("aria-pressed", String(scope !== null));
        htmlById("view-scope").hidden = scope === null;
        for (const key of /** @type {const} */ (["split", "stereo"]))
            buttonById("view-" + key).setAttribute("aria-pressed", String(this.modes[key]));
        const { stage } = this;
        const { classList } = document.body;
        classList.toggle("surround-above", stage.paneAt(0, 0).view.kind === "endoscope");
        classList.toggle("surround-below", stage.paneAt(0, innerHeight - 1).view.kind === "endoscope");
        const hint = htmlById("view-hint");
        if (!scope && hint.textContent === text("views.endoscope.how")) hint.hidden = true;
        if (!scope) return;
        buttonById("view-angled").setAttribute("aria-pressed", String(scope.pose.angle > 0));
        inputById("view-turn").disabled = scope.pose.angle === 0; // straight optics look the same however they turn
        for (const key of /** @type {const} */ (["turn", "roll"]))
            inputById("view-" + key).value = String(Math.round(scope.pose[key] / DEGREE));
    }
}
