#!/bin/sh
# A table of a scene's stream through each profile, to one client that presses: nothing is asserted.
# usage: measure_stream.sh FOLDER_OF_PROGRAMS SCENE [SECONDS]
bin=$1 scene=$2 seconds=${3:-15}
. "$(dirname "$0")/../clients/rig.sh"
row() { # NAME RIG_FLAGS...
    name=$1
    shift
    "$bin/palpate-rig" "$@" --json --seed 1 --tcp "0:127.0.0.1:$port" >"$work/rig" &
    rig_job=$!
    pids="$pids $rig_job"
    shows "$work/rig" $rig_job '"port"'
    "$bin/palpate-client" "ws://127.0.0.1:$(json port "$work/rig")/ws" --script press --seconds "$seconds" --json >"$work/client" 2>/dev/null
    stop $rig_job
    latency=$(sed -n 's/.*"latency_ms":{\([^}]*\)}.*/\1/p' "$work/client" | tr ',' '\n')
    printf '| %s | %.0f | %.0f | %.0f | %.0f | %.0f |\n' "$name" "$(json frames_per_s "$work/client")" "$(json cycles_per_s "$work/client")" \
        "$(echo "$latency" | sed -n 's/"p50"://p')" "$(echo "$latency" | sed -n 's/"p99"://p')" \
        "$(awk -v b="$(json bytes_per_s "$work/client")" 'BEGIN { print b / 1000 }')"
}
start_server --port 0
echo '| profile | frames a second | cycles a second | pose to frame ms, p50 | p99 | kB a second |'
echo '| --- | --- | --- | --- | --- | --- |'
for profile in lan 20 50 80 150; do row $profile --profile $profile; done
row "200, 2 % loss" --rtt-ms 200 --loss 2
row "40, 1 Mbit/s" --rtt-ms 40 --kbit-s 1000
row "2 s outage" --profile outage
stop "$server_job"
