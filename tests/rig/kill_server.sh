#!/bin/sh
# What kill -9 costs a session of four members, and whether its recordings replay equal. A server lives LIVES times, each
# for a time drawn by SEED from 1 s to SECONDS, and goes on where its recording ends; with LIVES 0 it lives once, for
# SECONDS. Meanwhile two members press, one watches, and one gives an edit or a switch each second. A line
# for each life: steps that were seen before its end, steps in its recording, and simulated time lost (a step
# is 1/60 s or less).
# usage: kill_server.sh FOLDER_OF_PROGRAMS [LIVES] [SECONDS] [SEED]
bin=$1 lives=${2:-20} seconds=${3:-12} seed=${4:-1}
. "$(dirname "$0")/../clients/rig.sh"
make_block
changes=0
awk -v n="$seconds" 'BEGIN {
    n_verb = split("paint at=front radius_m=0.04 young_factor=1.5|undo|extrude at=top distance_m=0.02|undo|" \
                   "configure step_ms=12|divide at=left|undo|configure step_ms=16", verb, "|")
    for (i = 0; i + 0.5 < n; i++) printf "? %.1f %s\n", i + 0.5, verb[i % n_verb + 1] }' >"$work/orders"

serve() {
    : >"$work/out"
    "$bin/palpate" serve "$scene" --open --json --port 0 --record "$work/life.log" --resume >"$work/out" 2>>"$work/serve.err" &
    server_job=$!
    pids="$pids $server_job"
    shows "$work/out" $server_job '"port"' || { cat "$work/serve.err"; exit 1; }
    port=$(json port "$work/out") server_pid=$(json pid "$work/out")
}

join() { # NAME flags
    name=$1
    shift
    timeout 900 "$bin/palpate-client" "ws://127.0.0.1:$port/ws" --json --seconds "$seconds" --name "$name" "$@" >"$work/$name.json" 2>/dev/null &
    pids="$pids $!" members="$members $!"
}

members_play() {
    members=""
    join presses --script press --depth 0.004
    join circles --script circle
    join watches --script idle --tool none
    join teaches --script idle --tool none --sculpt "$work/orders"
}

steps_seen() { curl -s "http://127.0.0.1:$port/metrics" | sed -n 's/^palpate_sim_step_seconds_by_session_count.* //p'; }

life() { # NUMBER TIME SIGNAL
    serve
    members_play
    sleep "$2"
    seen=$(steps_seen)
    kill "-$3" "$server_pid"
    wait "$server_job" 2>/dev/null
    for member in $members; do kill "$member" 2>/dev/null; wait "$member" 2>/dev/null; done
    log=$work/life.log
    [ "$1" -eq 1 ] || log=$work/life.$1.log
    "$bin/palpate" replay "$log" "$scene" --json >"$work/replay" 2>/dev/null
    check "life $1: every hash of its replay is equal" "$(json hashes_equal "$work/replay")" == "$(json hashes "$work/replay")"
    steps=$(json steps "$work/replay")
    changes=$((changes + $(json changes "$work/replay")))
    lost=$(awk -v a="$seen" -v b="$steps" 'BEGIN { printf "%.3f", (a > b) * (a - b) / 60 }')
    printf 'life %s: %s s, %s steps seen, %s recorded, %s changes of the scene, %s s lost\n' "$1" "$2" "$seen" "$steps" \
        "$(json changes "$work/replay")" "$lost"
    check "life $1: simulated time lost, s" "$lost" "<=" 1
}

if [ "$lives" -eq 0 ]; then
    life 1 "$seconds" TERM
else
    k=0
    for time in $(awk -v s="$seed" -v k="$lives" -v n="$seconds" 'BEGIN { srand(s); while (k-- > 0) printf "%.2f\n", 1 + (n - 1) * rand() }'); do
        k=$((k + 1))
        life $k "$time" KILL
    done
    check "every life but the first went on" "$(grep -c 'goes on where' "$work/serve.err")" == $((lives - 1))
fi
check "edits and switches in all recordings" $changes ">=" $((lives > 0 ? lives : seconds / 2))
finish
