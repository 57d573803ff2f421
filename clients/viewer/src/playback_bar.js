// The bar of a recording: where it is, its marks, how fast it plays, and the way to go on live from there.
import { buttonById, htmlById, inputById, makeOption, selectById } from "./dom.js";
import { decimal, text as textOf } from "./text.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const STEPS_1_S = 10; // positions of the bar a second

/** @typedef {NonNullable<import("./app_state.js").Status["playback"]>[number]} Playback */

/** @param {number} s @returns {string} "1:02.5" */
export function timeText(s) {
    const tenths = Math.round(10 * s);
    const rest = (tenths % 600) / 10;
    return `${Math.floor(tenths / 600)}:${rest < 10 ? "0" : ""}${decimal(rest.toFixed(1))}`;
}

/** what the state of the connection says about a recording @param {Playback} playback @param {boolean} paused */
export function playbackText({ ended, speed }, paused) {
    if (ended) return textOf("playback.end");
    if (paused) return textOf("playback.paused");
    return speed === 1 ? textOf("playback.plays") : textOf("playback.plays_at", { speed });
}

export class PlaybackBar {
    /** @param {Document} page @param {(command: import("./sculpt_commands.js").Command) => void} send */
    constructor(page, send) {
        this.page = page;
        this.send = send;
        this.sought = NaN; // time that the server has not reached yet
        /** @type {Playback | null} */
        this.now = null;
        const bar = inputById("playback-time", page);
        bar.oninput = () => this.showTime(Number(bar.value) / STEPS_1_S);
        bar.onchange = () => this.seek(Number(bar.value) / STEPS_1_S);
        const speed = selectById("playback-speed", page);
        for (const factor of SPEEDS) speed.append(makeOption(String(factor), `${factor}×`));
        speed.onchange = () => this.send({ verb: "speed", args: { factor: Number(speed.value) } });
        buttonById("playback-branch", page).onclick = () => this.branch();
    }

    /** @param {number} time_s */
    seek(time_s) {
        this.sought = time_s;
        this.send({ verb: "seek", args: { time_s } });
    }

    /** live from here, or back to where the session left the recording */
    branch() {
        if (!this.now?.plays) this.seek(this.now?.time_s ?? 0);
        else this.send({ verb: "branch", args: {} });
    }

    /** the server has answered a command, or refused it */
    answered() {
        this.sought = NaN;
    }

    /** at a new connection @param {{time_s: number, text: string}[]} marks */
    begin(marks) {
        this.marks = marks;
        this.sought = NaN;
        this.now = null;
        htmlById("playback", this.page).hidden = true;
    }

    /** @param {number} length_s */
    showMarks(length_s) {
        htmlById("playback-marks", this.page).replaceChildren(
            ...(this.marks ?? []).map(({ time_s, text }) => {
                const button = Object.assign(document.createElement("button"), {
                    title: textOf("playback.mark", { text, time: timeText(time_s) }),
                    onclick: () => this.seek(time_s),
                });
                button.setAttribute("aria-label", button.title);
                button.style.left = `${(100 * time_s) / length_s}%`;
                return button;
            }),
        );
    }

    /** @param {number} time_s */
    showTime(time_s) {
        const text = textOf("playback.at", { time: timeText(time_s), length: timeText(this.now?.length_s ?? 0) });
        htmlById("playback-text", this.page).textContent = text;
        inputById("playback-time", this.page).setAttribute("aria-valuetext", text);
    }

    /** @param {Playback | undefined} playback @param {boolean} may give its commands */
    show(playback, may) {
        const bar = inputById("playback-time", this.page);
        const branch = buttonById("playback-branch", this.page);
        const speed = selectById("playback-speed", this.page);
        htmlById("playback", this.page).hidden = !playback;
        if (!playback) return;
        if (this.now?.length_s !== playback.length_s) this.showMarks(playback.length_s);
        this.now = playback;
        bar.max = String(Math.round(playback.length_s * STEPS_1_S));
        bar.disabled = !may;
        branch.hidden = !may;
        speed.hidden = !may || !playback.plays;
        for (const mark of htmlById("playback-marks", this.page).querySelectorAll("button")) mark.disabled = !may;
        branch.textContent = textOf(playback.plays ? "playback.branch" : "playback.back");
        if (document.activeElement !== speed) speed.value = String(playback.speed);
        const drags = bar.matches(":active");
        if (drags) return;
        const time_s = Number.isNaN(this.sought) ? playback.time_s : this.sought;
        bar.value = String(Math.round(time_s * STEPS_1_S));
        this.showTime(time_s);
    }
}
