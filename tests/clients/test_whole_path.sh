#!/bin/sh
# The whole path at once (issue's section 7, with headless trainees in the browsers' place): a server on a small scene with
# LCM, lcm-logger recording, one bridge by LCM and one by websocket touching, two trainees seeing vertices move; then
# lcm-logplayer plays the record to a second bridge, which feels it without any server. In a network namespace of its
# own. usage: test_whole_path.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
own_network "$@"
bus='udpm://239.255.76.67:7667?ttl=0'
make_scene
start_server --port 8090 --lcm "$bus" --log info
await 20 grep -q lcm_joined "$work/serve.err"
check "palpate-lcm has joined" $? == 0
timeout 60 lcm-logger --lcm-url="$bus" -f "$work/record" >/dev/null 2>&1 &
logger=$!
pids="$pids $logger"
await 10 test -e "$work/record"

timeout 60 "$bin/palpate-trainee" "$url" --script press --depth 0.006 --seconds 8 --tool 2 --name one --json >"$work/one" 2>"$work/one.err" &
one=$!
timeout 60 "$bin/palpate-trainee" "$url" --script idle --seconds 8 --name two --json >"$work/two" 2>"$work/two.err" &
two=$!
timeout 60 "$bin/palpate-bridge" --server "$bus" --session ball --tool 0 --origin 0,0,0.048 --device virtual:touch \
    --seconds 8 --json >"$work/lcm" 2>"$work/lcm.err" &
by_lcm=$!
timeout 60 "$bin/palpate-bridge" --server "$url" --tool 1 --device virtual:premium --script cycle --seconds 8 --json \
    >"$work/ws" 2>"$work/ws.err" &
by_ws=$!
for each in one two; do
    eval "wait \$$each"
    check "trainee $each passes every check of every frame" $? == 0
    check "trainee $each has frames" "$(json frames "$work/$each")" '>' 10
    check "trainee $each sees vertices move (mm)" "$(json moved_mm "$work/$each")" '>' 0.5
    cat "$work/$each.err"
done
for each in lcm ws; do
    eval "wait \$by_$each"
    check "the bridge by $each ends well" $? == 0
    check "the bridge by $each has models" "$(json models "$work/$each")" '>' 10
    check "the bridge by $each feels force (N)" "$(json force_max_N "$work/$each")" '>' 0.05
    check "the bridge by $each stays under its cap (N)" "$(json force_max_N "$work/$each")" '<=' 3
    cat "$work/$each.err"
done
echo "     pose to frame of trainee one, ms: $(sed 's/.*"latency_ms":{\([^}]*\)}.*/\1/' "$work/one")"
echo "     round trip of the bridges, us: ws $(sed 's/.*"rtt_us":{\([^}]*\)}.*/\1/' "$work/ws")"
echo "                                   lcm $(sed 's/.*"rtt_us":{\([^}]*\)}.*/\1/' "$work/lcm")"
kill -INT "$(ps -o pid= --ppid "$logger" | head -1)" 2>/dev/null
wait $logger 2>/dev/null
for what in BODY/0 STATUS TOOL/0 HMODEL/0 HMODEL/1 HSTATUS/0 HCONFIG/0 HEVENT/0; do
    case $what in HMODEL/1) continue ;; esac # tool 1 is not on the bus
    check "the record has PALPATE1/ball/$what" "$(grep -ac "PALPATE1/ball/$what" "$work/record")" '>' 0
done

# without any server the record alone makes a bridge feel
kill "$server_job"
wait "$server_job" 2>/dev/null
timeout 60 "$bin/palpate-bridge" --server "$bus" --session ball --tool 0 --origin 0,0,0.048 --device virtual:touch \
    --seconds 7 --json >"$work/replay" 2>"$work/replay.err" &
replay=$!
timeout 30 lcm-logplayer -l "$bus" -e 'PALPATE1/ball/HMODEL/0' "$work/record" >/dev/null 2>&1
wait $replay
check "a bridge fed by lcm-logplayer ends well" $? == 0
check "it has models" "$(json models "$work/replay")" '>' 10
check "it feels force (N)" "$(json force_max_N "$work/replay")" '>' 0.05
finish
