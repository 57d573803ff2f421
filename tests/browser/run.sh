#!/bin/sh
# The browser test: real Chromium on a real server. usage: run.sh BUILD [PICTURES]
# BUILD is the folder of deploy/test.sh (release/bin/palpate, viewer_packages); PICTURES keeps the screenshots.
set -u
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "${1:-$here/../../build}" && pwd) || exit 2
exec node "$here/pull.mjs" "$build" "${2:-$build/pictures}"
