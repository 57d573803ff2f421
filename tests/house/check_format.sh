#!/bin/sh
# Every C file is formatted as .clang-format says. usage: check_format.sh [TREE]
cd "${1:-$(dirname "$0")/../..}" || exit 2
list=$(find server protocol clients tests \( -name node_modules -prune \) -o -name '*.[ch]' -print | sort)
[ -n "$list" ] || exit 2
# shellcheck disable=SC2086
clang-format --dry-run --Werror $list
