// Source files of the tree, and their text split into code, comments and strings. Each of the three has the length of the text: what belongs to
// another one is blank, line breaks stay, so that a place in it is a place in the file.
import { readdirSync } from "node:fs";
import path from "node:path";

// paths below the folders whose names match, from the top of the tree, sorted
export function list_files(tree, folders, pattern) {
    const walk = (folder) =>
        readdirSync(path.join(tree, folder), { withFileTypes: true }).flatMap((entry) => {
            const name = folder ? `${folder}/${entry.name}` : entry.name;
            if (entry.isDirectory()) return /^(node_modules|build.*|\.git)$/.test(entry.name) ? [] : walk(name);
            return pattern.test(name) ? [name] : [];
        });
    return folders.flatMap(walk).sort();
}

export const line_of = (text, at) => text.slice(0, at).split("\n").length;

const whole_line = { sh: /(?<=^|\s)#.*$/gm, html: /<!--[\s\S]*?-->/g, md: /[\s\S]+/g };
const kind_of = (file) =>
    /\.(c|h|lcm|cpp|css)$/.test(file)
        ? "c"
        : /\.m?js$/.test(file)
          ? "js"
          : /\.md$/.test(file)
            ? "md"
            : /\.html$/.test(file)
              ? "html"
              : "sh";
const blank = (text) => text.replace(/[^\n]/g, " ");

export function split_source(file, text) {
    const kind = kind_of(file);
    const out = { code: "", comment: "", string: "" };
    const put = (to, part) => {
        for (const name of Object.keys(out)) out[name] += name === to ? part : blank(part);
    };
    if (whole_line[kind]) {
        let at = 0;
        for (const m of text.matchAll(whole_line[kind])) {
            put("code", text.slice(at, m.index));
            put("comment", m[0]);
            at = m.index + m[0].length;
        }
        put("code", text.slice(at));
        return out;
    }
    // a regular expression stands where a value may begin; a template's ${} holds code again
    const token =
        /\/\*[\s\S]*?\*\/|\/\/[^\n]*|"(?:[^"\\\n]|\\[\s\S])*"|'(?:[^'\\\n]|\\[\s\S])*'|`|[{}]|\/(?![*/])(?:[^/\\[\n]|\\.|\[(?:[^\]\\\n]|\\.)*\])+\/[a-z]*/g;
    const open = []; // of each brace whether it is a template's
    let at = 0;
    const template = (from) => {
        let i = from;
        while (i < text.length && text[i] !== "`" && !(text[i] === "$" && text[i + 1] === "{"))
            i += text[i] === "\\" ? 2 : 1;
        const end = Math.min(i + (text[i] === "$" ? 2 : 1), text.length);
        if (text[i] === "$") open.push(true);
        put("string", text.slice(from, end));
        return end;
    };
    for (let m; (m = token.exec(text)); ) {
        put("code", text.slice(at, m.index));
        at = m.index + m[0].length;
        const first = m[0][0];
        if (m[0].startsWith("/*") || m[0].startsWith("//")) {
            put("comment", m[0]);
        } else if (first === '"' || first === "'") {
            put("string", m[0]);
        } else if (
            first === "/" &&
            kind === "js" &&
            /(^|[=(,:[!&|?{};+\-*%<>~^]|return|typeof|=>)\s*$/.test(out.code.slice(-40))
        ) {
            put("string", m[0]);
        } else if (first === "/") {
            put("code", "/"); // a quotient: what follows is read again
            at = m.index + 1;
        } else if (kind === "js" && first === "`") {
            put("string", "`");
            at = template(at);
        } else if (kind === "js" && first === "}" && open.pop()) {
            put("string", "}");
            at = template(at);
        } else {
            if (kind === "js" && first === "{") open.push(false);
            put("code", m[0]);
        }
        token.lastIndex = at;
    }
    put("code", text.slice(at));
    return out;
}
