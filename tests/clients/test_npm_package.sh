#!/bin/sh
# The npm package as a stranger uses it: packed, unpacked beside a program that imports it by name, golden packets decoded
# and a real server joined. usage: test_npm_package.sh PROGRAMS - - - PACKAGES
bin=$1
packages=${5-}
here=$(cd "$(dirname "$0")" && pwd)
tree=$here/../..
. "$here/rig.sh"
if ! command -v npm >/dev/null || ! [ -e "$packages/node_modules/typescript" ]; then
    echo "SKIP all: no npm or no packages of the viewer (deploy/common.sh fetches them)"
    exit 77
fi
mkdir -p "$work/npm" "$work/program/node_modules"
npm_config_cache=$work/npm/cache timeout 200 node "$tree/clients/viewer/package/pack.mjs" "$work/npm" "$packages" >"$work/pack.log"
check "packed" $? == 0
tar xzf "$work"/npm/palpate-client-*.tgz -C "$work/program/node_modules" || exit 1
cd "$work/program" || exit 1
mv node_modules/package node_modules/palpate-client
cd node_modules/palpate-client || exit 1
check "its version is that of the programs" "\"$(sed -n 's/.*"version": "\(.*\)".*/\1/p' package.json)\"" == \
    "\"$("$bin/palpate" --version | sed 's/^palpate \([0-9.]*\).*/\1/')\""
for file in LICENSE README.md index.html example.js src/client.js types/client.d.ts; do
    [ -s "$file" ] || check "$file is there" 0 == 1
done
check "types of each source" "$(ls types | wc -l)" == "$(ls src | wc -l)"
check "files that are for nobody" "$(find . -type f | grep -cvE '^\./(LICENSE|README\.md|package\.json|index\.html|example\.js|src/[a-z0-9_]+\.js|types/[a-z0-9_]+\.d\.ts)$')" == 0
check "imports of other packages" "$(grep -hoE 'from "[^.][^"]*"' src/*.js | wc -l)" == 0
cd "$work/program" || exit 1
cat >use.ts <<'TS'
import { decodeAsset, join, type Message } from "palpate-client";
import { planes } from "palpate-client/src/asset.js";
const session = join("ws://127.0.0.1/ws", (message: Message) => {
    if (message.type === "frame") session.reuse(message);
    if (message.type === "frame" && message.positions instanceof Float32Array) session.move([0, 0, 0], true);
});
const rest: Float32Array = decodeAsset(new Uint8Array()).rest;
// @ts-expect-error there is no such role
join("ws://127.0.0.1/ws", () => {}, { role: "surgeon" });
console.log(rest, planes);
TS
echo '{"compilerOptions": {"noEmit": true, "strict": true, "target": "es2022", "module": "nodenext", "types": []}, "files": ["use.ts"]}' >tsconfig.json
timeout 100 node "$packages/node_modules/typescript/bin/tsc"
check "a typed program compiles" $? == 0
cp "$here/ask_npm.mjs" .
timeout 100 node ask_npm.mjs packets "$tree/tests/data/golden"
check "golden packets" $? == 0
make_scene
start_server --port 0
if [ -e "$packages/node_modules/ws" ]; then
    timeout 100 node ask_npm.mjs touch "$url" "$packages"
    check "a ball is pulled over the package ws" $? == 0
    timeout 100 node ask_npm.mjs lost "http://127.0.0.1:1/" "$packages"
    check "where there is no server, it is tried again" $? == 0
else
    echo "SKIP a ball is pulled over the package ws: it is not there"
fi
websocket=
node -e 'process.exit(typeof WebSocket === "undefined" ? 1 : 0)' || websocket=--experimental-websocket
if node $websocket -e 0 2>/dev/null; then
    timeout 100 node --no-warnings $websocket ask_npm.mjs touch "$url"
    check "a ball is pulled" $? == 0
else
    echo "SKIP a ball is pulled over the runtime's WebSocket: this Node has none"
fi
finish
