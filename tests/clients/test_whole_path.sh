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
tries=4 # of what a bridge whose servo loop was late is allowed
make_scene
start_server --port 8090 --lcm "$bus" --log info
await 30 grep -q lcm_joined "$work/serve.err"
check "palpate-lcm has joined" $? == 0

# how many messages of that channel the record has
heard() { grep -ao "PALPATE1/ball/$1" "$work/record" 2>/dev/null | wc -l; }
# has the record so many of that channel?
has() { [ "$(heard "$1")" -ge "$2" ]; }
begin() { # NAME PROGRAM [flags]: in the background, at most two minutes; sets $job
    name=$1 program=$2
    shift 2
    timeout 120 "$bin/$program" "$@" --json >"$work/$name" 2>"$work/$name.err" &
    job=$!
    pids="$pids $job"
}
# felt NAME: did the bridge feel force?
felt() { holds "$(json force_max_N "$work/$1")" '>' 0.05; }
again() { # NAME...: is one of them to be tried again? says so
    for name in "$@"; do
        felt "$name" && continue
        late "$work/$name" || return 1
        echo "     the servo loop of $name was late: $(json forces "$work/$name"), once more"
        return 0
    done
    return 1
}

# it listens when the first message is in the record: what is said but once at the start is heard
timeout 240 lcm-logger --lcm-url="$bus" -f "$work/record" >/dev/null 2>&1 &
logger=$!
pids="$pids $logger"
await 30 has STATUS 1
check "lcm-logger records" $? == 0

begin one palpate-client "$url" --script press --depth 0.006 --seconds 110 --tool 2 --name one
one=$job
begin two palpate-client "$url" --script idle --seconds 110 --name two
two=$job
for try in $(seq $tries); do
    wanted=$(($(heard HMODEL/0) + 300)) # at 60 Hz five seconds of touch
    begin lcm palpate-bridge --server "$bus" --session ball --tool 0 --origin 0,0,0.048 --device virtual:touch
    by_lcm=$job
    begin ws palpate-bridge --server "$url" --tool 1 --device virtual:premium --script cycle
    by_ws=$job
    sleep 7
    await 30 has HMODEL/0 $wanted
    stop $by_lcm
    lcm_code=$?
    stop $by_ws
    ws_code=$?
    [ $try -lt $tries ] && again lcm ws || break
    sleep 1.5 # a sender that is silent for a second may begin to count anew
done
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

# without any server the record alone makes a bridge feel
stop "$server_job"
for try in $(seq $tries); do
    begin replay palpate-bridge --server "$bus" --session ball --tool 0 --origin 0,0,0.048 --device virtual:touch
    replay=$job
    timeout 100 lcm-logplayer -l "$bus" -e 'PALPATE1/ball/HMODEL/0' "$work/record" >/dev/null 2>&1
    stop $replay
    replay_code=$?
    [ $try -lt $tries ] && again replay || break
done
check "a bridge fed by lcm-logplayer ends well" $replay_code == 0
check "it has models" "$(json models "$work/replay")" '>' 10
check "it feels force (N)" "$(json force_max_N "$work/replay")" '>' 0.05
finish
