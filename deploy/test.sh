#!/bin/sh
# Installs what is missing, builds, runs every test and ends with a line "N passed, N failed".
# usage: deploy/test.sh [--fast]     --fast: the release build's tests only, no sanitizers, fuzzers or browser
# PALPATE_BUILD names another build folder.
set -u
. "$(dirname "$0")/common.sh"
fast=
case ${1-} in
'') ;;
--fast) fast=1 ;;
-h | --help)
    sed -n '2,4s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
*) fail "unknown option ${1-} (known: --fast)" ;;
esac

install_missing run test || exit 1
install_missing scan || say "tests of the scan say that it is not there and are left out"
install_missing mpi || say "calibration over MPI is not built and its test says so"
fetch_viewer || fail "could not get the viewer's packages, see $build/npm.log"

passed=0 failed=0
step() { # NAME COMMAND...: one test that is a command; its output is shown when it fails
    name=$1
    shift
    if "$@" >"$build/step.log" 2>&1; then
        passed=$((passed + 1))
        say "ok    $name"
    else
        failed=$((failed + 1))
        cat "$build/step.log"
        say "FAIL  $name"
    fi
}
tests_of() { # PRESET [ctest options]: runs ctest in one build and counts its tests
    preset=$1
    shift
    # first what computes, then, side by side, what mostly waits (tests/clients/CMakeLists.txt)
    (cd "$build/$preset" && ctest --output-on-failure -j 2 "$@" -LE "waits${leave:+|$leave}"
        ctest --output-on-failure -j "${side:-4}" "$@" -L waits) >"$build/ctest_$preset.log" 2>&1
    sed -n '/^ *[0-9]*\/[0-9]* Test /p' "$build/ctest_$preset.log"
    n_pass=$(grep -c '^ *[0-9]*/[0-9]* Test .*   Passed ' "$build/ctest_$preset.log")
    n_fail=$(grep -cE '^ *[0-9]*/[0-9]* Test .*(\*\*\*|Not Run)' "$build/ctest_$preset.log")
    if [ "$n_pass" -eq 0 ]; then n_fail=$((n_fail + 1)); fi
    if [ "$n_fail" -gt 0 ]; then cat "$build/ctest_$preset.log"; fi
    passed=$((passed + n_pass))
    failed=$((failed + n_fail))
    say "$preset: $n_pass passed, $n_fail failed"
}
build_preset() { # PRESET "TARGET..." [cmake options]
    preset=$1 target=$2
    shift 2
    # shellcheck disable=SC2086
    cmake -S "$tree" -B "$build/$preset" -G Ninja -D PAL_PRESET="$preset" "$@" >"$build/build_$preset.log" 2>&1 &&
        cmake --build "$build/$preset" --target $target >>"$build/build_$preset.log" 2>&1 && return 0
    tail -n 40 "$build/build_$preset.log"
    say "FAIL  build of $preset"
    failed=$((failed + 1))
    return 1
}

say "building release"
build_release -D PAL_BUILD_TESTS=ON
tests_of release
step "sources are formatted" sh "$tree/tests/house/check_format.sh" "$tree"
step "viewer: types" sh "$tree/tests/house/check_viewer.sh" types "$build"
step "viewer: node tests" sh "$tree/tests/house/check_viewer.sh" test "$build"
if [ -z "$fast" ]; then
    step "two browsers share an organ" sh "$tree/tests/browser/run.sh" pull "$build"
    step "fields in colours" sh "$tree/tests/browser/run.sh" fields "$build"
    step "a calibrated scene in the browser" sh "$tree/tests/browser/run.sh" calibrated "$build"
    step "a stomach refines in the browser" sh "$tree/tests/browser/run.sh" adaptive "$build"
    step "two browsers, a bridge and lcm-logger together" sh "$tree/tests/browser/run.sh" together "$build"
    say "building with address and undefined-behaviour sanitizers"
    build_preset asan all && leave="accuracy|bench" tests_of asan
    say "building with thread sanitizer"
    # the rooms that have threads
    threads="base num session net clients"
    build_preset tsan "server/all clients/all $(printf 'tests/%s/all ' $threads)" &&
        side=2 tests_of tsan -R "^($(echo $threads | tr ' ' '|'))/"
    say "building fuzzers"
    rm -f "$build"/fuzz_*.code
    # without this machine's wide registers: the compiler takes minutes over them
    if build_preset fuzz fuzzers -D CMAKE_C_COMPILER=clang -D PAL_NATIVE=OFF; then
        # two at a time
        ls "$build"/fuzz/tests/fuzz | sed -n 's/^fuzz_\([a-z0-9_]*\)$/\1/p' | xargs -P 2 -I % sh -c 'cd "$0" && mkdir -p corpus/% &&
            fuzz/tests/fuzz/fuzz_% -max_total_time=5 -timeout=20 -rss_limit_mb=2048 -artifact_prefix="$0/crash_" corpus/% "$1/%" \
                >fuzz_%.log 2>&1; echo $? >fuzz_%.code' "$build" "$tree/tests/data/fuzz"
        for code in "$build"/fuzz_*.code; do
            thing=$(basename "$code" .code)
            step "$(echo "$thing" | tr _ ' ') for 5 s" sh -c 'cat "$0/$1.log"; exit $(cat "$0/$1.code")' "$build" "$thing"
        done
    fi
fi
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
