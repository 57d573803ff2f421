#!/bin/sh
# What a scene pays for effects that it does not call for: the time of a step in a program that has all effects over
# that in one which lacks the effect's file, for every effect and every scene of tests/sim/absent without it; and the
# same program over itself, which is the noise. Programs are run in turn. For a release build; nothing fails by time.
# usage: absent.sh BUILD [ROUNDS]
set -eu
[ $# -ge 1 ] || { echo "usage: absent.sh BUILD [ROUNDS]" >&2; exit 2; }
folder=$1/tests/sim/absent rounds=${2:-5}
[ -x "$folder/absent_none" ] || { echo "$folder: build tests/sim/absent/all first" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
round=0
while [ "$round" -lt "$rounds" ]; do
    for program in "$folder"/absent_*; do
        [ -x "$program" ] && [ -f "$program" ] || continue
        effect=${program##*/absent_}
        case $effect in *.*) continue ;; esac
        # all effects, then without one, then all again: what drifts meanwhile falls out
        "$folder/absent_none" --time 8 > "$work/before"
        "$program" --time 8 > "$work/without"
        "$folder/absent_none" --time 8 > "$work/after"
        awk -v effect="$effect" '
            FILENAME ~ /before$/ { before[$1] = $2 }
            FILENAME ~ /after$/ { after[$1] = $2 }
            FILENAME ~ /without$/ { without[$1] = $2 }
            END { for (s in without) print effect, s, (before[s] + after[s]) / (2 * without[s]) }
        ' "$work/before" "$work/after" "$work/without" >> "$work/ratios"
    done
    round=$((round + 1))
done
# of each effect and scene the median over the rounds, then of all effects the spread
sort -k1,1 -k2,2 -k3,3g "$work/ratios" | awk '
    function close_group() { if (n) print key, value[int((n + 1) / 2)]; n = 0 }
    { now = $1 " " $2; if (now != key) close_group(); key = now; value[++n] = $3 }
    END { close_group() }' > "$work/medians"
awk '$1 == "none" { print $3 }' "$work/medians" | sort -g > "$work/noise"
awk '$1 != "none" { print $3 }' "$work/medians" | sort -g > "$work/all"
tell() {
    awk -v what="$2" '{ v[NR] = $1 } END { if (NR) printf "%s: median %.3f, 5 %% to 95 %% %.3f to %.3f, of %d pairs\n", what,
        v[int((NR + 1) / 2)], v[int(NR * 0.05) + 1], v[int(NR * 0.95 + 0.999)], NR }' "$1"
}
tell "$work/all" "step with the effect linked and not called for, over one without its file"
tell "$work/noise" "the same program over itself"
echo "farthest off:"
awk '$1 != "none"' "$work/medians" | awk '{ d = $3 > 1 ? $3 - 1 : 1 - $3; print d, $0 }' | sort -rg | head -5 | cut -d" " -f2-
