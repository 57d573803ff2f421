#!/bin/sh
# Installs what is missing, builds, prepares the default scene, starts the server and prints the address to open.
# usage: deploy/run.sh [INPUT] [palpate serve options...]
#   INPUT  a scene (.json), a surface (.obj .stl .ply .off) or a label volume (.nii .nii.gz .inr .inr.gz);
#          stomach, sphere or sheet: an adaptive surface that refines where it is touched;
#          soccer, monster, block3, chair, block4, head, bridge, nozzle or kidney: a subdivision solid to sculpt (or a .palcells file);
#          none: the liver of an abdominal CT, or a computed organ when the scan is not available
# PALPATE_BUILD names another build folder. The second run starts in seconds.
set -u
. "$(dirname "$0")/common.sh"
case ${1-} in -h | --help)
    sed -n '2,9s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac
start=$(pwd)
input='' shape='' solid=''
case ${1-} in
'' | -*) ;;
stomach | sphere | sheet)
    shape=$1
    shift
    ;;
soccer | monster | block3 | chair | block4 | head | bridge | nozzle | kidney)
    solid=$1
    shift
    ;;
*)
    input=$1
    shift
    case $input in /*) ;; *) input=$start/$input ;; esac
    [ -e "$input" ] || fail "$input: no such file"
    ;;
esac

install_missing run || exit 1
fetch_viewer || fail "could not download the packages of the viewer, see $build/npm.log"
message "building (the first time takes a minute)"
build_release release -D PAL_BUILD_TESTS="$tests"
palpate=$build/release/bin/palpate

# a labelled abdominal CT from a Debian package (CC0-1.0)
find_scan() {
    scan=$build/scan/data/images/liver.inr.gz
    [ -e "$scan" ] && return 0
    mkdir -p "$build/scan"
    install_missing scan
    archive=/usr/share/doc/libcgal-dev/data.tar.gz
    if [ ! -e "$archive" ]; then # slim systems install no documentation: unpack the package
        (cd "$build/scan" && apt-get download -q libcgal-demo && dpkg-deb -x libcgal-demo_*.deb .) >>"$build/install.log" 2>&1
        archive=$build/scan/usr/share/doc/libcgal-dev/data.tar.gz
    fi
    [ -e "$archive" ] && tar -xzf "$archive" -C "$build/scan" data/images/liver.inr.gz 2>>"$build/install.log"
    [ -e "$scan" ]
}

# a scene is prepared again (one second) when the program is newer
stale() { [ ! -e "$1" ] || [ "$palpate" -nt "$1" ]; }

if [ -n "$shape" ]; then
    input=$build/scene/$shape/scene.json
    if stale "$input"; then
        "$palpate" prepare --shape "$shape" -o "$build/scene/$shape" --quiet || fail "the scene could not be prepared"
    fi
fi
if [ -n "$solid" ]; then
    input=$build/scene/$solid.palcells
    mkdir -p "$build/scene"
    if stale "$input"; then
        "$palpate" cells "$solid" -o "$input" --quiet || fail "the cells could not be made"
    fi
fi
if [ -z "$input" ]; then
    input=$build/scene/liver/scene.json
    if stale "$input"; then
        # the patient lies on the back: up is -y, and the organ is fixed at its back, where it is attached
        if find_scan; then
            message "preparing the liver of an abdominal CT"
            "$palpate" prepare "$scan" --label 255 --name liver --up -y --hold 12 --title "Liver, from an abdominal CT" \
                --source "labelled CT of the Debian package libcgal-demo, CC0-1.0" -o "$build/scene/liver" \
                --quiet || fail "the scene could not be prepared"
        else
            input=$build/scene/organ/scene.json
            if stale "$input"; then
                message "the scan is not available, preparing a computed organ"
                "$palpate" prepare --procedural -o "$build/scene/organ" --quiet || fail "the scene could not be prepared"
            fi
        fi
    fi
fi
exec "$palpate" serve "$input" "$@"
