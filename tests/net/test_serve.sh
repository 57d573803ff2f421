#!/bin/sh
# The whole program: serves a cube, answers, refuses what it must with one line, ends on SIGTERM with 0.
# usage: test_serve.sh PALPATE
set -u
palpate=$1
work=$(mktemp -d) || exit 1
passed=0 failed=0 pid=
trap '[ -n "$pid" ] && kill -9 "$pid" 2>/dev/null; rm -rf "$work"' EXIT

check() { # check SENTENCE COMMAND...
    sentence=$1
    shift
    if "$@"; then
        passed=$((passed + 1))
        echo "ok   $sentence"
    else
        failed=$((failed + 1))
        echo "FAIL $sentence"
    fi
}

cat >"$work/cube.obj" <<END
v 0 0 0
v 80 0 0
v 80 80 0
v 0 80 0
v 0 0 80
v 80 0 80
v 80 80 80
v 0 80 80
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
END
mkdir "$work/viewer"
echo '<p>page' >"$work/viewer/index.html"

get() { # get PATH: status and body
    node -e 'fetch(process.argv[1]).then(async r => console.log(r.status, (await r.text()).slice(0, 200)),
        e => console.log("no answer", String(e)))' "http://127.0.0.1:$port$1"
}
waits_for() { # waits_for FILE WORD: until the line is there or the server is gone, at most 90 s
    n=0
    while ! grep -q "$2" "$1" 2>/dev/null; do
        n=$((n + 1))
        [ $n -lt 900 ] && kill -0 "$pid" 2>/dev/null || return 1
        sleep 0.1
    done
}
one_line() { # one_line CODE WORD ARGUMENTS...: exit code, exactly one line on stderr that has the word
    want=$1 word=$2
    shift 2
    "$palpate" serve "$@" >"$work/out" 2>"$work/err"
    [ $? -eq "$want" ] && [ "$(wc -l <"$work/err")" -eq 1 ] && grep -q -- "$word" "$work/err"
}

"$palpate" serve "$work/cube.obj" --units mm --resolution 5 --port 0 --viewer "$work/viewer" --json \
    >"$work/json" 2>"$work/log" &
pid=$!
check "says where it is in one JSON line" waits_for "$work/json" '"port"'
port=$(sed 's/.*"port": *\([0-9]*\).*/\1/' "$work/json")
check "tells its own pid" grep -q "\"pid\": *$pid[,}]" "$work/json"
check "is healthy" [ "$(get /healthz)" = "200 ok" ]
check "serves the page" [ "$(get /)" = "200 <p>page" ]
check "lists the session" sh -c "echo '$(get /sessions)' | grep -q '\"name\":\"cube\"'"
check "refuses a port in use in one line" one_line 1 "in use" "$work/cube.obj" --resolution 4 --port "$port"
check "refuses another address in one line" one_line 1 allow-remote "$work/cube.obj" --resolution 4 --listen 0.0.0.0
check "refuses a missing file in one line" one_line 1 nothing.obj "$work/nothing.obj"
check "refuses an unknown unit in one line" one_line 1 ell "$work/cube.obj" --units ell
check "refuses an unknown flag as usage" one_line 2 --frobnicate "$work/cube.obj" --frobnicate
kill -TERM "$pid"
wait "$pid"
check "ends on SIGTERM with 0" [ $? -eq 0 ]
check "has said nothing else" [ "$(wc -l <"$work/json")" -eq 1 ]
pid=

"$palpate" serve "$work/cube.obj" --resolution 5 --port 0 --viewer "$work/viewer" >"$work/plain" 2>"$work/log" &
pid=$!
check "names the address to open" waits_for "$work/plain" 'palpate: open http://127.0.0.1:'
check "states the unit it guessed" grep -q 'unit mm .*guessed' "$work/plain"
kill -INT "$pid"
wait "$pid"
check "ends on SIGINT with 0" [ $? -eq 0 ]
pid=

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
