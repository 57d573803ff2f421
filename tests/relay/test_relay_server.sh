#!/bin/sh
# palpate relay between a live server and its viewers: two at once, assets and page, the lock of the role, a server that
# goes and comes back, a relay of a relay, fields, a surface that adapts, and no simulation in it. usage: test_relay_server.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/../clients/rig.sh"

# start_relay NAME UPSTREAM [flags]: sets relay_job and relay, its address
start_relay() {
    name=$1 upstream=$2
    shift 2
    timeout 200 "$bin/palpate" relay "$upstream" --port 0 --json "$@" >"$work/$name.out" 2>"$work/$name.err" &
    relay_job=$!
    pids="$pids $relay_job"
    shows "$work/$name.out" $relay_job '"port"' || { cat "$work/$name.err"; exit 1; }
    relay="ws://127.0.0.1:$(json port "$work/$name.out")/ws"
}
# viewers RELAY N: until the relay has so many, for a minute at most
viewers() {
    timeout 60 node -e 'const [url, n] = process.argv.slice(1);
        const look = async () => {
            const text = await (await fetch(new URL("/metrics", url))).text();
            if (!text.includes(`\npalpate_clients ${n}\n`)) setTimeout(look, 20);
        };
        look();' "http${1#ws}" "$2"
}
# ready RELAY STATUS: until /readyz answers so, for a minute at most
ready() {
    timeout 60 node -e 'const [url, status] = process.argv.slice(1);
        const look = async () => {
            if ((await fetch(new URL("/readyz", url))).status !== Number(status)) setTimeout(look, 20);
        };
        look();' "http${1#ws}" "$2"
}
client() { # NAME URL flags: report in $work/NAME, exit code in $code
    name=$1 to=$2
    shift 2
    timeout 100 "$bin/palpate-client" "$to" --json --seconds 60 "$@" >"$work/$name" 2>"$work/$name.err"
    code=$?
    [ $code -eq 0 ] || cat "$work/$name.err"
}

make_scene
start_server --port 0
start_relay one "$url"
check "palpate relay is palpate-relay" "$(tr '\0' '\n' <"/proc/$(json pid "$work/one.out")/comm" | grep -c '^palpate-relay$')" == 1
check "its symbols can be read" "$(nm "$bin/palpate-relay" | grep -c pal_relay_)" ">" 10
check "no simulation is linked into it" "$(nm "$bin/palpate-relay" 2>/dev/null | grep -c -E 'pal_(world|hub|scene|session|body|tet)_')" == 0

# somebody presses at the server, two look at it through the relay
timeout 100 "$bin/palpate-client" "$url" --json --script circle --seconds 90 >"$work/hand" 2>"$work/hand.err" &
hand=$!
pids="$pids $hand"
members 1
client pair "$relay" --clients 2 --script idle --tool none --until frames=20,cycles=20
relay_one=$relay
check "two viewers pass every check of every frame" $code == 0
check "both have joined" "$(json joined "$work/pair")" == 2
check "none has a tool" "$(json with_tool "$work/pair")" == 0
client greedy "$relay" --script press --until frames=10
check "who asks for a tool watches" "$(json with_tool "$work/greedy")" == 0

# a relay of the relay
start_relay two "$relay"
client second "$relay" --script idle --tool none --until frames=20,cycles=20
check "a viewer of a relay of a relay passes every check" $code == 0
stop $relay_job
check "a relay ends on SIGTERM with 0" $? == 0

# a server that stands still closes no connection: the relay says so, and its viewer stays and sees more when it goes on
timeout 100 "$bin/palpate-client" "$relay_one" --json --script idle --tool none --seconds 60 >"$work/patient" 2>"$work/patient.err" &
patient=$!
pids="$pids $patient"
viewers "$relay_one" 1
kill -STOP "$server_pid"
ready "$relay_one" 503
check "a silent server is noticed" $? == 0
kill -CONT "$server_pid"
ready "$relay_one" 200
check "and called again" $? == 0
client after "$relay_one" --script idle --tool none --until frames=5,cycles=5
check "its frames go on" $code == 0
viewers "$relay_one" 1
check "the viewer has stayed" $? == 0
stop $patient

# the server goes away and comes back on the same port as another run: the viewer joins again by itself
timeout 100 "$bin/palpate-client" "$relay_one" --json --script idle --tool none --seconds 60 --until joins=2,cycles_of_it=5 >"$work/again" 2>"$work/again.err" &
again=$!
pids="$pids $again"
viewers "$relay_one" 1
stop $hand
kill "$server_job"
wait "$server_job" 2>/dev/null
start_server --port "$port"
wait $again
check "a viewer outlives a server that comes back" $? == 0
stop $server_job

# tickets of a key file that server and relay share
"$bin/palpate" ticket --new-key --keys "$work/keys" --quiet || exit 1
ticket=$("$bin/palpate" ticket --keys "$work/keys" --role viewer --expires 0 --uses 0)
start_server --port 0 --keys "$work/keys"
start_relay keyed "$url" --keys "$work/keys"
client admitted "$relay#$ticket" --script idle --tool none --until frames=1
check "a ticket of the same keys is good at a relay" $code == 0
timeout 60 "$bin/palpate-client" "$relay#${ticket%?????}AAAAA" --json --script idle --tool none --seconds 60 >"$work/forged" 2>"$work/forged.err"
check "a forged one is refused for good" "$(grep -c 'not one of this server' "$work/forged" "$work/forged.err" | grep -c ':[1-9]')" ">" 0
stop $relay_job
stop $server_job

# an edit at the server: the viewer gets the new parts, assets and frames
make_block
start_server --port 0
start_relay three "$url"
timeout 100 "$bin/palpate-client" "$relay" --json --script idle --tool none --seconds 60 --until topologies=1,cycles_of_it=1 >"$work/edited" 2>"$work/edited.err" &
edited=$!
pids="$pids $edited"
viewers "$relay" 1
printf '0.1 extrude at=top distance_m=0.02 scale=0.8 target=block\n0.2 divide at=left\n' >"$work/orders"
client edits "$url" --script idle --sculpt "$work/orders" --until orders=2
check "two edits are done" $code == 0
wait $edited
check "a viewer passes every check through them" $? == 0
stop $relay_job
stop $server_job

# a surface that adapts, pulled at the server, and its field: a viewer at a relay of the relay has both
deltas() { sed -n "s/.*\"topology_deltas\":{[^}]*\"$1\":\([0-9.]*\).*/\1/p" "$2"; }
"$bin/palpate" prepare --model adaptive --shape sphere --levels 3 -o "$work/sphere" --quiet || exit 1
scene=$work/sphere/scene.json
start_server --port 0
start_relay four "$url"
start_relay five "$relay"
timeout 100 "$bin/palpate-client" "$relay" --json --script idle --tool none --slow 4000 --seconds 60 --until deltas=1,cycles=10 >"$work/slow" 2>"$work/slow.err" &
slow=$!
timeout 100 "$bin/palpate-client" "$relay" --json --script idle --tool none --field displacement --seconds 60 --until deltas=4,triangles=230,fields=4 >"$work/far" 2>"$work/far.err" &
far=$!
viewers "$relay" 2
timeout 100 "$bin/palpate-client" "$url" --json --script pull --seconds 90 >"$work/pull" 2>"$work/pull.err" &
pull=$!
pids="$pids $pull"
wait $far
check "it passes every check of frames and triangles" $? == 0
check "of more triangles than at the start" "$(deltas triangles "$work/far")" '>' 229
wait $slow
check "one that reads slowly does too" $? == 0
client newcomer "$relay" --script idle --tool none --until deltas=1,triangles=230
check "and one that comes later has them too" $code == 0
stop $pull
finish
