#!/bin/sh
# The commands as a user runs them: exit codes, one line for a refusal, one JSON object, complete files or none, and
# hostile files. Prints "N passed, N failed"; exit 1 when a check failed.
# usage: test_commands.sh PALPATE [MAX_KB]     MAX_KB: address space a command may take (0: no limit, for sanitizers)
set -u
palpate=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
max_kb=${2:-0}
. "$(dirname "$0")/shell.sh"
run() { # run ARGS...: into out, err, code
    (
        [ "$max_kb" -gt 0 ] && ulimit -v "$max_kb"
        exec timeout 60 "$palpate" "$@"
    ) >out 2>err </dev/null
    code=$?
}
is_json() { # one object, nothing else; with node when it is there
    [ "$(lines "$1")" -eq 1 ] || return 1
    if command -v node >/dev/null 2>&1; then
        node -e 'const o = JSON.parse(require("fs").readFileSync(process.argv[1], "utf8"));
                 if (typeof o !== "object" || Array.isArray(o)) process.exit(1);' "$1"
    else
        grep -q '^{.*}$' "$1"
    fi
}

# ---- good input ----
cat >box.obj <<'END'
v 0 0 0
v 100 0 0
v 0 80 0
v 100 80 0
v 0 0 60
v 100 0 60
v 0 80 60
v 100 80 60
f 1 3 4 2
f 5 6 8 7
f 1 2 6 5
f 3 7 8 4
f 1 5 7 3
f 2 4 8 6
END

begin "prepare writes a scene, reports it on stdout and prints nothing on stderr"
run prepare box.obj -o scene
check "exit code $code" code_is 0
check "stderr is not empty" is_empty err
check "no tetrahedra on stdout" has out "tetrahedra"
for file in scene.json box.palmesh box.node box.ele box.face; do check "$file is missing" test -s "scene/$file"; done
check "something else is in the folder" test "$(ls -A scene | wc -l)" -eq 5
end

begin "prepare refuses material numbers outside the range of scenes (tests/scene/test_material_limits.c)"
for bad_number in "--young-Pa 1.001e15" "--young-Pa 0.999e-6" "--poisson -0.99991" "--poisson 0.4999991" "--density-kg-m3 1.001e24" "--density-kg-m3 0.999e-24"; do
    run prepare box.obj -o limits $bad_number
    check "$bad_number is refused" [ "$code" -ne 0 ]
    check "$bad_number is named" grep -q -e "${bad_number%% *}" err
done
end

begin "prepare says when a body returns slowly, and plan how fast it returns"
run prepare box.obj -o soft --no-tetgen --units mm --young-Pa 0.001
check "exit code $code" code_is 0
check "it is not said" has out "returns to rest slowly"
run plan soft --json
check "no lowest frequency" has out '"lowest_1_s":[[:space:]]*0'
check "no time of return" has out '"return_s":[[:space:]]*[1-9]'
run prepare box.obj -o stiff --no-tetgen --units mm --damping-ratio 0.5
check "a fast body is called slow" hasnt out "returns to rest slowly"
check "the ratio is not written" has stiff/scene.json '"damping_ratio":[[:space:]]*0.5'
end

begin "prepare --json has every figure and is one object"
run prepare box.obj -o scene2 --json --resolution 12 --units mm
check "exit code $code" code_is 0
check "stderr is not empty" is_empty err
check "not one JSON object" is_json out
for key in triangles voxels tets nodes components method volume_m3 volume_error degenerate duplicate nonfinite folded \
    read tree fill split skin write total; do
    check "no $key" has out "\"$key\":"
done
check "open or not" has out '"open":false,'
check "12 triangles" has out '"triangles":12,'
check "one component" has out '"components":1,'
check "units given, not guessed" has out '"units":{"name":"mm","m":0.001,"guessed":false}'
end

begin "tetgen finds the mesh consistent"
end

name="tetgen reads the mesh"
if command -v tetgen >/dev/null 2>&1; then
    begin "$name"
    # as a mesh: read back and checked; as a boundary: no facet cuts another
    (cd scene2 && tetgen -rC box.node) >tetgen.out 2>&1
    check "tetgen -rC does not read it as it is" has tetgen.out "Mesh tetrahedra: $(head -1 scene2/box.ele | cut -d' ' -f1)\$"
    {
        cat scene2/box.node
        awk 'NR == 1 { print $1, 1 } NR > 1 { print 3, $2, $3, $4, 1 } END { print "0\n0" }' scene2/box.face
    } >box.smesh
    tetgen -d box.smesh >tetgen.out 2>&1
    check "tetgen -d finds intersections" has tetgen.out "No faces are intersecting"
    end
else
    skip "$name" "the program tetgen is not there"
fi

begin "the unit is reported, guessed or not"
scaled_by() { awk -v k="$1" '$1 == "v" { $2 *= k; $3 *= k; $4 *= k } { print }' box.obj; }
scaled_by 1e8 >far.obj
run prepare box.obj -o scene4 --no-tetgen
check "no guess in the text" has out "unit mm guessed from the size"
run prepare far.obj -o scene4 --no-tetgen
check "no scale in the text" has out "scaled to an organ"
run prepare far.obj -o scene4 --no-tetgen --units m --name far
check "a given unit is called a guess" test "$(grep -c guessed out)" -eq 0
scaled_by 1e25 >huge.obj
run prepare huge.obj -o scene5 --no-tetgen --units m
refused 1 "huge.obj: line 9: tools"
end

begin "prepare questions a size that no organ has, and refuses what serve would refuse"
run prepare box.obj -o size --no-tetgen --units m
refused 1 "box.obj: tools\[0\].radius_m: .* is outside 0 .. 1; the body is 100 m long: is the file in mm? (--units mm)"
run prepare box.obj -o size --no-tetgen --units um
refused 1 "box.obj: a step of .* sub-steps.*; the body is 0.0001 m long: is the file in mm? (--units mm)"
check "a folder is left" test ! -e size
scaled_by 26 >tall.obj
run prepare tall.obj -o size --no-tetgen --units mm
check "exit code $code" code_is 0
check "2.6 m is not questioned" has out "the body is 2.6 m long: is its unit right?"
run prepare box.obj -o size --no-tetgen --units mm
check "100 mm are questioned" test "$(grep -c 'is the file in' out)" -eq 0
check "gravity is written where it does not act" test "$(grep -c gravity_m_s2 size/scene.json)" -eq 0
end

begin "prepare says when voxels miss the volume of a thin body"
awk '$1 == "v" { $4 *= 0.2 } { print }' box.obj >thin.obj
run prepare thin.obj -o thin --no-tetgen --units mm --resolution 10
check "the volume is not questioned" has out "the voxels miss the volume of the surface by 17 %: --resolution 20 comes nearer"
sed '$d' thin.obj >open.obj
run prepare open.obj -o thin --no-tetgen --units mm --resolution 10
check "a surface that is open gets the same remedy" has out "by 17 %, which is uncertain as the surface is open: close its holes"
awk '$1 == "v" { $4 /= 6 } { print }' box.obj >plate.obj
run prepare plate.obj -o thin --no-tetgen --units mm --resolution 10
check "the border layer is not questioned" has out "the voxels have 3.[0-9] times the volume of the surface.*--model fem"
run prepare plate.obj -o thin --no-tetgen --units mm --resolution 10 --model fem
check "that of model fem is" test "$(grep -c 'times the volume' out)" -eq 0
run prepare box.obj -o thin --no-tetgen --units mm --resolution 20
check "that of a block is" test "$(grep -c 'volume of the surface' out)" -eq 0
end

begin "prepare welds corners that nearly meet, and refuses gaps by their size in the file's unit"
soup() { # soup SHIFT: each face of the box with corners of its own, moved by up to SHIFT along each axis
    awk -v d="$1" '$1 == "v" { n++; for (a = 0; a < 3; a++) x[n, a] = $(a + 2) }
        $1 == "f" { for (k = 2; k <= 5; k++) { printf "v"; for (a = 0; a < 3; a++) printf " %.7f", x[$k, a] + d * ((NR * k * (a + 3)) % 5 / 2 - 1); print "" }
                    print "f -4 -3 -2 -1" }' box.obj
}
soup 0.00028 >soup.obj
run prepare soup.obj -o soup --no-tetgen --units mm
check "exit code $code" code_is 0
check "what was welded is not told" has out "welded 16 corners that were up to 0.00[01][0-9]* mm apart"
check "the box is not closed" has out "volume 480.0 ml by the surface, "
soup 0.014 >soup.obj
run prepare soup.obj -o soup2 --no-tetgen --units mm
refused 1 "soup.obj: line 5: corners of neighbouring triangles miss each other by up to 0.0[0-9]* in the file's unit, and gaps of at most 0.00[0-9]* are closed"
end

begin "prepare takes the image of an OBJ file that lies beside it, and no other"
{ printf 'mtllib box.mtl\nusemtl skin\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n'; awk '$1 == "v" { print } $1 == "f" { print "f", $2 "/1", $3 "/2", $4 "/3", $5 "/4" }' box.obj; } >image.obj
png() { printf '\211PNG\r\n\032\n\000\000\000\rIHDR\000\000\000\002\000\000\000\001\010\002\000\000\000\000\000\000\000'; }
run prepare image.obj -o image --no-tetgen --units mm
check "a file of materials that is not there is a fault: $code" code_is 0
check "it is not missed" has out "no image: box.mtl is not there"
printf 'newmtl skin\nmap_Kd skin.png\n' >box.mtl
run prepare image.obj -o image --no-tetgen --units mm
check "an image that is not there is not missed" has out "no image: skin.png is not there"
check "an image is written" test "$(grep -c '"images":' image/scene.json)" -eq 0
png >skin.png
run prepare image.obj -o image --no-tetgen --units mm
check "exit code $code" code_is 0
check "the image is not told" has out "image skin.png, 2 x 1 pixels"
check "it is not beside the scene" cmp -s skin.png image/image.png
check "the scene does not name it" has image/scene.json '"images":.*\["image.png"\]'
run plan image/scene.json
check "the scene is not read again: $code" code_is 0
run prepare image.obj -o image2 --no-tetgen --units mm --no-image
check "an image is written that was not wanted" test ! -e image2/image2.png -a "$(grep -c '"images":' image2/scene.json)" -eq 0
printf 'GIF89a' >skin.png
run prepare image.obj -o image3 --no-tetgen --units mm
refused 1 "skin.png: byte 0: neither a PNG nor a JPEG image"
check "a folder is left" test ! -e image3
printf 'newmtl skin\nmap_Kd ../skin.png\n' >box.mtl
run prepare image.obj -o image3 --no-tetgen --units mm
refused 1 "box.mtl: line 2: map_Kd: '../skin.png' is not the plain name of a file: put the image beside the OBJ file"
sed -i 's/"mesh":.*/"mesh": "image2.palmesh",/' image/scene.json
cp image2/image.palmesh image/image2.palmesh
run plan image/scene.json
refused 1 "scene.json: bodies\[0\].images: the surface has no image coordinates"
sed -i 's/"mesh":.*/"surface": "..\/image.obj", "units": "mm",/; s/"images":.*/"images": ["image.png", 7],/' image/scene.json
run plan image/scene.json
refused 1 "scene.json: bodies\[0\].images\[1\]: is not a text"
end

begin "prepare takes the images of all materials"
png >skin.png
awk '$1 == "f" && ++n == 3 { print "usemtl inner skin" } { print }' image.obj >two.obj
printf 'newmtl skin\nmap_Kd skin.png\nnewmtl inner skin\nmap_Kd fat.png\n' >box.mtl
run prepare two.obj -o two --no-tetgen --units mm
check "the image that is not there is not told: $code" has out "image skin.png, 2 x 1 pixels; fat.png is not there"
png >fat.png
printf '\003' | dd of=fat.png bs=1 seek=19 conv=notrunc 2>/dev/null
run prepare two.obj -o two --no-tetgen --units mm
check "exit code $code" code_is 0
check "the images are not told" has out "2 images, the first skin.png, 2 x 1 pixels"
check "they are not beside the scene" test "$(cmp -s skin.png two/two.png && cmp -s fat.png two/two_image2.png && echo yes)" = yes
check "the scene does not name them" has two/scene.json '"images":.*\["two.png", "two_image2.png"\]'
run plan two/scene.json
check "the scene is not read again: $code" code_is 0
sed -i 's/"images":.*/"images": ["two.png"],/' two/scene.json
run plan two/scene.json
refused 1 "scene.json: bodies\[0\].images: names 1 of the 2 images of the surface"
{ cat image.obj; for k in 1 2 3 4 5 6 7 8 9; do printf 'usemtl m%d\nf 1/1 2/2 3/3\n' $k; done; } >many.obj
for k in 1 2 3 4 5 6 7 8 9; do png >m$k.png; printf 'newmtl m%d\nmap_Kd m%d.png\n' $k $k; done >box.mtl
run prepare many.obj -o many --no-tetgen --units mm
refused 1 "many.obj: 9 images, a body shows at most 8"
printf 'newmtl skin\nmap_Kd ../skin.png\n' >box.mtl
end

begin "prepare keeps where the axes point in the patient, and refuses what cannot be"
run prepare box.obj -o axes --no-tetgen --units mm --axes LSA
check "exit code $code" code_is 0
check "the axes are not told" has out "100 x 80 x 60 mm, axes LSA"
check "the scene does not have them" has axes/scene.json '"anatomical_axes":.*"LSA"'
run prepare box.obj -o axes --no-tetgen --units mm
check "axes are known that nobody gave" test "$(grep -c anatomical_axes axes/scene.json)" -eq 0
run prepare box.obj -o axes2 --axes LAS
refused 2 "axes: LAS is left-handed, so the body would be shown as its mirror image"
run prepare box.obj -o axes2 --axes LLS
refused 2 "axes: LLS is not three letters, one of R and L"
end

begin "--quiet prints nothing"
run prepare box.obj -o scene3 --quiet
check "exit code $code" code_is 0
check "stdout is not empty" is_empty out
check "stderr is not empty" is_empty err
end

begin "--procedural needs no file"
run prepare --procedural -o organ --triangles 4000 --no-tetgen --name my-organ --title "My organ" --source me --json
check "exit code $code" code_is 0
check "no title in the scene" has organ/scene.json "My organ"
check "TetGen files in spite of --no-tetgen" test "$(ls -A organ | wc -l)" -eq 2
end

# box.obj and a copy of it, scaled and moved up by so many millimetres
above() { # above SCALE MM
    cat box.obj
    awk -v by="$1" -v up="$2" '$1 == "v" { print "v", by * $2, by * $3, by * $4 + up }
                               $1 == "f" { print "f", $2 + 8, $3 + 8, $4 + 8, $5 + 8 }' box.obj
}

begin "a small component without a support is dropped and reported, as text and in JSON"
above 0.1 90 >dust.obj
run prepare dust.obj -o dust --no-tetgen --units mm --model fem --resolution 10
check "exit code $code" code_is 0
check "not told" has out 'body "dust": dropped 1 of 2 components, 1 ml of 481 ml (0.21 %): small and without support'
check "more than one component" has out ", 1 component, "
run prepare dust.obj -o dust2 --no-tetgen --units mm --model fem --resolution 10 --json
check "no figures" has out '"loose_components":1,"loose_m3":9.99'
check "more than one component" has out '"components":1,'
run prepare box.obj -o dust3 --no-tetgen --json
check "something dropped of a box" has out '"loose_components":0,"loose_m3":0'
end

begin "a large one is refused by a sentence that names file, body and number, and --largest keeps the other"
above 0.5 90 >stack.obj
run prepare stack.obj -o stack --no-tetgen --units mm --model fem --resolution 12
check "exit code $code" code_is 1
check "not one line" lines_are err 1
check "no file and body" has err 'stack.obj: line 9: body "stack": 1 of 2 components has no support'
check "no way out" has err "by a support, or keep only the largest one (--largest"
check "a folder was left" test ! -e stack
run prepare stack.obj -o stack --no-tetgen --units mm --model fem --resolution 12 --largest
check "exit code $code" code_is 0
check "more than one component" has out ", 1 component, "
run plan stack.obj
check "exit code $code of another command" code_is 1
check "no file and body" has err 'stack.obj: line 9: body "stack": 1 of 2 components has no support'
run plan dust.obj
check "exit code $code of another command" code_is 0
end

begin "the same input gives the same files"
run prepare box.obj -o again
for file in scene.json box.palmesh box.node box.ele box.face; do check "$file differs" cmp -s "scene/$file" "again/$file"; done
end

begin "plan prints components and JSON, for a scene, a folder and a surface"
run plan scene/scene.json
check "exit code $code" code_is 0
check "no row of springs" has out "edge_distance"
run plan scene --json
check "exit code $code for a folder" code_is 0
check "not one JSON object" is_json out
check "no components" has out '"components":\[{'
check "no sub-steps" has out '"substeps":'
run plan box.obj --json
check "exit code $code for a surface" code_is 0
end

begin "plan says that all bodies take the sub-steps of the finest"
cat >pair.json <<'END'
{"bodies": [{"name": "large", "surface": "box.obj", "units": "mm", "resolution": 6, "supports": [{"lowest": 0.1}]},
            {"name": "small", "surface": "box.obj", "units": "mm", "resolution": 18, "supports": [{"lowest": 0.1}]}]}
END
run plan pair.json
check "exit code $code" code_is 0
check "it does not" has out "all bodies take the [0-9]* sub-steps of small, large alone would take [0-9]*: a lower resolution of small"
sed 's/: 18/: 6/' pair.json >even.json
run plan even.json
check "it does of equal bodies" test "$(grep -c 'all bodies take' out)" -eq 0
end

begin "a scene without gravity names none"
check "scene.json does" test "$(grep -c gravity scene/scene.json)" -eq 0
run prepare box.obj -o heavy --no-tetgen --units mm --gravity
check "exit code $code" code_is 0
check "one with gravity does not" has heavy/scene.json '"gravity"'
end

begin "every command has --help, --version works, no command is usage"
for command in serve prepare plan replay solve bench; do
    run $command --help
    check "$command --help: exit code $code" code_is 0
    check "$command --help: no usage" has out "usage: palpate $command"
    check "$command --help: stderr" is_empty err
done
run --version
check "version: exit code $code" code_is 0
check "no version" has out "^palpate [0-9]"
run
check "exit code $code without a command" code_is 2
check "stdout without a command" is_empty out
run dance
refused 2 'no command "dance"'
end

begin "what serve records replays to the same hashes, and not against another scene"
"$palpate" serve scene --port 0 --open --record rec.bin >serve.out 2>serve.err &
server=$!
check "serve did not start" shows serve.out "$server" "http://"
check "nothing is recorded" grows rec.bin "$server" 1000
kill -TERM "$server"
wait "$server"
code=$?
check "serve: exit code $code" code_is 0
run replay rec.bin scene --json
check "replay: exit code $code" code_is 0
check "not one JSON object" is_json out
check "a hash differs" has out '"first_difference":null'
run replay rec.bin organ
refused 1 "recorded from another scene"
end

begin "a recording survives kill -9, is not written over, and a closed terminal ends it in order"
"$palpate" serve scene --port 0 --open --record rec.bin >serve.out 2>serve.err &
server=$!
check "serve did not start" shows serve.out "$server" "http://"
check "the file that is there was taken" shows serve.err "$server" "rec.2.bin: records"
check "nothing is recorded" grows rec.2.bin "$server" 1000
kill -KILL "$server"
wait "$server" 2>/dev/null
run replay rec.2.bin scene --json
check "replay: exit code $code" code_is 0
check "the cut is not told" has out '"cut":"rec.2.bin: byte [0-9]*: the log is cut'
check "a hash differs" has out '"first_difference":null'
run replay rec.2.bin scene --strict
refused 1 "the log is cut"
run replay rec.bin scene --strict --quiet
check "replay of the first: exit code $code" code_is 0
"$palpate" serve scene --port 0 --open --record rec.bin >serve.out 2>serve.err &
server=$!
check "serve did not start" shows serve.out "$server" "http://"
check "nothing is recorded" grows rec.3.bin "$server" 100
kill -HUP "$server"
wait "$server"
code=$?
check "serve after SIGHUP: exit code $code" code_is 0
run replay rec.3.bin scene --strict --quiet
check "replay after SIGHUP: exit code $code" code_is 0
end

# ---- finite elements ----
begin "solve answers the shipped beam within its reference's error, with every figure"
run solve "$problems/beam.json" --case tip --json
check "exit code $code" code_is 0
check "stderr is not empty" is_empty err
check "not one JSON object" is_json out
for key in rms_percent max_percent nodes elements dof iterations prepare assemble factor solve total; do
    check "no $key" has out "\"$key\":[0-9]"
done
check "not compared with Timoshenko's beam" has out '"reference":"timoshenko"'
check "33 x 5 x 5 nodes" has out '"nodes":825,'
check "RMS not below 1 %" has out '"rms_percent":0\.'
run solve "$problems/beam.json" --case tip -o solved --quiet
check "exit code $code with -o" code_is 0
check "stdout is not empty" is_empty out
check "no CSV of 825 nodes" test "$(wc -l <solved/solution.csv)" -eq 826
check "no VTK file" has solved/solution.vtk "^DATASET UNSTRUCTURED_GRID"
run solve "$problems/beam.json" --case tip --samples solved/solution.csv --json
check "exit code $code with --samples" code_is 0
check "not the same as itself" has out '"rms_percent":\(0,\|[0-9.]*e-\)'
run solve "$problems/beam.json" --case tip_far --kinematics finite --resolution 16
check "exit code $code for finite kinematics" code_is 0
check "not neo-Hookean" has out "neo_hookean"
end

begin "solve gives a table and plots of several resolutions and elements"
run solve "$problems/beam.json" --case tip --resolution 8,16,32 --element hex8_bbar,tet4:16 --plot error.svg --json
check "exit code $code" code_is 0
check "no JSON" is_json out
for key in rms_percent nodes order change_percent change_order estimate_percent factor total; do
    check "no $key" has out "\"$key\":"
done
check "not 5 rows" test "$(grep -o '"resolution"' out | wc -l)" -eq 5
check "no files" has out '"files":\["error.svg","error_seconds.svg"\]'
for file in error.svg error_seconds.svg; do
    check "no $file" has $file "</svg>"
    check "no curve of tet4 in $file" has $file ">tet4</text>"
done
run solve "$problems/beam.json" --case tip --resolution 8,16
check "exit code $code" code_is 0
check "not 4 lines" lines_are out 4
run solve "$problems/beam.json" --case tip --resolution 8,4
refused 2 "4 is not above the one before"
run solve "$problems/beam.json" --case tip --element hex8,hex9
refused 2 "hex9 is not hex8_bbar, hex8, tet4 or tet10"
run solve "$problems/beam.json" --case tip --element hex8,tet4 --csv all.csv
refused 2 "are for one element"
run solve "$problems/beam.json" --case tip --resolution 8,16 --plot nowhere/error.svg
refused 1 "nowhere/error.svg"
end

begin "solve refuses what makes no sense, naming entry and number"
sed "s|\"beam.obj\"|\"$problems/beam.obj\"|" "$problems/beam.json" >good.json
cp "$problems/beam_timoshenko.csv" .
bad() { sed "$1" good.json >bad.json; }
bad 's/"nu": 0.3/"nu": 0.5/'
run solve bad.json --case tip
refused 1 "bad.json: materials\[0\].nu: 0.5 is not a Poisson ratio"
bad 's/"nu": 0.3/"nu": -1/'
run solve bad.json --case tip
refused 1 "bad.json: materials\[0\].nu: -1 is not a Poisson ratio"
bad 's/"E": 80000/"E": 0/'
run solve bad.json --case tip
refused 1 "bad.json: materials\[0\].E: 0 Pa is not a stiffness"
bad 's/"E": 80000/"E": -5/'
run solve bad.json --case tip
refused 1 "bad.json: materials\[0\].E: -5 Pa is not a stiffness"
bad 's/"E": 80000/"young": 80000/'
run solve bad.json --case tip
refused 1 "bad.json: materials\[0\].young: unknown key"
bad 's/"max": \[1e-6,/"max": [-1e-6,/'
run solve bad.json --case tip
refused 1 "bad.json: supports\[0\]: (-0.01, -0.03, -0.03)"
bad 's/"min": \[0.319999,/"min": [0.3201,/'
run solve bad.json --case tip
refused 1 "bad.json: load_cases\[0\].loads\[0\]: the region (0.3201, -0.03, -0.03) .. (0.33, 0.03, 0.03) meets no surface"
run solve good.json --case tipp
refused 1 'good.json: --case: there is no load case or reference "tipp"; known are tip, tip_far, hang, timoshenko'
run solve good.json
refused 1 "good.json: --case is missing; known are tip"
run solve good.json --case tip --nu 0.5
refused 1 "nu 0.5 is not a Poisson ratio"
run solve good.json --case tip --nu -1
refused 1 "nu -1 is not a Poisson ratio"
run solve good.json --case tip --young 0
refused 1 "E 0 Pa is not a stiffness"
run solve good.json --case tip --young -5
refused 1 "E -5 Pa is not a stiffness"
sed '1s/uy/yu/' beam_timoshenko.csv >column.csv
run solve good.json --case tip --samples column.csv
refused 1 'column.csv: line 1: column 5 is "yu", wanted "uy"'
sed '3s/,0,/,,/' beam_timoshenko.csv >column.csv
run solve good.json --case tip --samples column.csv
refused 1 'column.csv: line 3: column 2 (y): "" is not a number'
bad 's|"surface": "[^"]*"|"surface": "gone.obj"|'
run solve bad.json --case tip
refused 1 "gone.obj"
run solve gone.json --case tip
refused 1 "gone.json"
run solve good.json --case tip --vtk nowhere/at/all.vtk
refused 1 "nowhere/at/all.vtk"
run solve good.json --case tip --law ogden
refused 2 '--law: "ogden" is not linear, corotational or neo_hookean'
run solve good.json --case tip --elements hex8
refused 2 "unknown flag --elements"
run solve good.json --case tip --kinematics linear --law corotational
refused 2 "linear goes with linear only"
run solve good.json --case tip --resolution 0
refused 2 "--resolution: 0 is outside"
end

begin "prepare --model fem writes a scene of finite elements that steps"
run prepare box.obj -o fem --model fem --no-tetgen --resolution 6 --units mm
check "exit code $code" code_is 0
check "no model fem" has fem/scene.json '"fem"'
check "no implicit solver" has fem/scene.json '"implicit_euler"'
run plan fem --json
check "exit code $code of plan" code_is 0
check "no row of hexahedra" has out '"hex_elastic"'
sed 's/"absent".*//' out >rows
check "a row of springs" hasnt rows edge_distance
check "what called for hexahedra" has rows '"reason":"bodies\[0\].model \\"fem\\""'
check "what springs would be called for by" \
    has out '"name":"edge_distance","called_by":"model \\"tet_springs\\""'
run prepare box.obj -o fem2 --model fem --element tet10 --law neo_hookean --solver sdirk2 --no-tetgen --resolution 4
check "exit code $code with all words" code_is 0
run plan fem2 --json
check "exit code $code of plan" code_is 0
check "no row of tetrahedra" has out '"tet_elastic"'
check "no sdirk2" has out '"sdirk2"'
run prepare box.obj -o x --model fem --area-springs
refused 2 "--area-springs: model fem has no springs"
run prepare box.obj -o x --element tet4
refused 2 "--element: only goes with --model fem"
run prepare box.obj -o x --model fem --element brick
refused 2 '--element: "brick" is not hex8_bbar'
run prepare box.obj -o x --model fen
refused 2 '--model: "fen" is not springs, fem or adaptive'
end

# ---- surfaces that adapt ----
begin "prepare --shape writes hollow bodies whose levels have the counts of paper C"
run prepare --shape stomach -o stomach --json
check "exit code $code" code_is 0
check "not one JSON object" is_json out
check "levels of the stomach" has out '"levels":\[{"nodes":188,"springs":558},{"nodes":746,"springs":2232}\]'
check "not closed" has out '"closed":true,"open_edges":0,'
check "two files" test "$(ls -A stomach | wc -l)" -eq 2
check "model" has stomach/scene.json '"adaptive_springs"'
check "two openings held" test "$(grep -c '"box"' stomach/scene.json)" -eq 2
run prepare --shape sphere -o sphere --levels 3
check "exit code $code" code_is 0
for level in "level 0: 114 nodes, 336 springs" "level 1: 450 nodes, 1344 springs" "level 2: 1794 nodes, 5376 springs"; do
    check "no $level" has out "$level"
done
check "anchors not in space" has sphere/scene.json '"world"'
run prepare --shape sheet -o sheet --thickness-mm 1
check "exit code $code" code_is 0
check "not open along 64 edges" has out "open along 64 edges"
check "40 g of 1 mm" has out "40.0 g"
check "border not held" has sheet/scene.json '"boundary":.*true'
run prepare --shape organ -o x --no-tetgen --triangles 4000 --json
check "exit code $code of the organ" code_is 0
check "the organ is no longer made of tetrahedra" has out '"tets":[1-9]'
rm -rf x
end

begin "plan prints nodes and springs of every level, and what is active"
run plan stomach
check "exit code $code" code_is 0
check "active" has out "stomach: an adaptive surface, 188 nodes and 558 springs active of"
check "finest" has out "level 1: 746 nodes, 2232 springs"
for row in edge_spring shape_spring viscous refine rk4 surface_output; do check "no row $row" has out "$row"; done
run plan stomach --json
check "not one JSON object" is_json out
check "levels" has out '"nodes":188,"springs":558,"levels":\[{"nodes":188,"springs":558},{"nodes":746,"springs":2232}\]'
end

begin "prepare --model adaptive keeps a surface as it is, and reports it"
run prepare box.obj -o hollow --model adaptive --units mm --levels 3 --inflate 200
check "exit code $code" code_is 0
check "box" has out "level 0: 8 nodes, 18 springs"
check "no pressure" has hollow/scene.json '"pressure_Pa":.*200'
check "TetGen files" test "$(ls -A hollow | wc -l)" -eq 2
run plan hollow
check "exit code $code of plan" code_is 0
check "no row inflate" has out "inflate"
run prepare box.obj -o again_hollow --model adaptive --units mm --levels 3 --inflate 200 --quiet
check "not the same files" cmp -s hollow/box.palmesh again_hollow/box.palmesh
end

begin "an adaptive surface is made as coarse as asked, and refines as far as real time allows"
run prepare --shape stomach -o coarse --triangles 200 --json
check "exit code $code" code_is 0
check "not 200 triangles" has out '"triangles":200,'
check "a limit that nobody needs" hasnt coarse/scene.json most_node
run prepare --shape sphere -o deep --levels 6 --young-Pa 500000
check "exit code $code with six levels" code_is 0
check "the limit is not told" has out "at most [0-9]* nodes at a time"
check "the limit is not in the scene" has deep/scene.json '"most_node"'
check "no warning that it is too slow" has out "too slow for real time"
run prepare --shape sphere -o again_deep --levels 6 --young-Pa 5000
check "too slow with soft tissue" hasnt out "too slow"
run plan deep
check "exit code $code of plan" code_is 0
end

begin "surfaces that cannot adapt are refused in one sentence, with the way out"
{ cat box.obj; printf 'v 50 -50 0\nf 1 2 9\n'; } >fin.obj
run prepare fin.obj -o x --model adaptive
refused 1 "fin.obj: line 9: levels: 3 triangles (.*) share the edge of vertices 0 and 1"
check "no way out" has err "prepare it as voxels"
sed '$d' box.obj >open.obj
run prepare open.obj -o x --model adaptive --inflate 100
refused 1 "open.obj: line 9: pressure is asked for, but the surface has 4 open edges"
run prepare open.obj -o x --model adaptive
check "exit code $code for an open surface" code_is 0
check "open edges are not told" has out "open along 4 edges"
check "open edges are not held" has x/scene.json '"boundary":.*true'
rm -rf x
printf 'v 0 0 0\nv 100 0 0\nv 200 0 0\nf 1 2 3\n' >line.obj
run prepare line.obj -o x --model adaptive
refused 1 "line.obj: "
{ cat box.obj; printf 'f 1 2 2\n'; } >twice.obj
run prepare twice.obj -o x --model adaptive
check "exit code $code with a face without area" code_is 0
check "the face without area is not told" has out "1 degenerate"
rm -rf x
run prepare --shape stomach -o x --levels 10
refused 1 "10 levels need .* MiB, the budget is 512 MiB"
check "a folder was made" no_such x
end

begin "thresholds that are no numbers are refused with their entry"
for number in -1 1e999; do
    sed "s/\"effects\":.*\[{/\"effects\": [{\"name\": \"refine\", \"force_N\": $number}, {/" stomach/scene.json >stomach/bad.json
    run plan stomach/bad.json
    refused 1 "bodies\[0\].effects\[0\].*force_N: "
done
sed 's/"effects":.*\[{/"effects": [{"name": "refine", "force_N": NaN}, {/' stomach/scene.json >stomach/bad.json
run plan stomach/bad.json
refused 1 "stomach/bad.json: line [0-9]*: not JSON"
sed 's/"levels":.*2,/"levels": 10,/' stomach/scene.json >stomach/bad.json
run plan stomach/bad.json
refused 1 "10 levels need .* MiB, the budget is 512 MiB"
sed 's/"adaptive_springs",/"tet_springs"/; /"levels":/d; /"thickness_m":/d' stomach/scene.json >stomach/bad.json
run plan stomach/bad.json
refused 1 'stomach/bad.json: body "stomach" model: "tet_springs" works on tetrahedra'
end

begin "flags of one model are refused with another"
run prepare box.obj -o x --levels 3
refused 2 "--levels: only goes with --model adaptive"
run prepare box.obj -o x --thickness-mm 3 --model fem
refused 2 "--thickness-mm: only goes with --model adaptive"
run prepare box.obj -o x --inflate 3
refused 2 "--inflate: only goes with --model adaptive"
run prepare box.obj -o x --model adaptive --resolution 12
refused 2 "--resolution: model adaptive has no voxels"
run prepare box.obj -o x --model adaptive --area-springs
refused 2 "--area-springs: model adaptive"
run prepare box.obj -o x --model adaptive --tetgen
refused 2 "--tetgen: model adaptive has no tetrahedra"
run prepare box.obj -o x --model adaptive --element tet4
refused 2 "--element: only goes with --model fem"
run prepare box.obj -o x --model adaptive --levels 11
refused 2 "--levels: 11 is outside 1 .. 10"
run prepare box.obj -o x --model adaptive --inflate nan
refused 2 "--inflate"
run prepare --shape cube -o x
refused 2 'is not organ, stomach, sphere or sheet'
run prepare --shape stomach --procedural -o x
refused 2 "--procedural and --shape exclude each other"
run prepare box.obj --shape stomach -o x
refused 2 "either a file or --procedural"
check "a folder was made" no_such x
end

shared=${PAL_SHARED:-$here/../../../shared}/data
if [ -e "$shared/stomach_188.obj" ] && [ -e "$shared/sphere_114.obj" ]; then
    begin "a stomach and a sphere of the shared models adapt"
    run prepare "$shared/stomach_188.obj" -o x --model adaptive --json
    check "exit code $code" code_is 0
    check "stomach" has out '"levels":\[{"nodes":188,"springs":558},{"nodes":746,"springs":2232}\]'
    run prepare "$shared/sphere_114.obj" -o x --model adaptive --json
    check "exit code $code" code_is 0
    check "sphere" has out '"levels":\[{"nodes":114,"springs":336},{"nodes":450,"springs":1344}\]'
    run prepare "$shared/dragon_11k.ply" -o y --model adaptive
    refused 1 "dragon_11k.ply: byte [0-9]*: levels: 4 triangles"
    check "a folder was made" no_such y
    rm -rf x
    end
else
    skip "a stomach and a sphere of the shared models adapt" "$shared is not there"
fi

# ---- wrong usage ----
begin "wrong flags are refused by name with exit code 2"
run prepare box.obj -o x --resolutoin 3
refused 2 "unknown flag --resolutoin"
run prepare box.obj -o x --resolution
refused 2 "--resolution needs a value"
run prepare box.obj -o x --resolution many
refused 2 '--resolution: "many" is not a number'
run prepare box.obj -o x --resolution 5000
refused 2 "--resolution: 5000 is outside 1 .. 1024"
run prepare box.obj -o x --resolution 2.5
refused 2 "2.5 is not a whole number"
run prepare box.obj -o x --young-Pa nan
refused 2 "--young-Pa"
run prepare box.obj -o x --units furlong
refused 2 "--units"
run prepare box.obj -o x --label 3 --label 4
refused 2 "--label is given twice"
run prepare box.obj -o x --json=yes
refused 2 "--json takes no value"
run prepare box.obj
refused 2 "needs -o DIR"
run prepare -o x
refused 2 "either a file or --procedural"
run prepare box.obj --procedural -o x
refused 2 "either a file or --procedural"
run prepare box.obj other.obj -o x
refused 2 "one operand too many"
run plan
refused 2 "no operand is given"
run replay one
refused 2 "an operand is missing"
run bench nothing
refused 2 'no bench "nothing"'
run bench mesh --picture x.svg
refused 2 '--picture belongs to adaptive'
run serve box.obj --port 70000
refused 2 "--port: 70000 is outside 0 .. 65535"
run serve box.obj --listen 127.0.0.1:19011 --quiet
refused 1 "--listen 127.0.0.1:19011: wanted an IP address alone.*--port"
check "a folder was made" no_such x
end

begin "configuration: file and environment are refused by name"
echo '{"port": 1, "prot": 2}' >bad.json
run serve box.obj --config bad.json
refused 1 "bad.json: prot: unknown key"
echo '{"port": "x"}' >bad.json
run serve box.obj --config bad.json
refused 1 "bad.json: port: is not a number"
echo '{"port": 1,' >bad.json
run serve box.obj --config bad.json
refused 1 "bad.json: line"
PALPATE_MAX_CLIENTS=none run serve box.obj
refused 1 "PALPATE_MAX_CLIENTS"
PALPATE_NOTHING=1 run serve box.obj
refused 1 "PALPATE_NOTHING: unknown key"
PALPATE_CONFIG=gone.json run serve box.obj
refused 1 "gone.json"
end

# ---- refused input ----
begin "files that are not there or not files"
run prepare gone.stl -o x
refused 1 "gone.stl"
run prepare . -o x
refused 1 "\.: "
run plan gone.json
refused 1 "gone.json"
run replay gone.log scene
refused 1 "gone.log"
run replay box.obj scene
refused 1 "not an input log"
check "a folder was made" no_such x
end

begin "a refusal with --json is an object on stdout and one line on stderr"
run prepare gone.stl -o x --json
check "exit code $code" code_is 1
check "$(lines err) lines on stderr" lines_are err 1
check "not one JSON object" is_json out
check "no error in it" has out '"ok":false,"error":{"code":"IO"'
end

begin "a folder that cannot be written leaves nothing"
echo file >blocked
run prepare box.obj -o blocked
refused 1 "blocked"
run prepare box.obj -o blocked/deeper
refused 1 "blocked"
mkdir -p taken/scene.json
run prepare box.obj -o taken
check "exit code $code" code_is 1
check "something was left in the folder" test -z "$(ls -A taken | grep '^\.')"
end

begin "a bad scene is refused with file and entry"
sed 's/"young_Pa"/"youngPa"/' scene/scene.json >scene/bad.json
run plan scene/bad.json
refused 1 "scene/bad.json: bodies\[0\].material.youngPa: unknown key"
sed 's/"tool_push"/"tool_pusch"/' scene/scene.json >scene/bad.json
run plan scene/bad.json
refused 1 "tool_pusch"
sed 's/5000/1e12/' scene/scene.json >scene/bad.json
run plan scene/bad.json
refused 1 "sub-steps"
head -c 3000 scene/box.palmesh >scene/cut.palmesh
sed 's/box.palmesh/cut.palmesh/' scene/scene.json >scene/bad.json
run plan scene/bad.json
refused 1 "cut.palmesh"
end

# ---- hostile files: every one is refused with exit code 1, one line that names the file, and no folder ----
noise() { # noise N: bytes that are the same every time
    awk -v n="$1" 'BEGIN { s = 42; for (k = 0; k < n; k++) { s = (s * 1103515245 + 12345) % 2147483648; printf "%c", 1 + s % 127 } }'
}
zeros() { head -c "$1" /dev/zero; }
: >h_empty.stl
noise 4000 >h_noise.bin
{ zeros 80; printf '\377\377\377\377'; zeros 50; } >h_count.stl
{ printf 'solid x'; zeros 73; printf '\144\000\000\000'; zeros 1000; } >h_cut.stl
printf 'ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n' >h_count.ply
printf 'ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n' >h_list.ply
{ zeros 36; printf '\377\377\377\177'; } >>h_list.ply
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n' >h_cut.ply
printf 'v nan nan nan\nv inf 0 0\nv 0 1e999 0\nf 1 2 3\n' >h_nan.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999\n' >h_index.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -9\n' >h_negative.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\n' >h_nofaces.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n' >h_flat.obj
printf 'OFF\n2000000000 2000000000 0\n0 0 0\n' >h_count.off
printf 'OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2000000000 0 1 2\n' >h_polygon.off
{ printf '\134\001\000\000'; zeros 36; printf '\003\000\377\177\377\177\377\177\001\000\001\000\001\000\001\000'; zeros 14
    printf '\002\000\010\000'; zeros 270; printf 'n+1\000'; zeros 8; } >h_dims.nii
printf '#INRIMAGE-4#{\nXDIM=100000\nYDIM=100000\nZDIM=100000\nVDIM=1\nTYPE=unsigned fixed\nPIXSIZE=8 bits\n' >h_dims.inr
{ head -c 256 h_dims.inr; zeros 300; } >h_dims2.inr
head -c 100000 /dev/zero | gzip -c >h_zeros.nii.gz
head -c 60 h_zeros.nii.gz >h_cut.nii.gz
printf '\037\213\010\000garbage' >h_broken.inr.gz
mkfifo h_pipe.stl
for file in h_*; do
    begin "hostile $file"
    run prepare "$file" -o hostile
    refused 1 "$file"
    [ "$file" = h_pipe.stl ] || check "stderr names no line or byte" has err "$file: \(line\|byte\) [0-9]"
    check "a folder was made" no_such hostile
    end
done

begin "the unit of a scan cannot be given"
run prepare h_zeros.nii.gz -o hostile --units m
refused 1 "h_zeros.nii.gz: a scan is in mm"
end

# a file that grows a thousandfold when unpacked costs no more than its header says
begin "a bomb of zeros is refused"
{ printf '#INRIMAGE-4#{\nXDIM=16\nYDIM=16\nZDIM=16\nVDIM=1\nTYPE=unsigned fixed\nPIXSIZE=8 bits\nCPU=decm\n'; zeros 300; } |
    head -c 256 >head.inr
{ cat head.inr; zeros 200000000; } | gzip -1 -c >bomb.inr.gz
run prepare bomb.inr.gz -o hostile
refused 1 "bomb.inr.gz"
end

finish
