#!/bin/sh
# Files for and from other tools, read and written by VTK's own Python modules and by three.js: VTU of a solution, a VTU
# series and VTP series of a recording, VTP and glTF of a moment, a MetaImage volume in. Prints "N passed, N failed, N skipped"; exit 1
# when a check failed.
# usage: test_exports.sh PALPATE PACKAGES (folder with node_modules of the viewer)
set -u
palpate=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
reader=$here/read_exports.py
packages=$(realpath -m "$2")
gltf_reads() { node "$here/read_gltf.mjs" "$packages" "$@"; }
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
if [ ! -e "$packages/node_modules/three/examples/jsm/loaders/GLTFLoader.js" ]; then
    skip "glTF read by three.js" "the packages of the viewer are not in $packages"
    gltf_reads() { true; }
fi

begin "a solution as VTU has the points and displacements of its CSV"
run solve "$problems/beam.json" --case tip --resolution 12 --vtk tip.vtu --csv tip.csv
check "exit code $code" code_is 0
check "VTK reads other numbers" reads solution tip.vtu tip.csv
end

begin "a recording becomes a series for ParaView"
run prepare --procedural --resolution 8 --model fem -o organ
check "exit code $code of prepare" code_is 0
young=$(sed -n 's/.*"young_Pa":[[:space:]]*\([0-9.e+]*\).*/\1/p' organ/scene.json | head -n 1)
# the name of a body is any text: no file may leave the folder, and none of XML's signs its place; it sinks by gravity
sed 's/"step_s":/"gravity_m_s2": 2, "step_s":/; s/"name":[[:space:]]*"sleep"/"name": "gravity"/
    /"bodies"/,$ s/"name":[[:space:]]*"organ"/"name": "..\/..\/escape <\&\x27>"/
    s/"skin_output"/"surface_output"/' organ/scene.json >organ/named.json
check "the body has a name with a path" grep -q '"../../escape' organ/named.json
mv organ/named.json organ/scene.json
run serve organ/scene.json --record organ.log --port 0 --seconds 0.5
check "exit code $code of serve" code_is 0
run replay organ.log organ/scene.json --vtu series --vtp surfaces --rate 10
check "exit code $code of replay" code_is 0
check "it says where" has out "series/series.pvd"
check "it says where surfaces are" has out "surfaces/surfaces.pvd"
run replay organ.log organ/scene.json --vtp then.vtp --at 0.2
check "exit code $code of replay" code_is 0
run replay organ.log organ/scene.json --vtp surfaces --at 0.2
refused 2 '--at: goes with --gltf or --vtp FILE.vtp'
check "VTK reads another body" reads series series "$young"
check "VTK reads other surfaces" reads surfaces surfaces
check "a moment differs from the same alone" same surfaces/surfaces_000002.vtp then.vtp
check "the folder has all files" test "$(ls series/*escape*_1_000000.vtu | wc -l)" = 1
end

begin "glTF of a moment has the vertices of the series then"
# nodes are shown, so that the surface needs no interpolation
run replay organ.log organ/scene.json --vtu moments --rate 10 --gltf moment.glb --at 0.2
check "exit code $code" code_is 0
check "it says when" has out 'wrote moment.glb, the surfaces at 0.2 s'
reads points moments 0.2 >points.json
check "another reader finds other vertices" gltf_reads points moment.glb points.json
run replay organ.log organ/scene.json --gltf moment.glb --at 100
refused 1 '--at: 100 s: the recording ends at [0-9.]* s'
run replay organ.log organ/scene.json --at 0.1
refused 2 '--at: goes with --gltf or --vtp'
check "colours are not those of the page" gltf_reads colours \
    "$here/../../server/commands/shown_moment.c" "$here/../../clients/viewer/src/tissue_looks.js"
end

begin "an adaptive surface as glTF and VTP"
run prepare --procedural --model adaptive -o thin
# it sinks by gravity
sed 's/"step_s":/"gravity_m_s2": 2, "step_s":/; s/"name":[[:space:]]*"sleep"/"name": "gravity"/' thin/scene.json >thin/sinks.json
run serve thin/sinks.json --record thin.log --port 0 --seconds 0.3
run replay thin.log thin/sinks.json --gltf thin.glb --vtp thin.vtp
check "exit code $code" code_is 0
reads surface thin.vtp >thin.json
check "VTK reads another surface" [ $? -eq 0 ]
check "glTF has another surface" gltf_reads surface thin.glb thin.json
run replay thin.log thin/sinks.json --vtu nothing
refused 1 'no body of the scene has elements of volume'
end

begin "images of a surface are textures of glTF"
png() { # png PIXELS: the beginning of a PNG of one line, enough for a program that decodes none
    printf "\\211PNG\\r\\n\\032\\n\\0\\0\\0\\rIHDR\\0\\0\\0\\00$1\\0\\0\\0\\001\\010\\002\\0\\0\\0\\0\\0\\0\\0"
}
png 2 >skin.png
png 3 >lid.png
printf 'newmtl skin\nmap_Kd skin.png\nnewmtl lid\nmap_Kd lid.png\n' >box.mtl
{
    printf 'mtllib box.mtl\nv 0 0 0\nv 80 0 0\nv 80 60 0\nv 0 60 0\nv 0 0 40\nv 80 0 40\nv 80 60 40\nv 0 60 40\n'
    printf 'vt 0 0\nvt 1 0\nvt 1 0.75\nvt 0 0.75\nusemtl skin\nf 1/1 4/2 3/3 2/4\nf 1/1 2/2 6/3 5/4\n'
    printf 'f 2/1 3/2 7/3 6/4\nf 3/1 4/2 8/3 7/4\nf 4/1 1/2 5/3 8/4\nusemtl lid\nf 5/1 6/2 7/3 8/4\n'
} >box.obj
run prepare box.obj -o box --units mm --resolution 6 --model fem
check "exit code $code of prepare" code_is 0
sed 's/"gravity_m_s2":[^,]*,/"gravity_m_s2": 0,/; s/{"name":[[:space:]]*"gravity"},//' box/scene.json >box/still.json
run serve box/still.json --record box.log --port 0 --seconds 0.1
check "exit code $code of serve" code_is 0
run replay box.log box/still.json --gltf box.glb
check "exit code $code of replay" code_is 0
check "faces have other places or images" gltf_reads box box.glb box.obj 80 60 40
end

begin "a compressed MetaImage of VTK has its ball"
run prepare ball.mha -o ball --resolution 8 --json
check "exit code $code" code_is 0
check "the surface has not the volume of the voxels within 2 %" awk -v wanted="$(cat volume_m3)" '
    match($0, /"surface_volume_m3":[0-9.e-]+/) { got = substr($0, RSTART + 20, RLENGTH - 20) }
    END { exit !(got > 0.98 * wanted && got < 1.02 * wanted) }' out
end

finish
