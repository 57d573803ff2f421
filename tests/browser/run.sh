#!/bin/sh
# The browser tests: real Chromium on a real server. usage: run.sh pull|fields|calibrated|adaptive|sculpt|accuracy|rights|debrief|lobby|access|plots|look|effects|together BUILD [PICTURES]
#   pull      two browsers share an organ that one of them pulls
#   fields    displacement, stress, energy and edge stiffness in colours
#   calibrated  a calibrated scene and its error
#   adaptive  an adaptive surface that is refined under the tool
#   sculpt    a subdivision solid that is sculpted by clicks
#   accuracy  the plot of a study, switches along its Pareto front, components disabled and enabled
#   rights    viewer, trainee and instructor by ticket, and what the instructor lets the others do
#   debrief   a recording that is played, sought, and gone on from live
#   lobby     sessions of a server, opened and ended by an instructor
#   access    keyboard, screen readers, other languages, telephones
#   look      a look for each organ, patterns that stick to tissue, shadows and occlusion
#   effects   no test: prints what each visual feature costs a picture
#   together  two browsers, a haptic bridge and lcm-logger on one organ; in a network namespace of its own
# BUILD is the folder of deploy/test.sh (release/bin/palpate, viewer_packages); PICTURES keeps the screenshots.
set -u
here=$(cd "$(dirname "$0")" && pwd)
which=${1:-pull}
build=$(cd "${2:-$here/../../build}" && pwd) || exit 2
pictures=${3:-$build/pictures}
case $which in
pull | fields | calibrated | adaptive | sculpt | accuracy | rights | debrief | lobby | access | plots | look | effects) exec node "$here/$which.mjs" "$build" "$pictures" ${4-} ;;
together)
    exec unshare -n sh -c 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec node "$0/together.mjs" "$1" "$2"' \
        "$here" "$build" "$pictures"
    ;;
*)
    echo "usage: run.sh pull|fields|calibrated|adaptive|sculpt|accuracy|rights|debrief|lobby|access|plots|look|effects|together BUILD [PICTURES]" >&2
    exit 2
    ;;
esac
