// Every reference resolves inside the tree. Reads comments and messages of the sources and all pages (.md) and checks
//   - papers: "paper B section 3.2", "paper A, Fig. 7", "Table I of paper C": the letter, and a section, figure, table or equation that it has;
//     a section goes by its word ("paper B 2.2" does not), and by its letter ("A 3.4" does not)
//   - errata: "erratum B12" is in server/mesh/README.md or server/sim/README.md
//   - files: a path, the end of a path or a file name that stands in the tree, and pages by the links of a page
//   - tests: "sim/test_absent" names a test's file
//   - sections: server/README.md section "Threads" is a heading of that page
// usage: node test_references.mjs [--count] [TREE]      --count: what does not resolve by number of uses, in place of each place
import { existsSync, readFileSync } from "node:fs";
import path from "node:path";
import { line_of, list_files, split_source } from "./source_text.mjs";

const count = process.argv.includes("--count");
const tree = process.argv.slice(2).find((a) => !a.startsWith("--")) ?? path.join(import.meta.dirname, "../..");

// what the papers of README.md's references have: sections, number of figures, tables, equations
const papers = {
    A: {
        sections: "1 2 2.1 2.2 3 3.1 3.2 3.2.1 3.2.2 3.3 3.4 3.4.1 3.4.2 3.4.3 3.4.4 3.4.5 4 4.1 4.2 5",
        figures: 14,
        tables: 1,
        equations: 20,
    },
    B: {
        sections: "1 1.1 1.2 1.3 1.4 2 2.1 2.2 2.3 3 3.1 3.2 3.3 3.4 3.5 3.6 4 4.1 4.2 4.3 5 5.1 5.2 5.3",
        figures: 17,
        tables: 1,
        equations: 0,
    },
    C: { sections: "", figures: 13, tables: 1, equations: 10 },
};
// files that are made when the tree is built or served, or that belong to the system and to other programs
const foreign =
    /^(palpate_\w+_t\.h|.*\.node|three(\.module)?(\.min)?\.js|OrbitControls\.js|cholmod\.h|lws?\.h|(sys|lcm|cjson|lz4|suitesparse|openblas)\/.*|\w*math\.h|std\w+\.h|string\.h|Node\.js|node\.js|three\.js|config\.h)$/;
const errata_pages = ["server/sim/README.md", "server/mesh/README.md"];

const pages = (text) => text.replace(/\n[ \t]*(\*|\/\/|#)?[ \t]*/g, (m) => " ".repeat(m.length)); // lines run on
const numbers = (text) =>
    [...text.matchAll(/(\d+)(?:[a-z]\b)?(?:\s*(?:-|–|to)\s*(\d+))?/g)].flatMap((m) => [
        Number(m[1]),
        Number(m[2] ?? m[1]),
    ]);
const roman = (text) => text.replace(/\bI\b/g, "1");
const part =
    /([Ss]ections?|[Ff]igures?|[Ff]igs?\.?|[Tt]ables?|[Ee]quations?|[Ee]qs?\.?)\s+((?:\d+(?:\.\d+)*[a-z]?|I\b)(?:\s*(?:,|-|–|to|and|or)\s*\d+(?:\.\d+)*[a-z]?\b)*)/;

function paper_fault(letter, word, list) {
    const paper = papers[letter];
    if (/^section/i.test(word)) {
        const lost = list
            .split(/\s*(?:,|-|–|to|and|or)\s+|\s*[-–,]\s*/)
            .filter((s) => s && !paper.sections.split(" ").includes(s));
        return lost.length ? `paper ${letter} has no section ${lost[0]}` : null;
    }
    const what = /^fig/i.test(word) ? "figures" : /^tab/i.test(word) ? "tables" : "equations";
    const bad = numbers(roman(list)).find((n) => n < 1 || n > paper[what]);
    return bad === undefined ? null : `paper ${letter} has no ${what.slice(0, -1)} ${bad}`;
}

function headings(page) {
    const text = readFileSync(path.join(tree, page), "utf8");
    return [...text.matchAll(/^(?:#+\s+|\*\*)(.+?)(?:\*\*|$)/gm)].map((m) =>
        m[1].toLowerCase().replace(/[`.:]/g, "").trim(),
    );
}

const all = list_files(tree, [""], /./);
const known = new Set(all);
const ends = new Map(); // file name -> paths
for (const file of all) ends.set(path.basename(file), [...(ends.get(path.basename(file)) ?? []), file]);
const folders = new Set(all.flatMap((file) => file.split("/").map((_, i, parts) => parts.slice(0, i).join("/"))));
// the file of the tree that a word of `from` names: from the top, beside it, or by the end of its path
function resolve(name, from) {
    const clean = name.replace(/^\.\//, "");
    const beside = path.posix.normalize(path.posix.join(path.posix.dirname(from), clean));
    if (
        known.has(clean) ||
        known.has(beside) ||
        folders.has(clean.replace(/\/$/, "")) ||
        folders.has(beside.replace(/\/$/, ""))
    )
        return clean;
    return (ends.get(path.basename(clean)) ?? []).find((file) => file === clean || file.endsWith(`/${clean}`));
}

function faults_of(file, text) {
    const faults = [];
    const add = (at, name, why) => faults.push({ file, line: line_of(text, at), name, why });
    const parts = split_source(file, text);
    const prose = pages(parts.comment),
        page = file.endsWith(".md");
    const text_of = page ? prose : prose + "\n" + pages(parts.string); // strings: papers only
    const place = (at) => (at > prose.length ? at - prose.length - 1 : at);
    // papers
    for (const m of text_of.matchAll(/\bpaper ([A-Z])\b(?:'s)?(?:,? (\d[\d.]*\d|\d))?/g)) {
        if (!papers[m[1]]) add(place(m.index), m[0], "there is no such paper");
        else if (m[2]) add(place(m.index), m[0], `say "paper ${m[1]} section ${m[2]}"`);
    }
    for (const m of text_of.matchAll(new RegExp(`\\bpaper ([ABC])(?:'s)?,? \\(?${part.source}`, "g"))) {
        const why = paper_fault(m[1].toUpperCase(), m[2], m[3]);
        if (why) add(place(m.index), m[0], why);
    }
    for (const m of text_of.matchAll(new RegExp(`${part.source} of paper ([ABC])\\b`, "g"))) {
        const why = paper_fault(m[3], m[1], m[2]);
        if (why) add(place(m.index), m[0], why);
    }
    for (const m of prose.matchAll(
        /(?<![\w.'"(]|paper |\bpart )\(?([ABC]) (\d\.\d(?:\.\d)*|eqs?\.|figs?\.)(?=[\s,;:)–-]|$)/gi,
    ))
        if (/[ABC]/.test(m[1])) add(m.index, m[0], `say "paper ${m[1]} ..."`);
    for (const m of prose.matchAll(/\berrat(?:um|a) ([ABC]\d+(?:(?:,| and| to|-|–)\s*[ABC]\d+)*)/g))
        for (const id of m[1].match(/[ABC]\d+/g)) {
            const lists = (page) =>
                known.has(page) && new RegExp(`\\b${id}\\b`).test(readFileSync(path.join(tree, page), "utf8"));
            if (!errata_pages.some(lists)) add(m.index, `erratum ${id}`, `is not in ${errata_pages.join(" or ")}`);
        }
    // files
    const path_word =
        /(?<![\w/.$*{<%-])(?:\.\.?\/)*[A-Za-z_.][\w.-]*(?:\/[\w.-]+)*\.(?:c|h|md|mjs|js|sh|lcm|css|html)(?![\w*{/])/g;
    const tree_word = /(?<![\w/.$*-])(?:server|protocol|clients|tests|deploy|lcmtypes|\.github)(?:\/[\w.-]+)+\/?/g;
    const words = new Map();
    for (const re of [path_word, tree_word])
        for (const m of prose.matchAll(re)) words.set(m.index, m[0].replace(/[.-]+$/, ""));
    for (const [at, word] of words) {
        if (
            foreign.test(word) ||
            /^(\.\.\/)+(shared|data)\//.test(word) ||
            /^[A-Z]+\.\w+$/.test(word.replace("README.md", "x"))
        )
            continue;
        if (!resolve(word, file) && !ends.has(`${path.basename(word)}.c`)) add(at, word, "is not in the tree");
    }
    for (const m of prose.matchAll(/(?<![\w/.])(?:[a-z_]+\/)*test_[a-z_0-9]+(?![\w.*<{(/])/g))
        if (!["c", "sh", "mjs"].some((end) => resolve(`${m[0]}.${end}`, file)))
            add(m.index, m[0], "is not a test of the tree");
    if (page)
        for (const m of text.matchAll(/\]\((?!https?:|#|mailto:)([^)#\s]+)(?:#[^)]*)?\)/g))
            if (!existsSync(path.join(tree, path.dirname(file), m[1]))) add(m.index, m[1], "is a link to nothing");
    // sections of pages
    for (const m of prose.matchAll(
        /([\w/.]*README\.md),? (?:section )?"([^"]+)"|([\w/.]*README\.md),? section ([A-Z][\w -]*)/g,
    )) {
        const target = resolve(m[1] ?? m[3], file),
            wanted = (m[2] ?? m[4]).toLowerCase().replace(/[`.:]/g, "").trim();
        if (
            target &&
            known.has(target) &&
            !headings(target).some((h) => h.includes(wanted) || (m[4] && wanted.startsWith(h)))
        )
            add(m.index, m[0], "the page has no such heading");
    }
    return faults;
}

// planted: what does not resolve, and what does
const planted = [
    ["server/a.c", "/* paper B 2.2 */\n", ["1:paper B 2.2"]],
    [
        "server/a.c",
        "/* Voxels (paper B section 2.2, Table 1 of paper B, paper C Figs. 10 and 12). */\nint x; /* paper A sections 3.1 and\n * 3.4.4 */",
        [],
    ],
    ["server/a.c", "/* paper A section 3.9, and paper C Fig. 14 */", ["1:paper A section 3.9", "1:paper C Fig. 14"]],
    ["server/a.c", "int x;\n/* the law is in numerics.md part 3 */", ["2:numerics.md"]],
    ["server/a.c", "/* tests/house/test_words.mjs, house/test_words, server/sim/gone.c */", ["1:server/sim/gone.c"]],
    ["server/a.c", 'const char *s = "numerics.md (paper B 2.2)";', ["1:paper B 2.2"]],
    ["a.md", "See [there](nowhere.md).", ["1:nowhere.md", "1:nowhere.md"]],
];
for (const [file, text, wanted] of planted) {
    const got = faults_of(file, text).map((f) => `${f.line}:${f.name}`);
    if (got.join() === wanted.join()) continue;
    console.log(`self-test: ${file}: found [${got.join(" | ")}], wanted [${wanted.join(" | ")}]`);
    process.exit(2);
}

const read = all.filter(
    (file) =>
        /\.(c|h|lcm|m?js|sh|md|html|css|cmake)$|CMakeLists\.txt$/.test(file) &&
        !/test_references\.mjs$|^tests\/data\/|package-lock/.test(file),
);
const faults = read.flatMap((file) => faults_of(file, readFileSync(path.join(tree, file), "utf8")));
if (count) {
    const uses = new Map();
    for (const { file, name, why } of faults) {
        const key = `${name} (${why})`;
        uses.set(key, [...(uses.get(key) ?? []), path.dirname(file)]);
    }
    for (const [key, list] of [...uses].sort((a, b) => b[1].length - a[1].length))
        console.log(`${String(list.length).padStart(5)} ${key}: ${[...new Set(list)].slice(0, 8).join(", ")}`);
} else {
    for (const f of faults) console.log(`${f.file}:${f.line}: ${f.name}: ${f.why}`);
}
console.log(`references: ${read.length} files, ${faults.length} that do not resolve`);
process.exit(read.length > 0 && faults.length === 0 ? 0 : 1);
