#!/bin/sh
# Installs what is missing, builds, runs every test and ends with a line "N passed, N failed, N skipped". The output of a failed
# test is printed in full where it failed, and in short before the last line.
# usage: deploy/test.sh [--fast]     --fast: the tests of the release build only, no sanitizers, fuzzers or browser
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

install_missing run test pack || exit 1
install_missing scan || message "tests of the scan are skipped: it is not available"
install_missing mpi || message "calibration over MPI is not built and its test is skipped"
fetch_prometheus || message "the test of the dashboard is skipped: could not download prometheus, see $build/prometheus.log"
fetch_viewer || fail "could not download the packages of the viewer, see $build/npm.log"

passed=0 failed=0 skipped=0
digest=$build/digest.log
: >"$digest"

brief() { # NAME: copies the lines of standard input that name a failure, at most 15, into the digest
    echo "FAILED $1" >>"$digest"
    cat >"$build/brief.log"
    # shell tests print FAIL, tests in C file and line, node "not ok", compilers and sanitizers error
    grep -E '^ *(FAIL|not ok|palpate:)|^ *[^ :]+\.[a-z]+:[0-9]+: |(^|[ :])[Ee]rror: |Sanitizer|\*\*\*' "$build/brief.log" |
        cut -c 1-240 | head -n 15 >"$build/brief_lines.log"
    # of a test that was stopped, its last lines
    grep -qv '\*\*\*' "$build/brief_lines.log" ||
        grep -v '\*\*\*' "$build/brief.log" | grep . | tail -n 5 | cut -c 1-240 >>"$build/brief_lines.log"
    sed 's/^/    /' "$build/brief_lines.log" >>"$digest"
}
step() { # NAME COMMAND...: one test that is a command; its output is printed when it fails
    name=$1
    shift
    if "$@" >"$build/step.log" 2>&1; then
        passed=$((passed + 1))
        message "ok    $name"
    else
        failed=$((failed + 1))
        cat "$build/step.log"
        brief "$name" <"$build/step.log"
        message "FAIL  $name"
    fi
}
# the result line of a test in the log of ctest; its output follows
result='^ *[0-9]+/[0-9]+ Test +#[0-9]+: '
output_of() { # LOG TEST: that test's result and output
    awk -v result="$result" -v test="$2" '
        $0 ~ result { on = 0; for (i = 1; i <= NF; i++) if ($i == test) on = 1 }
        /^ +Start +[0-9]+: / || /^[0-9]+% tests passed/ || /^The following tests/ { on = 0 }
        on' "$1"
}
idle= # prefix of commands with low priority
build_preset() { # PRESET "TARGET..." [cmake options]: may run in the background; built() reports the result
    preset=$1 target=$2
    shift 2
    # shellcheck disable=SC2086
    $idle cmake -S "$tree" -B "$build/$preset" -G Ninja -D PAL_PRESET="$preset" "$@" >"$build/build_$preset.log" 2>&1 &&
        $idle cmake --build "$build/$preset" --target $target >>"$build/build_$preset.log" 2>&1 && touch "$build/built_$preset"
}
built() { # PRESET
    [ ! -e "$build/built_$1" ] || return 0
    tail -n 40 "$build/build_$1.log"
    brief "build of $1" <"$build/build_$1.log"
    message "FAIL  build of $1"
    failed=$((failed + 1))
    return 1
}
# the tests of one build, PRESET [ctest options]: those that compute and those that mostly wait (tests/clients/CMakeLists.txt)
# run side by side; one more of the former than cores, because some sleep at times
compute() {
    (cd "$build/$1" && shift && $idle ctest --output-on-failure -j 3 "$@") >"$build/ctest_$1.log" 2>&1
}
waits() {
    (cd "$build/$1" && shift && ctest --output-on-failure -j 4 -L waits "$@") >"$build/ctest_waits_$1.log" 2>&1
}
count() { # PRESET: its tests, once both have run
    preset=$1 log=$build/ctest_$1.log
    cat "$build/ctest_waits_$preset.log" >>"$log"
    rm "$build/ctest_waits_$preset.log"
    grep -E "$result" "$log"
    n_pass=$(grep -cE "$result.* Passed " "$log")
    n_skip=$(grep -cE "$result.*\*\*\*Skipped" "$log")
    # "7/9 Test #3: ROOM/NAME ....***Failed"
    bad=$(grep -E "$result.*(\*\*\*|Not Run)" "$log" | grep -v '\*\*\*Skipped' | sed -E "s|$result([^ ]+) .*|\1|")
    n_fail=$(echo "$bad" | grep -c .)
    for test in $bad; do
        output_of "$log" "$test"
        output_of "$log" "$test" | brief "$preset: $test"
    done
    if [ "$n_pass" -eq 0 ]; then
        n_fail=$((n_fail + 1))
        tail -n 40 "$log"
        tail -n 15 "$log" | brief "$preset: no test has passed"
    fi
    passed=$((passed + n_pass))
    failed=$((failed + n_fail))
    skipped=$((skipped + n_skip))
    message "$preset: $n_pass passed, $n_fail failed, $n_skip skipped"
}
message "building release"
build_release release -D PAL_BUILD_TESTS=ON
message "tests of release"
compute release -LE waits
if [ -z "$fast" ]; then
    rm -f "$build"/built_* "$build"/fuzz_*.code
    # all rooms but those excluded below; for the thread sanitizer the rooms with threads
    rooms=$(cd "$tree/tests" && ls -d */CMakeLists.txt | sed 's,/.*,,' | grep -vE '^(accuracy|bench)$')
    threads="base num estimate session net agones relay clients"
    # browsers and waiting tests leave much of the machine idle
    idle="nice -n 10"
    trap 'kill 0' INT # of what runs beside, too
    {
        build_preset asan "server/all clients/all $(printf 'tests/%s/all ' $rooms)"
        build_preset tsan "server/all clients/all $(printf 'tests/%s/all ' $threads)"
        # without wide registers, for which the compiler takes minutes
        build_preset fuzz fuzzers -D CMAKE_C_COMPILER=clang -D PAL_NATIVE=OFF
    } &
fi
waits release
count release
step "sources are formatted" sh "$tree/tests/house/check_format.sh" "$tree"
step "viewer: formatted" sh "$tree/tests/house/check_viewer.sh" format "$build"
step "viewer: types" sh "$tree/tests/house/check_viewer.sh" types "$build"
step "viewer: node tests" sh "$tree/tests/house/check_viewer.sh" test "$build"
if [ -z "$fast" ]; then
    step "two browsers share an organ" sh "$tree/tests/browser/run.sh" pull "$build"
    step "cut tissue in a browser" sh "$tree/tests/browser/run.sh" inside "$build"
    step "images on a surface" sh "$tree/tests/browser/run.sh" textured "$build"
    step "fields in colours" sh "$tree/tests/browser/run.sh" fields "$build"
    step "a calibrated scene in the browser" sh "$tree/tests/browser/run.sh" calibrated "$build"
    step "an adaptive surface in the browser" sh "$tree/tests/browser/run.sh" adaptive "$build"
    step "sculpting in the browser" sh "$tree/tests/browser/run.sh" sculpt "$build"
    step "looks in the browser" sh "$tree/tests/browser/run.sh" look "$build"
    step "error against cost in the browser" sh "$tree/tests/browser/run.sh" accuracy "$build"
    step "viewer, trainee and instructor in the browser" sh "$tree/tests/browser/run.sh" rights "$build"
    step "sessions opened and ended in the browser" sh "$tree/tests/browser/run.sh" lobby "$build"
    step "from a full server to a relay in the browser" sh "$tree/tests/browser/run.sh" relays "$build"
    step "time plots in the browser" sh "$tree/tests/browser/run.sh" plots "$build"
    step "endoscope, saved views, two views, stereo and a headset" sh "$tree/tests/browser/run.sh" views "$build"
    step "a recording in the browser" sh "$tree/tests/browser/run.sh" debrief "$build"
    step "keyboard, languages and telephones in the browser" sh "$tree/tests/browser/run.sh" access "$build"
    step "two browsers, a bridge and lcm-logger together" sh "$tree/tests/browser/run.sh" together "$build"
    message "building with sanitizers"
    wait
    message "tests with sanitizers"
    {
        # release only: MPI ranks, the whole robustness suite (tests/robustness covers its code), headers and tables, in
        # which a sanitizer sees nothing
        [ ! -e "$build/built_asan" ] ||
            compute asan -LE 'waits|accuracy|bench' -E '^house/(test_calibrate_mpi|test_robustness|test_study_records|headers|hard_cases|test_hard_table)$'
        [ ! -e "$build/built_tsan" ] || compute tsan -LE 'waits|one_thread|same_threads' -R "^($(echo $threads | tr ' ' '|'))/"
    } &
    built asan && waits asan
    built tsan && waits tsan -LE same_threads
    wait
    idle=
    for preset in asan tsan; do [ ! -e "$build/built_$preset" ] || count $preset; done
    if built fuzz; then
        # two at a time
        ls "$build"/fuzz/tests/fuzz | sed -n 's/^fuzz_\([a-z0-9_]*\)$/\1/p' | xargs -P 2 -I % sh -c 'cd "$0" && mkdir -p corpus/% &&
            fuzz/tests/fuzz/fuzz_% -max_total_time=2 -timeout=20 -rss_limit_mb=2048 -artifact_prefix="$0/crash_" corpus/% "$1/%" \
                >fuzz_%.log 2>&1; echo $? >fuzz_%.code' "$build" "$tree/tests/data/fuzz"
        for code in "$build"/fuzz_*.code; do
            thing=$(basename "$code" .code)
            step "$(echo "$thing" | tr _ ' ') for 2 s" sh -c 'cat "$0/$1.log"; exit $(cat "$0/$1.code")' "$build" "$thing"
        done
    fi
fi
[ "$skipped" -eq 0 ] || message "$skipped skipped (the reasons are in $build/ctest_*.log)"
cat "$digest"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
