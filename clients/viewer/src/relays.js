// A full server names relays to who only watches: the same page at other addresses. This page then goes to one of them,
// and tries the server again as long as it knows of none.

const PAUSE_MS = 1000; // before it goes, and up to as much again: pages that are refused together come apart

/**
 * @typedef {{
 *   get: (url: string, options: RequestInit) => Promise<Response>,
 *   place: Pick<Location, "origin" | "search">, ticket: string, random: () => number,
 *   later: (call: () => void, ms: number) => void, go: (address: string) => void,
 * }} Environment ticket "": none
 */

/** @param {string} address @returns {URL | null} */
function read(address) {
    try {
        const url = new URL(address);
        return url.protocol === "http:" || url.protocol === "https:" ? url : null;
    } catch {
        return null;
    }
}

/**
 * The address of a relay of the wanted session: any of them, so that a crowd spreads, but not the one that has just
 * refused. It keeps what this address asks for, and the ticket behind the #, which browsers send to nobody.
 * @param {unknown} relays @param {Pick<Environment, "place" | "ticket" | "random">} env @returns {string | null}
 */
export function relayAddress(relays, { place, ticket, random }) {
    const wanted = new URLSearchParams(place.search);
    const session = wanted.get("session");
    const fitting = (Array.isArray(relays) ? relays : [])
        .map(read)
        .filter((url) => url !== null)
        .filter((url) => url.origin !== place.origin)
        .filter((url) => !session || (url.searchParams.get("session") ?? session) === session);
    const url = fitting[Math.floor(random() * fitting.length)];
    if (!url) return null;
    for (const [key, value] of wanted) url.searchParams.set(key, value);
    url.hash = ticket;
    return url.href;
}

export class RelayChoice {
    turn = 0; // of the refusals: grows when the server lets the page in after all
    going = false;

    /** @param {Environment} env */
    constructor(env) {
        this.env = env;
    }

    /** there is no place here, but relays have */
    async refused() {
        if (this.going) return;
        this.going = true;
        const turn = this.turn;
        const address = relayAddress(await this.list(), this.env);
        this.going = address !== null && turn === this.turn;
        if (!address || !this.going) return;
        const leave = () => turn === this.turn && this.env.go(address);
        this.env.later(leave, PAUSE_MS * (1 + this.env.random()));
    }

    admitted() {
        this.turn++;
        this.going = false;
    }

    /** @returns {Promise<unknown>} */
    async list() {
        try {
            const reply = await this.env.get("sessions", { cache: "no-store" });
            return reply.ok ? (await reply.json()).relays : null;
        } catch {
            return null;
        }
    }
}
