#!/bin/sh
# Three servers behind HAProxy by the session's name: allocate.mjs opens a scene and keeps it, four clients join through the
# gateway, their server is killed and another goes on with the session, which is drained in turn. The Kubernetes API is a
# fake, everything else is real. usage: test_fleet.sh FOLDER_OF_PROGRAMS
bin=${1:?usage: test_fleet.sh FOLDER_OF_PROGRAMS}
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../clients/rig.sh"
if ! command -v haproxy >/dev/null || ! command -v openssl >/dev/null || ! command -v node >/dev/null; then
    echo "haproxy, openssl or node is missing"
    exit 77
fi
make_scene
mkdir "$work/scenes"
cp "$work/ball.json" "$work/ball.obj" "$work/scenes"
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout "$work/key" -out "$work/cert" -days 2 -subj /CN=127.0.0.1 \
    -addext "subjectAltName=IP:127.0.0.1" 2>"$work/openssl.log"
cat "$work/cert" "$work/key" >"$work/all.pem"
"$bin/palpate" ticket --keys "$work/keys" --new-key --quiet
https=$(node -e 'const s = require("net").createServer().listen(0, "127.0.0.1", () => { console.log(s.address().port); s.close(); })')
admission=
for k in 1 2 3; do
    start_server --port 0 --keys "$work/keys" --scenes "$work/scenes" --record "$work/log" --resume --drain-to "https://127.0.0.1:$https/"
    eval "port$k=$port pid$k=$server_pid job$k=$server_job"
    mv "$work/serve.err" "$work/serve$k.err"
done
: >"$work/map"
PALPATE_HTTPS="$https" PALPATE_PEM="$work/all.pem" PALPATE_HOST=127.0.0.1 PALPATE_MAP="$work/map" PALPATE_ADMIN="$work/admin" \
    PALPATE_SERVER="127.0.0.1:$port1" haproxy -f "$here/../../deploy/haproxy.cfg" -D -p "$work/haproxy.pid" >"$work/haproxy.log" 2>&1
check "HAProxy takes the configuration" $? == 0
pids="$pids $(cat "$work/haproxy.pid")"
: >"$work/servers"
node "$here/fake_kubernetes.mjs" "$work/servers" >"$work/api" &
api=$!
pids="$pids $api"
shows "$work/api" $api '^port '
free() { # free K: of the fleet the server of that number is, until the next call
    eval "echo gs-$1 \$port$1 \$pid$1" >"$work/servers"
}
allocates="node $here/../../deploy/agones/allocate.mjs ball.json --api http://127.0.0.1:$(sed -n 's/^port //p' "$work/api") --namespace games
    --keys $work/keys --palpate $bin/palpate --site https://127.0.0.1:$https --admin $work/admin --map $work/map"
$allocates --session one >"$work/got" 2>"$work/got.err"
check "without a free server there is none" $?/"$(grep -c 'no game server is free: UnAllocated' "$work/got.err")" == 1/1
free 1
$allocates --session one --keep >"$work/kept" 2>"$work/kept.err" &
keeper=$!
pids="$pids $keeper"
shows "$work/kept" $keeper '"server":"gs-1"'
check "a scene is opened on the server that is allocated" $? == 0
address=$(sed 's/.*"address":"\([^"]*\)".*/\1/' "$work/kept")
check "its address is the gateway's" "$address" == "https://127.0.0.1:$https/?session=one"
ticket=$(json ticket "$work/kept")
$allocates --session one >"$work/got" 2>"$work/got.err"
check "a name that is in use is refused" $?/"$(grep -c '409 there is a session one' "$work/got.err")" == 1/1

export PALPATE_CA="$work/cert"
timeout 280 "$bin/palpate-client" "$address#$ticket" --json --clients 4 --script press --seconds 250 --until joins=3,cycles_of_it=20 >"$work/clients" \
    2>"$work/clients.err" &
clients=$!
pids="$pids $clients"
url="$address#$ticket"
members 4
check "four members are inside" $? == 0

# another session is opened, used and ended meanwhile
free 2
$allocates --session two --keep >"$work/got" 2>"$work/got.err" &
second=$!
pids="$pids $second"
shows "$work/got" $second '"server":"gs-2"'
two=$(sed 's/.*"address":"\([^"]*\)".*/\1/' "$work/got")
timeout 100 "$bin/palpate-client" "$two#$(json ticket "$work/got")" --json --script press --seconds 60 --until cycles=20 >"$work/second" \
    2>"$work/second.err"
check "another is used meanwhile, through the same gateway" $? == 0
timeout 100 "$bin/palpate-client" "$two#$ticket" --script press --seconds 60 --until cycles=1 --quiet 2>"$work/stranger.err"
check "not with the ticket of the first" $? == 1
node -e '
    const [port, ticket] = process.argv.slice(1);
    const headers = { Authorization: `Bearer ${ticket}`, "Content-Type": "application/json" };
    fetch(`http://127.0.0.1:${port}/sessions`, { method: "POST", headers, body: `{"end":"two"}` }).then((answer) => console.log(answer.status))
    ' "$port2" "$("$bin/palpate" ticket --keys "$work/keys" --role instructor --quiet)" >"$work/ended"
check "and is ended" "$(cat "$work/ended")" == 200
wait $second
check "which is the end of its keeping" $? == 0

kill -KILL "$pid1"
wait "$job1" 2>/dev/null
shows "$work/kept" $keeper '"server":"gs-2"'
check "the killed server's session is opened on another" $? == 0
check "which goes on with its recording" "$(grep -c 'one goes on where .*log.one ends' "$work/serve2.err")" == 1
members 4
check "its four members come back" $? == 0
free 3
kill -TERM "$pid2"
wait "$job2"
check "a server that is drained ends with 0" $? == 0
shows "$work/kept" $keeper '"server":"gs-3"'
check "its session is opened on the third" $? == 0
wait $clients
check "and the four are there" $? == 0
check "each has come back twice" "$(json reconnects "$work/clients")" '>=' 8

$allocates --session three --keep >"$work/got" 2>"$work/got.err" &
third=$!
pids="$pids $third"
shows "$work/got.err" $third 'nobody is in three'
kill -KILL "$pid3"
wait $third
check "a session that nobody is in is not opened again" $?/"$(wc -l <"$work/got")" == 0/1
finish
