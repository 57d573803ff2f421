#!/bin/sh
# `palpate robustness` as a person runs it: small scenes that pass, scenes that were made to fail and do, and refusals.
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
    check "the hour was watched whole" has out "hour  *passed .*3600 s watched"
    check "it says since when it slept" has out "hour .*asleep from [0-9.e+-]* s on"
    check "a picture" has picture.svg "</svg>"
    check "of well-formed text" has picture.svg "start\" font-size="
    end
done

begin "what a body's way to its split stores is no gain, after a switch of supports too"
"$palpate" prepare --shape sphere --hold 12 --resolution 6 --model fem -o soft --quiet || exit 2
sed -i 's/"young_Pa":.*/"young_Pa": 2000,/' soft/scene.json
check "the scene is soft" has soft/scene.json '"young_Pa": 2000,'
gives 0 soft --only supports --seconds 12
check "it went there" has out "supports *passed .*([1-9][0-9]* safeguards"
end

begin "a beam of springs with solver rk4 untangles as well"
altered springs rk4 's/"model":/"solver": {"name": "rk4"}, &/' '"rk4"'
for shape in point mirrored shuffled; do
    gives 0 rk4 --only $shape --seconds 12
    check "it was turned over and is whole" has out "$shape *passed .*back after .*safeguards"
done
end

begin "springs that may not untangle collapse on a point, which is told apart"
altered springs tangled 's/"tet_springs"/"tet_springs", "recover": false/' '"recover": false'
gives 0 tangled --only point --seconds 12
check "counts" has out "^0 passed, 1 collapsed, 0 failed, 0 undecided, 0 do not apply"
check "it is collapsed" has out "point  *collapsed .*a reset brings it back"
end

if long "one case alone is what it is among all, and JSON says so"; then
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

begin "a body whose guard is too strict is stopped, and that fails"
altered fem strict 's/"finite_guard"/"finite_guard", "reach": 0.15/' '"reach": 0.15'
gives 1 strict --only meganewton --seconds 4
check "it says what was stopped" has out "FAILED .*beam stopped: node .*, 0.0[0-9]* m allowed"
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
check "it says which was stopped" has out "stretched *FAILED .*beam was stopped"
end

begin "a folded solid of cells comes back with either solver"
"$palpate" cells chair -o chair.palcells --quiet || exit 2
cp "$problems/../demos/chair.json" folded.json
sed 's/"model": {/"solver": {"name": "implicit_euler"}, &/' folded.json >implicit.json
for scene in folded implicit; do
    gives 0 $scene.json --only mirrored --seconds 12
    check "it was turned over and is whole" has out "mirrored *passed "
done
end

begin "less than an hour is no hour"
gives 1 springs --only hour --seconds 0.5
check "undecided" has out "^0 passed, 0 failed, 1 undecided"
check "it says so" has out "give more --seconds"
end

begin "a scene that does not rest is told, and what needs rest is undecided"
altered springs ringing 's/"damping_1_s":[[:space:]]*[0-9.]*/"damping_1_s": 0/' '"damping_1_s": 0'
altered ringing swinging 's/"effects":[[:space:]]*\[/&{"name": "gravity"}, /' '{"name": "gravity"}'
gives 1 swinging --only poisoned --seconds 4 --json
check "not ok" has out '"ok":false'
check "undecided, as it does not rest" has out '"rests":false.*"undecided":1'
end

begin "a body that nothing calms does not come back, and that fails"
gives 1 ringing --only meganewton --seconds 4
check "it says so" has out "FAILED .*; not back"
end

if long "a scene that a support leads for ever is compared with an untouched run"; then
    begin "$name"
    gives 0 "$problems/../../tests/data/hard/anchors.json" --seconds 60
    check "it says so" has out "is led for ever: compared with an untouched run"
    check "counts" has out "^16 passed, 0 failed, 0 undecided, 2 do not apply"
    end
fi

begin "supports are switched while the body bends, and it stands still"
gives 0 "$problems/../../tests/data/hard/hour.json" --only supports
check "no energy from the switch" has out "supports  *passed .*energy rises by 0 of what is stored"
end

begin "a tool that touches nothing puts in nothing"
# a tool as thin as a needle's point in the middle of a cube: nothing is near
sed -e 's/"radius_m": 0.01/"radius_m": 0.0001/' -e "s#../../../deploy/problems#$problems#" -e 's/"resolution": 5/"resolution": 9/' \
    "$problems/../../tests/data/hard/hour.json" >needle.json
gives 0 needle.json --only inside --json
check "no force" has out "force up to 0 N"
check "and no share of rounding" python3 -c "import json; assert json.load(open('out'))['cases'][0]['energy_excess'] < 1e-6"
end

begin "too little time is told and does not pass"
gives 1 springs --seconds 0.1
check "it says so" has out "give more --seconds\|did not come to rest before"
end

begin "what is no case and no scene is refused with one line"
gives 2 fem --only tickle
check "one line" [ "$(wc -l <err)" -eq 1 ]
check "it names the word" has err '^palpate robustness: there is no case "tickle"'
gives 1 nowhere.json
check "one line" [ "$(wc -l <err)" -eq 1 ]
run
check "usage" code_is 2
end

finish
