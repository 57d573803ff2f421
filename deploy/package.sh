#!/bin/sh
# Builds the Debian packages palpate, palpate-dev and, where there is an MPI, palpate-mpi, and prints their paths. On x86-64 they
# need a processor of level x86-64-v3 (since 2013; the package looks): a step takes 1.0 to 1.2 times as long as in a build for the machine
# itself, and without that level 2.6 to 2.9 times (computed organ of springs, head and chair of deploy/demos).
# usage: deploy/package.sh [cmake options]     -D CMAKE_C_FLAGS= for every processor of the architecture
# PALPATE_BUILD names another build folder. Install with: apt-get install ./palpate_*.deb
set -u
case ${1-} in -h | --help)
    sed -n '2,6s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac
. "$(dirname "$0")/common.sh"
install_missing run pack || exit 1
install_missing mpi || message "without palpate-mpi: no MPI"
fetch_viewer || fail "could not download the packages of the viewer, see $build/npm.log"
message "building (the first time takes minutes)"
[ "$(uname -m)" != x86_64 ] || set -- -D CMAKE_C_FLAGS=-march=x86-64-v3 "$@" # the last one of an option counts
build_release package -D PAL_BUILD_TESTS=OFF -D PAL_NATIVE=OFF "$@"
rm -f "$build"/package/palpate*.deb
(cd "$build/package" && cpack -G DEB) >"$build/cpack.log" 2>&1 || fail "could not pack, see $build/cpack.log"
ls "$build"/package/palpate*.deb
