// Makes the npm package: src/client.js with all that it imports, their types, this folder's page and README.
// usage: node pack.mjs FOLDER PACKAGES; writes FOLDER/palpate-client and FOLDER/palpate-client-VERSION.tgz. PACKAGES has
// node_modules with the type compiler: build/viewer_packages of deploy/common.sh.
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const sources = join(here, "..", "src");
const [folder, packages] = process.argv.slice(2).map((name) => resolve(name));
const stage = join(folder, "palpate-client");
mkdirSync(join(stage, "src"), { recursive: true });

/** @type {string[]} */
const files = ["client.js"];
for (const name of files) {
    const text = readFileSync(join(sources, name), "utf8");
    for (const [, imported] of text.matchAll(/(?:from |import\()"\.\/([\w.]+)"/g))
        if (!files.includes(imported)) files.push(imported);
    copyFileSync(join(sources, name), join(stage, "src", name));
}
for (const name of ["package.json", "README.md", "index.html", "example.js"])
    copyFileSync(join(here, name), join(stage, name));
copyFileSync(join(here, "..", "..", "..", "LICENSE"), join(stage, "LICENSE"));

const compiler = {
    extends: join(here, "..", "jsconfig.json"),
    compilerOptions: {
        noEmit: false,
        declaration: true,
        emitDeclarationOnly: true,
        outDir: join(stage, "types"),
        types: [],
    },
    include: [join(stage, "src", "*.js")],
};
writeFileSync(join(folder, "tsconfig.json"), JSON.stringify(compiler));
const tsc = join(packages, "node_modules", "typescript", "bin", "tsc");
execFileSync(process.execPath, [tsc, "-p", join(folder, "tsconfig.json")], { stdio: "inherit" });
execFileSync("npm", ["pack", "--silent", "--pack-destination", folder], { cwd: stage, stdio: "inherit" });
