// Files of `palpate replay --gltf` read by three.js's loader, and strictly by the specification.
//
// usage: node read_gltf.mjs PACKAGES points FILE.glb POINTS.json    every vertex is one of the points, as a float
//        node read_gltf.mjs PACKAGES surface FILE.glb SURFACE.json  vertices and triangles are those of the surface
//        node read_gltf.mjs PACKAGES box FILE.glb FILE.obj MM...    a box at rest of this size with images at its faces
//        node read_gltf.mjs PACKAGES colours TABLE.c LOOKS.js       colours of appearances are those of the page
// The JSON files are made by read_exports.py. Prints one line for each fault; exit code 1 when there is one, 77 without
// three.js in the folder PACKAGES.
import { existsSync, readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [packages, kind, file, ...rest] = process.argv.slice(2);
const faults = [];
const fault = (text) => faults.push(text);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const less = (a, b) => a.map((v, c) => v - b[c]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((v) => v / Math.hypot(...a));
const triples = (list) => Array.from({ length: list.length / 3 }, (_, i) => [...list.slice(3 * i, 3 * i + 3)]);

/** the two chunks by the specification: version 2, lengths, padding, types */
function chunks(bytes) {
    const view = new DataView(bytes);
    const at = (k) => view.getUint32(k, true);
    if (at(0) !== 0x46546c67 || at(4) !== 2 || at(8) !== bytes.byteLength) fault("the header is not that of glTF 2");
    const n = at(12);
    if (n % 4 || at(16) !== 0x4e4f534a) fault("the first chunk is not JSON");
    if (at(20 + n) % 4 || at(24 + n) !== 0x004e4942) fault("the second chunk is not binary");
    if (28 + n + at(20 + n) !== bytes.byteLength) fault("the chunks do not fill the file");
    return { json: JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, n))), start: 28 + n };
}

/** the numbers of an accessor, which lie in its view, as this does in the buffer */
function numbers(bytes, { json, start }, index) {
    const a = json.accessors[index];
    const v = json.bufferViews[a.bufferView];
    const width = { SCALAR: 1, VEC2: 2, VEC3: 3 }[a.type];
    const n = a.count * width;
    if (v.byteOffset % 4 || v.byteLength !== 4 * n || v.byteOffset + v.byteLength > json.buffers[0].byteLength)
        fault(`accessor ${index} does not fit its view`);
    const list = new (a.componentType === 5126 ? Float32Array : Uint32Array)(bytes, start + v.byteOffset, n);
    if (!a.min) return list;
    for (let c = 0; c < width; c++) {
        const some = list.filter((_, i) => i % width === c);
        const low = some.reduce((x, y) => Math.min(x, y));
        const high = some.reduce((x, y) => Math.max(x, y));
        if (Math.fround(a.min[c]) !== low || Math.fround(a.max[c]) !== high) fault(`accessor ${index}: wrong box`);
    }
    return list;
}

/** its primitives by the specification: {x, normal, uv, tri, material} */
function primitives(bytes) {
    const glb = chunks(bytes);
    const all = glb.json.meshes.flatMap((mesh) => mesh.primitives);
    return all.map(({ attributes, indices, material, mode }) => {
        if (mode !== 4) fault("a primitive is not of triangles");
        if (!glb.json.accessors[attributes.POSITION].min) fault("positions have no box");
        const read = (index) => numbers(bytes, glb, index);
        const uv = attributes.TEXCOORD_0 === undefined ? null : read(attributes.TEXCOORD_0);
        const x = triples(read(attributes.POSITION));
        const tri = triples(read(indices));
        const normal = triples(read(attributes.NORMAL));
        if (tri.flat().some((v) => v >= x.length)) fault("a triangle has a vertex that is not there");
        // the length of a float vector
        if (normal.some((v) => Math.abs(Math.hypot(...v) - 1) > 1e-6)) fault("a normal is not of unit length");
        return { x, tri, normal, uv, material: glb.json.materials[material] };
    });
}

/** on a smooth closed surface the normals of vertices look to the side of their triangles */
function checkNormals({ x, tri, normal }) {
    let volume = 0;
    let wrong = 0;
    for (const t of tri) {
        const [a, b, c] = t.map((v) => x[v]);
        const n = cross(less(b, a), less(c, a));
        volume += dot(a, cross(b, c)) / 6;
        if (
            dot(
                n,
                t.map((v) => normal[v]).reduce((p, q) => p.map((v, k) => v + q[k])),
            ) <= 0
        )
            wrong++;
    }
    if (!(volume > 0)) fault("the surface is inside out");
    if (wrong > 0.001 * tri.length) fault(`the normals of ${wrong} triangles look to their back`);
}

/** what three.js makes of it agrees: vertices, and z of the scene is up, which is y there */
async function checkLoader(bytes, parts) {
    const loader = `${packages}/node_modules/three/examples/jsm/loaders/GLTFLoader.js`;
    const { GLTFLoader } = await import(pathToFileURL(loader).href);
    const { scene } = await new GLTFLoader().parseAsync(bytes, "");
    const meshes = [];
    scene.updateMatrixWorld(true);
    scene.traverse((node) => node.isMesh && meshes.push(node));
    if (meshes.length !== parts.length) return fault(`three.js finds ${meshes.length} meshes`);
    meshes.forEach((mesh, k) => {
        const { position } = mesh.geometry.attributes;
        if (position.array.some((v, i) => v !== parts[k].x[Math.floor(i / 3)][i % 3]))
            fault("three.js: other vertices");
        const first = mesh.localToWorld(mesh.position.clone().fromArray(parts[k].x[0])).toArray();
        const [x, y, z] = parts[k].x[0];
        // a rotation of doubles of less than 1 m
        if (Math.hypot(...less(first, [x, z, -y])) > 1e-15)
            fault(`three.js: a vertex is at ${first}, not ${x} ${z} ${-y}`);
    });
}

async function points() {
    const bytes = Uint8Array.from(readFileSync(file)).buffer;
    const parts = primitives(bytes);
    const wanted = new Set(JSON.parse(readFileSync(rest[0])).points.map((p) => p.map(Math.fround).join()));
    if (!parts[0] || parts[0].x.length < 100) fault("there is hardly a vertex");
    for (const { x } of parts)
        for (const v of x) if (!wanted.has(v.join())) return fault(`${v} is not a point of the recording`);
    parts.forEach(checkNormals);
    await checkLoader(bytes, parts);
}

async function surface() {
    const bytes = Uint8Array.from(readFileSync(file)).buffer;
    const parts = primitives(bytes);
    const wanted = JSON.parse(readFileSync(rest[0]));
    if (JSON.stringify(parts[0].x) !== JSON.stringify(wanted.points)) fault("other vertices");
    if (JSON.stringify(parts[0].tri) !== JSON.stringify(wanted.triangles)) fault("other triangles");
    parts.forEach(checkNormals);
    await checkLoader(bytes, parts);
}

/** size in mm; the images of the materials of the OBJ lie beside it as NAME.png */
function box() {
    const bytes = Uint8Array.from(readFileSync(file)).buffer;
    const glb = chunks(bytes);
    const parts = primitives(bytes);
    const half = rest.slice(1).map((v) => v / 2000);
    const corners = [];
    const places = [];
    const faces = [];
    let name = "";
    for (const line of readFileSync(rest[0], "utf8").split("\n")) {
        const [word, ...words] = line.split(" ");
        if (word === "v") corners.push(words.map((v, c) => v / 1000 - half[c]));
        if (word === "vt") places.push(words.map(Number));
        if (word === "usemtl") name = words[0];
        if (word === "f") faces.push({ name, corners: words.map((w) => w.split("/").map((v) => v - 1)) });
    }
    const named = [...new Set(faces.map((face) => face.name))];
    if (parts.length !== named.length) fault(`${parts.length} parts, not ${named.length}`);
    parts.forEach(({ x, tri, uv, material }, k) => {
        const image = glb.json.images[glb.json.textures[material.pbrMetallicRoughness.baseColorTexture.index].source];
        const { byteOffset, byteLength } = glb.json.bufferViews[image.bufferView];
        const wanted = readFileSync(`${rest[0].replace(/[^/]*$/, "")}${named[k]}.png`);
        if (image.mimeType !== "image/png") fault(`image ${k} is of type ${image.mimeType}`);
        if (!wanted.equals(Buffer.from(bytes, glb.start + byteOffset, byteLength))) fault(`image ${k} has other bytes`);
        const mine = faces.filter((face) => face.name === named[k]);
        if (tri.length !== 2 * mine.length) fault(`image ${k} is on ${tri.length} triangles`);
        for (const t of tri) {
            const p = t.map((v) => x[v]);
            const n = unit(cross(less(p[1], p[0]), less(p[2], p[0])));
            // a float of less than 1 m; v of glTF counts from above
            const fits = ({ corners: list }) =>
                t.every((v, i) =>
                    list.some(
                        ([at, place]) =>
                            Math.hypot(...less(corners[at], p[i])) < 1e-7 &&
                            Math.abs(places[place][0] - uv[2 * v]) + Math.abs(1 - places[place][1] - uv[2 * v + 1]) <
                                1e-6,
                    ),
                );
            const outward = p.every((q) => dot(q, n) > 0);
            if (!outward || !mine.some(fits)) return fault(`image ${k}: a triangle has another place or image`);
        }
    });
}

async function colours() {
    const { LOOKS } = await import(pathToFileURL(rest[0]).href);
    const rows = [...readFileSync(file, "utf8").matchAll(/\{"([a-z_]+)", 0x([0-9a-f]{6})\}/g)];
    const table = Object.fromEntries(rows.map(([, name, rgb]) => [name, `#${rgb}`]));
    const looks = Object.fromEntries(Object.entries(LOOKS).map(([name, look]) => [name, look.colour]));
    for (const name of new Set([...Object.keys(table), ...Object.keys(looks)]))
        if (table[name] !== looks[name]) fault(`${name} is ${table[name]}, on the page ${looks[name]}`);
}

if (!existsSync(`${packages}/node_modules/three/examples/jsm/loaders/GLTFLoader.js`)) process.exit(77);
await { points, surface, box, colours }[kind]();
for (const text of faults.slice(0, 10)) console.log(text);
process.exit(faults.length > 0 ? 1 : 0);
