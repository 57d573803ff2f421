#!/bin/sh
# A table of a bridge (premium, press and hold) through each profile, by websocket and by LCM: nothing is asserted.
# usage: measure.sh FOLDER_OF_PROGRAMS [SECONDS]
bin=$1 seconds=${2:-20}
. "$(dirname "$0")/through.sh"
own_network "$@"
make_scene
bus=239.255.76.67
words() { tr ',{}' '\n\n\n'; }
# member OBJECT KEY FILE: a number of a member that is an object
member() { sed -n "s/.*\"$1\":{\([^}]*\)}.*/\1/p" "$3" | words | sed -n "s/^\"$2\"://p"; }
milli() { awk -v x="${1:-nan}" 'BEGIN { printf "%.1f", x / 1000 }'; }

row() { # PROFILE TRANSPORT
    "$bin/palpate-rig" --profile "$1" --json --tcp "0:127.0.0.1:$port" --lcm "$bus:7667,$bus:7668" >"$work/rig_$1" &
    rig_job=$!
    pids="$pids $rig_job"
    shows "$work/rig_$1" $rig_job '"port"'
    case $2 in
    websocket) set -- "$1" "$2" --server "ws://127.0.0.1:$(json port "$work/rig_$1")/ws" ;;
    LCM) set -- "$1" "$2" --server "udpm://$bus:7668?ttl=0" --session ball --tool 0 --origin 0,0,0.048 ;;
    esac
    profile=$1 transport=$2
    shift 2
    "$bin/palpate-bridge" "$@" --device "$(device premium)" --seconds "$seconds" --json >"$work/bridge" 2>/dev/null
    stop $rig_job
    models=$(json models "$work/bridge")
    printf '| %s | %s | %s, %s | %.0f %% | %s | %s | %.2f | %.2f | %s | %s |\n' "$profile" "$transport" \
        "$(milli "$(member rtt_us p50 "$work/bridge")")" "$(milli "$(member rtt_us p99 "$work/bridge")")" \
        "$(awk -v n="$models" -v s="$seconds" 'BEGIN { print 100 * (1 - n / (60 * s)) }')" "$(json models_old "$work/bridge")" \
        "$(json stale "$work/bridge")" "$(json force_max_N "$work/bridge")" "$(json jump_max_N "$work/bridge")" \
        "$(json generated_mJ "$work/bridge" | grep . || echo '-')" \
        "$(milli "$(member lateness_us mean "$work/rig_$profile")"), $(milli "$(member lateness_us max "$work/rig_$profile")")"
}
echo '| profile | transport | round trip ms, p50, p99 | models that did not come of 60 a second | came too late | times stale | largest force N | largest step N at a model | generated mJ | lateness of the rig ms, mean, max |'
echo '| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |'
for profile in lan 20 50 80 150 200 outage; do
    for transport in websocket LCM; do
        start_server --port 0 --lcm "udpm://$bus:7667?ttl=0" --log info
        shows "$work/serve.err" "$server_job" lcm_joined
        row $profile $transport
        stop "$server_job"
    done
done
