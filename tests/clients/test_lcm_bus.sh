#!/bin/sh
# Two rigs on one bus, with a key: each server moves with its own devices alone, a host without the key moves nothing and hears
# nobody, orders act by the ticket of palpate-lcm, and listeners get the triangles of a surface that adapts.
# In a network namespace of its own. usage: test_lcm_bus.sh FOLDER_OF_PROGRAMS FORGE_PROGRAM FAKES ORDER_PROGRAM
bin=$1 order=$4
. "$(dirname "$0")/rig.sh"
own_network "$@"
bus='udpm://239.255.76.67:7667?ttl=0'
"$bin/palpate" ticket --keys "$work/bus.keys" --new-key >/dev/null
"$bin/palpate" ticket --keys "$work/other.keys" --new-key >/dev/null

# a ball, whoever comes is what it asks to be; and an adaptive sphere, where palpate-lcm is a trainee
make_scene
start_server --port 8090 --lcm "$bus" --lcm-key "$work/bus.keys" --log info
shows "$work/serve.err" $server_job lcm_joined
check "the first rig's palpate-lcm has joined" $? == 0
cp "$work/serve.err" "$work/first.err"
"$bin/palpate" prepare --model adaptive --shape sphere --levels 3 -o "$work/sphere" --quiet || exit 1
timeout 280 "$bin/palpate" serve "$work/sphere/scene.json" --port 8091 --lcm "$bus" --lcm-key "$work/bus.keys" \
    --log info --json >"$work/second.out" 2>"$work/second.err" &
second=$!
pids="$pids $second"
shows "$work/second.err" $second lcm_joined
check "the second rig's has too" $? == 0
sphere=$(json sessions "$work/second.out" | tr -d '[]"')
[ -n "$sphere" ] || sphere=$(sed -n 's/.*"sessions":\["\([^"]*\)".*/\1/p' "$work/second.out")

bridge() { # NAME SESSION flags
    name=$1 of=$2
    shift 2
    timeout 60 "$bin/palpate-bridge" --server "$bus" --session "$of" --origin 0,0,0.048 --device "$(device touch)" --json "$@" \
        >"$work/$name" 2>"$work/$name.err"
}
bridge own ball --tool 0 --lcm-key "$work/bus.keys" --until models=60,force_N=0.06
check "a device with the key feels the first rig's ball" $? == 0
bridge none ball --tool 1 --seconds 3
check "one without the key gets no model" "$(json models "$work/none")" == 0
bridge wrong ball --tool 1 --lcm-key "$work/other.keys" --seconds 3
check "nor one with another key" "$(json models "$work/wrong")" == 0
check "and palpate-lcm says why" "$(grep -c 'not signed with the key' "$work/serve.err")" '>' 0
curl -s http://127.0.0.1:8091/sessions >"$work/sessions"
check "nobody took a tool of the second rig" "$(json free_tools "$work/sessions")" == "$(json tools "$work/sessions")"

check "nor was it concerned by what comes to the first" "$(grep -c 'lcm_refused' "$work/second.err")" == 0

# a third rig has the ball of the first, and a key of its own: its channels have another prefix
timeout 280 "$bin/palpate" serve "$work/ball.json" --port 8092 --lcm "$bus" --lcm-key "$work/other.keys" --lcm-channel left \
    --log info --json >"$work/third.out" 2>"$work/third.err" &
third=$!
pids="$pids $third"
shows "$work/third.err" $third lcm_joined
check "the third rig has joined" $? == 0
bridge left ball --tool 0 --channel left --lcm-key "$work/other.keys" --until models=60,force_N=0.06
check "its device feels its ball" $? == 0
PALPATE_LCM_KEY="$work/other.keys" bridge right ball --tool 0 --seconds 2
check "and nothing on the channels of the first rig" "$(json models "$work/right")" == 0
shows "$work/serve.err" $server_job 'TOOL/0: a message is not signed'
check "whose palpate-lcm refuses that one" $? == 0
check "but hears nothing of the third rig" "$(grep -c 'lcm_refused.*left' "$work/serve.err")" == 0
check "and neither is called another palpate-lcm" "$(cat "$work"/serve.err "$work"/third.err | grep -c 'another palpate-lcm')" == 0
check "the third rig refused nothing" "$(grep -c 'lcm_refused' "$work/third.err")" == 0
# a fourth one takes the channels of the first
timeout 60 "$bin/palpate-lcm" --server "ws://127.0.0.1:8091/ws" --lcm "$bus" --session ball --lcm-key "$work/bus.keys" \
    >/dev/null 2>"$work/fourth.err" &
fourth=$!
pids="$pids $fourth"
shows "$work/serve.err" $server_job 'another palpate-lcm takes the session ball'
check "two rigs with the same channels are reported" $? == 0
stop $fourth

# a bridge that waits for another session is told which one is there
timeout 60 "$bin/palpate-bridge" --server "$bus" --session nothere --lcm-key "$work/bus.keys" --device "$(device touch)" --seconds 3 \
    >/dev/null 2>"$work/nothere.err"
check "a bridge for a session that is not there learns of one that is" \
    "$(grep -cE 'not session nothere, but [a-z]+ is there' "$work/nothere.err")" == 1

# orders
reply=$("$order" 60 "$bus" "$sphere" "$work/bus.keys" pause)
check "a trainee's ticket does not pause" "$(echo "$reply" | grep -c '^refused role pause: only for')" == 1
reply=$("$order" 60 "$bus" "$sphere" "$work/bus.keys" nonsense)
check "a command that nobody knows is refused in words" "$(echo "$reply" | grep -c '^refused verb .*nonsense')" == 1
# palpate-lcm with an instructor's ticket
PALPATE_TICKET=$(sed -n 's/.*"instructor":"\([^"]*\)".*/\1/p' "$work/third.out") timeout 100 "$bin/palpate-lcm" --server "ws://127.0.0.1:8092/ws" \
    --lcm "$bus" --lcm-key "$work/other.keys" --channel front >/dev/null 2>"$work/front.err" &
pids="$pids $!"
shows "$work/front.err" $! lcm_joined
reply=$(CHANNEL=front "$order" 60 "$bus" ball "$work/other.keys" pause)
check "an instructor's does, and the status has state and role" "$(echo "$reply" | grep -c '^paused by 2')" == 1
reply=$(CHANNEL=left "$order" 60 "$bus" ball "$work/other.keys" resume)
check "the trainee's bus of the same session may not resume" "$(echo "$reply" | grep -c '^refused role')" == 1
"$order" 60 "$bus" ball - pause >"$work/unsigned" 2>&1 &
unsigned=$!
pids="$pids $unsigned"
shows "$work/serve.err" $server_job 'ball/ORDER: a message is not signed'
check "an order without the key is refused" $? == 0
stop $unsigned
check "and does not reach the session" "$(grep -c ' order: palpate-lcm' "$work/serve.err")" == 0

# triangles of the surface that adapts: those of the asset, then more where it is pulled
check "a late listener gets the present triangles" "$("$order" 60 "$bus" "$sphere" "$work/bus.keys" TRIANGLES 1)" == 224
PALPATE_TICKET=$(sed -n 's/.*"trainee":"\([^"]*\)".*/\1/p' "$work/second.out") timeout 100 "$bin/palpate-client" "ws://127.0.0.1:8091/ws" \
    --json --script pull --seconds 90 --until deltas=4,triangles=230 >"$work/pull" 2>"$work/pull.err" &
pull=$!
most=$("$order" 60 "$bus" "$sphere" "$work/bus.keys" TRIANGLES 225)
check "and more of them while it is pulled" "$most" '>' 224
wait $pull
check "which a websocket client confirms" $? == 0
finish
