#!/bin/sh
# The reference beam in Palpate and in its peers: error against the converged reference and time, side by side.
# Needs a release build with libbullet-dev and calculix-ccx installed, and the reference solutions.
# usage: run.sh BUILD REFERENCE_BEAM_FOLDER
set -eu
[ $# -eq 2 ] || { echo "usage: run.sh BUILD REFERENCE_BEAM_FOLDER" >&2; exit 2; }
build=$1 ref=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
peer=$build/tests/bench/peers
for nu in 0.3 0.45; do
    tag=$(printf 'nu%03.0f' "$(echo "$nu" | awk '{print $1 * 100}')")
    for n in 16 32; do
        for kind in linear finite; do
            [ $kind = linear ] && { force=0.25 csv=$ref/u_linear_$tag.csv case=linear_$tag; }
            [ $kind = finite ] && { force=2 csv=$ref/u_nh_$tag.csv case=nh_$tag; }
            echo "beam, nu $nu, $kind, $n cubes along"
            [ -x "$peer/peer_bullet" ] && "$peer/peer_bullet" $n $nu $force "$csv" 8
            [ -x "$peer/peer_calculix" ] && for e in C3D8 C3D8I C3D4; do
                "$peer/peer_calculix" $n $nu $force $kind "$csv" $e "$work"
            done
            "$build/bin/palpate" solve "$ref/problem.json" --case $case --resolution $n --json | tr -d '\n'
            echo
        done
    done
done
