// Where things stand on the page: the organ between the panels, notices, the state of the connection.
import { htmlById } from "./dom.js";
import { text as textOf } from "./text.js";

const WIDTH_MIN = 260; // pixels between panels that the organ needs
export const NARROW = 640; // pixels: on a narrower page the panels lie below the organ, as in style.css
const MARGIN = 18; // pixels beside a panel
/** panels of each side */
const LEFT = ["accuracy-panel", "plots", "sculpt"];
const RIGHT = ["panel"];

export class Layout {
    /** the stage is set when it exists @type {import("./stage.js").Stage | null} */
    stage = null;
    silent = false; // the server does not answer
    pending = false; // panels have moved while a drag held the organ in place
    noticeTimer = 0; // 0: the notice stays

    constructor() {
        // what stands above the buttons follows their rows
        const tools = htmlById("tools");
        const measure = () => {
            const foot = Math.round(innerHeight - tools.getBoundingClientRect().top);
            document.documentElement.style.setProperty("--foot", `${foot}px`);
            this.place(this.pending);
        };
        const observer = new ResizeObserver(measure);
        for (const element of [tools, ...[...LEFT, ...RIGHT, "inside"].map((id) => htmlById(id))])
            observer.observe(element);
        window.addEventListener("resize", measure);
    }

    /**
     * The organ and its labels stand in what panels leave free: between them, or above them on a narrow page. During a
     * drag they stay where they are: the tool's target would move.
     * @param {boolean} dragging
     */
    place(dragging) {
        this.pending = dragging;
        if (dragging) return;
        const { beside, left, right, bottom } = this.covered();
        const style = document.documentElement.style;
        style.setProperty("--left", `${beside}px`);
        style.setProperty("--middle", `calc(50% + ${(left - right) / 2}px)`);
        style.setProperty("--free", `calc(100vw - ${left + right}px)`);
        this.stage?.setMargins(left, right, bottom);
    }

    /**
     * What panels cover at each side, pixels. Section planes stand to the right of another panel at the left.
     * @returns {{beside: number, left: number, right: number, bottom: number}} beside: of left, without section planes
     */
    covered() {
        const across = innerWidth <= NARROW && innerHeight > innerWidth; // as in panels.css
        const size = (/** @type {string} */ id) => {
            const { width, top } = htmlById(id).getBoundingClientRect();
            return width && (across ? innerHeight - top : width + MARGIN);
        };
        const [left, right] = [Math.max(...LEFT.map(size)), Math.max(...RIGHT.map(size))];
        const inside = size("inside");
        const foot = innerHeight - htmlById("tools").getBoundingClientRect().top;
        return across
            ? { beside: 0, left: 0, right: 0, bottom: Math.max(left, right, inside, foot) }
            : { beside: left, left: left + inside, right, bottom: foot };
    }

    /** does the organ have room beside all panels? Else they are shown one at a time */
    hasRoom() {
        const { left, right } = this.covered();
        const across = innerWidth <= NARROW && innerHeight > innerWidth;
        return !across && innerWidth - left - right >= WIDTH_MIN;
    }

    /**
     * @param {string} text empty hides it @param {number} ms the notice disappears after this time; 0: it stays
     * @param {"alarm" | "calm"} [tone] calm: nothing is wrong
     */
    notice(text, ms = 0, tone = "alarm") {
        clearTimeout(this.noticeTimer);
        this.noticeTimer = ms ? window.setTimeout(() => this.notice(""), ms) : 0;
        const element = htmlById("notice");
        // written only when it changes: screen readers read each change
        if (element.textContent !== text) element.textContent = text;
        element.classList.toggle("calm", tone === "calm");
        element.hidden = !text;
    }

    /** hides a notice, but not one that disappears by itself */
    clearNotice() {
        if (!this.noticeTimer) this.notice("");
    }

    /** the picture is old while the server does not answer @param {number} seconds 0: it answers */
    silence(seconds) {
        document.body.classList.toggle("silent", seconds > 0);
        if (seconds > 0) this.connection("lost", textOf("state.silent", { s: seconds }));
        else if (this.silent) this.connection("live", textOf("state.live"));
        this.silent = seconds > 0;
    }

    /** @param {import("./link.js").ConnectionState} state @param {string} text */
    connection(state, text) {
        htmlById("state").dataset.state = state;
        htmlById("state-text").textContent = text;
    }
}
