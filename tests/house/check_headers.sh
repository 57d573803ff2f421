#!/bin/sh
# Every public header of server, protocol and clients compiles on its own, so that including it first is never wrong.
# check_headers.sh COMPILER [ROOT]; prints each that does not, exit 1.
set -u
compiler=$1
cd "${2:-$(dirname "$0")/../..}" || exit 2
bad=0 n=0
for header in $(find server protocol clients -name '*.h' -not -path '*/node_modules/*' | sort); do
    # the LCM types are made by lcm-gen in the build folder
    if grep -q '^#include "palpate_' "$header"; then continue; fi
    n=$((n + 1))
    if ! echo "#include \"$header\"" | "$compiler" -std=gnu17 -fsyntax-only -Wno-psabi -I. -x c - 2>/dev/null; then
        echo "$header does not compile on its own"
        bad=1
    fi
done
if [ "$n" -eq 0 ]; then
    echo "no headers found"
    bad=1
fi
exit $bad
