#!/bin/sh
# https and wss by palpate serve itself: a client that trusts the certificate joins, one that does not is told why, the
# page comes, other upgrades end. usage: test_tls.sh FOLDER_OF_PROGRAMS
bin=${1:?usage: test_tls.sh FOLDER_OF_PROGRAMS}
. "$(dirname "$0")/../clients/rig.sh"
make_scene
command -v openssl >/dev/null || exit 77
authority() { # authority NAME: a certificate that signs itself, for this machine and for organ.test
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout "$work/$1.key" -out "$work/$1.pem" -days 2 \
        -subj /CN=organ.test -addext "subjectAltName=DNS:organ.test,IP:127.0.0.1" 2>"$work/openssl.log"
}
tls() { # tls TEXT: what the server answers to these bytes
    printf "$1" | timeout 20 openssl s_client -quiet -connect "127.0.0.1:$port" 2>/dev/null | head -1
}
authority own
authority other
start_server --port 0 --tls-cert "$work/own.pem" --tls-key "$work/own.key" --allow-remote --hosts organ.test
"$bin/palpate-client" "https://127.0.0.1:$port/" --script press --seconds 60 --until cycles=20 --json >"$work/press"
check "a client of this machine joins by https" "$(json joined "$work/press")" == 1
# by a name that is not loopback, as from another machine
if unshare -r true 2>/dev/null || [ "$(id -u)" == 0 ]; then
    printf '127.0.0.1 localhost\n127.0.0.1 organ.test\n' >"$work/hosts"
    as_remote() { # as_remote CA COMMAND...: with organ.test as a name of this machine
        ca=$1
        shift
        PALPATE_CA=$ca unshare -m sh -c 'mount --bind "$0" /etc/hosts && exec "$@"' "$work/hosts" "$@"
    }
    as_remote "$work/own.pem" "$bin/palpate-client" "wss://organ.test:$port/ws" --seconds 60 --until cycles=20 --json >"$work/trusts"
    check "one that trusts the authority joins" "$(json joined "$work/trusts")" == 1
    as_remote "$work/other.pem" "$bin/palpate-client" "wss://organ.test:$port/ws" --seconds 3 --json >"$work/doubts" 2>"$work/doubts.err"
    check "one that does not is not let down to plain text" "$(json joined "$work/doubts")" == 0
    check "and is told why" "$(grep -c 'certificate' "$work/doubts.err")" '>=' 1
fi
check "an upgrade to HTTP/2 is refused" "$(tls 'GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: h2c\r\nHTTP2-Settings: AAMAAABk\r\nConnection: Upgrade\r\n\r\n' | cut -d' ' -f2)" == 400
check "so is a tunnel" "$(tls 'CONNECT /x HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n' | cut -d' ' -f2)" == 400
check "a page comes" "$(tls 'GET /sessions HTTP/1.1\r\nHost: organ.test\r\n\r\n' | cut -d' ' -f2)" == 200
check "a foreign name does not" "$(tls 'GET /sessions HTTP/1.1\r\nHost: evil.test\r\n\r\n' | cut -d' ' -f2)" == 403
refusal() { # refusal ARGUMENTS...: the sentence of a server that does not start
    timeout 60 "$bin/palpate" serve "$work/ball.json" --port 0 "$@" 2>&1 | tail -1
}
check "a certificate without a key" "$(refusal --tls-cert "$work/own.pem" | grep -c 'the key is missing')" == 1
check "a key of another certificate" "$(refusal --tls-cert "$work/own.pem" --tls-key "$work/other.key" | grep -c 'is not that of the certificate')" == 1
check "a key that is none" "$(refusal --tls-cert "$work/own.pem" --tls-key "$work/own.pem" | grep -c 'holds no key in PEM')" == 1
stop "$server_job"
finish
