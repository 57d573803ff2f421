#!/bin/sh
# A solid that is sculpted while it runs, from a real server to palpate-client and palpate-bridge: every frame fits the
# topology it belongs to for who gives the orders, who looks on and who presses. They press 4 mm deep, and what is kept and
# loses a cell then has no divided cells: their thin parts, pressed flat and cut open, may be folded over, which is rightly
# refused. usage: test_sculpt_server.sh PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
make_block
start_server --port 0
ask() { # NAME flags: gives the orders of $work/orders; report in $work/NAME, exit code in $code
    name=$1
    shift
    timeout 120 "$bin/palpate-client" "$url" --json --script idle --sculpt "$work/orders" "$@" >"$work/$name" 2>"$work/$name.err"
    code=$?
}

cat >"$work/orders" <<'ORDERS'
# one of each
1.0 probe   at=top
1.0 extrude at=top distance_m=0.02 scale=0.8 target=block
1.2 paint   at=front radius_m=0.04 young_factor=3 density_factor=2
1.2 probe   at=front
1.4 sharpen at=top sharpness=2 entity=1
1.4 divide  at=left
1.6 undo
1.6 redo
1.6 undo
1.8 cut     nx=0 ny=1 nz=0 offset_m=0.001
1.8 uncut
2.0 set_rest_shape
2.0 delete  at=right
? 2.0 extrude at=top distance_m=-1
? 2.0 delete x_m=9 y_m=0 z_m=0
ORDERS
timeout 120 "$bin/palpate-client" "$url" --json --script press --depth 0.004 --seconds 110 --name presses \
    --until topologies=11,cycles_of_it=20,force_N=0.01 >"$work/press" 2>"$work/press.err" &
press=$!
timeout 120 "$bin/palpate-client" "$url" --json --script idle --seconds 110 --name looks --field displacement \
    --until topologies=11,cycles_of_it=20,fields=3 >"$work/look" 2>"$work/look.err" &
look=$!
timeout 120 "$bin/palpate-bridge" --server "$url" --device "$(device premium)" --options depth=4 --seconds 115 \
    --json >"$work/bridge" 2>"$work/bridge.err" &
bridge=$!
members 3
ask sculpt --seconds 100 --until orders=15
[ $code -eq 0 ] || cat "$work/sculpt.err"
check "all orders are answered and done, but for those that may be refused" $code == 0
check "fifteen answers" "$(json orders "$work/sculpt")" == 15
check "two of them are refusals" "$(grep -c '"done":false' "$work/sculpt")" == 2
check "with the server's sentence" "$(grep -c 'nothing of block is at 9 0 0 m' "$work/sculpt")" == 1
check "eleven topologies" "$(json topologies "$work/sculpt")" == 11
check "a cell more has more vertices" "$(grep '"order":"extrude"' "$work/sculpt" | head -1 | sed 's/.*"vertices":\([0-9]*\).*/\1/')" '>' \
    "$(grep '"order":"probe"' "$work/sculpt" | head -1 | sed 's/.*"vertices":\([0-9]*\).*/\1/')"
check "what was painted is stiffer" "$(grep '"order":"probe"' "$work/sculpt" | sed -n '2s/.*"young_Pa":\([0-9.]*\).*/\1/p')" '>' \
    "$(grep '"order":"probe"' "$work/sculpt" | sed -n '1s/.*"young_Pa":\([0-9.]*\).*/\1/p')"
check "each change is seen" "$(grep '"order"' "$work/sculpt" | grep -v probe | grep '"done":true' | grep -vc '"frame_ms":0,')" == 11
wait $press
check "who presses meanwhile passes every check of every frame" $? == 0
check "through all topologies" "$(json topologies "$work/press")" == 11
check "and feels force (N)" "$(json force_max_N "$work/press")" '>' 0.001
wait $look
check "who looks on in colours passes every check" $? == 0
check "through all topologies" "$(json topologies "$work/look")" == 11
stop $bridge
check "a bridge that holds a tool ends well" $? == 0
check "models come" "$(json models "$work/bridge")" '>' 10
check "none of them is refused" "$(json not_finite "$work/bridge")" == 0
check "and the force stays under its cap (N)" "$(json force_max_N "$work/bridge")" '<=' 3

echo '0 extrude at=top distance_m=-1' >"$work/orders"
ask refused --seconds 30 --until orders=1
check "a refusal that was not expected is a failure" $code == 1
check "that names the line" "$(grep -c 'line 1: extrude' "$work/refused.err")" == 1
for line in '0 extrude at=roof' '0' 'x undo' '0 undo now' '0 extrude distance_m=far'; do
    echo "$line" >"$work/orders"
    ask bad --seconds 1
    check "\"$line\" is refused with its place" "$([ $code -eq 1 ] && grep -c "orders:1: " "$work/bad.err")" == 1
done
finish
