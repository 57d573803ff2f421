#!/bin/sh
# The whole path at once (issue's section 7, with headless trainees in the browsers' place): a server on a small scene with
# LCM, lcm-logger recording, one bridge by LCM and one by websocket touching, two trainees seeing vertices move; then
# lcm-logplayer plays the record to a second bridge, which feels it without any server. In a network namespace of its
# own. Nothing lasts a fixed time: each step waits for what the next one needs, so that a slow machine takes longer.
# usage: test_whole_path.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
own_network "$@"
bus='udpm://239.255.76.67:7667?ttl=0'
make_scene
start_server --port 8090 --lcm "$bus" --log info
shows "$work/serve.err" $server_job lcm_joined
check "palpate-lcm has joined" $? == 0

# how many messages of that channel the record has
heard() { grep -ao "PALPATE1/ball/$1" "$work/record" 2>/dev/null | wc -l; }
begin() { # NAME PROGRAM [flags]: in the background, at most two minutes; sets $job
    name=$1 program=$2
    shift 2
    timeout 120 "$bin/$program" "$@" --json >"$work/$name" 2>"$work/$name.err" &
    job=$!
    pids="$pids $job"
}

# it listens when the first message is in the record: what is said but once at the start is heard
timeout 240 lcm-logger --lcm-url="$bus" -f "$work/record" >/dev/null 2>&1 &
logger=$!
pids="$pids $logger"
shows "$work/record" $logger PALPATE1/ball/STATUS
check "lcm-logger records" $? == 0

begin one palpate-client "$url" --script press --depth 0.006 --seconds 110 --tool 2 --name one
one=$job
begin two palpate-client "$url" --script idle --seconds 110 --name two
two=$job
# at 60 Hz twenty seconds of touch: a slow device touches before a bridge has heard all of the record
begin lcm palpate-bridge --server "$bus" --session ball --tool 0 --origin 0,0,0.048 --device "$(device touch)" \
    --until models=1200,force_N=0.06
by_lcm=$job
begin ws palpate-bridge --server "$url" --tool 1 --device "$(device premium)" --script cycle --until models=11,force_N=0.06
by_ws=$job
wait $by_lcm
lcm_code=$?
wait $by_ws
ws_code=$?
for each in one two; do
    eval "stop \$$each"
    check "trainee $each passes every check of every frame" $? == 0
    check "trainee $each has frames" "$(json frames "$work/$each")" '>' 10
    check "trainee $each sees vertices move (mm)" "$(json moved_mm "$work/$each")" '>' 0.5
    cat "$work/$each.err"
done
for each in lcm ws; do
    eval "check 'the bridge by $each ends well' \$${each}_code == 0"
    check "the bridge by $each has models" "$(json models "$work/$each")" '>' 10
    check "the bridge by $each feels force (N)" "$(json force_max_N "$work/$each")" '>' 0.05
    check "the bridge by $each stays under its cap (N)" "$(json force_max_N "$work/$each")" '<=' 3
    cat "$work/$each.err"
done
echo "     pose to frame of trainee one, ms: $(sed 's/.*"latency_ms":{\([^}]*\)}.*/\1/' "$work/one")"
echo "     round trip of the bridges, us: ws $(sed 's/.*"rtt_us":{\([^}]*\)}.*/\1/' "$work/ws")"
echo "                                   lcm $(sed 's/.*"rtt_us":{\([^}]*\)}.*/\1/' "$work/lcm")"
stop $logger
for what in BODY/0 STATUS TOOL/0 HMODEL/0 HSTATUS/0 HCONFIG/0 HEVENT/0; do # tool 1 is not on the bus
    check "the record has PALPATE1/ball/$what" "$(heard $what)" '>' 0
done

# without any server the record alone makes a bridge feel; its hand waits until the recorded hand has pressed, because a
# model that rises around a hand may not push it
stop "$server_job"
begin replay palpate-bridge --server "$bus" --session ball --tool 0 --origin 0,0,0.048 \
    --device "$(device touch),wait=7" --until models=11,force_N=0.06
replay=$job
# at the pace of the record: models that came ever later would be stale
timeout 100 lcm-logplayer -l "$bus" -e 'PALPATE1/ball/HMODEL/0' "$work/record" >/dev/null 2>&1 &
player=$!
pids="$pids $player"
wait $replay
replay_code=$?
stop $player
check "a bridge fed by lcm-logplayer ends well" $replay_code == 0
check "it has models" "$(json models "$work/replay")" '>' 10
check "it feels force (N)" "$(json force_max_N "$work/replay")" '>' 0.05
finish
