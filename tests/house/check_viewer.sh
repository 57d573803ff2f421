#!/bin/sh
# The viewer's checks: `types` runs tsc over the JSDoc types, `test` runs node --test, `format` asks prettier whether the
# viewer and every script of the tests is formatted, `reformat` formats them. Packages come from the lock file into the
# build folder (deploy/common.sh). usage: check_viewer.sh types|test|format|reformat [BUILD]
set -u
tree=$(cd "$(dirname "$0")/../.." && pwd)
build=${2:-$tree/build}
build=$(cd "$build" && pwd) || exit 2
packages=$build/viewer_packages
case ${1-} in
types)
    # the served vendor folder does not exist in the tree: its types stand in for it, beside the sources by rootDirs
    mkdir -p "$packages/types/vendor"
    echo 'export * from "three";' >"$packages/types/vendor/three.module.min.d.ts"
    echo 'import uPlot from "uplot"; export default uPlot;' >"$packages/types/vendor/uPlot.esm.d.ts"
    while read -r addon; do
        mkdir -p "$packages/types/vendor/addons/${addon%/*}"
        echo "export * from \"three/addons/$addon\";" >"$packages/types/vendor/addons/${addon%.js}.d.ts"
    done <"$tree/clients/viewer/addons.txt"
    cat >"$packages/tsconfig.json" <<JSON
{
  "extends": "$tree/clients/viewer/jsconfig.json",
  "compilerOptions": { "rootDirs": ["$tree/clients/viewer", "$packages/types"], "typeRoots": ["$packages/node_modules/@types"], "types": [] },
  "include": ["$tree/clients/viewer/src/*.js", "$packages/types/vendor/**/*.d.ts"]
}
JSON
    exec "$packages/node_modules/.bin/tsc" --noEmit -p "$packages/tsconfig.json"
    ;;
format | reformat)
    mode=--check
    [ "$1" = format ] || mode=--write
    cd "$tree" || exit 2
    # shellcheck disable=SC2046
    exec "$packages/node_modules/.bin/prettier" --log-level warn --config clients/viewer/package.json $mode \
        $(find clients/viewer tests -name node_modules -prune -o \( -name '*.js' -o -name '*.mjs' \) -print | sort) \
        clients/viewer/index.html clients/viewer/*.css clients/viewer/package.json clients/viewer/jsconfig.json
    ;;
test) cd "$tree/clients/viewer" && exec node --test test/*.test.js ;;
*)
    echo "usage: check_viewer.sh types|test|format|reformat [BUILD]" >&2
    exit 2
    ;;
esac
