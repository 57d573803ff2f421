#!/bin/sh
# A surface that adapts, from a real server to palpate-client: pressed and pulled it is refined, and every patch of
# triangles fits, whoever reads slowly, stalls, comes late or is many. usage: test_topology_delta_server.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
"$bin/palpate" prepare --model adaptive --shape sphere --levels 3 -o "$work/sphere" --quiet || exit 1
scene=$work/sphere/scene.json
start_server --port 0
run() { # NAME flags: report in $work/NAME, exit code in $code
    name=$1
    shift
    timeout 100 "$bin/palpate-client" "$url" --json "$@" >"$work/$name" 2>"$work/$name.err"
    code=$?
    [ $code -eq 0 ] || cat "$work/$name.err"
}
# deltas KEY FILE: a number of the report's object `topology_deltas`
deltas() { sed -n "s/.*\"topology_deltas\":{[^}]*\"$1\":\([0-9.]*\).*/\1/p" "$2"; }

run idle --script idle --seconds 60 --until frames=1,cycles=20
check "who only looks sees the surface as at load" $code == 0
check "224 triangles on the first of three levels" "$(deltas triangles "$work/idle")" == 224
check "of as many slots as the finest level has" "$(deltas slots "$work/idle")" == 3584
check "and no delta, for nothing changes" "$(deltas n "$work/idle")" == 0

# pulled by one, seen by a slow reader and by one that stalls
timeout 100 "$bin/palpate-client" "$url" --json --script idle --slow 4000 --seconds 60 --until deltas=1,cycles=60 --name slow >"$work/slow" 2>"$work/slow.err" &
slow=$!
timeout 100 "$bin/palpate-client" "$url" --json --script idle --stall 2 --seconds 60 --until deltas=1,stalls=1 --name stalls >"$work/stall" 2>"$work/stall.err" &
stall=$!
members 2
run pull --script pull --seconds 60 --until deltas=4,triangles=230
check "a pull passes every check" $code == 0
check "and brings deltas" "$(deltas n "$work/pull")" '>' 3
check "of more triangles than at load" "$(deltas triangles "$work/pull")" '>' 224
check "much smaller than the surface of 43 kB" "$(deltas bytes_mean "$work/pull")" '<' 3000
wait $slow
check "a slow reader passes every check" $? == 0
check "and is brought along" "$(deltas n "$work/slow")" '>' 0
wait $stall
check "one that stalls passes every check" $? == 0
check "and is brought along" "$(deltas n "$work/stall")" '>' 0

run crowd --clients 4 --script press --seconds 60 --until deltas=2,cycles=20
check "four at once, late to what was pulled, pass every check" $code == 0
check "each with its deltas" "$(deltas n "$work/crowd")" '>' 3

# a connection that ends begins at the asset again
timeout 100 "$bin/palpate-client" "$url" --json --seconds 60 --until joins=2,cycles_of_it=20 >"$work/again" 2>"$work/again.err" &
again=$!
members 1
kill "$server_job"
wait "$server_job" 2>/dev/null
start_server --port "$port"
wait $again
check "a trainee outlives its server" $? == 0
check "and joins again by itself" "$(json reconnects "$work/again")" '>=' 1
finish
