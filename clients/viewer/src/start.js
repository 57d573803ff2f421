// What an address shows: a session, or the lobby where there is a choice and none is named.
import { Lobby, offersChoice } from "./lobby.js";
import { fillTexts } from "./text.js";
import { takeTicket } from "./ticket.js";

fillTexts(document);
const ticket = takeTicket(location, history, () => sessionStorage);
const lobby = new Lobby(document, ticket, fetch.bind(window));
const named = new URLSearchParams(location.search).has("session");
const list = named ? null : await lobby.read();
if (list && offersChoice(list)) lobby.open(list);
else await import("./main.js");
