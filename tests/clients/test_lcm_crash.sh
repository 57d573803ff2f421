#!/bin/sh
# Two forged fragments on the bus end palpate-lcm and nothing else: it is back within a second or so, the session has gone
# on. In a network namespace of its own. usage: test_lcm_crash.sh FOLDER_OF_PROGRAMS FORGE_PROGRAM
bin=$1 forge=$2
. "$(dirname "$0")/rig.sh"
own_network "$@"
make_scene
start_server --port 8090 --lcm 'udpm://239.255.76.67:7667?ttl=0' --log info
lcm_pid() { ps -o pid=,comm= --ppid "$server_pid" | awk '$2 == "palpate-lcm" { print $1 }'; }
have_lcm() { [ -n "$(lcm_pid)" ] && grep -q lcm_joined "$work/serve.err"; }
await 20 have_lcm
before=$(lcm_pid)
check "the server runs palpate-lcm" "$(echo "$before" | wc -w)" == 1

# a watcher over the whole time: the session may not miss a step
timeout 60 "$bin/palpate-client" "$url" --script press --seconds 7 --json >"$work/watch" 2>"$work/watch.err" &
watch=$!
sleep 2
start=$(date +%s%N)
"$forge" 239.255.76.67 7667 PALPATE1/ball/TOOL/0
other() { now=$(lcm_pid) && [ -n "$now" ] && [ "$now" != "$before" ]; }
gone() { [ -z "$(lcm_pid)" ] || other; }
await 5 gone
check "two forged fragments end it" $? == 0
await 5 other
check "the server starts it again" $? == 0
took=$((($(date +%s%N) - start) / 1000000))
check "within seconds, a second on a quiet machine (ms)" "$took" '<' 5000
check "by the signal of a bad address" "$(grep -c 'died of signal 11' "$work/serve.err")" '>=' 1
joined_twice() { [ "$(grep -c lcm_joined "$work/serve.err")" -ge 2 ]; }
await 10 joined_twice
check "and it joins the session again" $? == 0
wait $watch
check "a trainee has seen every check pass all the while" $? == 0
check "never lost its connection" "$(json reconnects "$work/watch")" == 0
check "and no gap as of a restart in the session's frames (ms)" \
    "$(tr ',{}' '\n\n\n' <"$work/watch" | sed -n '/gap_ms/,/max/s/"max"://p' | head -1)" '<' 2000
check "the server is the same process" "$(kill -0 "$server_pid" && echo 1)" == 1

# without a multicast route: one warning that names the remedy, and it goes on trying
ip route del 224.0.0.0/4 dev lo
timeout 30 "$bin/palpate-lcm" --server "$url" --seconds 2 --quiet >/dev/null 2>"$work/noroute"
check "palpate-lcm runs without a multicast route" $? == 0
check "says so once" "$(wc -l <"$work/noroute")" == 1
check "and names the command that adds one" "$(grep -c 'ip route add' "$work/noroute")" == 1
timeout 10 "$bin/palpate-lcm" --server "$url?session=none" --seconds 5 --quiet >/dev/null 2>&1
check "a session that does not exist is a failure" $? == 1
finish
