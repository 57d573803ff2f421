#!/bin/sh
# What peers on LCM learn when a solid is sculpted: the status names the new asset, frames go on.
# In a network namespace of its own. usage: test_sculpt_lcm.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
own_network "$@"
bus='udpm://239.255.76.67:7667?ttl=0'
make_block
start_server --port 8090 --lcm "$bus" --log info
shows "$work/serve.err" $server_job lcm_joined
check "palpate-lcm has joined" $? == 0
timeout 280 lcm-logger --lcm-url="$bus" -f "$work/record" >/dev/null 2>&1 &
logger=$!
pids="$pids $logger"
# named N: until a status on the bus has named so many assets; says how many
named() {
    seen="" n_seen=0
    follow "$work/record" $logger | grep -ao --line-buffered '/asset/[0-9a-f]*' | while read -r asset; do
        case $seen in *"$asset"*) continue ;; esac
        seen="$seen $asset" n_seen=$((n_seen + 1))
        if [ $n_seen -eq "$1" ]; then echo $n_seen && break; fi
    done
}
check "the status names the asset" "$(named 1)" == 1
printf '0 extrude at=top distance_m=0.02\n2.5 divide at=left\n' >"$work/orders"
timeout 100 "$bin/palpate-client" "$url" --json --script idle --sculpt "$work/orders" --seconds 60 --until orders=2 >"$work/sculpt" 2>"$work/sculpt.err"
check "it is sculpted" $? == 0
check "each topology's asset is named" "$(named 3)" == 3
timeout 100 tail -c 0 -F "$work/record" 2>/dev/null | grep -aq 'PALPATE1/block/BODY/0'
check "frames go on" $? == 0
check "palpate-lcm is still the same" "$(grep -c lcm_joined "$work/serve.err")" == 1
finish
