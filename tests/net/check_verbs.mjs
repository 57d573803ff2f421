// Compares the commands that the page sends with the server's table of verbs: each exists there.
// usage: node check_verbs.mjs PALPATE [FOLDER_OF_THE_PAGE]
import { execFileSync } from "node:child_process";
import { readFileSync, readdirSync } from "node:fs";
import path from "node:path";

const [palpate, folder = path.join(import.meta.dirname, "../../clients/viewer/src")] = process.argv.slice(2);
const table = execFileSync(palpate, ["serve", "--help-protocol"], { encoding: "utf8" });
const verbs = new Map(
    table
        .trim()
        .split("\n")
        .map((line) => line.split("\t"))
        .map(([name, , args]) => [name, args.split(" ").filter((key) => key && key !== "|")]),
);
let sent = 0, faults = 0;
for (const file of readdirSync(folder).filter((name) => name.endsWith(".js") && name !== "control_table.js")) {
    const text = readFileSync(path.join(folder, file), "utf8");
    for (const [, verb, args] of text.matchAll(/\bverb: "(\w+)"(?:,[^{}]*args: \{([^}]*)\})?/g)) {
        sent++;
        const keys = [...(args ?? "").matchAll(/(?:^|,)\s*(\w+)/g)].map((m) => m[1]);
        const wrong = verbs.has(verb) ? keys.filter((key) => !verbs.get(verb).includes(key)) : [verb];
        for (const word of wrong) console.log(`${file}: ${verb}: the server knows no ${word}`);
        faults += wrong.length;
    }
}
console.log(`verbs: ${verbs.size} in the table, ${sent} literals on the page, ${faults} faults`);
process.exit(verbs.size > 20 && sent > 5 && faults === 0 ? 0 : 1);
