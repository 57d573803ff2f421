#!/bin/sh
# The viewer's checks: `types` runs tsc over the JSDoc types, `test` runs node --test. Packages come from the lock file
# into the build folder. usage: check_viewer.sh types|test
set -u
tree=$(cd "$(dirname "$0")/../.." && pwd)
build=${PALPATE_BUILD:-$tree/build}
case ${1-} in
types)
    "$build/viewer_packages/node_modules/.bin/tsc" --noEmit -p "$tree/clients/viewer/jsconfig.json" \
        --typeRoots "$build/viewer_packages/node_modules/@types" --baseUrl "$tree"
    ;;
test) cd "$tree/clients/viewer" && node --test test/ ;;
*)
    echo "usage: check_viewer.sh types|test" >&2
    exit 2
    ;;
esac
