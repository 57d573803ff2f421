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

get() { # get PATH [BODY]: status and body; with BODY a POST
    node -e 'const [url, body] = process.argv.slice(1);
        fetch(url, body ? { method: "POST", body, headers: { "Content-Type": "application/json" } } : {}).then(
            async r => console.log(r.status, (await r.text()).slice(0, 800)),
            e => console.log("no answer", String(e)))' "http://127.0.0.1:$port$1" ${2+"$2"}
}
serve() { # serve ARGUMENTS...: starts the server; its output comes through descriptor 3
    rm -f "$work/pipe"
    mkfifo "$work/pipe"
    "$palpate" serve --port 0 --viewer "$work/viewer" "$@" >"$work/pipe" 2>"$work/log" &
    pid=$!
    exec 3<"$work/pipe"
}
waits_for() { # waits_for FILE WORD: copies lines of the server to FILE until one has the word; fails when it ends before
    while IFS= read -r line <&3; do
        echo "$line" >>"$1"
        case $line in *"$2"*) return 0 ;; esac
    done
    return 1
}
ends_with_0() { # ends_with_0 SIGNAL FILE [THREAD]: copies what is left of the output to FILE
    kill -"$1" "${3:-$pid}"
    cat <&3 >>"$2"
    wait "$pid"
}
signal_taker() { # a thread that does not block SIGTERM (bit 14), of OpenBLAS where it has started one, else the first
    taker=$pid
    for task in /proc/"$pid"/task/*; do
        mask=$(sed -n 's/^SigBlk:.*\(....\)$/\1/p' "$task/status")
        [ $((0x$mask & 0x4000)) -ne 0 ] || taker=${task##*/}
    done
    echo "$taker"
}
one_line() { # one_line CODE WORD ARGUMENTS...: exit code, exactly one line on stderr that has the word
    want=$1 word=$2
    shift 2
    "$palpate" serve "$@" >"$work/out" 2>"$work/err"
    [ $? -eq "$want" ] && [ "$(wc -l <"$work/err")" -eq 1 ] && grep -q -- "$word" "$work/err"
}

serve "$work/cube.obj" --units mm --resolution 5 --json
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
check "ends on SIGTERM with 0" ends_with_0 TERM "$work/json"
check "has said nothing else" [ "$(wc -l <"$work/json")" -eq 1 ]
pid=

serve "$work/cube.obj" --units mm --resolution 5 --json
check "opens again" waits_for "$work/again" '"port"'
check "ends on SIGTERM to a thread of a library with 0" ends_with_0 TERM "$work/again" "$(signal_taker)"
pid=

"$palpate" ticket --keys "$work/tickets" --new-key >/dev/null
serve "$work/cube.obj" --resolution 5 --config "$(dirname "$0")/../../deploy/palpate.example.json" --keys "$work/tickets" \
    --record "$work/record" --health 127.0.0.1:0 --json
check "takes the configuration that the tree has as an example" waits_for "$work/example" '"port"'
check "ends with 0" ends_with_0 TERM "$work/example"
pid=

serve "$work/cube.obj" --resolution 5
check "names the address to open" waits_for "$work/plain" 'palpate: open http://127.0.0.1:'
check "ends on SIGINT with 0" ends_with_0 INT "$work/plain"
check "states the unit it guessed" grep -q 'unit mm .*guessed' "$work/plain"
pid=

serve "$work/nothing.obj" "$work/cube.obj" --resolution 5 --open --json
check "serves one scene beside one that is missing" waits_for "$work/two" '"port"'
port=$(sed 's/.*"port": *\([0-9]*\).*/\1/' "$work/two")
get /sessions >"$work/list"
check "lists the session" grep -q '"name":"cube"' "$work/list"
check "and the one that failed, with the reason" grep -q '"name":"nothing",.*"state":"failed","text":".*nothing.obj' "$work/list"
check "opens none without a folder" [ "$(get /sessions '{"open":"cube.obj"}' | cut -c 1-3)" = 405 ]
check "ends with 0" ends_with_0 TERM "$work/two"
check "says so in its log, with the time in UTC" grep -Eq '^[0-9-]{10}T[0-9:]{8}\.[0-9]{3}Z error session: .*nothing.obj is not served' "$work/log"
pid=
check "does not start when all scenes are missing" one_line 1 nothing.obj --port 0 "$work/nothing.obj"

mkdir "$work/scenes"
cp "$work/cube.obj" "$work/scenes"
serve --scenes "$work/scenes" --resolution 5 --open --json
check "starts with nothing but a folder of scenes" waits_for "$work/none" '"port"'
port=$(sed 's/.*"port": *\([0-9]*\).*/\1/' "$work/none")
check "lists no session, and the scene" [ "$(get /sessions)" = '200 {"sessions":[],"scenes":["cube.obj"]}' ]
check "is healthy without a session" [ "$(get /healthz)" = "200 ok" ]
check "opens a scene" [ "$(get /sessions '{"open":"cube.obj"}')" = '202 {"session":"cube"}' ]
check "opens none outside of the folder" [ "$(get /sessions '{"open":"../cube.obj"}' | cut -c 1-3)" = 404 ]
check "ends with 0 while it is opened" ends_with_0 TERM "$work/none"
check "logs who asked" grep -q 'Z info session: cube is being opened for an instructor from 127.0.0.1' "$work/log"
check "logs what was refused" grep -q 'Z info refused: a request from 127.0.0.1: there is no scene ../cube.obj' "$work/log"
pid=

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
