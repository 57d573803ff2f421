#!/bin/sh
# A device that sculpts (paper A, section 4.1) and one that takes hold within the volume (3.3), by real programs: the
# virtual hand touches a solid, presses the button, moves 30 mm up and lets go. usage: test_brush_server.sh PROGRAMS
bin=$1
. "$(dirname "$0")/rig.sh"
make_block
start_server --port 0
# who looks on tells what became of the solid: two edits change its topology twice
timeout 200 "$bin/palpate-client" "$url" --json --script idle --seconds 190 --name looks --until topologies=2 \
    >"$work/look" 2>"$work/look.err" &
look=$!
sculpts() { # NAME flags: the report in $work/NAME, exit code in $code
    name=$1
    shift
    timeout 100 "$bin/palpate-bridge" --server "$url" --device "$(device touch)" --script sculpt --json --seconds 90 "$@" \
        >"$work/$name" 2>"$work/$name.err"
    code=$?
}
probe() { # the stiffness on top, Pa
    echo '0 probe at=top' >"$work/orders"
    timeout 100 "$bin/palpate-client" "$url" --json --script idle --sculpt "$work/orders" --seconds 60 --until orders=1 \
        >"$work/probe" 2>"$work/probe.err"
    json young_Pa "$work/probe"
}
before=$(probe)
sculpts paint --brush paint,strength=3,radius=40
check "a device paints" $code == 0
check "with orders" "$(json orders "$work/paint")" '>=' 1
check "none of them is refused" "$(json orders_refused "$work/paint")" == 0
after=$(probe)
check "what it painted is stiffer (Pa)" "$after" '>' "$before"
sculpts inflate --brush inflate,strength=1000
check "a device inflates" $code == 0
check "the pressure follows the hand" "$(json orders "$work/inflate")" '>' 5
check "none of it is refused" "$(json orders_refused "$work/inflate")" == 0
sculpts extrude --brush extrude
check "a device extrudes" $code == 0
check "with one order" "$(json orders "$work/extrude")" == 1
check "that is not refused" "$(json orders_refused "$work/extrude")" == 0
wait $look
check "who looks on passes every check of every frame" $? == 0
check "a cell more and the paint are two topologies" "$(json topologies "$work/look")" == 2

# the hand goes down to the middle of the block, through its surface, and pulls what is there
timeout 100 "$bin/palpate-bridge" --server "$url" --device "$(device touch),descent=20" --script grasp --inside \
    --origin 0,0,0 --json --seconds 90 >"$work/inside" 2>"$work/inside.err"
check "a device takes hold within the volume and ends by itself" $? == 0
check "the tissue is pulled there (N)" "$(json server_N "$work/inside")" '>' 0.3
check "and the hand feels it (N)" "$(json felt_N "$work/inside")" '>' 0.3
check "no more energy than the tank's (mJ)" "$(json generated_mJ "$work/inside")" '<=' 1.01
timeout 20 "$bin/palpate-bridge" --server udpm://239.255.76.67:7667 --brush paint --quiet >"$work/no" 2>&1
check "by LCM there is no brush" "$(grep -c 'brush needs a server by websocket' "$work/no")" == 1
finish
