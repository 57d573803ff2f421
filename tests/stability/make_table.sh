#!/bin/sh
# The page of the hard cases from what the tests recorded (hard_case.h).
#
#   make_table.sh --run BUILD        builds in BUILD (release; made when it is not there) every test that records, runs
#                                    them and writes records.tsv and README.md: the one command that makes them
#   make_table.sh RECORDS            the same from a folder of records that is there, or from records.tsv
#   make_table.sh --families BUILD ORGANS MODELS
#                                    runs `palpate robustness` on generated organs (as its flags --generate, all for every
#                                    one, and --model; minutes of a core for each) and writes by_family.md here and README.md
#   make_table.sh --check            every case x model is recorded in the tree, or why not; README.md is to the byte what
#                                    records.tsv says
#   make_table.sh --check RECORDS    and the records of a run are those of records.tsv: the same lines, words, verdicts,
#                                    bounds and counts, figures off by a fifth of themselves or of their bound at most
# Exit code 1 and a line for each fault.
set -eu
cd "$(dirname "$0")/../.."
LC_ALL=C
export LC_ALL
catalogue=tests/stability/catalogue.txt
page=tests/stability/README.md
kept=tests/stability/records.tsv
families=tests/stability/by_family.md
models="tet_springs adaptive_springs fem subdivision_fem"
tab=$(printf '\t')

recorders() { grep -lr --include='test_*.c' '"tests/stability/\(hard_case\|four_models\).h"' tests | sort; }

# all records of a folder or file, one a line, in the order of the catalogue, models and tests; of equal case, model and
# words in several tests the worst. Files of tests that are no more do not count
gather() {
    if [ -d "$1" ]; then
        for test in $(recorders); do cat "$1/$(basename "$test" .c).tsv"; done
    else
        cat "$1"
    fi | awk -F '\t' -v OFS='\t' -v models="$models" -v catalogue="$catalogue" '
        function ratio(value, bound) { return bound > 0 ? value / bound : value + 0 }
        BEGIN {
            n_model = split(models, model, " ")
            while ((getline text < catalogue) > 0)
                if (text !~ /^#/ && text != "") { split(text, at, "|"); gsub(/ /, "", at[1]); id[++n_id] = at[1] }
        }
        { key = $1 FS $2 FS $4 }
        !(key in line) { order[$1, $2, ++count[$1, $2]] = key; line[key] = $0; worst[key] = ratio($5, $6); next }
        ratio($5, $6) > worst[key] { line[key] = $0; worst[key] = ratio($5, $6) }
        END {
            for (i = 1; i <= n_id; i++)
                for (m = 1; m <= n_model; m++)
                    for (k = 1; k <= count[id[i], model[m]]; k++) print line[order[id[i], model[m], k]]
        }'
}

tables() { # RECORDS part(whole|matrix)
    awk -F '\t' -v part="$2" -v models="$models" -v catalogue="$catalogue" '
        function trim(s) { gsub(/^ +| +$/, "", s); return s }
        # INFINITY of a time until rest
        function shown(value) { return value == "inf" ? "never" : value }
        function figure(kind, value, bound, unit) {
            if (kind == "none") return "does not apply"
            if (kind == "all") return value " of " bound
            return shown(value) (unit == "" || value == "inf" ? "" : " " unit)
        }
        function cell(kind, value, bound, unit) {
            if (kind == "all") return value " of " bound
            text = shown(value) " (" bound ")" (unit == "" ? "" : " " unit)
            return kind == "missed" && value > bound ? "**" text "**" : text
        }
        {
            n = ++count[$1, $2]
            ceiling[$1, $2, n] = $10; kind[$1, $2, n] = $3; what[$1, $2, n] = $4; value[$1, $2, n] = $5; bound[$1, $2, n] = $6
            unit[$1, $2, n] = $7; test[$1, $2, n] = $8
        }
        END {
            n_model = split(models, model, " ")
            if (part == "whole") {
                print "| case | model | what | figure | shall be | test |"
                print "| --- | --- | --- | --- | --- | --- |"
            } else {
                print "| case | springs | adaptive | fem | subdivision |"
                print "| --- | --- | --- | --- | --- |"
            }
            while ((getline text < catalogue) > 0) {
                if (text ~ /^#/ || text == "") continue
                split(text, at, "|")
                id = trim(at[1])
                row = "| " trim(at[2])
                if (part == "whole") print "| **" id "**: " trim(at[2]) " | | " trim(at[3]) " | | | |"
                for (m = 1; m <= n_model; m++) {
                    best = 0; worst = -4; beside = ""
                    for (k = 1; k <= count[id, model[m]]; k++) {
                        i = id SUBSEP model[m] SUBSEP k
                        r = kind[i] == "none" ? -1 : kind[i] == "all" ? 0.5 : bound[i] > 0 ? value[i] / bound[i] : 0
                        # the hour that ran tells more than minutes beside it, however near to their bound
                        if (id == "hour" && kind[i] != "none" && what[i] !~ /drift in an hour/) r -= 2
                        if (kind[i] == "missed" && value[i] > bound[i]) r += 1e9
                        # what a scene has to ask for stands beside what it gets, and does not stand for it
                        if (what[i] ~ /not the default/) beside = beside "; not by default " cell(kind[i], value[i], bound[i], unit[i])
                        else if (r > worst) { worst = r; best = i }
                        if (part != "whole") continue
                        shall = kind[i] == "none" ? "" : kind[i] == "all" ? "all" : "<= " bound[i] (unit[i] == "" ? "" : " " unit[i])
                        f = figure(kind[i], value[i], bound[i], unit[i])
                        if (kind[i] == "missed" && value[i] > bound[i]) f = "**" f "**, missed; the test holds it at <= " ceiling[i]
                        print "| " id " | " model[m] " | " what[i] " | " f " | " shall " | " test[i] " |"
                    }
                    if (best && kind[best] == "none") {
                        if (!(what[best] in note)) { note[what[best]] = ++n_note; why[n_note] = what[best] }
                        row = row " | – <sup>" note[what[best]] "</sup>"
                    } else
                        row = row " | " (best ? cell(kind[best], value[best], bound[best], unit[best]) beside : "?")
                }
                if (part == "matrix") print row " |"
            }
            if (part == "matrix") printf "\nWhy a case cannot be put to a model:\n"
            for (k = 1; k <= n_note && part == "matrix"; k++) print (k > 1 ? "· " : "") "<sup>" k "</sup> " why[k] (k < n_note ? "" : ".")
        }' "$1"
}

# the page with the matrix of cases and models, then every record, as records.tsv wants them: to the file PAGE
render() {
    {
        cat <<'TEXT'
# Hard cases

`tests/stability/make_table.sh --run BUILD` makes this page from what the tests record (`hard_case.h`, kept in `records.tsv`). The cases
are those of `catalogue.txt`. Each figure is the worst of all elements, material laws, solvers and seeds of the test; the bound stands in
parentheses. **Bold figures** exceed their bound. S is the diagonal of the bounding box of the body at rest. A dash means that the case does
not apply to the model; the number gives the reason below the table.

The bold figures are of one problem, a soft cube on a stiff one with Poisson's ratio 0.499. Three constants of springs for a whole body cannot
be right for two materials: fitted on a grid they are 1.79 % off. Tetrahedra and hexahedra whose change of volume is linear in
the displacement of every corner lock: the default hexahedron takes its mean over the element and is 1.19 % off.

## Cases and models

TEXT
        tables "$kept" matrix
        [ ! -f "$families" ] || sed '1i\
\
## By family\
' "$families"
        cat <<'TEXT'

## Every record

A line in bold opens a case and states what must hold; then follows what each model does.

TEXT
        tables "$kept" whole
    } >"$1"
}

families_text() {
    cat <<'TEXT'
`tests/stability/make_table.sh --families BUILD ORGANS MODELS` makes this section, kept in `by_family.md`. Organs drawn by family and seed
(`server/mesh/geometry/organ_family.h`), for which nothing was tuned, run the cases of `palpate robustness`. Wanted are 100 % safe, and 95 %
safe and recovered. A case that its processor time does not judge counts on neither side. Even seeds have no gravity, odd ones have.

TEXT
}

write() {
    gather "$1" >"$kept.new"
    mv "$kept.new" "$kept"
    render "$page.new"
    mv "$page.new" "$page"
    holes
}

ids() { sed -n '/^#/d; s/^\([a-z_]*\) *|.*/\1/p' "$catalogue"; }

# every case x model is recorded, by a test that is there
holes() {
    bad=0
    for id in $(ids); do
        for model in $models; do
            grep -q "^$id$tab$model$tab" "$kept" || {
                echo "$kept: no line of case $id, model $model"
                bad=1
            }
        done
        grep -q "\"$id\"" $(recorders) || {
            echo "$catalogue: no test records case $id"
            bad=1
        }
    done
    return $bad
}

# the records of a run beside those in the tree
compare() {
    gather "$1" | awk -F '\t' -v kept="$kept" '
        function away(a, b, bound, d, size) {
            if (a == b) return 0
            d = a - b; size = a > b ? a : b
            if (d < 0) d = -d
            return a == "inf" || b == "inf" || !(d <= 0.2 * size || d <= 0.2 * bound)
        }
        function fault(text) { print kept ": " text; bad = 1 }
        BEGIN {
            while ((getline line < kept) > 0) {
                n = split(line, f, "\t")
                key = f[1] ", " f[2] ", " f[4]
                for (i = 1; i <= n; i++) was[key, i] = f[i]
                there[key] = 1
            }
        }
        {
            key = $1 ", " $2 ", " $4
            if (!(key in there)) { fault(key ": recorded, but not there"); next }
            delete there[key]
            if ($3 != was[key, 3] || $6 != was[key, 6] || $7 != was[key, 7] || $10 != was[key, 10])
                fault(key ": now " $3 " " $5 " (" $6 ") " $7 ", was " was[key, 3] " " was[key, 5] " (" was[key, 6] ") " was[key, 7])
            else if (($3 == "all" && $5 != was[key, 5]) || ($3 != "none" && away($5, was[key, 5], $6)) ||
                     ($3 == "missed" && ($5 <= $6) != (was[key, 5] <= was[key, 6])))
                fault(key ": " $5 " now, " was[key, 5] " in the tree")
        }
        END {
            for (key in there) fault(key ": no test records it")
            exit bad
        }'
}

same() { # FILE MADE
    cmp -s "$1" "$2" && return 0
    echo "$1 is not what $kept says: $(diff "$1" "$2" | grep -c '^[<>]') lines differ, the first:"
    diff "$1" "$2" | grep '^[<>]' | sed -n 1,2p | cut -c 1-300
    return 1
}

check() {
    bad=0
    holes || bad=1
    work=$(mktemp -d)
    render "$work/page"
    same "$page" "$work/page" || bad=1
    rm -r "$work"
    [ -z "${1-}" ] || compare "$1" || bad=1
    [ $bad = 0 ] && echo "$(ids | wc -l) hard cases, every one with every model"
    return $bad
}

case "${1-}" in
--check)
    # records are looked at when all tests that record have run, those beside ../shared too
    [ -d "${PAL_SHARED:-../shared}/reference" ] || {
        [ -z "${2-}" ] || skipped="../shared is not there"
        set -- --check
    }
    for test in $(recorders); do
        [ -z "${2-}" ] || [ -f "$2/$(basename "$test" .c).tsv" ] || {
            skipped="$(basename "$test" .c) has not run"
            set -- --check
        }
    done
    check "${2-}" || exit 1
    if [ -n "${skipped-}" ]; then
        echo "SKIP records: $skipped"
        exit 77
    fi
    ;;
--run)
    build=$2
    [ -f "$build/build.ninja" ] || cmake -S . -B "$build" -G Ninja -D PAL_PRESET=release -D PAL_BUILD_TESTS=ON
    grep -q '^PAL_PRESET:[A-Z]*=release' "$build/CMakeCache.txt" || {
        echo "$build is no release build: builds with sanitizers record nothing"
        exit 1
    }
    cmake --build "$build" --target recorders
    [ -d "${PAL_SHARED:-../shared}/reference" ] || {
        echo "some that record need ../shared"
        exit 1
    }
    PAL_HARD_CASES=$(realpath "$build")/hard_cases
    export PAL_HARD_CASES
    rm -rf "$PAL_HARD_CASES"
    mkdir -p "$PAL_HARD_CASES"
    for test in $(recorders); do
        program=${test%.c}
        echo "$program"
        "$build/$program" >"$PAL_HARD_CASES/last" || {
            cat "$PAL_HARD_CASES/last"
            exit 1
        }
    done
    write "$PAL_HARD_CASES"
    ;;
--families)
    "$2/bin/palpate" robustness --generate "$3" --model "$4" --seconds 120 --table "$families.new" || [ -s "$families.new" ]
    {
        families_text
        echo "Organs: $3. Models: $4. 120 s of processor time for each scene."
        echo
        cat "$families.new"
    } >"$families"
    rm "$families.new"
    render "$page"
    ;;
"" | -*)
    sed -n '2,15s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
*)
    write "$1"
    ;;
esac
