#!/bin/sh
# The browser tests: real Chromium on a real server. usage: run.sh NAME BUILD [PICTURES], NAME being
#   pull      two browsers share an organ that one of them pulls
#   textured  the images of an OBJ file on its surface, tetrahedral and adaptive
#   inside    the inner tissue that a deleted control cell shows
#   fields    displacement, stress, energy and stiffness in colours, inside the body too: sections and clouds
#   calibrated  a calibrated scene and its error
#   adaptive  an adaptive surface that is refined under the tool
#   sculpt    a subdivision solid that is sculpted by clicks
#   accuracy  the plot of a study, switches along its Pareto front, components disabled and enabled
#   rights    viewer, trainee and instructor by ticket, and what the instructor lets the others do
#   debrief   a recording that is played, sought, and gone on from live
#   lobby     sessions of a server, opened and ended by an instructor
#   relays    a page that a full server refuses goes on to a relay
#   access    keyboard, screen readers, other languages, telephones
#   plots     force, displacement, work and step time over time; pictures and videos of the page
#   look      a look for each organ, patterns that stick to tissue, shadows and occlusion
#   effects   no test: prints what each visual feature costs a picture
#   views     an endoscope, saved views, two views side by side, stereo and a headset
#   together  two browsers, a haptic bridge and lcm-logger on one organ; in a network namespace of its own
# BUILD is the folder of deploy/test.sh (release/bin/palpate, viewer_packages); PICTURES keeps the screenshots.
set -u
here=$(cd "$(dirname "$0")" && pwd)
which=${1:-pull}
build=$(cd "${2:-$here/../../build}" && pwd) || exit 2
pictures=${3:-$build/pictures}
case $which in
together)
    exec unshare -n sh -c 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec node "$0/together.mjs" "$1" "$2"' \
        "$here" "$build" "$pictures"
    ;;
common) ;;
*) [ -e "$here/$which.mjs" ] && exec node "$here/$which.mjs" "$build" "$pictures" ${4-} ;;
esac
echo "usage: run.sh NAME BUILD [PICTURES], NAME being one of those at the head of run.sh" >&2
exit 2
