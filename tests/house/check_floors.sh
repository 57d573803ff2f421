#!/bin/sh
# The floor check: an include may only point down the stair of README.md; siblings do not see each other.
# Prints every include that points up or sideways, then one summary line; exit 1 when there is any.
# usage: check_floors.sh [TREE]
set -u
tree=${1:-$(dirname "$0")/../..}
cd "$tree" || exit 2

# rooms each room may include from (itself is always allowed)
allowed() {
    case $1 in
    server/base) echo "" ;;
    protocol) echo "" ;;
    server/num) echo "server/base" ;;
    server/mesh) echo "server/num server/base" ;;
    server/sim) echo "server/mesh server/num server/base" ;;
    server/scene | server/session | server/lab) echo "server/sim server/mesh server/num server/base" ;;
    server/net) echo "server/session server/sim protocol server/base server/mesh" ;;
    server/commands | server) echo "server/commands server/net server/session server/scene server/lab server/sim server/mesh server/num server/base protocol server" ;;
    clients/link) echo "protocol server/base lcmtypes" ;;
    clients/*) echo "clients/link protocol server/base lcmtypes" ;;
    *) echo "?" ;;
    esac
}

room_of() { # the room of a path, its first folders, in $room; no other process, as it is asked thousands of times
    case $1 in
    server/*/* | clients/*)
        room=${1#*/}
        room=${1%%/*}/${room%%/*}
        ;;
    server/*) room=server ;;
    protocol/*) room=protocol ;;
    lcmtypes/*) room=lcmtypes ;;
    *) room= ;;
    esac
}

bad=0 seen=0
list=$(find server protocol clients -name '*.[ch]' | sort)
for file in $list; do
    room_of "$file"
    from=$room may=" $(allowed "$room") $room "
    for target in $(sed -n 's/^[ \t]*#[ \t]*include[ \t]*"\([^"]*\)".*/\1/p' "$file"); do
        seen=$((seen + 1))
        room_of "$target"
        to=$room
        case $target in palpate_*_t.h) to=lcmtypes ;; esac
        if [ -z "$to" ]; then
            echo "$file: includes \"$target\", which is not named from the top of the tree"
            bad=$((bad + 1))
            continue
        fi
        case $may in
        *" $to "*) ;;
        *)
            echo "$file: includes \"$target\": $from may not see $to"
            bad=$((bad + 1))
            ;;
        esac
        # inside sim: effects and solvers never see the world, nor each other
        case $file in
        server/sim/effects/* | server/sim/solvers/* | server/sim/models/*)
            case $target in
            server/sim/world.h | server/sim/plan.h)
                echo "$file: includes \"$target\": an effect may not see the world"
                bad=$((bad + 1))
                ;;
            server/sim/effects/*.c | server/sim/solvers/*.c)
                echo "$file: includes \"$target\": effects never see each other"
                bad=$((bad + 1))
                ;;
            esac
            ;;
        esac
    done
    # the simulation has no JSON, threads, sockets or files
    case $file in
    server/sim/*)
        if grep -nE '^[ \t]*#[ \t]*include[ \t]*<(cjson|pthread|threads|sys/socket|libwebsockets|lcm|fcntl|sys/stat)' "$file"; then
            echo "$file: sim has no JSON, threads, sockets or files"
            bad=$((bad + 1))
        fi
        ;;
    esac
done

# a name stands once in the tree, a file is at most 700 lines
for name in $(find server protocol clients -name '*.[ch]' -exec basename {} \; | grep -vx 'main\.c' | sort | uniq -d); do
    echo "$name: the name stands more than once in the tree"
    bad=$((bad + 1))
done
# shellcheck disable=SC2086
for file in $(wc -l $list | awk '$1 > 700 && $2 != "total" { print $2 ":" $1 }'); do
    echo "${file%:*}: ${file#*:} lines, more than 700"
    bad=$((bad + 1))
done

# the top level holds what README.md says and nothing else
for entry in $(ls); do
    case $entry in
    CMakeLists.txt | LICENSE | README.md | clients | deploy | lcmtypes | protocol | server | tests | build*) ;;
    *)
        echo "$entry: does not belong on the top level"
        bad=$((bad + 1))
        ;;
    esac
done

echo "floors: $seen includes checked, $bad faults"
[ "$seen" -gt 0 ] && [ "$bad" -eq 0 ]
