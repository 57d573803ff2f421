// Who is here, who did what, and what an instructor may do about it.
import { buttonById, htmlById } from "./dom.js";
import { cssColour } from "./plan_panel.js";
import { isTextKey, text as textOf } from "./text.js";

/**
 * @typedef {import("./control_table.js").Member} Member
 * @typedef {{verb: string, target?: string, args: Record<string, number>}} Command
 * @typedef {{id: number, name: string, text: string, numbers: string, at: number}} Order numbers: as they were sent
 */

/** what trainees may be let do */
export const RIGHTS = Object.freeze(
    /** @type {const} */ (["steer", "material", "component", "configure", "sculpt", "cut"]),
);
const ORDERS_SHOWN = 6;

/** @param {string} text @param {string} title @param {() => void} action */
function button(text, title, action) {
    const made = Object.assign(document.createElement("button"), { textContent: text, title, type: "button" });
    made.onclick = action;
    return made;
}

/** @param {string} text @param {boolean} checked @param {(checked: boolean) => void} action */
function checkbox(text, checked, action) {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked });
    box.onchange = () => action(box.checked);
    label.append(box, ` ${text}`);
    return label;
}

/** "3 s ago", "2 min ago" @param {number} seconds */
export const agoText = (seconds) =>
    seconds < 60
        ? textOf("time.seconds_ago", { n: Math.max(0, Math.round(seconds)) })
        : textOf("time.minutes_ago", { n: Math.round(seconds / 60) });

export class MembersPanel {
    /** @type {Order[]} newest first */
    orders = [];
    opened = 0; // id of the member whose choices are shown
    /** @type {Member[]} */
    members = [];

    /** @param {Document} page @param {(command: Command) => void} send @param {() => number} now ms */
    constructor(page, send, now) {
        this.send = send;
        this.now = now;
        this.list = htmlById("members", page);
        this.room = htmlById("room-choices", page);
        this.order = htmlById("orders", page);
        buttonById("lock-session", page).onclick = () =>
            this.send({ verb: "lock_session", args: { enabled: this.locked ? 0 : 1 } });
    }

    locked = false;

    /**
     * @param {Extract<import("./control_table.js").ServerMessage, {type: "members"}>} message
     * @param {number} ownId @param {{name: string}[]} tools
     */
    show(message, ownId, tools) {
        const instructs = message.members.find(({ id }) => id === ownId)?.role === "instructor";
        this.members = message.members;
        this.locked = message.locked === true;
        this.list.replaceChildren(...message.members.map((member) => this.row(member, ownId, instructs)));
        this.room.hidden = !instructs;
        if (!instructs) return;
        const lock = buttonById("lock-session");
        lock.textContent = textOf(this.locked ? "people.unlock" : "people.lock");
        lock.setAttribute("aria-pressed", String(this.locked));
        htmlById("tool-choices").replaceChildren(
            ...tools.map(({ name }, tool) => this.toolRow(tool, name, message, ownId)),
        );
    }

    /** @param {Member} member @param {number} ownId @param {boolean} instructs */
    row(member, ownId, instructs) {
        const { id, name, role, tool, colour, muted } = member;
        const item = document.createElement("li");
        const title = document.createElement("span");
        const note = document.createElement("small");
        const holds = (tool ?? -1) >= 0;
        const dot = document.createElement("i");
        dot.style.background = cssColour(colour);
        title.textContent = id === ownId ? textOf("people.you", { name }) : name;
        const kind = role === "instructor" || role === "trainee" ? role : "viewer";
        note.textContent =
            "  " +
            textOf(
                muted ? "people.muted" : holds ? `role.${kind}` : kind === "viewer" ? "role.viewer" : "people.no_tool",
            );
        item.append(dot, title, note);
        if (!instructs || id === ownId || role === "instructor") return item;
        const more = button("…", textOf("people.choices", { name }), () => {
            this.opened = this.opened === id ? 0 : id;
            choices.hidden = this.opened !== id;
            more.setAttribute("aria-expanded", String(!choices.hidden));
        });
        const choices = this.choices(member);
        choices.hidden = this.opened !== id;
        more.className = "more";
        more.setAttribute("aria-expanded", String(!choices.hidden));
        item.append(more, choices);
        return item;
    }

    /** @param {Member} member */
    choices({ id, name, role, rights, muted }) {
        const choices = document.createElement("div");
        const has = (rights ?? "").split(" ");
        choices.className = "choices";
        if (role === "trainee")
            for (const right of RIGHTS)
                choices.append(
                    checkbox(textOf(`people.may.${right}`), has.includes(right), (enabled) =>
                        this.send({ verb: "allow", target: right, args: { member: id, enabled: enabled ? 1 : 0 } }),
                    ),
                );
        choices.append(
            checkbox(textOf("people.muted"), muted === true, (enabled) =>
                this.send({ verb: "mute", args: { member: id, enabled: enabled ? 1 : 0 } }),
            ),
            button(textOf("people.remove"), textOf("people.remove.tip", { name }), () =>
                this.send({ verb: "remove", args: { member: id } }),
            ),
            button(textOf("people.ban"), textOf("people.ban.tip", { name }), () =>
                this.send({ verb: "ban", args: { member: id } }),
            ),
        );
        return choices;
    }

    /**
     * @param {number} tool @param {string} name
     * @param {{members: Member[], locked_tools?: number[]}} message @param {number} ownId
     */
    toolRow(tool, name, { members, locked_tools }, ownId) {
        const row = document.createElement("div");
        const holder = Object.assign(document.createElement("select"), { title: textOf("people.holder", { name }) });
        holder.setAttribute("aria-label", holder.title);
        holder.append(new Option(textOf("people.nobody"), "0"));
        for (const { id, name: who, role, muted } of members)
            if (role !== "viewer" && !muted)
                holder.append(new Option(id === ownId ? textOf("people.you", { name: who }) : who, String(id)));
        holder.value = String(members.find((member) => member.tool === tool)?.id ?? 0);
        holder.onchange = () => this.send({ verb: "hand_over", args: { tool, member: Number(holder.value) } });
        const locked = locked_tools?.includes(tool) === true;
        row.append(
            name,
            holder,
            checkbox(textOf("people.locked"), locked, (enabled) =>
                this.send({ verb: "lock_tool", args: { tool, enabled: enabled ? 1 : 0 } }),
            ),
        );
        return row;
    }

    /** @param {Extract<import("./control_table.js").ServerMessage, {type: "orders"}>} message */
    takeOrders({ orders }) {
        for (const { id, name, verb, target, text = "", age_s } of orders) {
            const member = text.match(/\bmember (\d+)/)?.[1];
            // a command that switches something names what it did: .0 off, .1 on
            const switched = `order.${verb}.${text.match(/\benabled ([01])\b/)?.[1] ?? 1}`;
            const key = isTextKey(switched) ? switched : `order.${verb}`;
            const did = isTextKey(key) ? textOf(key) : verb.replaceAll("_", " ");
            // a right has no name of its own
            const what = [did, verb === "allow" ? "" : target, member && this.nameOf(Number(member))];
            const at = this.now() - 1000 * age_s;
            this.orders.unshift({
                id,
                name,
                text: what.filter(Boolean).join(" ").replace(/:$/, ""),
                numbers: `${target} ${text}`.trim(),
                at,
            });
        }
        this.orders.length = Math.min(this.orders.length, ORDERS_SHOWN);
        this.showOrders();
    }

    showOrders() {
        this.order.replaceChildren(
            ...this.orders.map(({ name, text, numbers, at }) => {
                const item = Object.assign(document.createElement("li"), { title: numbers });
                const ago = Object.assign(document.createElement("small"), {
                    textContent: ` ${agoText((this.now() - at) / 1000)}`,
                });
                item.append(Object.assign(document.createElement("b"), { textContent: name }), ` ${text}`, ago);
                return item;
            }),
        );
    }

    /** @param {number} id */
    nameOf(id) {
        return (
            this.members.find((member) => member.id === id)?.name ??
            (id ? textOf("people.member", { id }) : textOf("people.nobody"))
        );
    }

    begin() {
        this.orders = [];
        this.opened = 0;
        this.showOrders();
    }
}
