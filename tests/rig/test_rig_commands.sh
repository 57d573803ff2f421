#!/bin/sh
# palpate-rig as a person runs it: its examples run as printed, wrong usage is refused in one line, what it reports is
# what passed. usage: test_rig_commands.sh FOLDER_OF_PROGRAMS
bin=$1
. "$(dirname "$0")/through.sh"
own_network "$@"
PATH=$bin:$PATH
"$bin/palpate-rig" --help >"$work/help"
check "no line of the help is longer than 120" "$(awk 'length > 120' "$work/help" | wc -l)" == 0
sed -n '/^EXAMPLES/,/^$/s/^  //p' "$work/help" >"$work/examples"
check "the help has examples" "$(wc -l <"$work/examples")" '>=' 4
while read -r line; do
    timeout 60 sh -c "$line" >"$work/out" 2>"$work/example.err" </dev/null
    check "$line" $? == 0
    check "  without a word on stderr" "$(wc -l <"$work/example.err")" == 0
done <"$work/examples"

# refused CODE TEXT FLAGS...: exit code, one line that has the text, nothing else
refused() {
    wanted=$1 text=$2
    shift 2
    timeout 20 "$bin/palpate-rig" "$@" >"$work/out" 2>"$work/refused"
    check "palpate-rig $*" $? == "$wanted"
    check "  one line: $text" "$(wc -l <"$work/refused")/$(grep -c -e "$text" "$work/refused")/$(wc -c <"$work/out")" == 1/1/0
}
refused 2 'no profile "moon" (--list)' --profile moon --tcp 0:127.0.0.1:1
refused 2 '--tcp or --lcm is missing' --profile 80
refused 2 'a jitter of 30 ms is more than the round trip of 20 ms' --tcp 0:127.0.0.1:1 --profile 20 --jitter-ms 30
refused 2 'leaves no time between them' --tcp 0:127.0.0.1:1 --outage 2 --outage-every 2
refused 2 '--loss' --tcp 0:127.0.0.1:1 --loss 101
refused 1 'is not PORT:ADDRESS:PORT' --tcp 8090
refused 1 'is not PORT:ADDRESS:PORT' --tcp 0:localhost:8090
refused 1 'is not GROUP:PORT,GROUP:PORT' --lcm 127.0.0.1:7667,239.255.76.67:7668
refused 1 'is not GROUP:PORT,GROUP:PORT' --lcm 239.255.76.67:7667
refused 1 'both sides are the same group' --lcm 239.255.76.67:7667,239.255.76.67:7667

# through the rig comes what the server sent
make_scene
start_server --port 0
start_rig 50 --tcp "0:127.0.0.1:$port"
refused 1 "port $rig_port: Address already in use" --tcp "$rig_port:127.0.0.1:$port"
get() { node -e 'fetch(process.argv[1]).then((r) => r.text()).then((t) => process.stdout.write(t))' "$1"; }
get "http://127.0.0.1:$port/metrics" | grep -c '^# ' >"$work/direct"
get "http://127.0.0.1:$rig_port/metrics" | grep -c '^# ' >"$work/through"
check "a page comes through" "$(cat "$work/through")" == "$(cat "$work/direct")"
check "it has lines" "$(cat "$work/direct")" '>' 5
for profile in lan 80; do
    check "$profile: every byte comes back in order" "$(node "$(dirname "$0")/echo.mjs" "$bin/palpate-rig" $profile 100000)" == 100000
done
profile=50
stop "$rig_job"
check "bytes are counted" "$(sum bytes)" '>' 1448
check "no packet is larger than a segment" "$(sum bytes)" '<=' "$((1448 * $(sum packets)))"

# nobody behind it: the connection ends, the rig goes on
kill "$server_job"
wait "$server_job" 2>/dev/null
start_rig lan --tcp "0:127.0.0.1:$port"
timeout 20 "$bin/palpate-client" "ws://127.0.0.1:$rig_port/ws" --seconds 1 --quiet 2>/dev/null
check "without a server a client has no connection" $? == 1
stop "$rig_job"
check "and the rig counts it" "$(json refused "$work/rig_lan")" '>' 0
# without a multicast route the remedy is named
ip route del 224.0.0.0/4 dev lo
refused 1 'ip route add 224.0.0.0/4 dev lo' --lcm 239.255.76.67:7667,239.255.76.67:7668
finish
