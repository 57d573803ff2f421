// Refusals of sculpting commands in plain words: the server's sentences name cells, faces and numbers. Pure.
import { text } from "./text.js";

/** @typedef {import("./text.js").TextKey} TextKey */

/** what the server's sentence contains, and the text shown for it @type {[RegExp, TextKey][]} */
const REFUSALS = [
    [/is the last one/, "sculpt.refused.last"],
    [/same face twice/, "sculpt.refused.same"],
    [/have vertex .+ in common/, "sculpt.refused.touch"],
    [/must have equally many/, "sculpt.refused.corners"],
    [/would vanish/, "sculpt.refused.joined"],
    [/lies between cells/, "sculpt.refused.outside"],
    [/folds|folded/, "sculpt.refused.fold"],
    [/no area|no positive volume/, "sculpt.refused.flat"],
    [
        /is no ball|in pieces|in another order|of the same cell already|inside out|two cells at most|third face|run round/,
        "sculpt.refused.invalid",
    ],
    [/corners, .+ is the most/, "sculpt.refused.many"],
    [/: nothing of/, "sculpt.refused.nowhere"],
    [/both ends of the curve/, "sculpt.refused.ends"],
    [/nothing to undo/, "sculpt.refused.undo"],
    [/nothing to redo/, "sculpt.refused.redo"],
    [/strokes already/, "sculpt.refused.strokes"],
    [/leaves nothing of it/, "sculpt.refused.empty"],
    [/take a tool first/, "sculpt.refused.tool"],
    [/commands wait already|have taken much time/, "sculpt.refused.busy"],
    [/a step would take/, "sculpt.refused.slow"],
];

/** @param {string} sentence of the server @returns {string} */
export function refusalText(sentence) {
    const known = REFUSALS.find(([pattern]) => pattern.test(sentence));
    return known ? text(known[1]) : sentence;
}
