// The ticket of this page: it comes behind the # of the address, which browsers send to nobody, and is kept for this
// tab. The address bar loses it, so that a copied address or a shared screen gives no rights away.

import { ROLES } from "./control_table.js";

const KEY = "palpate.ticket";
const PATTERN = /^[\w-]{83}$/;

/** @param {Location} place @param {History} history @param {() => Storage} storage may throw @returns {string} "": none */
export function takeTicket(place, history, storage) {
    const given = place.hash.slice(1);
    try {
        if (PATTERN.test(given)) storage().setItem(KEY, given);
        const kept = storage().getItem(KEY) ?? "";
        if (given && kept === given) history.replaceState(null, "", place.pathname + place.search);
        return kept;
    } catch {
        return PATTERN.test(given) ? given : ""; // without storage it stays in the address
    }
}

/** the highest role of a ticket: the third of its bytes @param {string} ticket */
export const roleOfTicket = (ticket) =>
    ROLES[atob(ticket.slice(0, 4).replaceAll("-", "+").replaceAll("_", "/")).charCodeAt(2)];
