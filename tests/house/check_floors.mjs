// The floor check. An include points down: to a room on a lower floor, or to a file of its own room. Files never include
// each other in a ring. Prints each fault and one summary line; exit code 1 when there is any.
// usage: node check_floors.mjs [TREE]
import { readdirSync, readFileSync, statSync } from "node:fs";
import path from "node:path";

const tree = process.argv[2] ?? path.join(import.meta.dirname, "../..");

// rooms from the lowest floor up; rooms of one line do not see each other
const floors = [
    ["server/base", "protocol", "lcmtypes"],
    ["server/num", "server/rendering", "server/agones", "clients/link"],
    ["server/mesh/geometry", "clients/haptic_bridge", "clients/lcm_bridge", "clients/scripted_client"],
    ["server/mesh/files", "server/mesh/voxel"],
    ["server/mesh/scan", "server/mesh/cells"],
    ["server/mesh/volume"],
    ["server/sim/core"],
    ["server/sim/recovery"],
    ["server/sim/springs", "server/sim/elements", "server/sim/surface"],
    ["server/sim/subdivision", "server/sim/contact"],
    ["server/sim/implicit"],
    ["server/sim/solvers", "server/sim/models", "server/sim/effects"],
    ["server/sim/plan"],
    ["server/sim/world"],
    ["server/sim/transfer"],
    ["server/figure", "server/cli", "server/scene", "server/solve", "server/estimate"],
    ["server/calibrate", "server/robustness", "server/session"],
    ["server/study"],
    ["server/net/transport", "server/net/admission"],
    ["server/net", "clients/relay"],
    ["server/bench", "server/commands"],
    ["server"],
];
// what a room sees of the floors below it, where that is less than all
const narrow = {
    protocol: [],
    "clients/link": ["protocol", "server/base", "lcmtypes"],
    "clients/*": ["clients/link", "server/rendering", "protocol", "server/base", "lcmtypes"],
    "clients/relay": ["clients/link", "server/net/transport", "server/net/admission", "protocol", "server/base"],
    "server/net/transport": ["protocol", "server/base"],
    "server/net/admission": ["protocol", "server/base"],
    "server/rendering": ["protocol", "server/base"],
    "server/agones": ["server/base"],
    "server/net": [
        "server/net/transport",
        "server/net/admission",
        "server/session",
        "server/sim/",
        "server/mesh/",
        "server/num",
        "protocol",
        "server/base",
    ],
};
// files that may read the state of a model (body.h, model): its room, its recipe, its own components, and what prints or measures it
const own_state =
    /^server\/(sim\/(surface|subdivision|models)\/|sim\/effects\/(edge_spring|shape_spring|inflate|refine|cell_elastic)\.c|commands\/command_plan\.c|bench\/)/;
const level = new Map(floors.flatMap((rooms, i) => rooms.map((room) => [room, i])));
const faults = [];
const fault = (file, text) => faults.push(`${file}: ${text}`);

const walk = (folder) =>
    readdirSync(path.join(tree, folder), { withFileTypes: true }).flatMap((e) => {
        const name = `${folder}/${e.name}`;
        if (e.isDirectory()) return e.name === "node_modules" ? [] : walk(name);
        return /\.[ch]$/.test(e.name) ? [name] : [];
    });
const present = (folder) => statSync(path.join(tree, folder), { throwIfNoEntry: false });
const files = ["server", "protocol", "clients"].filter(present).flatMap(walk).sort();

function may(from, to) {
    if (from === to) return true;
    if (!level.has(from) || !level.has(to) || level.get(to) >= level.get(from)) return false;
    const client = from.startsWith("clients/") && from !== "clients/link";
    const seen = narrow[from] ?? narrow[client ? "clients/*" : from];
    if (seen) return seen.some((s) => to === s || (s.endsWith("/") && to.startsWith(s)));
    return (
        !to.startsWith("clients/") &&
        to !== "lcmtypes" &&
        (to !== "protocol" || level.get(from) >= level.get("server/net/transport"))
    );
}

const includes = new Map(); // unit (path without extension) -> units it includes
const unit = (file) => file.replace(/\.[ch]$/, "");
let seen = 0;
for (const file of files) {
    const text = readFileSync(path.join(tree, file), "utf8");
    const room = path.dirname(file);
    if (!level.has(room)) fault(file, `the room ${room} has no floor`);
    if (!includes.has(unit(file))) includes.set(unit(file), new Set());
    for (const [, target] of text.matchAll(/^[ \t]*#[ \t]*include[ \t]*"([^"]*)"/gm)) {
        seen++;
        if (/^palpate_\w+_t\.h$|^lcmtypes\//.test(target)) {
            if (!may(room, "lcmtypes")) fault(file, `includes "${target}": ${room} may not see lcmtypes`);
            continue;
        }
        if (!/^(server|protocol|clients)\//.test(target)) {
            fault(file, `includes "${target}", which is not named from the top of the tree`);
            continue;
        }
        const to = path.dirname(target);
        if (!may(room, to)) fault(file, `includes "${target}": ${room} may not see ${to}`);
        if (/^server\/sim\/(effects|solvers|models)$/.test(room) && target.endsWith(".c"))
            fault(file, `includes "${target}": effects never see each other`);
        if (unit(target) !== unit(file)) includes.get(unit(file)).add(unit(target));
    }
    if (
        file.startsWith("server/sim/") &&
        /^[ \t]*#[ \t]*include[ \t]*<(cjson|pthread|threads|sys\/socket|libwebsockets|lcm|fcntl|sys\/stat)/m.test(text)
    )
        fault(file, "sim has no JSON, threads, sockets or files");
    if (!own_state.test(file))
        for (const [read] of text.matchAll(/(?:->|\.)model\.(?:adaptive|solid)\b/g))
            fault(file, `reads ${read}: others than the model read body->dofs`);
    // a room reports by its results and by log; only commands print and exit (err.c: a failed assertion; flags.c: the manual)
    const quiet =
        room.startsWith("server/") &&
        !/^server\/(commands|bench|cli)$/.test(room) &&
        !/^server\/base\/(err|log|flags)\.c$/.test(file);
    const prints = text.match(/(?<!\w)(?:printf|puts|putchar|perror|_?exit|abort)\(|fprintf\(std(?:out|err)\b/);
    if (quiet && prints) fault(file, `${prints[0]}: a room below commands neither prints nor exits`);
    const lines = text.split("\n").length - 1;
    if (lines > 700) fault(file, `${lines} lines, more than 700`);
}

// rings: strongly connected units (Tarjan)
const index = new Map(),
    low = new Map(),
    stack = [],
    open = new Set();
let rings = 0;
function visit(u) {
    index.set(u, index.size);
    low.set(u, index.get(u));
    stack.push(u);
    open.add(u);
    for (const w of includes.get(u) ?? []) {
        if (!includes.has(w)) continue;
        if (!index.has(w)) visit(w);
        if (open.has(w)) low.set(u, Math.min(low.get(u), low.get(w)));
    }
    if (low.get(u) !== index.get(u)) return;
    const ring = [];
    for (let w; w !== u; ) {
        w = stack.pop();
        open.delete(w);
        ring.push(w);
    }
    if (ring.length < 2) return;
    rings++;
    fault(ring.sort()[0], `a ring of ${ring.length} files that include each other: ${ring.join(" ")}`);
}
for (const u of includes.keys()) if (!index.has(u)) visit(u);

// a name stands once in the tree; a folder has about 20 .c files
const names = new Map(),
    folders = new Map();
for (const file of files) {
    const name = path.basename(file);
    if (name === "main.c" || name === "tuning.h") continue; // each program has one, each room may have one
    if (names.has(name)) fault(file, `the name stands more than once in the tree: ${names.get(name)}`);
    names.set(name, file);
    if (/_parts\.h$/.test(name))
        fault(file, "a header of parts: a room has a core that knows nobody, and files that know the core");
    if (name.endsWith(".c")) folders.set(path.dirname(file), (folders.get(path.dirname(file)) ?? 0) + 1);
}
for (const [folder, n] of folders) if (n > 22) fault(folder, `${n} .c files, more than 22`);

// the top level holds what README.md says and nothing else
for (const entry of readdirSync(tree))
    if (
        !/^(\..*|CMakeLists\.txt|LICENSE|README\.md|clients|deploy|lcmtypes|protocol|server|tests|build.*)$/.test(entry)
    )
        fault(entry, "does not belong on the top level");

for (const line of faults) console.log(line);
console.log(`floors: ${seen} includes checked, ${rings} rings, ${faults.length} faults`);
process.exit(seen > 0 && faults.length === 0 ? 0 : 1);
