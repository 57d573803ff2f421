#!/bin/sh
# Plays a demo: serves its scene on a free port, sends its commands with palpate-client, stops what it started.
# usage: deploy/demos/run.sh NAME [--wait S] [--stay] [--json] [palpate serve options...]
#   NAME     head, chair, paint, mass, nozzle or bridge; deploy/demos/README.md describes each
#   --wait   seconds before it starts, to open the printed address
#   --stay   keep serving after the demo, until Ctrl-C
#   --json   results of the clients as JSON lines, each after the name of its file
# PALPATE_BIN names the folder of the programs (build/release/bin). Exit code 1 when a command was refused or a check failed.
set -u
here=$(cd "$(dirname "$0")" && pwd) || exit 1
bin=${PALPATE_BIN:-$here/../../build/release/bin}
unset PALPATE_BIN # the server takes PALPATE_* for its configuration
usage() {
    sed -n '2,8s/^# \{0,1\}//p' "$0"
    exit "$1"
}
case ${1-} in
-h | --help) usage 0 ;;
head) cells=head flags="--script pull --up 0,-1,0 --depth 0.025" cycles=390 ;;
chair) cells=chair flags="--script $here/hover.script" cycles=540 ;;
paint) cells=chair flags="--script $here/hover.script" cycles=480 ;;
mass) cells=block flags="--script $here/hover.script" cycles=120 ;;
nozzle) cells=nozzle flags="--script $here/hover.script --field strain" cycles=360 ;;
bridge) cells=bridge flags="--script $here/hover.script --field displacement" cycles=360 ;;
*) usage 2 >&2 ;;
esac
name=$1
shift
pause=0 stay='' json=''
while :; do
    case ${1-} in
    --wait) pause=${2-} && shift 2 || usage 2 >&2 ;;
    --stay) stay=yes && shift ;;
    --json) json=--json && shift ;;
    *) break ;;
    esac
done
[ -x "$bin/palpate" ] || {
    echo "palpate: no programs in $bin: run deploy/run.sh once, or name their folder in PALPATE_BIN" >&2
    exit 1
}
work=$(mktemp -d) || exit 1
pids=''
cleanup() {
    trap - EXIT INT TERM
    for pid in $pids; do kill "$pid" 2>/dev/null; done
    for pid in $pids; do wait "$pid" 2>/dev/null; done
    rm -rf "$work"
}
trap cleanup EXIT
trap 'exit 1' INT TERM

# the control cells that the scene names
if [ $cells = block ]; then
    "$bin/palpate" cells block --cells 3,2,2 --size-m 0.12,0.06,0.06 -o "$work/block.palcells" --quiet || exit 1
else
    "$bin/palpate" cells $cells -o "$work/$cells.palcells" --quiet || exit 1
fi
cp "$here/$name.json" "$work/" || exit 1
mkfifo "$work/serve" || exit 1
"$bin/palpate" serve "$work/$name.json" --port 0 --open --json --quiet "$@" >"$work/serve" &
server=$!
pids=$server
port=$(sed -n 's/.*"port":\([0-9]*\).*/\1/p;q' "$work/serve")
[ -n "$port" ] || exit 1
echo "palpate: $name: http://127.0.0.1:$port/" >&2
sleep "$pause"

# one client with a tool of its own for each file of commands
players='' code=0
for orders in "$here/$name".orders "$here/$name"_*.orders; do
    [ -e "$orders" ] || continue
    file=$(basename "$orders" .orders)
    "$bin/palpate-client" "ws://127.0.0.1:$port/ws" --name "$file" $flags --sculpt "$orders" $json \
        --seconds 300 --until "orders=$(grep -c '^[?0-9]' "$orders"),cycles=$cycles" >"$work/$file.report" &
    players="$players $!"
    pids="$pids $!"
done
for player in $players; do wait "$player" || code=1; done
for report in "$work"/*.report; do
    echo "$(basename "$report" .report):"
    cat "$report"
done
[ -z "$stay" ] || wait $server
exit $code
