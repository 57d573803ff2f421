#!/bin/sh
# palpate-bridge with a virtual device against a real server by websocket: touches, feels, stops on signal, fades when the
# server goes. usage: test_bridge_server.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
make_scene
start_server --port 0

# once more where the servo loop was late and forces were off for that (servo_thread.c)
for try in 1 2 3 4; do
    timeout 60 "$bin/palpate-bridge" --server "$url" --device virtual:premium --seconds 4.5 --json >"$work/hold" 2>/dev/null
    code=$?
    holds "$(json force_max_N "$work/hold")" '>' 0.1 || ! late "$work/hold" || [ $try -eq 4 ] || continue
    break
done
check "a bridge that presses and holds ends well" $code == 0
check "it holds a tool" "$(json tool "$work/hold")" '>=' 0
check "models come" "$(json models "$work/hold")" '>' 10
check "none of them is refused" "$(json not_finite "$work/hold")" == 0
check "force is felt" "$(json force_max_N "$work/hold")" '>' 0.1
check "and never more than the cap" "$(json force_max_N "$work/hold")" '<=' 3
check "poses go out" "$(json poses "$work/hold")" '>' 100
echo "     largest step of force at a model: $(json jump_max_N "$work/hold") N"

# emergency stop by signal while it presses
for try in 1 2 3 4; do
    timeout 60 "$bin/palpate-bridge" --server "$url" --device virtual:touch --seconds 50 --json >"$work/stop" 2>/dev/null &
    job=$!
    members 1
    sleep $((2 + 2 * try)) # more where the hand came too late
    kill -USR1 "$(ps -o pid= --ppid "$job" | head -1)"
    sleep 0.5
    stop $job
    holds "$(json force_max_N "$work/stop")" '>' 0.05 && break
done
check "an emergency stop is latched" "$([ "$(json state "$work/stop")" = estop ] && echo 1)" == 1
check "it had pressed before" "$(json force_max_N "$work/stop")" '>' 0.05

# the server goes while it presses: models stale, force gone
timeout 60 "$bin/palpate-bridge" --server "$url" --seconds 50 --json >"$work/gone" 2>/dev/null &
job=$!
members 1
sleep 3
kill "$server_job"
wait "$server_job" 2>/dev/null
sleep 2
stop $job
check "without a server models are stale" "$(json stale "$work/gone")" '>=' 1
check "and the device is free again" "$([ "$(json state "$work/gone")" = free ] && echo 1)" == 1

timeout 20 "$bin/palpate-bridge" --server "$url" --seconds 1 --json >"$work/nobody" 2>"$work/nobody.err"
check "nobody at the address is a failure" $? == 1
check "said in one line" "$(wc -l <"$work/nobody.err")" == 1
timeout 20 "$bin/palpate-bridge" --device hdapi:x >/dev/null 2>&1
check "an unknown back end is refused" $? == 1
check "the list of devices names the virtual ones" "$("$bin/palpate-bridge" --list-devices | grep -c omega3)" == 1
check "the doctor runs the servo for a second" "$(timeout 20 "$bin/palpate-bridge" --doctor | grep -c 'lateness p50')" == 1
finish
