#!/bin/sh
# palpate study as a person runs it: what it says and writes, that it goes on after Ctrl-C and measures nothing twice,
# that what it names is a scene which plan and serve take, that a scene which asks for an accuracy gets it, and that bad
# input is refused in one line. Quick studies of a small body: figures are in tests/study and tests/accuracy. Prints
# "N passed, N failed"; exit 1 when a check failed.
# usage: test_study.sh PALPATE
set -u
palpate=$(realpath "$1")
. "$(dirname "$0")/shell.sh"
run() { # run ARGS...: into out, err, code
    timeout 300 "$palpate" "$@" >out 2>err </dev/null
    code=$?
}
number() { # number KEY FILE: the first number of that key
    sed -n "s/.*\"$1\":[[:space:]]*\(-\{0,1\}[0-9][0-9.e+-]*\)[,}].*/\1/p" "$2" | head -n 1
}
count() { grep -o "$1" "$2" | wc -l | tr -d ' '; }
refuse() { # refuse CODE TEXT ARGS...
    wanted=$1 text=$2
    shift 2
    begin "refuses: $text"
    run "$@"
    refused "$wanted" "$text"
    end
}

beam=$problems/beam.json

# ---- words ----
refuse 2 "no operand is given" study
refuse 2 "within: \"1\" is not a length" study "$beam" --within 1
refuse 2 "within: \"1ms\" is not a length" study "$beam" --within 1ms
refuse 2 "within: \"0mm\" is not a length" study "$beam" --within 0mm
refuse 2 "within: \"-1mm\" is not a length" study "$beam" --within -1mm
refuse 2 "within: \"nanmm\" is not a length" study "$beam" --within nanmm
refuse 2 "budget: \"4mm\" is not a time" study "$beam" --budget 4mm
refuse 2 "budget: \"\" is not a time" study "$beam" --budget ""
refuse 2 "which name the configuration to write" study "$beam" -o x
refuse 2 "pick: 0 is outside" study "$beam" --pick 0
refuse 2 "pick: \"x\"" study "$beam" --pick x
refuse 2 "pick: names the configuration of a row, --budget does not go with it" study "$beam" --pick 3 --budget 1ms
refuse 1 "pick 3: there is no o/study.json yet: run palpate study .*beam.json" study "$beam" --pick 3 --out o
refuse 2 "methods: \"fem,femur\" contains a name that is not" study "$beam" --methods fem,femur
refuse 2 "methods: \"fem,\" contains a name that is not" study "$beam" --methods fem,
refuse 2 "units: \"ell\" is not m, cm" study "$beam" --units ell
refuse 2 "seconds: 0 is outside" study "$beam" --seconds 0
refuse 1 "no load case or reference \"none\"; known are tip, tip_far, hang, timoshenko" study "$beam" --case none --out o
refuse 1 "a problem has one body" study "$beam" --body liver --out o
refuse 1 "none.csv" study "$beam" --reference none.csv --out o
refuse 1 "nowhere.json" study nowhere.json --out o
begin "nothing is made for what is refused"
check "a folder was made" [ ! -e o ]
end

# ---- a quick study, broken off and gone on with ----
begin "Ctrl-C keeps what was measured and says how to go on"
# in a group of its own and with the interrupt not ignored, as a terminal starts it; a study that was over before the
# signal came is begun anew
for _ in 1 2 3 4 5; do
    rm -rf o
    mkdir o
    setsid sh -c 'trap - INT; exec "$@"' sh "$palpate" study "$beam" --quick --out o --json >out 2>err </dev/null &
    child=$!
    shows o/study.json "$child" '"model"'
    kill -INT "$child" 2>/dev/null
    wait "$child"
    code=$?
    if [ "$code" -ne 0 ]; then break; fi
done
check "exit code $code" code_is 1
check "stderr does not say how to continue" has err "the same command continues"
check "stdout has not one line" lines_are out 1
check "stdout is no refusal" has out '"code":"STATE"'
check "it says it is whole" has o/study.json '"complete":[[:space:]]*false'
before=$(count '"model"' o/study.json)
check "no point was kept" [ "$before" -ge 1 ]
cp o/study.json broken_off.json
end

begin "the same command goes on, measures nothing twice and writes all of its files"
run study "$beam" --quick --out o --json
check "exit code $code" code_is 0
check "something is on stderr" is_empty err
check "not one line" lines_are out 1
check "$(number measured_before out) measured before, wanted $before" [ "$(number measured_before out)" = "$before" ]
all=$(count '"model"' o/study.json)
check "measured $(number measured out) of $all" [ "$(number measured out)" -eq "$((all - before))" ]
check "it is not whole" has o/study.json '"complete":[[:space:]]*true'
for file in study.json study.csv study.svg study.html; do check "no $file" [ -s o/$file ]; done
check "the table has not a row a configuration" lines_are o/study.csv "$((all + 1))"
check "the page has not a row a configuration" [ "$(count '<tr' o/study.html)" -eq "$((all + 1))" ]
check "the page asks for other files" [ "$(grep -c -E '(src|href)=' o/study.html)" -eq 0 ]
check "the drawing is not in the page" has o/study.html "<svg "
check "no real time" has o/study.svg "real time"
check "no front" has o/study.svg "the front"
# what was measured before stands there to the bit, and its time is no longer: the least of what it took counts
first=$(number error_m broken_off.json)
check "the first error changed" has o/study.json "\"error_m\":[[:space:]]*$first"
check "the first milliseconds grew" at_most "$(number ms o/study.json)" "$(number ms broken_off.json)"
end

begin "a whole study is shown again without measuring"
cp o/study.json whole.json
run study "$beam" --quick --out o
check "exit code $code" code_is 0
check "it does not say what it had" has out "$all of $all measured before"
check "no front" has out "^\*"
check "a line is too wide for a terminal of 120 columns" test "$(awk 'length > 120' out | wc -l)" -eq 0
check "does not say that its reference is coarse" has out "^Quick: a coarse reference"
check "the page does not say so" has o/study.html "a coarse reference"
check "the study changed" cmp -s o/study.json whole.json
rows=$(grep -c -E '^[* ] +[0-9]' out)
bad_rows=$(grep -c "^not measured: " out)
check "$rows rows and $bad_rows not measured, wanted $all" [ "$((rows + bad_rows))" -eq "$all" ]
# by ascending milliseconds
check "not in the order of ms" sh -c "grep -E '^[* ] +[0-9]' out | cut -c 7-15 | sort -c -n"
check "its rows are not counted from 1" sh -c "grep -E '^[* ] +[0-9]' out | cut -c 2-6 | sort -c -n -u"
end

refuse 1 "other loads" study "$beam" --quick --out o --seconds 0.2
refuse 1 "other loads" study "$beam" --quick --out o --case tip_far
refuse 1 "is of a quick study: --quick continues it" study "$beam" --out o
sed 's/"machine":.*/"machine": "another one",/' whole.json >o/study.json
refuse 1 "another machine (another one): --again starts over" study "$beam" --quick --out o
sed 's/"shape":.*/"shape": "0000000000000000",/' whole.json >o/study.json
refuse 1 "another body" study "$beam" --quick --out o
head -c 1000 whole.json >o/study.json
refuse 1 "again starts over" study "$beam" --quick --out o
sed 's/"complete":.*/"complete": 3,/' whole.json >o/study.json
refuse 1 "complete: is not true or false" study "$beam" --quick --out o
cp whole.json o/study.json

# ---- picking ----
most=$(number max_m o/study.json)
loose=$(awk "BEGIN { printf \"%.6gmm\", 1000 * $most }")
begin "the cheapest within an error is written as a scene that plan takes"
run study "$beam" --quick --out o --within "$loose" -o near --json
check "exit code $code" code_is 0
check "nothing was measured" [ "$(number measured out)" = 0 ]
check "no configuration" has out '"picked":{"point":'
check "no scene" [ -s near/scene.json ]
check "no study beside it" [ -s near/study.json ]
check "does not say how far off it is" has near/scene.json '"accuracy":[[:space:]]*"within '
run plan near --json
check "plan: exit code $code" code_is 0
check "plan: something is on stderr" is_empty err
check "plan: the study is of another body" [ "$(grep -c study_warning out)" -eq 0 ]
check "plan: picked without being asked" [ "$(grep -c '"picked"' out)" -eq 0 ]
end

begin "the most accurate in a time, and both, are named"
run study "$beam" --quick --out o --budget 1s --json
check "exit code $code" code_is 0
accurate=$(sed -n 's/.*"picked":{[^}]*"error_m":\([0-9.e+-]*\).*/\1/p' out)
run study "$beam" --quick --out o --budget 1s --within "$loose" --json
check "exit code $code" code_is 0
cheap=$(sed -n 's/.*"picked":{[^}]*"error_m":\([0-9.e+-]*\).*/\1/p' out)
check "the cheapest ($cheap m) is nearer than the most accurate ($accurate m)" at_most "$accurate" "$cheap"
end

begin "which configuration serves is asked of the study that is there, whatever its loads, and nothing else is said"
run study "$beam" --out o --budget 1s
check "exit code $code" code_is 0
check "the answer does not say how far off, of what loads" has out "mm off.*under load case .*quick, that move it by up to"
check "the table stands above it" [ "$(grep -c -E '^[* ] +[0-9]' out)" -eq 0 ]
check "the study changed" cmp -s o/study.json whole.json
end

refuse 1 "is within 1e-06 mm: the nearest is" study "$beam" --quick --out o --within 1e-6mm -o far
refuse 1 "in at most 1e-06 ms: the nearest is" study "$beam" --quick --out o --budget 1e-6ms
check "a scene was written" [ ! -e far ]

# ---- a row ----
setting_of() { sed -n "$(($2 + 1))p" "$1" | cut -d , -f 1-4,7; } # setting_of CSV ROW: model, element, law, solver, size
begin "a row of the table is written as a scene, from the study that is there, and a row of what was written again"
for row in 2 "$all"; do
    run study "$beam" --pick "$row" --out o -o "row_$row" --json
    check "row $row: exit code $code" code_is 0
    check "row $row: something was measured" [ "$(number measured out)" = 0 ]
    check "row $row: does not say which" [ "$(number row out)" = "$row" ]
    size=$(setting_of o/study.csv "$row" | cut -d , -f 5)
    model=$(setting_of o/study.csv "$row" | cut -d , -f 1)
    check "row $row: its configuration is not in the output" has out "\"configuration\":\"$(echo "$model" | tr -d '"').* $size voxels"
    check "row $row: the scene has another model" has "row_$row/scene.json" "$model"
    check "row $row: the study is not beside it" [ -s "row_$row/study.json" ]
    check "row $row: the scene is not called as its problem" has "row_$row/scene.json" '"title":.*soft cantilever'
done
run study row_2 --pick 1 -o row_1
check "exit code $code" code_is 0
check "the row is not said" has out "^row 1: .* mm off"
check "what to do next is not said" has out "^palpate serve row_1"
run plan row_1
check "plan: exit code $code" code_is 0
check "the page has no button a row" [ "$(count '<button>' o/study.html)" -eq "$rows" ]
check "the page does not have the command of a row" has o/study.html "beam.json --quick --out o --pick [0-9]* -o NEW</code>"
end
refuse 1 "pick $((all + 1)): the table of o/study.json has rows 1 to $all" study "$beam" --pick $((all + 1)) --out o
sed "s/\"err\":[[:space:]]*\"OK\"/\"err\": \"BUDGET\"/; s/\"front\":.*/\"front\": false,/" whole.json >o/study.json
refuse 1 "pick .* was not measured" study "$beam" --pick 4 --out o
cp whole.json o/study.json

# ---- killed anywhere ----
# what a study says beside its times: configurations, codes, nodes, sub-steps and errors of every configuration
errors_of() { cut -d , -f 1-4,6-9,11,17,19-22 "$1" | sort; }
if long "killed at random moments, also while its reference is made, it ends with the same table"; then
    begin "$name"
    errors_of o/study.csv >once.txt
    kills=0
    mkdir k
    for try in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16; do
        setsid "$palpate" study "$beam" --quick --out k --quiet >out 2>err </dev/null &
        child=$!
        # somewhere while it writes answers of the reference, then points; ever later so that it ends
        file=k/study.reference
        if [ -s $file ]; then file=k/study.json; fi
        grows $file "$child" "$(awk "BEGIN { srand($try); print 1 + int(200 * rand() * $try) }" </dev/null)"
        if kill -KILL "$child" 2>/dev/null; then kills=$((kills + 1)); fi
        wait "$child" 2>/dev/null
        if [ -s k/study.json ] && has k/study.json '"complete":[[:space:]]*true'; then break; fi
    done
    run study "$beam" --quick --out k --json
    check "exit code $code" code_is 0
    check "it was killed $kills times" [ "$kills" -ge 2 ]
    check "no answers of the reference are kept" [ -s k/study.reference ]
    errors_of k/study.csv >killed.txt
    check "another table" cmp -s once.txt killed.txt
    check "another reference" [ "$(number reference_m k/study.json)" = "$(number reference_m o/study.json)" ]
    end
fi

# ---- a scene that asks ----
ask() { # ask NUMBER: the scene with max_error_mm
    sed "s/\"accuracy\":.*/\"accuracy\": {\"max_error_mm\": $1, \"text\": \"asked\"},/" near/scene.json >near/ask.json
    mv near/ask.json near/scene.json
}
ask "${loose%mm}"
begin "a scene that asks for an accuracy is planned and served in the configuration that the study gives"
run plan near
check "exit code $code" code_is 0
check "plan does not say which" has out "picked of the .* configurations of near/study.json (within"
run plan near --json
check "no configuration in JSON" has out '"picked":{"body":'
: >out # or what plan said is taken for the server's words
timeout 60 "$palpate" serve near --port 0 --open --json >out 2>err </dev/null &
child=$!
check "serve did not start" shows out "$child" '"port":'
kill "$child"
wait "$child"
check "serve does not say which" has err "picked of the .* configurations of near/study.json"
end
refuse 1 "is in the folder of the source" study near --quick --within 1mm -o near
refuse 1 "is in the folder of the source" study near/scene.json --quick --within 1mm -o ./near/../near/other.json
ask 0.000001
refuse 1 "palpate study near --again" plan near
refuse 1 "none of the .* configurations is within 1e-06 mm" serve near --port 0
mv near/study.json elsewhere.json
refuse 1 "but there is no near/study.json: run palpate study near" plan near
refuse 1 "but there is no near/study.json: run palpate study near" serve near --port 0
echo "{" >near/study.json
refuse 1 "near/study.json: line 1" serve near --port 0
sed 's/"shape":.*/"shape": "0000000000000000",/' elsewhere.json >near/study.json
refuse 1 "of another body" plan near

finish
