#!/bin/sh
# Four clients live through three servers: the first ends in order and sends them to the second, which goes on from its
# recording; the second is killed, and the third goes on from what was on the disk.
# usage: test_drain.sh FOLDER_OF_PROGRAMS
bin=${1:?usage: test_drain.sh FOLDER_OF_PROGRAMS}
. "$(dirname "$0")/../clients/rig.sh"
command -v node >/dev/null || { echo "node is missing"; exit 77; }
make_scene
free_port() { node -e 'const s = require("net").createServer().listen(0, "127.0.0.1", () => { console.log(s.address().port); s.close(); })'; }
life() { # life PORT [FLAGS]: a server that records, and goes on where the newest recording ends
    start_server --record "$work/run.log" --resume --port "$@"
}
ends() { # ends SIGNAL: the server's exit code
    kill "-$1" "$server_pid"
    wait "$server_job" 2>/dev/null
    code=$?
    cat "$work/serve.err" >>"$work/lives.err"
}
watch_relay() { # until somebody who watches through the relay has seen 20 cycles
    timeout 100 "$bin/palpate-client" "ws://127.0.0.1:$(json port "$work/relay.out")/ws" --tool none --script idle --seconds 60 --until cycles=20 \
        --quiet 2>"$work/viewer.err"
}

second=$(free_port)
life 0 --drain-to "http://127.0.0.1:$second/"
timeout 250 "$bin/palpate-client" "$url" --json --clients 4 --script press --seconds 200 --until joins=3,cycles_of_it=20 >"$work/clients" \
    2>"$work/clients.err" &
clients=$!
pids="$pids $clients"
members 4
timeout 250 "$bin/palpate" relay "$url" --port 0 --json >"$work/relay.out" 2>"$work/relay.err" &
relay=$!
pids="$pids $relay"
shows "$work/relay.out" $relay '"port"'
watch_relay
ends TERM
check "a server that is drained ends with 0" $code == 0
# two more are the relay, and the one that has counted them if it is still there
check "four members and the relay were sent on" "$(grep -c '1 sessions end, [56] clients are sent to http://127.0.0.1' "$work/serve.err")" == 1
"$bin/palpate" replay "$work/run.log" "$work/ball.json" --strict --json >"$work/replay" 2>"$work/replay.err"
check "its recording is whole, and its replay equal" $? == 0
check "it has steps" "$(json steps "$work/replay")" '>' 10

life "$second"
members 4
check "another goes on with it" "$(grep -c 'ball goes on where .*run.log ends' "$work/serve.err")" == 1
watch_relay
check "so does the relay, for who watches there" $? == 0
ends KILL
life "$second"
wait $clients
check "all four have been on every server, and saw correct frames" $? == 0
check "a killed server's session goes on" "$(grep -c 'ball goes on where .*run.2.log ends' "$work/serve.err")" == 1
check "and each has come back twice" "$(json reconnects "$work/clients")" '>=' 8
ends TERM
check "without a place to send them to, a server ends with 0 too" $code == 0
finish
