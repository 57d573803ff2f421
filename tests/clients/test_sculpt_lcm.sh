#!/bin/sh
# What peers on LCM learn when a solid is sculpted: the status names the new asset, frames go on.
# In a network namespace of its own. usage: test_sculpt_lcm.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
own_network "$@"
bus='udpm://239.255.76.67:7667?ttl=0'
make_block
start_server --port 8090 --lcm "$bus" --log info
await 30 grep -q lcm_joined "$work/serve.err"
check "palpate-lcm has joined" $? == 0
timeout 120 lcm-logger --lcm-url="$bus" -f "$work/record" >/dev/null 2>&1 &
pids="$pids $!"
# assets that a status on the bus has named, frames on the bus
assets() { grep -ao '/asset/[0-9a-f]*' "$work/record" 2>/dev/null | sort -u | wc -l; }
named() { [ "$(assets)" -ge "$1" ]; }
frames() { grep -ao 'PALPATE1/block/BODY/0' "$work/record" 2>/dev/null | wc -l; }
await 30 named 1
check "the status names the asset" $? == 0
printf '0 extrude at=top distance_m=0.02\n2.5 divide at=left\n' >"$work/orders"
timeout 100 "$bin/palpate-client" "$url" --json --script idle --sculpt "$work/orders" --seconds 60 --until orders=2 >"$work/sculpt" 2>"$work/sculpt.err"
check "it is sculpted" $? == 0
await 30 named 3
check "each topology's asset is named" "$(assets)" '>=' 3
seen=$(frames)
more() { [ "$(frames)" -gt "$seen" ]; }
await 30 more
check "frames go on" $? == 0
check "palpate-lcm is still the same" "$(grep -c lcm_joined "$work/serve.err")" == 1
finish
