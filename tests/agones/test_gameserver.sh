#!/bin/sh
# palpate serve as an Agones game server: ready, health, allocation by the first who joins, and none of it where there is
# no sidecar. usage: test_gameserver.sh FOLDER_OF_PROGRAMS FAKE_SIDECAR
bin=$1 fake=$2
. "$(dirname "$0")/../clients/rig.sh"
make_scene
threads() { ls "/proc/$server_pid/task" | wc -l; }
timeout 250 "$fake" >"$work/sidecar" &
sidecar=$!
pids="$pids $sidecar"
shows "$work/sidecar" $sidecar '^port '
export AGONES_SDK_HTTP_PORT="$(sed -n 's/^port //p' "$work/sidecar")"
start_server --port 0 --drain-to http://127.0.0.1:1/
shows "$work/sidecar" $sidecar '^POST /ready {}'
check "it is ready" $? == 0
shows "$work/sidecar" $sidecar '^POST /health {}' 2
check "its simulation's heartbeat is its health" $? == 0
check "it has one session" "$(grep -c '^PUT /metadata/label {"key":"sessions","value":"1"}' "$work/sidecar")" == 1
with=$(threads)
timeout 250 "$bin/palpate-client" "$url" --script idle --seconds 200 --quiet 2>"$work/client.err" &
client=$!
pids="$pids $client"
shows "$work/sidecar" $sidecar '^POST /allocate {}'
check "who joins allocates it" $? == 0
kill -TERM "$server_pid"
wait "$server_job"
check "and SIGTERM ends it with 0" $? == 0
kill $client
unset AGONES_SDK_HTTP_PORT
start_server --port 0
check "without a sidecar there is no thread for it" $(threads) == $((with - 1))
finish
