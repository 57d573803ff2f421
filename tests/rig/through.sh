# Shared by the tests of programs behind the rig; sourced with $bin set, after $0 was called in tests/rig.
. "$(dirname "$0")/../clients/rig.sh"

# start_rig PROFILE FLAGS...: sets $rig_job; its port, with --tcp, in $rig_port
start_rig() {
    profile=$1
    shift
    "$bin/palpate-rig" --profile "$profile" --json "$@" >"$work/rig_$profile" 2>"$work/rig_$profile.err" &
    rig_job=$!
    pids="$pids $rig_job"
    shows "$work/rig_$profile" $rig_job '"port"'
    check "$profile: the rig runs" $? == 0
    rig_port=$(json port "$work/rig_$profile")
}

# sum KEY: of both directions, from the report of the rig
sum() { tr ',{}' '\n\n\n' <"$work/rig_$profile" | awk -F: -v key="\"$1\"" '$1 == key { sum += $2 } END { print sum + 0 }'; }

# stop_rig: ends it; it has done what its profile says
stop_rig() {
    stop "$rig_job"
    check "$profile: the rig ends well" $? == 0
    check "$profile: packets pass" "$(sum packets)" '>' 100
    case $profile in
    80 | 150 | 200) check "$profile: packets are lost" "$(sum lost)" '>' 0 ;;
    *) check "$profile: none is lost by chance" "$(sum lost)" == 0 ;;
    esac
    case $profile in
    outage) check "$profile: some in an outage" "$(sum in_outage)" '>' 0 ;;
    *) check "$profile: none in an outage" "$(sum in_outage)" == 0 ;;
    esac
}

# bridged NAME CODE: what holds for a bridge whatever the network does
bridged() {
    check "$1: the bridge ends well" "$2" == 0
    check "$1: no model is refused" "$(json not_finite "$work/bridge_$1")" == 0
    check "$1: the device has no fault" "$(json faults "$work/bridge_$1")" == 0
    check "$1: force is felt (N)" "$(json force_max_N "$work/bridge_$1")" '>' 0.05
    check "$1: never more than the cap (N)" "$(json force_max_N "$work/bridge_$1")" '<=' 3
}
