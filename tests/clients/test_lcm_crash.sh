#!/bin/sh
# Two forged fragments on the bus end palpate-lcm and nothing else: the server starts it again, the session goes on. In a network namespace of its own. usage: test_lcm_crash.sh FOLDER_OF_PROGRAMS FORGE_PROGRAM
bin=$1 forge=$2
. "$(dirname "$0")/rig.sh"
own_network "$@"
make_scene
start_server --port 8090 --lcm 'udpm://239.255.76.67:7667?ttl=0' --log info
lcm_pid() { ps -o pid=,comm= --ppid "$server_pid" | awk '$2 == "palpate-lcm" { print $1 }'; }
shows "$work/serve.err" $server_job lcm_joined
before=$(lcm_pid)
check "the server runs palpate-lcm" "$(echo "$before" | wc -w)" == 1

# a watcher over the whole time
timeout 280 "$bin/palpate-client" "$url" --script press --seconds 270 --json >"$work/watch" 2>"$work/watch.err" &
watch=$!
members 1
"$forge" 239.255.76.67 7667 PALPATE1/ball/TOOL/0
shows "$work/serve.err" $server_job "palpate-lcm ($before) died of signal 11"
check "two forged fragments end it by the signal of a bad address" $? == 0
shows "$work/serve.err" $server_job lcm_joined 2
check "the server starts it again, and it joins the session again" $? == 0
check "as another process" "$(lcm_pid | grep -cvx "$before")" == 1
members 1 # what the session shows goes on
stop $watch
check "a trainee has seen every check pass all the while" $? == 0
check "never lost its connection" "$(json reconnects "$work/watch")" == 0
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
