#!/bin/sh
# The floor check can fail: each kind of fault is planted in a small tree and must be found.
set -u
here=$(cd "$(dirname "$0")" && pwd)
passed=0 failed=0
verdict() { # NAME WANTED GOT
    if [ "$2" = "$3" ]; then
        passed=$((passed + 1))
        echo "ok   $1"
    else
        failed=$((failed + 1))
        echo "FAIL $1 (exit $3, wanted $2)"
    fi
}
plant() { # NAME FILE TEXT [EXIT [FILE TEXT]]: a clean little tree with what is planted must be refused
    tree=$(mktemp -d)
    mkdir -p "$tree/server/base" "$tree/server/sim/core" "$tree/server/sim/effects" "$tree/server/mesh/geometry" "$tree/protocol" "$tree/clients/scripted_client"
    echo '#include "server/base/err.h"' >"$tree/server/mesh/geometry/clean.c"
    if [ -n "$2" ]; then printf '%s\n' "$3" >"$tree/$2"; fi
    if [ -n "${5-}" ]; then printf '%s\n' "$6" >"$tree/$5"; fi
    node "$here/check_floors.mjs" "$tree" >/dev/null 2>&1
    code=$?
    rm -rf "$tree"
    verdict "$1" "${4:-1}" "$code"
}
node "$here/check_floors.mjs" >/dev/null
verdict "the tree keeps its floors" 0 $?
plant "a clean tree passes" "" "" 0
plant "finds an upward include" server/base/up.c '#include "server/mesh/geometry/surface.h"'
plant "finds a sideways include" protocol/side.c '#include "server/base/err.h"'
plant "finds a client that sees the server" clients/scripted_client/peek.c '#include "server/sim/world/world.h"'
plant "finds an effect that sees the world" server/sim/effects/big.c '#include "server/sim/world/world.h"'
plant "finds a room that prints" server/sim/core/loud.c 'void f(void) { printf("x"); }'
plant "finds threads in sim" server/sim/core/threads.c '#include <pthread.h>'
plant "finds a room without a floor" server/sim/loose.c '#include "server/base/err.h"'
plant "finds a ring" server/sim/core/a.h '#include "server/sim/core/b.h"' 1 server/sim/core/b.h '#include "server/sim/core/a.h"'
plant "finds a header of parts" server/sim/core/a_parts.h '#include "server/base/err.h"'
plant "finds a foreign top-level entry" notes.txt 'notes'
plant "finds a name that stands twice" server/sim/core/clean.c '#include "server/base/err.h"'
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
