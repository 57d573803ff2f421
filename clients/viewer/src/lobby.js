// The lobby: the sessions of a server with their people and pictures, and for instructors the scenes that can be opened.
import { decodeAsset } from "./asset.js";
import { htmlById } from "./dom.js";
import { drawSurfaces } from "./picture.js";
import { speedText } from "./plan_panel.js";
import { text as textOf } from "./text.js";

const REFRESH_MS = 2000;
const SLOW = 1.05; // slowdown that still counts as real time

/**
 * @typedef {{
 *   name: string, title: string, state: "running" | "paused" | "recording" | "opening" | "failed", text?: string,
 *   members?: number, viewers?: number, tools?: number, free_tools?: number, slowdown?: number, assets?: string[],
 *   people?: {name: string, role: string}[]
 * }} Session
 * @typedef {{sessions: Session[], scenes?: string[]}} List scenes: of those who may open them
 */

/** is there anything to choose, or a reason to read why a scene failed? @param {List} list */
export const offersChoice = ({ sessions, scenes }) =>
    sessions.filter(({ state }) => state !== "failed").length !== 1 ||
    scenes !== undefined ||
    sessions.some(({ text }) => text);

/** @param {Session} session @returns {string} */
export function stateText({ state, slowdown = 1, text }) {
    if (state === "failed" && text) return textOf("lobby.failed_by", { reason: text });
    if (state !== "running") return textOf(`lobby.state.${state}`);
    return slowdown > SLOW ? speedText(slowdown) : textOf("lobby.state.running");
}

/** @param {Session} session @returns {string} */
export function peopleText({ people, members = 0, viewers = 0 }) {
    const n = members + viewers;
    if (!n) return textOf("lobby.nobody");
    if (!people?.length) return n === 1 ? textOf("lobby.member") : textOf("lobby.members", { n });
    return people
        .map(({ name, role }) =>
            role === "trainee"
                ? name
                : `${name} (${textOf(role === "instructor" ? "role.instructor" : "role.viewer")})`,
        )
        .join(", ");
}

export class Lobby {
    /** @param {Document} page @param {string} ticket "": none @param {typeof fetch} get */
    constructor(page, ticket, get) {
        this.page = page;
        this.ticket = ticket;
        this.get = get;
        this.shown = ""; // the list as it is shown
    }

    /** @param {Record<string, string>} [more] */
    headers(more = {}) {
        return this.ticket ? { ...more, Authorization: `Bearer ${this.ticket}` } : more;
    }

    /** null: the server did not answer @returns {Promise<List | null>} */
    async read() {
        try {
            const reply = await this.get("sessions", { headers: this.headers(), cache: "no-store" });
            return reply.ok ? await reply.json() : null;
        } catch {
            return null;
        }
    }

    /** @param {List} list */
    open(list) {
        this.page.body.classList.add("choosing");
        htmlById("lobby", this.page).hidden = false;
        this.page.title = `${textOf("lobby.title")} · Palpate`;
        this.show(list);
        setInterval(async () => {
            const now = await this.read();
            htmlById("lobby-silent", this.page).hidden = now !== null;
            if (now) this.show(now);
        }, REFRESH_MS);
    }

    /** {open: scene} or {end: session} @param {Record<string, string>} order */
    async order(order) {
        const note = htmlById("lobby-note", this.page);
        try {
            const reply = await this.get("sessions", {
                method: "POST",
                headers: this.headers({ "Content-Type": "application/json" }),
                body: JSON.stringify(order),
            });
            note.textContent = reply.ok ? "" : ((await reply.json().catch(() => null))?.error ?? reply.statusText);
        } catch {
            note.textContent = textOf("lobby.silent");
        }
        const now = await this.read();
        if (now) this.show(now);
    }

    /** what has not changed stays, with its picture and the focus @param {List} list */
    show(list) {
        const key = JSON.stringify(list, (name, value) =>
            name === "slowdown" ? Number((1 / value).toFixed(1)) : value,
        );
        if (key === this.shown) return;
        this.shown = key;
        const cards = htmlById("lobby-sessions", this.page);
        const kept = new Map([...cards.children].map((card) => [/** @type {HTMLElement} */ (card).dataset.name, card]));
        const wanted = list.sessions.map((session) => {
            const card = kept.get(session.name) ?? this.card(session);
            const alike = list.sessions.filter(({ title }) => title === session.title).length > 1;
            this.update(/** @type {HTMLElement} */ (card), session, alike, list.scenes !== undefined);
            kept.delete(session.name);
            return card;
        });
        for (const card of kept.values()) card.remove();
        wanted.forEach((card, i) => cards.children[i] !== card && cards.insertBefore(card, cards.children[i] ?? null));
        htmlById("lobby-empty", this.page).hidden = list.sessions.length > 0;
        this.showScenes(list.scenes);
    }

    /** @param {Session} session */
    card({ name }) {
        const card = document.createElement("li");
        card.dataset.name = name;
        const canvas = Object.assign(document.createElement("canvas"), { width: 320, height: 220 });
        canvas.setAttribute("aria-hidden", "true");
        const line = (/** @type {string} */ kind, /** @type {string} */ tag) =>
            Object.assign(document.createElement(tag), { className: kind });
        card.append(canvas, line("title", "h2"), line("state", "p"), line("people", "p"), line("actions", "div"));
        return card;
    }

    /** @param {HTMLElement} card @param {Session} session @param {boolean} alike another one has its title
     * @param {boolean} instructs */
    update(card, session, alike, instructs) {
        const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (card.querySelector(`.${name}`));
        const runs = session.state !== "opening" && session.state !== "failed";
        part("title").textContent = alike ? `${session.title} (${session.name})` : session.title;
        part("state").textContent = stateText(session);
        part("people").textContent = runs ? peopleText(session) : "";
        card.dataset.state = session.state;
        const actions = [runs && "join", runs && "watch", runs && instructs && "end"].filter(Boolean).join(" ");
        if (part("actions").dataset.shown !== actions) {
            part("actions").dataset.shown = actions;
            part("actions").replaceChildren(...this.actions(session.name, actions));
        }
        if (session.assets) this.draw(card, session.assets);
    }

    /** @param {string} name @param {string} actions */
    actions(name, actions) {
        const link = (/** @type {string} */ text, /** @type {string} */ more) => {
            const query = new URLSearchParams(location.search);
            query.set("session", name);
            const a = Object.assign(document.createElement("a"), { href: `?${query}${more}`, textContent: text });
            a.setAttribute("aria-label", `${text} ${name}`);
            return a;
        };
        const end = () => {
            const button = Object.assign(document.createElement("button"), { textContent: textOf("lobby.end") });
            button.setAttribute("aria-label", `${textOf("lobby.end")} ${name}`);
            // a second press within some seconds means it
            button.onclick = () => {
                if (button.dataset.sure) return void this.order({ end: name });
                button.dataset.sure = "yes";
                button.textContent = textOf("lobby.end_sure");
                setTimeout(() => {
                    delete button.dataset.sure;
                    button.textContent = textOf("lobby.end");
                }, 4000);
            };
            return button;
        };
        return actions
            .split(" ")
            .filter(Boolean)
            .map((action) =>
                action === "join"
                    ? link(textOf("lobby.join"), "")
                    : action === "watch"
                      ? link(textOf("lobby.watch"), "&role=viewer")
                      : end(),
            );
    }

    /** the rest shape, once @param {HTMLElement} card @param {string[]} assets */
    async draw(card, assets) {
        const key = assets.join();
        if (card.dataset.drawn === key) return;
        card.dataset.drawn = key;
        try {
            const surfaces = await Promise.all(
                assets.map(async (path) => {
                    const reply = await this.get(path.replace(/^\//, ""));
                    return decodeAsset(new Uint8Array(await reply.arrayBuffer()));
                }),
            );
            drawSurfaces(/** @type {HTMLCanvasElement} */ (card.querySelector("canvas")), surfaces);
        } catch {
            // a session that has just ended: without a picture
        }
    }

    /** @param {string[] | undefined} scenes */
    showScenes(scenes) {
        htmlById("lobby-open", this.page).hidden = !scenes;
        htmlById("lobby-no-scenes", this.page).hidden = scenes?.length !== 0;
        const list = htmlById("lobby-scenes", this.page);
        const key = scenes?.join("\n") ?? "";
        if (list.dataset.shown === key) return;
        list.dataset.shown = key;
        list.replaceChildren(
            ...(scenes ?? []).map((scene) => {
                const item = document.createElement("li");
                const button = Object.assign(document.createElement("button"), {
                    textContent: scene,
                    onclick: () => void this.order({ open: scene }),
                });
                button.setAttribute("aria-label", textOf("lobby.open", { scene }));
                item.append(button);
                return item;
            }),
        );
    }
}
