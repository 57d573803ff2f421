#!/bin/sh
# palpate-bridge with a virtual device against a real server by websocket: touches, feels, stops on signal, fades when the
# server goes. usage: test_bridge_server.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
make_scene
start_server --port 0

timeout 110 "$bin/palpate-bridge" --server "$url" --device "$(device premium)" --seconds 100 \
    --until models=11,poses=101,force_N=0.11 --json >"$work/hold" 2>"$work/hold.err"
check "a bridge that presses and holds ends well" $? == 0
check "it holds a tool" "$(json tool "$work/hold")" '>=' 0
check "models come" "$(json models "$work/hold")" '>' 10
check "none of them is refused" "$(json not_finite "$work/hold")" == 0
check "force is felt" "$(json force_max_N "$work/hold")" '>' 0.1
check "and never more than the cap" "$(json force_max_N "$work/hold")" '<=' 3
check "poses go out" "$(json poses "$work/hold")" '>' 100
echo "     largest step of force at a model: $(json jump_max_N "$work/hold") N"

# presses NAME [flags]: a bridge in the background, until it presses; its pid in $job
presses() {
    name=$1
    shift
    timeout 110 "$bin/palpate-bridge" --server "$url" --device "$(device touch)" --seconds 100 "$@" >"$work/$name" 2>"$work/$name.err" &
    job=$!
    shows "$work/$name.err" $job 'info touch: '
}

# emergency stop by signal while it presses
presses stop
check "a second one presses" $? == 0
kill -USR1 "$(ps -o pid= --ppid "$job" | head -1)"
shows "$work/stop.err" $job 'emergency stop'
check "an emergency stop is reported" $? == 0
stop $job
check "and latched" "$(grep -c 'state estop;' "$work/stop")" == 1

# the server goes while it presses: models stale, force gone
presses gone --until force_N=0.06,stale=1,free=1
check "a third one presses" $? == 0
kill "$server_job"
wait "$server_job" 2>/dev/null
wait $job
check "it ends well" $? == 0
check "without a server models are stale" "$(sed -n 's/.* \([0-9]*\) times stale/\1/p' "$work/gone")" '>=' 1
check "and the device is free again" "$(grep -c 'state free;' "$work/gone")" == 1

# the server comes back on the same port, and the bridge to it
start_server --port "$port"
timeout 110 "$bin/palpate-bridge" --server "$url" --device "$(device touch)" --seconds 100 --json >"$work/back" 2>"$work/back.err" &
job=$! pids="$pids $!"
members 1
kill "$server_job"
wait "$server_job" 2>/dev/null
start_server --port "$port"
members 1
stop $job
check "a bridge joins a server again that comes back" "$(json reconnects "$work/back")" == 1
kill "$server_job"
wait "$server_job" 2>/dev/null

# a scene whose up is y, grasped and pulled: the device's up is the scene's, and the hand feels what the tissue gives
sed 's/"gravity_m_s2": 0,/"gravity_m_s2": 0, "up": [0, 1, 0],/' "$work/ball.json" >"$work/up.json"
scene=$work/up.json
start_server --port 0
timeout 110 "$bin/palpate-bridge" --server "$url" --device "$(device omega3)" --script grasp --seconds 100 --json \
    >"$work/grasp" 2>"$work/grasp.err"
check "a bridge that grasps ends by itself" $? == 0
felt=$(json felt_N "$work/grasp") given=$(json server_N "$work/grasp")
check "the tissue is pulled" "$given" '>' 0.3
# how exactly is tested in virtual time (test_bridge_rendering): a server slower than real time gives older models
check "and the hand feels it" "$felt" '>' 0.3
check "no more energy than the tank's" "$(json generated_mJ "$work/grasp")" '<=' 1.01
place=$(sed -n 's/.*"position_m":\[\([^]]*\)\].*/\1/p' "$work/grasp")
check "the hand is above the ball along y" "$(echo "$place" | cut -d, -f2)" '>' 0.04
check "and not along z" "$(echo "$place" | cut -d, -f3)" '<' 0.02
echo "     grasp held: felt $felt N of $given N, largest step $(json max_step_N "$work/grasp") N"

timeout 20 "$bin/palpate-bridge" --server ws://127.0.0.1:9/ws --seconds 1 --json >"$work/nobody" 2>"$work/nobody.err"
check "nobody at the address is a failure" $? == 1
check "said in one line" "$(wc -l <"$work/nobody.err")" == 1
check "the server's log says when who joined and left" \
    "$(grep -cE '^[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9:.]+Z info (join: .+ joins ball as member|leave: .+ leaves ball)' "$work/serve.err")" '>=' 2
timeout 20 "$bin/palpate-client" ws://127.0.0.1:1/ws --seconds 1 >/dev/null 2>"$work/unknown.err"
check "a client without a server says so, with no number" "$(grep -c 'never joined: Unable' "$work/unknown.err")" == 1
timeout 20 "$bin/palpate-bridge" --device nothing:x >/dev/null 2>&1
check "an unknown back end is refused" $? == 1
timeout 20 "$bin/palpate-bridge" --device virtual:foo >/dev/null 2>"$work/foo.err"
check "an unknown virtual device is named, with those there are" "$(grep -c 'virtual:foo: no such .* touch, premium' "$work/foo.err")" == 1
timeout 20 "$bin/palpate-bridge" --hand nobody >/dev/null 2>"$work/hand.err"
check "an unknown hand is told by its flag" "$(grep -c -e --hand "$work/hand.err")" == 1
check "the list of devices names the virtual ones" "$("$bin/palpate-bridge" --list-devices | grep -c omega3)" == 1
check "the doctor runs the servo for a second" "$(timeout 20 "$bin/palpate-bridge" --doctor | grep -c 'lateness p50')" == 1
finish
