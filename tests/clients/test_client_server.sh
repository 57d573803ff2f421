#!/bin/sh
# palpate-client against a real server: presses, pulls, many at once, slow and stalled readers, a server that goes and
# comes back, nobody at the address. usage: test_client_server.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
"$bin/palpate-client" --help >"$work/help"
check "no line of the help is longer than 120" "$(awk 'length > 120' "$work/help" | wc -l)" == 0
timeout 20 "$bin/palpate-client" ws://127.0.0.1:1/ws --until "" 2>"$work/nothing"
code=$?
check "to wait for nothing is wrong usage" $code == 2
check "which is said in one line that names the flag" "$(grep -c -e '--until ""' "$work/nothing")/$(wc -l <"$work/nothing")" == 1/1
make_scene
start_server --port 0
run() { # NAME flags: report in $work/NAME, exit code in $code
    name=$1
    shift
    timeout 100 "$bin/palpate-client" "$url" --json "$@" >"$work/$name" 2>"$work/$name.err"
    code=$?
    [ $code -eq 0 ] || cat "$work/$name.err"
}

run press --script press --seconds 60 --until answered=10,moved_mm=2.1,force_N=0.06
check "a press passes every check of every frame" $code == 0
check "its poses come back in frames" "$(tr ',{}' '\n\n\n' <"$work/press" | sed -n '/latency_ms/,/mean/s/"n"://p' | head -1)" '>' 2
check "the organ gives way by more than 2 mm" "$(json moved_mm "$work/press")" '>' 2
check "the tool feels it" "$(json force_max_N "$work/press")" '>' 0.05

run pull --script pull --seconds 60 --until moved_mm=5.1
check "a pull passes every check" $code == 0
check "it moves the organ by more than 5 mm" "$(json moved_mm "$work/pull")" '>' 5

# for the rate six seconds
run field --script press --seconds 60 --field displacement --until fields=60,field_high=0.0016
check "a field that is asked for passes every check" $code == 0
check "it comes about ten times a second" "$(tr ',{}' '\n\n\n' <"$work/field" | sed -n 's/"per_s"://p')" '<=' 11
check "and more than once" "$(tr ',{}' '\n\n\n' <"$work/field" | sed -n '/"field":/,/high/s/"n"://p')" '>' 1
check "its values reach what the vertices moved" "$(tr ',{}' '\n\n\n' <"$work/field" | sed -n 's/"high"://p')" '>' 0.0015
run stress --script press --seconds 60 --until frames=5 --field von_mises 2>/dev/null
check "a body of springs gives no stress" $code == 1
check "which is said in one line" "$(grep -c 'von_mises' "$work/stress.err")" == 1

printf '# t x y z buttons\n0 0 0 0.02 0\n1 0 0 0.004 0\n2 0 0 0.02 0\n' >"$work/script"
run file --script "$work/script" --seconds 60 --until force_N=0.02
check "a script from a file runs" $code == 0
check "and touches" "$(json force_max_N "$work/file")" '>' 0.01

run crowd --clients 8 --script circle --seconds 60 --until frames=20,cycles=20
check "eight at once pass every check" $code == 0
check "all of them have joined" "$(json joined "$work/crowd")" == 8
check "each tool has one holder" "$(json with_tool "$work/crowd")" == 3

# a slow reader beside a fast one: the fast one is served as if alone
timeout 60 "$bin/palpate-client" "$url" --json --script idle --slow 3000 --seconds 50 --name slow >"$work/slow" 2>"$work/slow.err" &
slow=$!
members 1
run fast --script press --seconds 60 --until cycles=200
stop $slow
check "a slow reader passes every check" $? == 0
check "and takes fewer cycles" "$(json cycles_per_s "$work/slow")" '<' "$(json cycles_per_s "$work/fast")"
check "a fast one beside it passes" $code == 0

run stall --stall 2 --script press --seconds 60 --until stalls=1,cycles_after_stall=60
check "a reader that stalls for 2 s passes every check" $code == 0
# at most the credit of 12 cycles was on its way, and one may come again with another accuracy
check "and is current again within the credit" "$(json old_cycles_after_stall "$work/stall")" '<=' 13

# the connection ends between a frame and what closes its cycle; another server, whose cycles begin anew, takes it up
old_port=$port old_job=$server_job
start_server --port 0
node "$(dirname "$0")/cut.mjs" "$old_port" "$port" >"$work/cut" &
pids="$pids $!"
shows "$work/cut" $! '^[0-9]'
url="ws://127.0.0.1:$(head -1 "$work/cut")/ws"
run cut_off --script press --seconds 60 --until joins=2,cycles_of_it=20
check "one that is cut off within a cycle goes on elsewhere" $code == 0
check "it was cut off at a cycle that the other has not reached" "$(sed -n 2p "$work/cut")" '>=' 50
check "and has joined again" "$(json reconnects "$work/cut_off")" '>=' 1
kill "$server_job"
wait "$server_job" 2>/dev/null
port=$old_port server_job=$old_job url="ws://127.0.0.1:$old_port/ws"

# the server goes away and comes back on the same port
timeout 100 "$bin/palpate-client" "$url" --json --seconds 60 --until joins=2,cycles_of_it=20 >"$work/again" 2>"$work/again.err" &
again=$!
members 1
kill "$server_job"
wait "$server_job" 2>/dev/null
start_server --port "$port"
wait $again
check "a trainee outlives its server" $? == 0
check "and joins again by itself" "$(json reconnects "$work/again")" '>=' 1

kill "$server_job"
wait "$server_job" 2>/dev/null
run nobody --seconds 1 2>/dev/null
check "nobody at the address is a failure" $code == 1
check "said in one line" "$(wc -l <"$work/nobody.err")" == 1
timeout 5 "$bin/palpate-client" ftp://x >/dev/null 2>&1
check "an address of another kind is refused" $? == 1
timeout 5 "$bin/palpate-client" "$url" --nonsense >/dev/null 2>&1
check "an unknown flag is wrong usage" $? == 2
timeout 5 "$bin/palpate-client" "$url" --field rainbow >/dev/null 2>&1
check "so is a field that there is not" $? == 2
finish
