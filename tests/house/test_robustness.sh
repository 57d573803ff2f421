#!/bin/sh
# `palpate robustness` as a user runs it: small scenes that pass, scenes altered so that they fail, and refusals.
# Prints "N passed, N failed"; exit 1 when a check failed.
# usage: test_robustness.sh PALPATE
set -u
palpate=$(realpath "$1")
. "$(dirname "$0")/shell.sh"
run() {
    timeout 600 "$palpate" robustness "$@" >out 2>err </dev/null
    code=$?
}
gives() { # gives CODE ARGS...: runs, and the exit code is this
    wanted=$1
    shift
    run "$@"
    check "exit code $wanted, not $code" code_is "$wanted"
}
altered() { # altered FROM TO SED TEXT: a copy of a prepared scene, edited; it has the text now
    cp -r "$1" "$2"
    sed -i "$3" "$2/scene.json"
    check "the scene has $4" has "$2/scene.json" "$4"
}

"$palpate" prepare "$problems/beam.obj" --hold 12 --resolution 8 --model fem -o fem --quiet || exit 2
"$palpate" prepare "$problems/beam.obj" --hold 12 --resolution 8 -o springs --quiet || exit 2

for scene in fem springs; do
    begin "a beam of $scene passes every case"
    # as much as the hour of springs takes, with sanitizers too
    gives 0 $scene --seconds 120 --picture picture.svg
    check "counts" has out "^18 passed, 0 failed, 0 undecided, 0 do not apply"
    check "it says that the scene rests" has out "comes to rest by itself"
    check "the poisoned body names its node" has out "poisoned .*beam stopped: node [0-9]* of .* at (.*) mm: its position"
    check "the hour was simulated whole" has out "hour  *passed .*3600 s monitored"
    check "it says since when it slept" has out "hour .*asleep from [0-9.e+-]* s on"
    check "a picture" has picture.svg "</svg>"
    check "of well-formed text" has picture.svg "start\" font-size="
    end
done

begin "a beam of springs with solver rk4 recovers from inversion as well"
altered springs rk4 's/"model":/"solver": {"name": "rk4"}, &/' '"rk4"'
for shape in point mirrored shuffled; do
    gives 0 rk4 --only $shape --seconds 12
    check "it was inverted and has recovered" has out "$shape *passed .*back after .*safeguards"
done
end

begin "springs without inversion recovery collapse when shuffled, and the verdict is collapsed"
# with a Poisson ratio of 0.45 they open again by themselves
altered springs tangled 's/"tet_springs"/"tet_springs", "recover": false/; s/"poisson":.*,/"poisson": 0.485,/' '"recover": false'
gives 0 tangled --only shuffled --seconds 12
check "counts" has out "^0 passed, 1 collapsed, 0 failed, 0 undecided, 0 do not apply"
check "it is collapsed" has out "shuffled  *collapsed .*a reset brings it back"
end

if long "one case alone gives the same as among all, in JSON too"; then
    begin "$name"
    gives 0 fem --json --only shuffled --seconds 8
    check "its verdict" has out '"name":"shuffled",.*"verdict":"passed"'
    grep -o "\"deviation_S\":[^,]*" out | cut -c1-21 >alone
    run fem --json --seconds 8
    grep -o '"name":"shuffled".*' out | grep -o '"deviation_S":[^,]*' | head -n 1 | cut -c1-21 >among
    check "the same figure" cmp -s alone among
    run fem --json --only shuffled --seconds 8 --seed 2
    grep -o '"deviation_S":[^,]*' out | cut -c1-21 >other
    check "another with another seed" [ -s other ]
    if cmp -s alone other; then check "another with another seed" false; fi
    end
fi

begin "a body with too strict a guard is stopped, and that fails"
altered fem strict 's/"finite_guard"/"finite_guard", "reach": 0.15/' '"reach": 0.15'
gives 1 strict --only meganewton --seconds 4
check "it says what was stopped" has out "failed .*beam stopped: node .*, 0.0[0-9]* m allowed"
check "counts" has out "^0 passed, 1 failed"
end

begin "a strict guard is not excused by springs beside it"
cp -r strict both
cp springs/beam.palmesh both/springs.palmesh
python3 - <<'TEXT'
import json
both, springs = (json.load(open(name + "/scene.json")) for name in ("both", "springs"))
body = springs["bodies"][0]
body.update(name="springs", mesh="springs.palmesh")
both["bodies"].append(body)
json.dump(both, open("both/scene.json", "w"))
TEXT
gives 1 both --only stretched --seconds 8
check "it says which was stopped" has out "stretched *failed .*beam was stopped"
end

begin "a mirrored subdivision solid recovers with either solver"
"$palpate" cells chair -o chair.palcells --quiet || exit 2
cp "$problems/../demos/chair.json" folded.json
sed 's/"model": {/"solver": {"name": "implicit_euler"}, &/' folded.json >implicit.json
for scene in folded implicit; do
    gives 0 $scene.json --only mirrored --seconds 12
    check "it was inverted and has recovered" has out "mirrored *passed "
done
end

begin "an hour that is cut short is undecided"
gives 1 springs --only hour --seconds 0.1
check "undecided" has out "^0 passed, 0 failed, 1 undecided"
check "it says what it needs" has out "needs about [0-9]* s of processor time"
end

begin "a scene that does not rest is reported, and a case that needs rest is undecided"
altered springs ringing 's/"damping_ratio":[[:space:]]*[0-9.]*/"damping_1_s": 0/' '"damping_1_s": 0'
altered ringing swinging 's/"effects":[[:space:]]*\[/&{"name": "gravity"}, /' '{"name": "gravity"}'
gives 1 swinging --only poisoned --seconds 4 --json
check "not ok" has out '"ok":false'
check "undecided, as it does not rest" has out '"rests":false.*"undecided":1'
end

begin "a body without damping does not come back, and that fails"
gives 1 ringing --only meganewton --seconds 4
check "it is safe, not recovered" has out "meganewton *failed *yes *no"
# by chance with an element inverted at that moment
check "it says so" has out "[0-9] % S from rest after 11.0 s"
end

if long "a scene with a prescribed motion without end is compared with an unloaded run"; then
    begin "$name"
    gives 0 "$problems/../../tests/data/hard/anchors.json" --seconds 60
    check "it says so" has out "has a prescribed motion without end: compared with an unloaded run"
    check "counts" has out "^16 passed, 0 failed, 0 undecided, 2 do not apply"
    end
fi

begin "a switch of supports while the body is bent adds no energy"
gives 0 "$problems/../../tests/data/hard/hour.json" --only supports
check "no energy from the switch" has out "supports  *passed .*energy rises by 0 of what is stored"
end

begin "a tool that touches nothing adds no energy"
# a tool as thin as a needle's point in the middle of a cube: nothing is near
sed -e 's/"radius_m": 0.01/"radius_m": 0.0001/' -e "s#../../../deploy/problems#$problems#" -e 's/"resolution": 5/"resolution": 9/' \
    "$problems/../../tests/data/hard/hour.json" >needle.json
gives 0 needle.json --only inside --json
check "no force" has out '"peak_contact_N":0,'
check "and no share of rounding" python3 -c "import json; assert json.load(open('out'))['cases'][0]['energy_excess'] < 1e-6"
end

begin "too little time is reported and does not pass"
gives 1 springs --seconds 0.1
check "it says so" has out "needs about [0-9]* s\|did not come to rest before"
end

begin "several scenes run side by side, in the order of the command, and a table says what fails"
gives 1 strict fem --only meganewton --seconds 8 --table answers.md
check "first the first" [ "$(sed -n '/^strict$/=' out)" -lt "$(sed -n '/^fem$/=' out)" ]
check "each has its counts" [ "$(grep -c "^[01] passed, [01] failed" out)" -eq 2 ]
check "the cause stands in the table" has answers.md "stopped: meganewton (1)"
gives 1 strict fem --only meganewton --seconds 8 --json
check "one object with both" python3 -c "
import json
both = json.load(open('out'))['scenes']
assert [s['failed'] for s in both] == [1, 0] and [s['passed'] for s in both] == [0, 1]
case = both[1]['cases'][0]
assert case['safe'] and case['recovered'] and case['returns_s'] < 10 and case['peak_contact_N'] == 0"
end

begin "a generated organ runs as a model that is asked for"
gives 0 --generate branched:5 --model fem --only inside --seconds 20 --json
check "it is safe" has out '"name":"branched:5","model":"fem".*"safe":true,"recovered":true'
gives 2 --generate round:1 --model fem --only inside
check "one line" [ "$(wc -l <err)" -eq 1 ]
gives 2 --generate lobed:1 --model wax
gives 2
end

begin "an unknown case and a missing scene are refused with one line"
gives 2 fem --only tickle
check "one line" [ "$(wc -l <err)" -eq 1 ]
check "it names the word" has err '^palpate robustness: there is no case "tickle"'
gives 1 nowhere.json
check "one line" [ "$(wc -l <err)" -eq 1 ]
run
check "usage" code_is 2
end

finish
