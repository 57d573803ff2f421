#!/bin/sh
# palpate calibrate as a person runs it: what it says and writes, that a seed gives the same bytes on any number of
# cores, that Ctrl-C and budgets keep the best, and that bad input is refused in one line. Small bodies: the figures of
# the paper are in tests/accuracy. Prints "N passed, N failed"; exit 1 when a check failed.
# usage: test_calibrate.sh PALPATE
set -u
palpate=$(realpath "$1")
. "$(dirname "$0")/shell.sh"
run() { # run ARGS...: into out, err, code
    timeout 120 "$palpate" "$@" >out 2>err </dev/null
    code=$?
}
number() { # number KEY: the first number of that key in out
    sed -n "s/.*\"$1\":\(-\{0,1\}[0-9.e+-]*\)[,}].*/\1/p" out | head -n 1
}
nothing_is_left() {
    check "a file was left" no_such no.json
    check "a mesh was left" no_such no.palmesh
}
refuse() { # refuse CODE TEXT ARGS...
    wanted=$1 text=$2
    shift 2
    begin "refuses: $text"
    run calibrate "$@"
    refused "$wanted" "$text"
    nothing_is_left
    end
}

beam=$problems/beam.json bar=$problems/bar.json
small="--resolution 8 --split 1"

# ---- what comes out ----
# shellcheck disable=SC2086
begin "a fit is better than its start, says so, and plan runs its scene"
run calibrate "$bar" --case bend --verify twist_pull $small --json -o bend.json --trajectory t.svg --picture p.svg \
    --vtk v.vtk
check "exit code $code" code_is 0
check "something is on stderr" is_empty err
check "not one line" lines_are out 1
for key in ok problem cases error_percent start_percent hand_percent verify_percent method evaluations rejected spent \
    ended constants nodes tets springs damping_1_s steady_s live files seconds; do
    check "no key $key" has out "\"$key\":"
done
check "the error is not below the start's" at_most "$(number error_percent)" "$(number start_percent) * 0.9"
check "the live rest is elsewhere" at_most "$(number difference_percent)" 0.1
check "no mesh" [ -s bend.palmesh ]
check "the scene has no constants" has bend.json k_distance_J
check "the scene has no weights" has bend.json '"volume"'
check "the scene does not say how accurate it is" has bend.json 'RMS of finite elements (bend)'
check "the scene does not tell what was not fitted" has bend.json 'twist_pull, not fitted'
check "no trajectory" has t.svg '<svg'
check "no picture" has p.svg '<svg'
check "vtk without constants" has v.vtk k_distance_J
check "vtk without displacements" has v.vtk springs_twist_pull_m
run plan bend.json --json
check "plan refuses the scene" code_is 0
end

begin "on a grid the scene holds a grid and no constant besides"
# shellcheck disable=SC2086
run calibrate "$bar" --case bend $small --grid 3x2x2 --evaluations 10 --json -o grid.json
check "exit code $code" code_is 0
check "no grid in the report" has out '"grid":{"n":\[3,2,2\],"used":12'
check "no grid in the scene" has grid.json '"grid"'
check "not ended by evaluations" has out '"ended":"evaluations"'
run plan grid.json
check "plan refuses the scene" code_is 0
end

begin "people get a table"
# shellcheck disable=SC2086
run calibrate "$bar" --case bend $small --evaluations 5 -o text.json
check "exit code $code" code_is 0
check "no table" has out calibrated
check "no constants" has out 'k_d .* J, .* times the start'
check "no file" has out 'wrote text.json'
# shellcheck disable=SC2086
run calibrate "$bar" --case bend $small --decades 0.05 --evaluations 20 -o text.json
check "does not say that a constant stands at its bound" has out 'k_d .*, as far as --decades lets it go'
end

# ---- the same again ----
anneal() { # anneal NAME WORKERS
    # shellcheck disable=SC2086
    run calibrate "$bar" --case bend $small --method annealing --kinematics linear --evaluations 150 --seed 7 \
        --workers "$2" --json -o "$1/s.json"
}
# the folders one, again and two are made, as those of prepare and study are
begin "annealing with one seed writes the same bytes, on one core or two"
anneal one 1
check "exit code $code" code_is 0
check "worse than the start" at_most "$(number error_percent)" "$(number start_percent)"
anneal again 1
anneal two 2
check "the same seed gave another scene" same one/s.json again/s.json
check "two workers gave another scene" same one/s.json two/s.json
check "the mesh differs" same one/s.palmesh two/s.palmesh
# shellcheck disable=SC2086
run calibrate "$bar" --case bend $small --evaluations 2 --quiet -o named/scene.json
check "a scene.json is not named after its folder" has named/scene.json '"name":[[:space:]]*"named"'
end

# ---- ends ----
begin "Ctrl-C keeps the best so far"
# on a terminal of its own, where it shows its progress and the key is pressed
mkfifo keys
script -qec "'$palpate' calibrate '$bar' --case bend $small --method annealing --evaluations 100000000 -o stop.json >out" \
    /dev/null <keys >err 2>&1 &
pid=$!
exec 3>keys
check "no progress" grows err "$pid" 50
printf '\003' >&3
wait "$pid"
code=$?
exec 3>&-
check "exit code $code" code_is 0
check "does not say that it was stopped" has out 'annealing: stopped after'
check "worse than the start" at_most "$(awk '$1 == "bend" { print $(NF - 1) }' out)" "$(awk '$1 == "bend" { print $(NF - 5) }' out)"
run plan stop.json
check "plan refuses the scene" code_is 0
end

begin "a budget ends the search"
# shellcheck disable=SC2086
run calibrate "$bar" --case bend $small --method annealing --evaluations 100000000 --budget 0.3 --json -o budget.json
check "exit code $code" code_is 0
check "does not say so" has out '"ended":"budget"'
check "worse than the start" at_most "$(number error_percent)" "$(number start_percent)"
end

begin "a reference is its own truth"
run calibrate "$beam" --case timoshenko --evaluations 3 --resolution 16 --json -o ref.json
check "exit code $code" code_is 0
check "not the reference" has out '"truth":"timoshenko","kinematics":"linear"'
end

# ---- a hand's loads ----
client=$(dirname "$palpate")/palpate-client
if [ -x "$client" ]; then
    "$palpate" prepare --procedural --resolution 10 -o organ >out 2>err
    "$palpate" serve organ/scene.json --open --record pull.log --port 0 --seconds 20 >served 2>&1 &
    server=$!
    begin "the touches of a recording become load cases, a release the damping"
    check "the server does not say where it is" shows served "$server" 'open http'
    "$client" "ws://$(sed -n 's,.*open http://\([0-9.:]*\)/.*,\1,p' served)/ws" --script pull --seconds 5 \
        >out 2>err
    kill -INT "$server"
    wait "$server"
    run calibrate organ/scene.json --from pull.log --split 1 --budget 5 --json -o hand.json
    check "exit code $code" code_is 0
    check "the replay differs" has out '"replay_equal":true'
    for key in from load_share release; do check "no key $key" has out "\"$key\":"; done
    check "no pull among the cases" has out '"id":"pull-1"'
    check "a case without its moment and force" has out '"time_s":[0-9.]*,"force_N":[0-9.]*'
    check "the error is not below the start's" at_most "$(number error_percent)" "$(number start_percent)"
    check "the scene has no constants" has hand.json k_distance_J
    check "the scene does not say what it was fitted to" has hand.json 'calibrated on pull-1'
    run plan hand.json
    check "plan refuses the scene" code_is 0
    end
    refuse 1 "no load case or reference" organ/scene.json --from pull.log --case press-9 -o no.json
    refuse 1 "is not fem or recording" organ/scene.json --from pull.log --truth reference -o no.json
    refuse 1 "recorded from another scene" hand.json --from pull.log -o no.json
    begin "does not write over the recording"
    cp pull.log kept.log
    run calibrate organ/scene.json --from pull.log -o pull.log
    refused 1 "is the recording itself"
    check "the recording changed" same pull.log kept.log
    end
else
    skip "loads of a recorded hand" "palpate-client is not built"
fi

# ---- refusals ----
refuse 2 "--case ID is missing" "$bar" -o no.json
refuse 2 "-o SCENE.json is missing" "$bar" --case bend
refuse 1 'no load case or reference "nothing"; known are bend, twist_pull' "$bar" --case nothing -o no.json
refuse 2 "--grid: is not" "$bar" --case bend --grid 0x3x3 -o no.json
refuse 2 "--grid: is not" "$bar" --case bend --grid 5x5 -o no.json
refuse 2 "--grid: is not" "$bar" --case bend --grid 5x5x5x5 -o no.json
refuse 1 "--grid: 50 x 50 x 50 nodes" "$bar" --case bend --grid 50x50x50 -o no.json
refuse 1 "is fitted" "$bar" --case bend --verify bend -o no.json
refuse 1 "stands there twice" "$bar" --case bend,bend -o no.json
: >file
refuse 1 "file: is there and not a folder" "$bar" --case bend -o file/no.json
refuse 2 "--budget: 0 is outside" "$bar" --case bend --budget 0 -o no.json
refuse 2 "--method: \"foo\" is not adjoint or annealing" "$bar" --case bend --method foo -o no.json
refuse 2 "--kinematics: \"foo\" is not finite or linear" "$bar" --case bend --kinematics foo -o no.json
refuse 1 "no reference answers" "$bar" --case bend --truth reference -o no.json
refuse 1 "is linear, --kinematics says finite" "$beam" --case timoshenko --kinematics finite -o no.json
refuse 1 "outside of the body: is it of another one?" "$problems/cube.json" --case push --resolution 8 \
    --truth "$problems/beam_timoshenko.csv" -o no.json

cp "$problems/bar.obj" "$problems/beam.obj" .
begin "does not write over the problem"
cp "$bar" no.json
run calibrate no.json --case bend -o no.json
check "exit code $code" code_is 1
check "says something else" has err "is the problem itself"
check "the problem changed" same no.json "$bar"
rm -f no.json
end

begin "does not write over a surface or a pipe"
cp "$bar" read.json
run calibrate read.json --case bend -o bar.obj
check "exit code $code" code_is 1
check "says something else" has err "is the problem's surface itself"
check "the surface changed" same bar.obj "$problems/bar.obj"
mkfifo pipe
run calibrate read.json --case bend -o x.json --vtk pipe
check "exit code $code" code_is 1
check "says something else" has err "pipe exists and is not a file"
check "the pipe is gone" [ -p pipe ]
run calibrate read.json --case bend -o x.json --vtk ./x.json
check "exit code $code" code_is 1
check "says something else" has err "is the file of -o as well"
end

problem() { # problem SUPPORTS LOADS: problem.json, a beam
    cat >problem.json <<END
{"format": "palpate-reference-1", "name": "made up", "surface": "beam.obj",
 "materials": [{"id": "a", "region": {"type": "all"}, "E": 80000, "nu": 0.3}],
 "supports": [$1], "load_cases": [{"id": "c", "loads": [$2]}]}
END
}
end_box='{"type": "box", "min": [-1, -1, -1], "max": [0.000001, 1, 1]}'
tip='{"type": "point", "point": [0.32, 0, 0], "force": [0, 0, -0.01]}'
problem "" "$tip"
refuse 1 "nothing holds the body" problem.json --case c --resolution 16 -o no.json
problem "{\"type\": \"fixed\", \"region\": $end_box}" '{"type": "point", "point": [0.32, 0, 0], "force": [0, 0, 0]}'
refuse 1 "nothing to fit" problem.json --case c --resolution 16 -o no.json
problem "{\"type\": \"fixed\", \"region\": $end_box}" '{"type": "point", "point": [0, 0, 0], "force": [0, 0, -1]}'
refuse 1 "on nodes that a support holds" problem.json --case c --resolution 16 -o no.json
problem "{\"type\": \"fixed\", \"region\": $end_box}" "$tip, $(echo "$tip" | sed 's/-0.01/0.01/')"
refuse 1 "loads cancel each other" problem.json --case c --resolution 16 -o no.json
problem '{"type": "fixed", "region": {"type": "box", "min": [-1, -1, 0.019999], "max": [0.000001, 1, 1]}}' "$tip"
refuse 1 "all on one line" problem.json --case c --resolution 16 -o no.json
problem "{\"type\": \"moved\", \"region\": $end_box, \"move\": [0, 0, 0.01]}" "$tip"
refuse 1 "supports\[0\]: moves" problem.json --case c --resolution 16 -o no.json

finish
