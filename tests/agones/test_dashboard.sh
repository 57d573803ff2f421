#!/bin/sh
# The Grafana dashboard of deploy/agones over a real Prometheus that scrapes a live server: every expression is PromQL and
# has data, a wrong one is told. usage: test_dashboard.sh FOLDER_OF_PROGRAMS PACKAGES
bin=${1:?usage: test_dashboard.sh FOLDER_OF_PROGRAMS PACKAGES}
packages=${2-}
here=$(cd "$(dirname "$0")" && pwd)
folder=$here/../../deploy/agones
. "$here/../clients/rig.sh"
# deploy/common.sh unpacks Debian's package there, as its installation starts a service
PATH=$PATH:$packages/../prometheus/usr/bin
if ! command -v prometheus >/dev/null || ! command -v node >/dev/null || ! [ -e "$packages/node_modules/uplot" ]; then
    echo "SKIP all: no prometheus, no node or no packages of the viewer (deploy/common.sh fetches them)"
    exit 77
fi
make_scene
start_server --port 0
node "$here/count_scrapes.mjs" "$port" >"$work/scrapes" &
counter=$!
pids="$pids $counter"
shows "$work/scrapes" $counter '^port '
cat >"$work/prometheus.yml" <<CONFIGURATION
global: {scrape_interval: 5s, scrape_timeout: 5s} # more than a busy machine needs for an answer
scrape_configs:
  - job_name: palpate
    static_configs: [{targets: ["127.0.0.1:$(sed -n 's/^port //p' "$work/scrapes")"], labels: {pod: palpate-0}}]
CONFIGURATION
timeout 280 "$bin/palpate-client" "$url" --script press --seconds 250 --quiet &
pids="$pids $!"
members 1
prometheus --config.file="$work/prometheus.yml" --storage.tsdb.path="$work/data" --web.listen-address=127.0.0.1:0 \
    >"$work/prometheus.log" 2>&1 &
prometheus=$!
pids="$pids $prometheus"
shows "$work/prometheus.log" $prometheus 'msg="Listening on"'
address=http://$(sed -n 's/.*msg="Listening on" address=//p' "$work/prometheus.log")
# a rate needs two samples between which frames were encoded
shows "$work/scrapes" $counter '^stored 2'
draw() { timeout 100 node "$1/render_dashboard.mjs" "$address" --packages "$packages" -o "$work/page.html" 2>"$work/draw.err"; }
draw "$folder"
check "every panel has data" $? == 0
cat "$work/draw.err"
check "panels that the page lacks" "$(node -e '
    const [page, dashboard] = process.argv.slice(1).map((file) => require("fs").readFileSync(file, "utf8"));
    console.log(JSON.parse(dashboard).panels.filter(({ title }) => !page.includes(`"title":"${title}"`)).length);
    ' "$work/page.html" "$folder/dashboard.json")" == 0
mkdir "$work/wrong"
cp "$folder/render_dashboard.mjs" "$work/wrong"
sed 's/sum(palpate_sessions{/sum(palpate_sessions{{/' "$folder/dashboard.json" >"$work/wrong/dashboard.json"
draw "$work/wrong"
check "what is no PromQL is told" $?/"$(grep -c 'parse error' "$work/draw.err")" == 1/1
sed 's/palpate_sessions{/palpate_persons{/' "$folder/dashboard.json" >"$work/wrong/dashboard.json"
draw "$work/wrong"
check "what nobody measures is told" $?/"$(grep -c 'palpate_persons.*: no data' "$work/draw.err")" == 1/1
finish
