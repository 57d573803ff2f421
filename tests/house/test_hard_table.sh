#!/bin/sh
# The check of the tables of hard cases can fail: in a copy of what it reads each kind of fault is planted and must be
# found, and what is no fault must not.
set -u
here=$(cd "$(dirname "$0")" && pwd)
top=$here/../..
passed=0 failed=0
dir=$(mktemp -d) || exit 2
trap 'rm -rf "$dir"' EXIT
tree=$dir/tree run=$dir/run
PAL_SHARED=$dir/shared
export PAL_SHARED
mkdir -p "$PAL_SHARED/reference"

fresh() { # a clean tree, and a run that recorded what the tree keeps
    rm -rf "$tree" "$run"
    mkdir -p "$tree/tests/stability" "$run"
    cp "$top/tests/stability/make_table.sh" "$top/tests/stability/catalogue.txt" "$top/tests/stability/records.tsv" \
        "$tree/tests/stability"
    {
        echo '#include "tests/stability/hard_case.h"'
        sed -n '/^#/d; s/^\([a-z_]*\) *|.*/"\1"/p' "$top/tests/stability/catalogue.txt"
    } >"$tree/tests/stability/test_all.c"
    cp "$top/tests/stability/records.tsv" "$run/test_all.tsv"
    sh "$tree/tests/stability/make_table.sh" "$tree/tests/stability/records.tsv" >/dev/null || exit 2
}
verdict() { # NAME WANTED
    sh "$tree/tests/stability/make_table.sh" --check "$run" >"$dir/out" 2>&1
    code=$?
    if [ "$code" = "$2" ]; then
        passed=$((passed + 1))
        echo "ok   $1"
    else
        failed=$((failed + 1))
        echo "FAIL $1 (exit $code, wanted $2)"
        sed -n 1,3p "$dir/out"
    fi
}
# of the record of one case, model and words: the value, bound, ... of column N becomes an awk expression
change() { # FILE COLUMN EXPRESSION
    awk -F '\t' -v OFS='\t' "\$1 == \"poisson_static\" && \$2 == \"fem\" && \$3 == \"le\" && !done { \$$2 = $3; done = 1 } 1" \
        "$1" >"$dir/new"
    cmp -s "$1" "$dir/new" && echo "nothing was changed" && exit 2
    mv "$dir/new" "$1"
}

fresh
verdict "a table that its run made passes" 0
change "$run/test_all.tsv" 5 '$5 * 1.1'
verdict "a figure off by a tenth passes" 0
fresh
change "$run/test_all.tsv" 5 '$5 + 0.5 * $6'
verdict "a figure off by half its bound is found" 1
fresh
change "$run/test_all.tsv" 6 '$6 * 1.5'
verdict "another bound is found" 1
fresh
change "$run/test_all.tsv" 3 '"missed"'
verdict "another verdict is found" 1
fresh
change "$run/test_all.tsv" 4 '"something else"'
verdict "another line is found" 1
fresh
sed -i '/^contrast/d' "$run/test_all.tsv"
verdict "a line that no test records is found" 1
fresh
sed -i '/^| no_density | fem/d' "$tree/tests/stability/README.md"
verdict "a row that is gone is found" 1
fresh
sed -i '/^mirror\tfem/d' "$tree/tests/stability/records.tsv"
verdict "a case without a record of one model is found" 1
fresh
rm "$run/test_all.tsv"
verdict "records of a run that was not are skipped" 77
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
