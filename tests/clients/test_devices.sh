#!/bin/sh
# palpate-bridge with the fakes of the vendors' libraries in the linker's search path: what it lists and measures, and a
# device that comes by dlopen into a session. usage: test_devices.sh FOLDER_OF_PROGRAMS FORGE FOLDER_OF_FAKES
bin=$1
fakes=$3
. "$(dirname "$0")/rig.sh"
unset FDSDK GTDD_HOME
bridge() { LD_LIBRARY_PATH=$fakes timeout 60 "$bin/palpate-bridge" "$@"; }

"$bin/palpate-bridge" --list-devices >"$work/none" 2>"$work/none.err"
check "each back end has a line" "$(cut -d: -f1 "$work/none" | tr '\n' ' ' | grep -c '^virtual hdapi dhd haply input plugin $')" == 1
check "a missing library is named" "$(grep -c '^hdapi: not available: looked for libHD.so,' "$work/none")" == 1
bridge --list-devices >"$work/all" 2>"$work/all.err"
check "one that is there is found" "$(grep -c "^hdapi: 1: $fakes/libHD.so" "$work/all")" == 1
check "with the number of its devices" "$(grep -c "^dhd: 1: $fakes/libdhd.so" "$work/all")" == 1

PAL_FAKE=wall=1 bridge --doctor --device hdapi: >"$work/doctor" 2>"$work/doctor.err"
check "the doctor finds what is missing" $? == 1
check "and says what to do" "$(grep -c 'not ok  environment: GTDD_HOME is not set: set it' "$work/doctor")" == 1
check "calibration is good" "$(grep -c 'ok      calibration: good' "$work/doctor")" == 1
check "the first pose is there" "$(grep -c 'ok      pose: ' "$work/doctor")" == 1
check "the rate is measured" "$(grep -c 'update rate: ' "$work/doctor")" == 1
PAL_FAKE=init=0x302 bridge --doctor --device hdapi: >"$work/sick" 2>"$work/sick.err"
check "a device that does not open is one line" "$(grep -c '^not ok  device: .* error 0x302' "$work/sick")" == 1
bridge --device dhd:7 >"$work/seven" 2>"$work/seven.err"
check "so it is without the doctor" "$(grep -c 'device 7 of the DHD library' "$work/seven.err")" == 1
check "and nothing else" "$(wc -l <"$work/seven.err")" == 1

make_scene
start_server --port 0
PAL_FAKE=wall=1,buttons=1 bridge --server "$url" --device hdapi: --seconds 50 --until models=11,poses=101 --json \
    >"$work/joined" 2>"$work/joined.err"
check "a device by dlopen joins a session" $? == 0
check "under its own name" "$(grep -c 'Fake Touch' "$work/joined")" == 1
check "models come" "$(json models "$work/joined")" '>' 10
check "poses go out" "$(json poses "$work/joined")" '>' 100
PAL_FAKE=wall=1 bridge --server "$url" --device "$(device premium)" --second-device hdapi: --seconds 50 \
    --until models=11,poses=101 --json >"$work/both" 2>"$work/both.err"
check "two devices join a session" $? == 0
check "with a tool each" "$(tr ',{}' '\n\n\n' <"$work/both" | grep '^"tool":[0-9]' | sort -u | wc -l)" == 2
check "and a report each" "$(grep -c 'virtual Premium.*"second":{.*Fake Touch' "$work/both")" == 1
PAL_FAKE=wall=1,error=0x302,error_at=500 bridge --server "$url" --device hdapi: --seconds 50 >"$work/lost" 2>"$work/lost.err" &
job=$!
shows "$work/lost.err" $job 'error 0x302'
check "a device that is lost is reported" $? == 0
# a slow machine may see it answer, and fail, again
check "in one line" "$(grep -c 'error 0x302' "$work/lost.err")" == $((1 + $(grep -c 'answers again' "$work/lost.err")))
stop $job
finish
