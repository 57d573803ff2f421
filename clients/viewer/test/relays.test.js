// Where a page goes that only watches and is refused by a full server.
import assert from "node:assert/strict";
import { test } from "node:test";
import { RelayChoice, relayAddress } from "../src/relays.js";

const env = { place: { origin: "http://full:8090", search: "?session=liver&name=Eve" }, ticket: "", random: () => 0 };

test("a relay is any of those that show the session, with what the address asked for", () => {
    const list = ["http://a:8092/", "https://b.example/", "http://c/?session=liver", "http://d/?session=heart"];
    const chosen = [0, 0.4, 0.99].map((r) => relayAddress(list, { ...env, random: () => r }));
    assert.deepEqual(chosen, [
        "http://a:8092/?session=liver&name=Eve",
        "https://b.example/?session=liver&name=Eve",
        "http://c/?session=liver&name=Eve",
    ]);
    const anywhere = { ...env, place: { origin: "http://full:8090", search: "" } };
    assert.equal(relayAddress(["http://d/?session=heart"], anywhere), "http://d/?session=heart");
    assert.equal(relayAddress(["http://a/"], { ...anywhere, ticket: "AQEC" }), "http://a/#AQEC");
});

test("not the relay that has refused, nor what is no address of a page", () => {
    assert.equal(relayAddress(["http://full:8090/"], env), null);
    assert.equal(relayAddress(["javascript:alert(1)", "relay", 7, null], env), null);
    assert.equal(relayAddress([], env), null);
    assert.equal(relayAddress(undefined, env), null);
    assert.equal(relayAddress("http://a/", env), null);
});

/** @param {unknown} relays */
function page(relays) {
    /** @type {{call: () => void, ms: number}[]} */
    const waiting = [];
    /** @type {string[]} */
    const gone = [];
    const get = async (/** @type {string} */ url) => {
        assert.equal(url, "sessions");
        if (relays instanceof Error) throw relays;
        return /** @type {Response} */ (/** @type {unknown} */ ({ ok: true, json: async () => ({ relays }) }));
    };
    const later = (/** @type {() => void} */ call, /** @type {number} */ ms) => void waiting.push({ call, ms });
    const choice = new RelayChoice({ ...env, random: () => 0.5, get, later, go: (address) => void gone.push(address) });
    return { choice, waiting, gone };
}

test("it goes after a pause, once, and not when the server has let it in meanwhile", async () => {
    const a = page(["http://a/"]);
    await Promise.all([a.choice.refused(), a.choice.refused()]);
    assert.deepEqual(
        a.waiting.map(({ ms }) => ms),
        [1500],
    );
    a.waiting[0].call();
    assert.deepEqual(a.gone, ["http://a/?session=liver&name=Eve"]);

    const b = page(["http://b/"]);
    await b.choice.refused();
    b.choice.admitted();
    b.waiting[0].call();
    assert.deepEqual(b.gone, []);
    // a later refusal is another one
    await b.choice.refused();
    b.waiting[1].call();
    assert.equal(b.gone.length, 1);

    const c = page(["http://c/"]);
    const asked = c.choice.refused();
    c.choice.admitted();
    await asked;
    assert.equal(c.waiting.length, 0);
});

test("without relays, or without an answer, it stays and asks at the next refusal again", async () => {
    for (const relays of [undefined, [], new Error("no answer")]) {
        const { choice, waiting } = page(relays);
        await choice.refused();
        assert.equal(waiting.length, 0);
        assert.equal(choice.going, false);
    }
});
