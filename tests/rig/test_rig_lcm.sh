#!/bin/sh
# A bridge by LCM through each profile of the rig, with a client of the same session beside it: the bridge feels and
# recovers, the session goes on, and without fresh models the hand feels the free damping and nothing else. In a network
# namespace of its own. Nothing here asserts a time. usage: test_rig_lcm.sh FOLDER_OF_PROGRAMS WATCH_FORCE
bin=$1 watch_force=$2
. "$(dirname "$0")/through.sh"
own_network "$@"
make_scene
bus=239.255.76.67

# through PROFILE CONDITION: until what the bridge waits for, on a server of its own, whose LCM numbers begin at 1
through() {
    start_server --port 0 --lcm "udpm://$bus:7667?ttl=0" --log info
    shows "$work/serve.err" "$server_job" lcm_joined
    start_rig "$1" --lcm "$bus:7667,$bus:7668"
    timeout 120 "$bin/palpate-client" "$url" --script idle --seconds 110 --json >"$work/client_$1" 2>"$work/client_$1.err" &
    client=$!
    "$watch_force" "udpm://$bus:7668?ttl=0" PALPATE1/ball/TOOL/0 >"$work/force_$1" &
    watch=$!
    pids="$pids $watch"
    timeout 120 "$bin/palpate-bridge" --server "udpm://$bus:7668?ttl=0" --session ball --tool 0 --origin 0,0,0.048 \
        --device "$(device premium)" --seconds 110 --until "$2" --json >"$work/bridge_$1" 2>"$work/bridge_$1.err"
    bridged "$1" $?
    members 2
    stop $client
    check "$1: a client of the session sees every frame pass every check" $? == 0
    check "$1: and keeps its connection" "$(json reconnects "$work/client_$1")" == 0
    kill $watch
    wait $watch 2>/dev/null
    check "$1: the bridge's states are heard" "$(wc -l <"$work/force_$1")" '>' 100
    check "$1: palpate-lcm is still the same" "$(grep -c lcm_joined "$work/serve.err")" == 1
    stop "$server_job"
    stop_rig
    check "$1: the rig passes on all that it can" "$(json failed "$work/rig_$1")" == 0
}

for profile in lan 20 50 80 150 200; do through $profile models=40,poses=200,force_N=0.06; done
check "200: lost models are counted" "$(json models_lost "$work/bridge_200")" '>=' 1
# 300 models come before the outage at most
through outage models=420,stale=1,force_N=0.06
check "outage: and those that it took" "$(json models_lost "$work/bridge_outage")" '>=' 1
check "outage: the models of the bridge get stale" "$(json stale "$work/bridge_outage")" '>=' 1
# a model is stale 0.5 s after its arrival at most, the force has faded 0.5 s later, and damping is left (README.md of the
# bridge): 0.5 N s/m, or more where the energy gate asks for it; a line may be half written; an age of more than an hour is
# that of no model. On a busy machine a model may be old when it arrives: what counts is how much older it is than in the
# first state that had it
free='NF == 4 && $4 != model { model = $4; arrived = $1 } { free = NF == 4 && $1 - arrived > 1.01 && $1 < 3600 }'
check "outage: states without a fresh model are heard" "$(awk "$free free" "$work/force_outage" | wc -l)" '>' 50
check "outage: then nothing but damping is felt (N)" "$(awk "$free"' free && $3 > max { max = $3 }
    END { print max + 0 }' "$work/force_outage")" '<' 0.001
check "outage: force is felt again" "$(awk "$free"' free { gap = 1 } NF == 4 && !free && gap && $2 > max { max = $2 }
    END { print max + 0 }' "$work/force_outage")" '>' 0.05

# two devices at one bridge, each with a tool and channels of its own
start_server --port 0 --lcm "udpm://$bus:7667?ttl=0" --log info
shows "$work/serve.err" "$server_job" lcm_joined
timeout 120 "$bin/palpate-bridge" --server "udpm://$bus:7667?ttl=0" --session ball --tool 0 --origin 0,0,0.048 \
    --device "$(device premium)" --second-device "$(device premium)" --seconds 110 --until models=300,poses=200,force_N=0.06 \
    --json >"$work/two" 2>"$work/two.err"
check "two devices: the bridge ends well" $? == 0
sed 's/.*"second"://' "$work/two" >"$work/second"
for hand in two second; do
    check "$hand: its models come" "$(json models "$work/$hand")" '>=' 40
    check "$hand: its force is felt (N)" "$(json force_max_N "$work/$hand")" '>=' 0.06
done
check "the second hand has the next tool" "$(json tool "$work/second")" == 1
stop "$server_job"
finish
