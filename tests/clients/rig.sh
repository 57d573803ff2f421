# Shared by the shell tests of the clients: a small scene, a server on it, numbers out of JSON, waits for what happens.
# Sourced with $bin (folder of the programs) set; needs nothing but the programs and POSIX tools.
set -u
. "$(dirname "$0")/../fixtures/wait_for.sh"
work=$(mktemp -d)
pids=""
passed=0 failed=0

cleanup() {
    for pid in $pids; do kill "$pid" 2>/dev/null; done
    for pid in $pids; do wait "$pid" 2>/dev/null; done
    rm -rf "$work"
}
trap cleanup EXIT
trap 'exit 1' INT TERM

# runs the test again in a network namespace of its own with multicast on lo; exit 77 (left out) where that is refused
own_network() {
    if [ "${PAL_NAMESPACE:-}" != yes ]; then
        for how in -n -rn; do
            if unshare $how true 2>/dev/null; then
                rm -rf "$work"
                PAL_NAMESPACE=yes exec unshare $how sh "$0" "$@"
            fi
        done
        echo "SKIP all: no network namespace (needs root or user namespaces)"
        exit 77
    fi
    ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo || {
        echo "SKIP all: no multicast on lo"
        exit 77
    }
}

# a ball of 40 mm radius, held at its lower third, no gravity: quick to step, the same every time
make_scene() {
    awk 'BEGIN { R = 12; S = 20; r = 0.04; pi = 3.14159265358979
        print "v 0 0 " r
        for (i = 1; i < R; i++) for (j = 0; j < S; j++) {
            t = pi * i / R; p = 2 * pi * j / S
            printf "v %.6f %.6f %.6f\n", r * sin(t) * cos(p), r * sin(t) * sin(p), r * cos(t) }
        print "v 0 0 " (-r); n = 2 + (R - 1) * S
        for (j = 0; j < S; j++) {
            k = (j + 1) % S; print "f 1 " 2 + j " " 2 + k; print "f " n " " 2 + (R - 2) * S + k " " 2 + (R - 2) * S + j
            for (i = 0; i < R - 2; i++) { a = 2 + i * S + j; b = 2 + i * S + k
                print "f " a " " a + S " " b + S; print "f " a " " b + S " " b } } }' >"$work/ball.obj"
    cat >"$work/ball.json" <<'SCENE'
{"name": "ball", "title": "Ball", "gravity_m_s2": 0,
 "bodies": [{"name": "ball", "surface": "ball.obj", "units": "m", "resolution": 6, "supports": [{"lowest": 0.3}],
             "effects": [{"name": "tool_push"}, {"name": "tool_grasp"}, {"name": "finite_guard"}]}],
 "tools": [{"name": "probe 1", "radius_m": 0.008}, {"name": "probe 2", "radius_m": 0.008},
           {"name": "probe 3", "radius_m": 0.008}]}
SCENE
}

# a block of 100 mm of 2 x 2 x 2 control cells that can be sculpted, held at its lowest part, no gravity
make_block() {
    "$bin/palpate" cells block --cells 2,2,2 --size-m 0.1,0.1,0.1 -o "$work/block.palcells" --quiet || exit 1
    cat >"$work/block.json" <<'SCENE'
{"name": "block", "title": "Block", "gravity_m_s2": 0,
 "bodies": [{"name": "block", "cells": "block.palcells", "supports": [{"lowest": 0.2}],
             "model": {"name": "subdivision_fem", "levels": 1}}],
 "tools": [{"name": "probe 1", "radius_m": 0.008}, {"name": "probe 2", "radius_m": 0.008}]}
SCENE
    scene=$work/block.json
}

# start_server [flags]: serves $scene, the ball when it is not set, to everybody unless $admission is empty; sets
# $server_pid, $port, $url
start_server() {
    : >"$work/serve.out"
    timeout 280 "$bin/palpate" serve "${scene:-$work/ball.json}" ${admission---open} --json "$@" >"$work/serve.out" 2>"$work/serve.err" &
    pids="$pids $!"
    server_job=$!
    if ! shows "$work/serve.out" $server_job '"port"'; then
        echo "the server does not start:"
        cat "$work/serve.err"
        exit 1
    fi
    port=$(json port "$work/serve.out")
    server_pid=$(json pid "$work/serve.out")
    url="ws://127.0.0.1:$port/ws"
}

# members N: until the session has so many, for a minute at most
members() { timeout 70 "$bin/palpate-client" "$url" --script idle --name waits --seconds 60 --until members=$(($1 + 1)),frames=1 --quiet; }

# json KEY FILE: first number (or word) of that key
json() { tr ',{}' '\n\n\n' <"$2" | sed -n "s/^\"$1\":\"\{0,1\}\([^\"]*\)\"\{0,1\}\$/\1/p" | head -1; }

# stop JOB: ends what runs under a `timeout`, which hands the signal on; its exit code
stop() {
    kill "$1" 2>/dev/null
    wait "$1" 2>/dev/null
}

# a bridge whose device lives in time of its own: however busy the machine is, its servo loop is never late
device() { echo "virtual:$1,clock=steps"; }

# holds ACTUAL OPERATOR WANTED: compares numbers; nothing is no number
holds() { [ -n "$1" ] && awk -v a="$1" -v b="$3" "BEGIN { exit !(a $2 b) }"; }

# check SENTENCE ACTUAL OPERATOR WANTED: compares numbers
check() {
    if holds "$2" "$3" "$4"; then
        passed=$((passed + 1))
        echo "ok   $1 ($2 $3 $4)"
    else
        failed=$((failed + 1))
        echo "FAIL $1 (${2:-nothing} $3 $4)"
    fi
}

finish() {
    # a sanitizer that speaks on any stderr is a failure
    check "no sanitizer has spoken" "$(cat "$work"/*.err 2>/dev/null | grep -c 'Sanitizer')" == 0
    if [ "$failed" -gt 0 ]; then tail -n 5 "$work"/*.err; fi
    echo "$passed passed, $failed failed"
    [ "$failed" -eq 0 ]
    exit
}
