#!/bin/sh
# Two of the demos play without a refusal, and the figures they print are those of mechanics: a force moves four times the
# mass a quarter as far, a stiff stand sways less. usage: test_demos.sh PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
demos=$(cd "$(dirname "$0")/../../deploy/demos" && pwd)

# play NAME: its report in $work/NAME, exit code in $code
play() {
    PALPATE_BIN=$bin timeout 100 "$demos/run.sh" "$1" --json >"$work/$1" 2>"$work/$1.err"
    code=$?
    [ $code -eq 0 ] || cat "$work/$1.err"
}
# moved VERB N FILE: moved_mm of the N-th order of that verb
moved() { grep "\"order\":\"$1\"" "$3" | sed -n "$2s/.*\"moved_mm\":\([0-9.e-]*\).*/\1/p"; }
ratio() { holds "$2" '>' 0 && awk -v a="$1" -v b="$2" 'BEGIN { print a / b }'; }

play mass
check "same force, other mass: plays" $code == 0
check "three hands push and let go" "$(grep -c '"order":"release".*"done":true' "$work/mass")" == 3
# the files are played in the order of their names: even, heavy, left
even=$(moved release 1 "$work/mass") heavy=$(moved release 2 "$work/mass") left=$(moved release 3 "$work/mass")
check "the even bar goes far (mm)" "$even" '>' 20
check "four times the mass goes a quarter as far, at least" "$(ratio "$even" "$heavy")" '>' 2.5
check "and at most" "$(ratio "$even" "$heavy")" '<' 6
check "heavy at its left end it goes less far than even (mm)" "$left" '<' "$even"
check "and farther than all heavy" "$left" '>' "$heavy"

play paint
check "stiffness is painted: plays" $code == 0
check "the probe finds it (Pa)" "$(grep '"order":"probe"' "$work/paint" | sed -n 's/.*"young_Pa":\([0-9.e+]*\).*/\1/p')" '>' 30000
sways=$(moved release 1 "$work/paint") stands=$(moved release 2 "$work/paint")
check "legs that are soft let the seat sway (mm)" "$sways" '>' 10
check "legs ten times as stiff less (share)" "$(ratio "$stands" "$sways")" '<' 0.85

"$demos/run.sh" nothing >"$work/nothing" 2>&1
check "an unknown demo is wrong usage" $? == 2
check "whose help names the demos" "$(grep -c 'head, chair, paint, mass, nozzle or bridge' "$work/nothing")" == 1
finish
