#!/bin/sh
# A bridge and a client by websocket through each profile of the rig: every frame passes every check, no connection is
# lost, the bridge feels and recovers. Nothing here asserts a time. usage: test_rig_websocket.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/through.sh"
make_scene
start_server --port 0

# through PROFILE BRIDGE CLIENT: until what each of them waits for
through() {
    start_rig "$1" --tcp "0:127.0.0.1:$port"
    timeout 120 "$bin/palpate-client" "ws://127.0.0.1:$rig_port/ws" --script press --seconds 110 --until "$3" --json \
        >"$work/client_$1" 2>"$work/client_$1.err" &
    client=$!
    timeout 120 "$bin/palpate-bridge" --server "ws://127.0.0.1:$rig_port/ws" --device "$(device premium)" --seconds 110 \
        --until "$2" >"$work/bridge_$1" --json 2>"$work/bridge_$1.err"
    bridged "$1" $?
    wait $client
    check "$1: every frame passes every check" $? == 0
    stop_rig
    check "$1: what a stream loses is sent again" "$(sum retransmissions)" == "$(($(sum lost) + $(sum in_outage)))"
    check "$1: no connection is given up" "$(sum given_up)" == 0
}
# each of the two connects once for the asset and once for the session, and again when a connection is lost
connections() { json connections "$work/rig_$1"; }

for profile in lan 20 50 80 150 200; do through $profile models=40,poses=200,force_N=0.06 frames=20,answered=5; done
# 300 models and cycles come before the outage at most
through outage models=420,stale=1,force_N=0.06 cycles=420
check "outage: the models of the bridge get stale" "$(json stale "$work/bridge_outage")" '>=' 1
for profile in lan 20 50 80 150 200 outage; do
    check "$profile: both keep their connections" "$(connections $profile)" == 4
    check "$profile: so says the bridge" "$(json reconnects "$work/bridge_$profile")" == 0
    check "$profile: so says the client" "$(json reconnects "$work/client_$profile")" == 0
done
finish
