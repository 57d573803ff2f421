#!/bin/sh
# Files for and from other tools, read and written by VTK's own Python modules: VTU of a solution, a VTU series of a
# recording, a MetaImage volume in. Prints "N passed, N failed, N skipped"; exit 1 when a check failed.
# usage: test_exports.sh PALPATE
set -u
palpate=$(realpath "$1")
reader=$(realpath "$(dirname "$0")")/read_exports.py
. "$(dirname "$0")/shell.sh"
run() {
    timeout 100 "$palpate" "$@" >out 2>err </dev/null
    code=$?
}
# Debian's own Python, where another one stands before it
python=/usr/bin/python3
"$python" "$reader" ball ball.mha >volume_m3 2>/dev/null
if [ $? -ne 0 ]; then
    skip "files of other tools" "VTK's Python modules are not there (python3-vtk9)"
    finish
    exit
fi
reads() { "$python" "$reader" "$@"; }

begin "a solution as VTU has the points and displacements of its CSV"
run solve "$problems/beam.json" --case tip --resolution 12 --vtk tip.vtu --csv tip.csv
check "exit code $code" code_is 0
check "VTK reads other numbers" reads solution tip.vtu tip.csv
end

begin "a recording becomes a series for ParaView"
run prepare --procedural --resolution 8 --model fem -o organ
check "exit code $code of prepare" code_is 0
young=$(sed -n 's/.*"young_Pa":[[:space:]]*\([0-9.e+]*\).*/\1/p' organ/scene.json | head -n 1)
# the name of a body is any text: no file may leave the folder, and none of XML's signs its place
sed '/"bodies"/,$ s/"name":[[:space:]]*"organ"/"name": "..\/..\/escape <\&\x27>"/' organ/scene.json >organ/named.json
check "the body has a name with a path" grep -q '"../../escape' organ/named.json
mv organ/named.json organ/scene.json
run serve organ/scene.json --record organ.log --port 0 --seconds 0.5
check "exit code $code of serve" code_is 0
run replay organ.log organ/scene.json --vtu series --rate 10
check "exit code $code of replay" code_is 0
check "it says where" has out "series/series.pvd"
check "VTK reads another body" reads series series "$young"
check "the folder has all files" test "$(ls series/*escape*_1_000000.vtu | wc -l)" = 1
end

begin "a recording of a surface has no elements to write"
run prepare --procedural --model adaptive -o thin
run serve thin/scene.json --record thin.log --port 0 --seconds 0.3
run replay thin.log thin/scene.json --vtu nothing
refused 1 'no body of the scene has elements of volume'
end

begin "a compressed MetaImage of VTK has its ball"
run prepare ball.mha -o ball --resolution 8 --json
check "exit code $code" code_is 0
check "the surface has not the volume of the voxels within 2 %" awk -v wanted="$(cat volume_m3)" '
    match($0, /"surface_volume_m3":[0-9.e-]+/) { got = substr($0, RSTART + 20, RLENGTH - 20) }
    END { exit !(got > 0.98 * wanted && got < 1.02 * wanted) }' out
end

finish
