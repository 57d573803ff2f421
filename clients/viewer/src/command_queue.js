// Commands on their way to the server, which takes a limited number a second (protocol/README.md, "Limits"): a slider
// gives far more. One that waits is replaced by a newer one of the same verb and target. Pure.

const COMMANDS_S = 15; // three quarters of what the server takes
const AT_ONCE = 15;

/** @typedef {Extract<import("./control_table.js").ClientMessage, {type: "command"}>} Command */

export class CommandQueue {
    /** @type {Command[]} oldest first */
    waiting = [];
    level = AT_ONCE;
    countedAt = 0; // ms

    /** @param {Command} command */
    add(command) {
        const same = this.waiting.findIndex((old) => old.verb === command.verb && old.target === command.target);
        if (same >= 0) this.waiting[same] = command;
        else this.waiting.push(command);
    }

    /** the commands that may be sent now, ms @param {number} now @returns {Command[]} */
    take(now) {
        this.level = Math.min(AT_ONCE, this.level + ((now - this.countedAt) / 1000) * COMMANDS_S);
        this.countedAt = now;
        const taken = this.waiting.splice(0, Math.floor(this.level));
        this.level -= taken.length;
        return taken;
    }

    /** ms until the next one may be sent; null: none waits */
    pause() {
        return this.waiting.length ? Math.max(0, ((1 - this.level) / COMMANDS_S) * 1000) : null;
    }
}
