import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { roleOfTicket, takeTicket } from "../src/ticket.js";

/** a ticket as protocol/README.md lays it out: 62 bytes, the third is the highest role @param {number} role */
function ticketOf(role) {
    const bytes = Buffer.alloc(62, 0xfb);
    bytes[0] = 1;
    bytes[2] = role;
    return bytes.toString("base64url");
}

test("the page asks for the role of its ticket, so that the server has nothing to refuse", () => {
    assert.deepEqual([0, 1, 2].map(ticketOf).map(roleOfTicket), ["viewer", "trainee", "instructor"]);
    assert.equal(
        roleOfTicket(ticketOf(7)),
        undefined,
        "a role of later versions: the page asks as it would without a ticket",
    );
});

test("a ticket leaves the address, and lasts for the tab", () => {
    const kept = new Map();
    const storage = /** @type {Storage} */ (
        /** @type {unknown} */ ({
            setItem: (/** @type {string} */ k, /** @type {string} */ v) => kept.set(k, v),
            getItem: (/** @type {string} */ k) => kept.get(k) ?? null,
        })
    );
    let address = "";
    const history = /** @type {History} */ (
        /** @type {unknown} */ ({
            replaceState: (/** @type {any} */ s, /** @type {string} */ t, /** @type {string} */ a) => (address = a),
        })
    );
    const place = (/** @type {string} */ hash) => /** @type {Location} */ ({ hash, pathname: "/", search: "?lang=de" });
    const ticket = ticketOf(1);
    assert.equal(ticket.length, 83);
    assert.equal(
        takeTicket(place("#" + ticket), history, () => storage),
        ticket,
    );
    assert.equal(address, "/?lang=de");
    assert.equal(
        takeTicket(place(""), history, () => storage),
        ticket,
    );
    assert.equal(
        takeTicket(place("#view"), history, () => storage),
        ticket,
        "another fragment is no ticket",
    );
});
