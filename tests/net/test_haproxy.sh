#!/bin/sh
# deploy/haproxy.cfg with the real HAProxy before two real servers: wss by tickets, sessions by name, and what does not
# get through. usage: test_haproxy.sh FOLDER_OF_PROGRAMS
bin=${1:?usage: test_haproxy.sh FOLDER_OF_PROGRAMS}
. "$(dirname "$0")/../clients/rig.sh"
make_scene
if ! command -v haproxy >/dev/null || ! command -v openssl >/dev/null || ! command -v curl >/dev/null; then
    echo "haproxy, openssl or curl is missing"
    exit 77
fi
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout "$work/key" -out "$work/cert" -days 2 -subj /CN=organ.test \
    -addext "subjectAltName=DNS:organ.test" 2>"$work/openssl.log"
cat "$work/cert" "$work/key" >"$work/all.pem"
mkdir "$work/scenes"
cp "$work/ball.json" "$work/ball.obj" "$work/scenes"
admission=
start_server --port 0 --allow-remote --hosts organ.test --scenes "$work/scenes"
first=$port
ticket=$(sed -n 's/.*"instructor": *"\([^"]*\)".*/\1/p' "$work/serve.out")
sed 's/"name": *"ball"/"name": "second"/' "$work/ball.json" >"$work/second.json"
scene=$work/second.json
start_server --port 0 --allow-remote --hosts organ.test
second=$port
echo "second 127.0.0.1:$second" >"$work/map"
free_port() { node -e 'const s = require("net").createServer().listen(0, "127.0.0.1", () => { console.log(s.address().port); s.close(); })'; }
https=$(free_port)
export PALPATE_HTTPS="$https" PALPATE_PEM="$work/all.pem" PALPATE_HOST=organ.test PALPATE_MAP="$work/map" \
    PALPATE_ADMIN="$work/admin" PALPATE_SERVER="127.0.0.1:$first"
haproxy -db -f "$(dirname "$0")/../../deploy/haproxy.cfg" >"$work/haproxy.log" 2>&1 &
proxy=$!
unset PALPATE_HTTPS PALPATE_PEM PALPATE_HOST PALPATE_MAP PALPATE_ADMIN PALPATE_SERVER
pids="$pids $proxy"
ask() { # ask ARGUMENTS...: the status of an answer through HAProxy
    curl -s -o "$work/body" -w '%{http_code}' --http1.1 --max-time 20 --retry 20 --retry-connrefused --retry-delay 1 --cacert "$work/cert" \
        --resolve "organ.test:$https:127.0.0.1" "$@"
}
site=https://organ.test:$https
check "the list of sessions comes" "$(ask "$site/sessions")" == 200
check "and is the first server's" "$(grep -c '"ball"' "$work/body")" == 1
check "without a ticket, it names no scenes" "$(grep -c scenes "$work/body")" == 0
ask -H "Authorization: Bearer $ticket" "$site/sessions" >/dev/null
check "with an instructor's, it does" "$(grep -c '"scenes":\["ball.json","ball.obj"\]' "$work/body")" == 1
order() { # order ARGUMENTS...: the status of opening a scene
    ask -H 'Content-Type: application/json' -d '{"open":"ball.json"}' "$@" "$site/sessions"
}
check "who has a ticket opens one" "$(order -H "Authorization: Bearer $ticket" -H "Origin: https://organ.test:$https")" == 202
check "who has none does not" "$(order)" == 401
check "nor does another site" "$(order -H "Authorization: Bearer $ticket" -H 'Origin: https://evil.test')" == 403
check "metrics stay inside" "$(ask "$site/metrics")" == 404
check "a foreign name" "$(ask -H 'Host: evil.test' "$site/sessions")" == 403
check "an upgrade to HTTP/2" "$(ask -H 'Connection: Upgrade, HTTP2-Settings' -H 'Upgrade: h2c' -H 'HTTP2-Settings: AAMAAABk' "$site/")" == 400
check "a tunnel" "$(ask -X CONNECT "$site/x")" == 400
check "two upgrades" "$(ask -H 'Upgrade: websocket' -H 'Upgrade: h2c' "$site/")" == 400
socket() { # socket SESSION ORIGIN: whether a websocket is opened, and whose
    node --experimental-websocket -e '
        const tls = require("tls"), [port, session, origin] = process.argv.slice(1);
        const s = tls.connect({ host: "127.0.0.1", port, servername: "organ.test", rejectUnauthorized: false }, () => s.write(
            `GET /ws?session=${session} HTTP/1.1\r\nHost: organ.test:${port}\r\nX-A: b\r\nOrigin: ${origin}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n` +
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: palpate.v2\r\n\r\n"));
        let all = "";
        s.on("data", (d) => {
            all += d.toString("latin1");
            if (/^HTTP\/1\.\d [^1]/.test(all)) { console.log(all.split(" ")[1]); s.end(); }
            if (all.includes("\r\n\r\n") && !s.joined) {
                s.joined = true;
                const text = Buffer.from(JSON.stringify({ type: "join", name: "Ada", role: "viewer", tool: null }));
                s.write(Buffer.concat([Buffer.from([0x81, 0x80 | text.length, 0, 0, 0, 0]), text]));
            }
            const hello = /"session":"(\w+)"/.exec(all);
            if (hello) { console.log(hello[1]); s.destroy(); }
        });
        s.on("error", () => {});
        setTimeout(() => process.exit(1), 20000).unref();
    ' "$https" "$@"
}
check "a page's websocket opens" "$(socket '' "https://organ.test:$https")" == ball
check "the session's name leads to its server" "$(socket second "https://organ.test:$https")" == second
check "another site's does not, behind a header that hides it from the library" "$(socket '' https://evil.test)" == 403
finish
