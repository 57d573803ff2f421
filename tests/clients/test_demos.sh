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
# of NUMBER VERB N FILE: that number of the N-th order of that verb
of() { grep "\"order\":\"$2\"" "$4" | sed -n "$3s/.*\"$1\":\([0-9.e-]*\).*/\1/p"; }
# least and most N FILE: bounds of the mean acceleration (m/s2) of what the N-th order pulls, 2 distance / time^2. The pull
# began between giving and answer, each two frames later at most; on a busy machine that is longer, and the bounds are wider
least() { awk -v m="$(of moved_mm release "$1" "$2")" -v t="$(of given_s release "$1" "$2")" -v from="$(of given_s curve "$1" "$2")" \
    'BEGIN { print 2e-3 * m / (t - from) ^ 2 }'; }
most() { awk -v m="$(of moved_mm release "$1" "$2")" -v t="$(of given_s release "$1" "$2")" -v from="$(of answered_s curve "$1" "$2")" \
    'BEGIN { t -= from + 0.034; print (t > 0 ? 2e-3 * m / t ^ 2 : 1e9) }'; }
ratio() { holds "$2" '>' 0 && awk -v a="$1" -v b="$2" 'BEGIN { print a / b }'; }

play mass
check "same force, other mass: plays" $code == 0
check "three hands push and let go" "$(grep -c '"order":"release".*"done":true' "$work/mass")" == 3
# the files are played in the order of their names: even, heavy, left
for bound in least most; do
    for bar in 1 2 3; do eval "${bound}_$bar=$($bound $bar "$work/mass")"; done
done
check "the even bar is accelerated (m/s2)" "$most_1" '>' 0.06
check "four times the mass is a quarter as fast, at least" "$(ratio "$most_1" "$least_2")" '>' 2.5
check "and at most" "$(ratio "$least_1" "$most_2")" '<' 6
check "heavy at its left end it is slower than even" "$least_3" '<' "$most_1"
check "and faster than all heavy" "$most_3" '>' "$least_2"

play paint
check "stiffness is painted: plays" $code == 0
check "the probe finds it (Pa)" "$(grep '"order":"probe"' "$work/paint" | sed -n 's/.*"young_Pa":\([0-9.e+]*\).*/\1/p')" '>' 30000
sways=$(of moved_mm release 1 "$work/paint") stands=$(of moved_mm release 2 "$work/paint")
check "legs that are soft let the seat sway (mm)" "$sways" '>' 10
check "legs ten times as stiff less (share)" "$(ratio "$stands" "$sways")" '<' 0.85

"$demos/run.sh" nothing >"$work/nothing" 2>&1
check "an unknown demo is wrong usage" $? == 2
check "whose help names the demos" "$(grep -c 'head, chair, paint, mass, nozzle or bridge' "$work/nothing")" == 1
finish
