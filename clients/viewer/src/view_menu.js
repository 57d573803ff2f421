// The menu of views: a button that opens it, what it offers, and its keys.
import { buttonById, htmlById, inputById } from "./dom.js";
import { text } from "./text.js";

const HINT_MS = 7000; // two sentences are read
const DEGREE = Math.PI / 180;

export class ViewMenu {
    explained = false; // how an endoscope is moved

    /**
     * @param {import("./stage.js").Stage} stage @param {import("./view_modes.js").ViewModes} modes
     */
    constructor(stage, modes) {
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
        for (const key of /** @type {const} */ (["turn", "roll"]))
            inputById("view-" + key).oninput = () => {
                modes.scope?.take({ ...modes.scope.pose, [key]: Number(inputById("view-" + key).value) * DEGREE });
                stage.dirty = true;
            };
        modes.changed = () => this.show();
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
        setTimeout(() => (hint.hidden = true), HINT_MS);
    }

    /** the state of the views */
    show() {
        const { scope } = this.modes;
        buttonById("view-endoscope").setAttribute("aria-pressed", String(scope !== null));
        htmlById("view-scope").hidden = scope === null;
        document.body.classList.toggle("surround", this.stage.panes[0].view.kind === "endoscope");
        if (!scope) return;
        buttonById("view-angled").setAttribute("aria-pressed", String(scope.pose.angle > 0));
        inputById("view-turn").disabled = scope.pose.angle === 0; // straight optics look the same however they turn
        for (const key of /** @type {const} */ (["turn", "roll"]))
            inputById("view-" + key).value = String(Math.round(scope.pose[key] / DEGREE));
    }
}
