// The private words of the past may not come back. Reads every identifier of C and JavaScript (outside comments and strings) and
// every file name, splits it into words (pal_edge_m, edgeCount) and refuses those below; the message names the standard
// term. First it checks that it can fail.
// usage: node test_words.mjs [--count] [TREE]      --count: the words by number of uses and folder, in place of each place
import { readFileSync } from "node:fs";
import path from "node:path";
import { line_of, list_files, split_source } from "./source_text.mjs";

const count = process.argv.includes("--count");
const tree = process.argv.slice(2).find((a) => !a.startsWith("--")) ?? path.join(import.meta.dirname, "../..");

// word or words_with_underscores -> the term of the field
const terms = {
    "road roads": "transport",
    trio: "triple_buffer",
    "tangle tangled tangles untangle untangled": "inversion (a state), recovery (an action)",
    "torture tortured insult insults": "robustness, case",
    "trainee trainees": "client (trainee is a role)",
    "wish wishes": "options",
    "knob knobs": "parameter",
    "foresee foreseen foresees foresight": "predict, predicted",
    "price priced prices": "cost",
    "rescue rescues rescued": "safeguards",
    "brake brakes braked": "damping",
    relief: "inertia_relief",
    "ease eased eases": "blend, inverse_mass or ramp",
    "handed lag lags take_over takes_over go_on goes_on": "transfer",
    strips: "simd_blocks",
    "grab grabs grabbed grip grips gripped": "grasp",
    "holder holders": "tool_contact",
    anew: "again",
    "tell tells told": "report, log, notify",
    "say says said saying": "report, message",
    "obey obeys obeyed": "execute",
    "complain complains scold scolds": "send_error, rate limit",
    "workshop workshops waste wasted": "jobs, retired",
    "point_rows embed embeds embedded": "interpolation",
    "most least n_most n_least": "max, min",
    "patience wild calm": "backoff",
    zz: "zz_estimator",
    "felt firm": "haptic_stiffness, contact_stiffness",
    complaint: "error",
};
// the files of the session, the wire and the clients in which a tool has a holder: the member who moves it
const member_with_tool =
    /^(protocol\/wire|server\/(session\/(members|session)|net\/(stream|hub_(input|members|instruct|peers|jobs|verb)|http_pages))\.|clients\/(viewer|scripted_client)\/|tests\/(protocol|session|net|browser)\/)/;
// uses that are right: the identifier, or the file, matches
const right = {
    trainee: /^(.*role.*|PAL_(MEMBER|RIGHT)_TRAINEE|trainee)$/i, // a role of a member
    trainees: /role/i,
    relief: /inertia_?relief/i,
    zz: /zz_?(estimator|energy)|^server\/sim\/(core|elements|surface)\//i, // there the z-z component of a tensor
    holder: member_with_tool,
    holders: member_with_tool,
    // of a stylus; the opening of a gripper, a field of LCM messages
    grip: /^(protocol\/wire|server\/net\/hub_input|clients\/(haptic_bridge\/(device|servo|bridge_net)|link\/lcm_convert)|tests\/(protocol\/|net\/test_hub|fakes\/|clients\/test_(lcm|device)))/,
    most: /almost/i,
};
// words that are right in a sentence, which a name of five words or more is (tests are named so)
const plain = new Set(
    "most least say says said saying tell tells told ease eases calm wild felt firm waste go_on goes_on take_over takes_over anew".split(
        " ",
    ),
);
const keywords = new Set(Object.keys(terms).flatMap((words) => words.split(" ")));
const term_of = new Map(Object.entries(terms).flatMap(([words, term]) => words.split(" ").map((word) => [word, term])));
const longest = Math.max(...[...keywords].map((word) => word.split("_").length));

// the private words of a name
function private_words(name, file) {
    const words = name
        .replace(/([a-z0-9])([A-Z])/g, "$1_$2")
        .toLowerCase()
        .split(/[^a-z]+/)
        .filter(Boolean);
    const found = [];
    for (let i = 0; i < words.length; i++)
        for (let n = 1; n <= longest && i + n <= words.length; n++) {
            const word = words.slice(i, i + n).join("_");
            if (words.length >= 5 && plain.has(word)) continue;
            if (/^(most|least)$/.test(word) && words[i - 1] === "at") continue; // at_least
            if (keywords.has(word) && !right[word]?.test(name) && !right[word]?.test(file)) found.push(word);
        }
    return found;
}

function faults_of(file, text) {
    const faults = [];
    const add = (name, at) => {
        for (const word of private_words(name, file))
            faults.push({ file, line: at < 0 ? 1 : line_of(text, at), name, word });
    };
    add(path.basename(file).replace(/\.\w+$/, ""), -1);
    const code = split_source(file, text).code.replace(/^[ \t]*#[ \t]*include.*$/gm, "");
    const seen = new Set(); // a name is told once a file: what is renamed is renamed everywhere
    for (const { 0: name, index } of code.matchAll(/[A-Za-z_$][\w$]*/g)) {
        if (count || !seen.has(name)) add(name, index);
        seen.add(name);
    }
    return faults;
}

// planted: one fault each, and none
const planted = [
    ["a.c", "int x;\nstatic int pal_trio_make(void); /* trio */\n", ["2:trio"]],
    ["a.c", 'const char *s = "knob"; // knob\n#include "server/road.h"\n', []],
    ["a.c", "enum { PAL_MOST_NODES };\nint point_rows, inertia_relief;", ["1:most", "2:point_rows"]],
    ["a.c", "static void a_pose_is_told_at_most_once(void) {}\nint at_least;", []],
    ["grip.js", "const text = `knob ${toldRows} knob`, re = /knob/;", ["1:grip", "1:told"]],
];
for (const [file, text, wanted] of planted) {
    const got = faults_of(file, text).map((f) => `${f.line}:${f.word}`);
    if (got.join() === wanted.join()) continue;
    console.log(`self-test: ${file}: found [${got}], wanted [${wanted}]`);
    process.exit(2);
}

const folders = ["server", "protocol", "clients", "tests"];
const files = list_files(tree, folders, /\.([ch]|m?js)$/).filter((file) => !file.startsWith("tests/house/test_words."));
const faults = files.flatMap((file) => faults_of(file, readFileSync(path.join(tree, file), "utf8")));
if (count) {
    const uses = new Map();
    for (const { file, word } of faults) {
        const by = uses.get(word) ?? uses.set(word, new Map()).get(word);
        by.set(path.dirname(file), (by.get(path.dirname(file)) ?? 0) + 1);
    }
    const sum = (by) => [...by.values()].reduce((a, b) => a + b, 0);
    for (const [word, by] of [...uses].sort((a, b) => sum(b[1]) - sum(a[1]))) {
        const where = [...by].sort((a, b) => b[1] - a[1]).map(([folder, n]) => `${folder} ${n}`);
        console.log(`${String(sum(by)).padStart(6)} ${word} (${term_of.get(word)}): ${where.join(", ")}`);
    }
} else {
    for (const f of faults)
        console.log(`${f.file}:${f.line}: ${f.name}: "${f.word}" is a private word: ${term_of.get(f.word)}`);
}
console.log(`words: ${files.length} files, ${faults.length} private words`);
process.exit(files.length > 0 && faults.length === 0 ? 0 : 1);
