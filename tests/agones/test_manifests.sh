#!/bin/sh
# The manifests of deploy/agones against check_manifests.py and the metrics of a live server.
# usage: test_manifests.sh FOLDER_OF_PROGRAMS
bin=${1:?usage: test_manifests.sh FOLDER_OF_PROGRAMS}
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../clients/rig.sh"
if ! python3 -c 'import yaml' 2>/dev/null || ! command -v curl >/dev/null; then
    echo "python3-yaml or curl is missing"
    exit 77
fi
make_scene
start_server --port 0
curl -s --max-time 60 "http://127.0.0.1:$port/metrics" >"$work/metrics"
python3 "$here/check_manifests.py" "$here/../.." "$bin/palpate" "$work/metrics" >"$work/checked"
check "the manifests fit each other and the program" $? == 0
cat "$work/checked"
finish
