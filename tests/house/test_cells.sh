#!/bin/sh
# `palpate cells` as a user runs it: figures beside those of Table 1, files that come back to the bit, boundaries that
# are closed, one line for a refusal. Prints "N passed, N failed"; exit 1 when a check failed.
# usage: test_cells.sh PALPATE [MAX_KB]     MAX_KB: address space a command may take (0: no limit, for sanitizers)
set -u
palpate=$(realpath "$1")
max_kb=${2:-0}
. "$(dirname "$0")/shell.sh"
run() { # run ARGS...: into out, err, code
    (
        [ "$max_kb" -gt 0 ] && ulimit -v "$max_kb"
        exec timeout 60 "$palpate" cells "$@"
    ) >out 2>err </dev/null
    code=$?
}
good() { # good ARGS...: runs, exit code 0, nothing on stderr
    run "$@"
    check "exit code $code of $*" code_is 0
    check "stderr is not empty after $*" is_empty err
}
# what the object on stdout says of the solid, a member a line, volumes rounded to nine digits: the sum of a volume depends
# on the processor and on the corner that a cell begins at
facts() {
    sed 's/.*"control_cells"/"control_cells"/; s/,"paper":{[^}]*}//; s/,"file".*//' "$1" | tr , '\n' |
        awk -F : '/volume_m3/ { $2 = sprintf("%.9g", $2) } 1'
}
# euler FILE.obj: V - E + F, or "open" when an edge is not there once in each direction
euler() {
    awk '$1 == "v" { v++ }
         $1 == "f" { f++; for (k = 0; k < 3; k++) side[$(2 + k) " " $(2 + (k + 1) % 3)]++ }
         END { for (s in side) { split(s, end); e++; if (side[s] != 1 || side[end[2] " " end[1]] != 1) open = 1 }
               print open ? "open" : v - e / 2 + f }' "$1"
}

# numbers of elements, and the paper's or ours of the control cells
begin "--list puts the figures of the named solids beside those of Table 1"
good --list
check "$(lines out) lines" lines_are out 10
for row in "soccer 2 24 1536 26.6 73.4 0.0 1536: 24 76 0" "monster 1 38 312 0.0 94.9 5.1 320: 94 3 4" \
    "block3 2 27 1728 57.9 42.1 0.0 1728: 58 42 0" "chair 1 76 712 0.0 70.8 29.2 984: 68 3 29" \
    "block4 1 64 512 42.2 57.8 0.0 512: 42 58 0" "head 1 123 1074 13.4 69.5 17.1 1241: 82 1 17" \
    "bridge 1 150 1200 0.0 100.0 0.0 1200: 95 5 0" "nozzle 1 99 792 0.0 100.0 0.0 792: 100 0 0" \
    "kidney 1 83 664 0.0 100.0 0.0 - "; do
    check "no row $row" eval "tr -s ' ' <out | grep -q \"^$row\""
done
good --list --json
check "not one line" lines_are out 1
check "nozzle" has out '"name":"nozzle","levels":1,"rule":"maccracken_joy","control_cells":99,.*"elements":792,'
check "the paper's chair" has out '"paper":{"levels":1,"control_cells":76,"elements":984,"percent":\[68,3,29\]}'
good --list --quiet
check "stdout is not empty" is_empty out
end

begin "every named solid goes to a file and back to the bit"
for solid in soccer monster block3 chair block4 head bridge nozzle kidney; do
    good $solid -o a.palcells --quiet
    check "something is on stdout" is_empty out
    good a.palcells -o b.palcells
    check "$solid.palcells is not the same" cmp -s a.palcells b.palcells
    # a VTK file keeps points to the bit and cells as what they are, though begun at other corners
    good b.palcells -o a.vtk --json
    facts out >a.facts
    good a.vtk -o b.vtk --json
    facts out >b.facts
    sed '/^CELLS /q' a.vtk >a.points
    sed '/^CELLS /q' b.vtk >b.points
    check "points of $solid.vtk are not the same" cmp -s a.points b.points
    check "$solid.vtk is another solid" cmp -s a.facts b.facts
done
end

begin "a solid subdivided from its file is the solid subdivided"
good chair -o a.palcells
good chair --levels 1 -o b.palcells
good a.palcells --levels 1 -o c.palcells
check "not the same" cmp -s b.palcells c.palcells
good chair --levels 1 --rule averaging -o c.palcells
check "averaging is the same" eval "! cmp -s b.palcells c.palcells"
# in two steps the solid has the same cells, though rules and boundary see it anew
good b.palcells --levels 1 --json
check "4656 elements" has out '"elements":4656,'
end

begin "boundaries are closed surfaces of the solid's genus"
for solid in "soccer 2" "monster 0" "chair -8" "head 2" "bridge -38" "nozzle 0" "kidney 2" "torus 0" "ring 0" "tube 0" "block 2"; do
    good "${solid% *}" --levels 1 -o a.obj
    check "V - E + F of ${solid% *} is $(euler a.obj), wanted ${solid#* }" test "$(euler a.obj)" = "${solid#* }"
done
good monster --levels 2 --json -o a.ply
check "faces in the file" eval 'triangles=$(sed "s/.*boundary_triangles\":\([0-9]*\).*/\1/" out) && grep -aq "^element face $triangles\$" a.ply'
good monster --levels 2 --json -o a.stl
check "bytes of the file" test "$(wc -c <a.stl)" -eq $((84 + 50 * triangles))
check "the file's name" has out '"file":"a.stl"'
end

begin "primitives have the numbers and sizes that are asked for"
good block --cells 2,3,4 --size-m 0.2,0.3,0.4 --json
check "24 cells, 24 l" has out '"cells":24,.*"size_m":\[0.2.*,0.3.*,0.4.*\],.*"volume_m3":0.024'
good torus --cells 6,2
check "120 cells with a hole" has out "^1 piece, genus 1, 0 cavities"
good tube --cells=12,2,5 --size-m=0.01,0.02,0.1
check "120 bricks" has out "^tube: 120 control cells, .* x 100 mm"
good ring --cells 3 --levels 3
check "1536 elements" has out "^1536 finite elements"
good chair
check "pyramids are no elements" has out "^no finite elements yet"
end

begin "wrong words are refused by name with exit code 2"
run
refused 2 "needs either a SHAPE or --list"
run --list head
refused 2 "needs either a SHAPE or --list"
run --list -o x.ply
refused 2 "--list goes with --rule, --json and --quiet only"
run sofa
refused 2 'there is no shape "sofa"'
run head monster
refused 2 '"monster" is one operand too many'
run head --rule catmull
refused 2 '--rule: "catmull" is not maccracken_joy or averaging'
run head --levels 9
refused 2 "--levels: 9 is outside 0 .. 8"
run head --levels
refused 2 "--levels needs a value"
run head -o head.off
refused 2 "-o: is not a .palcells, .vtk, .ply, .obj or .stl file"
run head -o .ply
refused 2 "-o: is not"
run head --cells 3,3,3
refused 2 "--cells: only goes with block, ring, tube and torus"
run head --size-m 1
refused 2 "--size-m: only goes with block, ring, tube and torus"
run head --scale 2
refused 2 "unknown flag --scale"
for list in 3,3 3,3,3,3 3,3,x 3,3,2.5 3,3, nan,3,3 1e300,3,3 ""; do
    run block --cells "$list"
    refused 2 "--cells: \"$list\" is not 3 whole numbers separated by commas (along x, y and z)"
done
run tube --size-m 0.01,0.02
refused 2 '--size-m: "0.01,0.02" is not 3 numbers separated by commas (inner radius, outer radius and length)'
end

begin "numbers out of range and files that cannot be are refused with exit code 1, and nothing is written"
run block --cells 0,1,1 -o x.ply
refused 1 "number of cells along x is 0"
run block --cells 1000,1000,1000 -o x.ply
refused 1 "a shape of .* cells, at most 1000000 are made"
run ring --cells 2 -o x.ply
refused 1 "number of cells around is 2"
run tube --size-m 0.03,0.02,0.1 -o x.ply
refused 1 "outer radius is 0.02 m, must be above 0.03"
run torus --size-m 0.02,nan -o x.ply
refused 2 "--size-m"
run head --levels 8 -o x.ply
refused 1 "head: subdivision: level 4 of 8 needs .* MiB, the budget is 512 MiB"
run gone.palcells -o x.ply
refused 1 "gone.palcells: No such file"
run . -o x.ply
refused 2 'there is no shape "."'
run ./ -o x.ply
refused 1 "\./: "
for end in palcells vtk ply obj stl; do
    run head -o gone/x.$end
    refused 1 "gone/x.$end: No such file"
done
check "a file was written" no_such x.ply
end

begin "hostile files of cells are refused with their name and line"
good chair -o a.palcells
good chair -o a.vtk
: >empty.palcells
head -c 2000 a.palcells >cut.palcells
head -c 9000 a.vtk >cut.vtk
sed 's/^v .*/v nan 0 0/' a.palcells >nan.palcells
sed 's/^f 1 .*/f 1 2 999999999999/' a.palcells >far.palcells
{ cat a.palcells; sed -n '/^c$/,$p' a.palcells; } >twice.palcells
printf 'palcells 1\nv 0 0 0\nc\nf 1 1 1\n' >same.palcells
printf '# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 2000000000 double\n' >many.vtk
head -c 100000 /dev/zero >zeros.palcells
for file in empty.palcells cut.palcells cut.vtk nan.palcells far.palcells twice.palcells same.palcells many.vtk zeros.palcells; do
    run $file --levels 1 -o x.palcells
    refused 1 "palpate cells: $file: "
done
check "a file was written" no_such x.palcells
run cut.palcells --json
check "exit code $code" code_is 1
check "no object" has out '^{"ok":false,"error":{"code":"REFUSED"'
end

finish
