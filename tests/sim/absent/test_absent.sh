#!/bin/sh
# test_absent.sh FULL EFFECT=PROGRAM...: FULL is linked with every effect, each PROGRAM without one (absent_scenes.c).
# For every effect: its code is not in the program; scenes without it give the same hash, row calls, bytes and heap
# calls as in FULL; scenes with it are refused, and say so; there is at least one of both kinds. No step calls the heap.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
n_bad=0 n_effect=0
bad() {
    echo "  $*"
    n_bad=$((n_bad + 1))
}
full=$1
shift
"$full" > "$work/full" || { echo "$full failed"; exit 1; }
cat "$work/full"
grep -q refused "$work/full" && bad "a scene is refused though every effect is there"
[ "$(tail -n 1 "$work/full")" = "code of gravity: there" ] || bad "the probe does not see what is there"
sed -i '$d' "$work/full"
[ "$(grep -c ' and 0 heap calls$' "$work/full")" = "$(wc -l < "$work/full")" ] || bad "a step calls the heap"
for pair; do
    effect=${pair%%=*} program=${pair#*=}
    n_effect=$((n_effect + 1))
    "$program" > "$work/without" || bad "$effect: the program without it failed"
    [ "$(tail -n 1 "$work/without")" = "code of $effect: not there" ] || bad "$effect: $(tail -n 1 "$work/without")"
    awk -v effect="$effect" -v without="$work/without" '
        {
            has = 0
            for (i = 2; i <= NF && $i != "|"; i++) if ($i == effect) has = 1
            if ((getline other < without) <= 0) { print "  " effect ": lines are missing"; bad++; exit }
            if (has && index(other, "refused: ") && index(other, "there is no effect \"" effect "\"")) refused++
            else if (has) { print "  with " effect ", " $1 " should be refused: " other; bad++ }
            else if (other == $0) same++
            else { print "  without " effect ":\n    " $0 "\n    " other; bad++ }
        }
        END {
            if (!same) { print "  " effect ": no scene is without it"; bad++ }
            if (!refused) { print "  " effect ": no scene has it"; bad++ }
            exit bad > 0
        }' "$work/full" || n_bad=$((n_bad + 1))
done
echo "$n_effect effects left out one by one, $n_bad faults"
[ "$n_bad" = 0 ] && [ "$n_effect" -ge 25 ]
