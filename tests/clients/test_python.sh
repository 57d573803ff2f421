#!/bin/sh
# The Python package: golden packets give the same numbers as in C, bad bytes its own error and nothing else, and a real
# server is joined, touched and given orders. usage: test_python.sh PROGRAMS
bin=$1
here=$(cd "$(dirname "$0")" && pwd)
tree=$here/../..
. "$here/rig.sh"
# Debian's own Python, where another one stands before it
python=/usr/bin/python3
if ! "$python" -c 'import numpy, websockets' 2>/dev/null; then
    echo "SKIP all: no numpy or websockets for Python (python3-numpy, python3-websockets)"
    exit 77
fi
export PYTHONDONTWRITEBYTECODE=1 PYTHONPATH="$tree/clients/python"
asks() { timeout 200 "$python" -W error::RuntimeWarning "$here/ask_python.py" "$@"; }

if "$python" -c 'import mypy' 2>/dev/null; then
    (cd "$tree/clients/python" && timeout 200 "$python" -m mypy --cache-dir /dev/null palpate examples)
    check "types are right" $? == 0
else
    echo "SKIP types: no mypy (mypy)"
fi
asks packets "$tree/tests/data/golden"
check "golden packets and bad bytes" $? == 0
if "$python" -c 'import setuptools, wheel, pip' 2>/dev/null; then
    cp -r "$tree/clients/python" "$work/source" # setuptools leaves files there
    "$python" -m venv --system-site-packages --without-pip "$work/venv"
    (
        unset PYTHONPATH
        cd "$work" || exit 1
        timeout 200 "$work/venv/bin/python" -m pip install --no-index --no-build-isolation --no-cache-dir "$work/source" >"$work/pip.log" 2>&1
        timeout 200 "$work/venv/bin/python" "$here/ask_python.py" packets "$tree/tests/data/golden"
    )
    check "pip installs it without a network" $? == 0
    version=$("$work/venv/bin/python" -c 'import importlib.metadata as m; print(m.version("palpate"))')
    check "its version is that of the programs" "\"$version\"" == "\"$("$bin/palpate" --version | sed 's/^palpate \([0-9.]*\).*/\1/')\""
else
    echo "SKIP pip installs it: no pip (python3-pip)"
fi
make_scene
start_server --port 0
asks touch "$url"
check "a ball is pulled" $? == 0
make_block
"$bin/palpate" ticket --keys "$work/keys" --new-key --quiet
"$bin/palpate" ticket --keys "$work/keys" --role viewer --tool none --session block --uses 5 --user 9 --json >"$work/ticket"
mkdir "$work/scenes"
cp "$work/ball.json" "$work/ball.obj" "$work/scenes/"
admission='' start_server --port 0 --keys "$work/keys" --scenes "$work/scenes"
asks sculpt "$url" "$work/keys" "$(json ticket "$work/ticket")"
check "tickets, sessions, answers and another topology" $? == 0
"$bin/palpate" prepare --shape sphere -o "$work/sphere" --quiet
scene=$work/sphere/scene.json
admission=--open start_server --port 0
asks adapt "$url"
check "triangles that change" $? == 0
finish
