#!/bin/sh
# Tables of the hard cases from what the tests recorded (hard_case.h).
#
#   make_table.sh RECORDS            writes tests/stability/README.md and the matrix in README.md
#   make_table.sh --run BUILD        runs all tests that record, then the same
#   make_table.sh --check            every case x model stands in both tables of the tree
#   make_table.sh --check RECORDS    and RECORDS has every case x model too
# Exit code 1 and a line for each hole.
set -eu
cd "$(dirname "$0")/../.."
LC_ALL=C
export LC_ALL
catalogue=tests/stability/catalogue.txt
whole=tests/stability/README.md
models="tet_springs adaptive_springs fem subdivision_fem"
tab=$(printf '\t')

recorders() { grep -l '"tests/stability/\(hard_case\|four_models\).h"' tests/*/test_*.c; }

# all records, one a line; of equal case, model and words in several tests the worst
gather() {
    cat "$1"/*.tsv 2>/dev/null | awk -F '\t' -v OFS='\t' '
        { key = $1 FS $2 FS $4 }
        !(key in line) { order[++n] = key; line[key] = $0; ratio[key] = $6 ? $5 / $6 : 0; next }
        ($6 ? $5 / $6 : 0) > ratio[key] { line[key] = $0; ratio[key] = $5 / $6 }
        END { for (i = 1; i <= n; i++) print line[order[i]] }'
}

tables() { # RECORDS part(whole|matrix)
    gather "$1" | awk -F '\t' -v part="$2" -v models="$models" -v catalogue="$catalogue" '
        function trim(s) { gsub(/^ +| +$/, "", s); return s }
        # INFINITY of a time until rest
        function shown(value) { return value == "inf" ? "never" : value }
        function figure(kind, value, bound, unit) {
            if (kind == "none") return "does not apply"
            if (kind == "all") return value " of " bound
            return shown(value) (unit == "" || value == "inf" ? "" : " " unit)
        }
        function cell(kind, value, bound, unit) {
            if (kind == "none") return "–"
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
                    best = 0; worst = -4
                    for (k = 1; k <= count[id, model[m]]; k++) {
                        i = id SUBSEP model[m] SUBSEP k
                        r = kind[i] == "none" ? -1 : kind[i] == "all" ? 0.5 : bound[i] > 0 ? value[i] / bound[i] : 0
                        # the hour that ran tells more than minutes beside it, however near to their bound
                        if (id == "hour" && kind[i] != "none" && what[i] !~ /drift in an hour/) r -= 2
                        if (kind[i] == "missed" && value[i] > bound[i]) r += 1e9
                        if (r > worst) { worst = r; best = i }
                        if (part != "whole") continue
                        shall = kind[i] == "none" ? "" : kind[i] == "all" ? "all" : "<= " bound[i] (unit[i] == "" ? "" : " " unit[i])
                        f = figure(kind[i], value[i], bound[i], unit[i])
                        if (kind[i] == "missed" && value[i] > bound[i]) f = "**" f "**, missed; the test holds it at <= " ceiling[i]
                        print "| " id " | " model[m] " | " what[i] " | " f " | " shall " | " test[i] " |"
                    }
                    row = row " | " (best ? cell(kind[best], value[best], bound[best], unit[best]) : "?")
                }
                if (part == "matrix") print row " |"
            }
        }'
}

write() {
    {
        cat <<'TEXT'
# Hard cases

Made by `tests/stability/make_table.sh --run BUILD` from what the tests record (`hard_case.h`); the cases are those of
`catalogue.txt`. A line in bold opens a case and tells what shall hold; then what every model does. Figures are the worst of all
elements, laws, solvers and seeds of the test. S: diagonal of the box around the body at rest. **Bold figures** miss what shall hold.

TEXT
        tables "$1" whole
    } >"$whole.new"
    mv "$whole.new" "$whole"
    tables "$1" matrix >"$whole.matrix"
    awk -v matrix="$whole.matrix" '
        /^<!-- hard cases -->/ { print; while ((getline line < matrix) > 0) print line; skip = 1; next }
        /^<!-- end of hard cases -->/ { skip = 0 }
        !skip { print }' README.md >README.md.new
    rm "$whole.matrix"
    mv README.md.new README.md
}

ids() { sed -n '/^#/d; s/^\([a-z_]*\) *|.*/\1/p' "$catalogue"; }

check() {
    bad=0
    n=$(ids | wc -l)
    for id in $(ids); do
        for model in $models; do
            grep -q "^| $id | $model | [^|]" "$whole" || {
                echo "$whole: no line of case $id, model $model"
                bad=1
            }
            [ -z "${1-}" ] || grep -hq "^$id$tab$model$tab" "$1"/*.tsv || {
                echo "$1: no record of case $id, model $model"
                bad=1
            }
        done
        grep -q "\"$id\"" $(recorders) || {
            echo "$catalogue: no test records case $id"
            bad=1
        }
    done
    rows=$(sed -n '/^<!-- hard cases -->/,/^<!-- end of hard cases -->/p' README.md | grep -c '^| ' || true)
    [ "$rows" -eq $((n + 2)) ] || {
        echo "README.md: the matrix of hard cases has $rows lines, wanted $((n + 2))"
        bad=1
    }
    ! sed -n '/^<!-- hard cases -->/,/^<!-- end of hard cases -->/p' README.md | grep '| ? |' || {
        echo "README.md: the matrix of hard cases has a hole"
        bad=1
    }
    [ -z "${1-}" ] || for id in $(cut -f 1 "$1"/*.tsv | sort -u); do
        ids | grep -qx "$id" || {
            echo "$catalogue: case $id is recorded, but not there"
            bad=1
        }
    done
    [ $bad = 0 ] && echo "$n hard cases, every one with every model"
    return $bad
}

case "${1-}" in
--check)
    # records are looked at when all tests that record have run, those beside ../shared too
    [ -d "${PAL_SHARED:-../shared}/reference" ] || {
        [ -z "${2-}" ] || echo "left out: records, since ../shared is not there"
        set -- --check
    }
    for test in $(recorders); do
        [ -z "${2-}" ] || [ -f "$2/$(basename "$test" .c).tsv" ] || {
            echo "left out: records, since $(basename "$test" .c) has not run"
            set -- --check
        }
    done
    check "${2-}"
    ;;
--run)
    PAL_HARD_CASES=$2/hard_cases
    export PAL_HARD_CASES
    rm -rf "$PAL_HARD_CASES"
    mkdir -p "$PAL_HARD_CASES"
    for test in $(recorders); do
        program=$(echo "$test" | sed 's/\.c$//')
        echo "$program"
        "$2/$program" >"$PAL_HARD_CASES/last" || {
            cat "$PAL_HARD_CASES/last"
            exit 1
        }
    done
    write "$PAL_HARD_CASES"
    ;;
"" | -*)
    sed -n '2,9s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
*)
    write "$1"
    ;;
esac
