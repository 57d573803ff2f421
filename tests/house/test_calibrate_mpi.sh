#!/bin/sh
# palpate-calibrate-mpi as a person runs it: one rank and two give the same answer to the bit, a journal saves what was
# gathered when a rank is killed, and hostile journals and words get one sentence. Prints "N passed, N failed"; exit 1
# when a check failed. Only this machine is used.
# usage: test_calibrate_mpi.sh PALPATE_CALIBRATE_MPI
set -u
if [ ! -x "${1:-}" ] || ! command -v mpirun >/dev/null 2>&1; then
    echo "SKIP all: there is no MPI here (openmpi-bin, libopenmpi-dev)"
    exit 77
fi
program=$(realpath "$1")
. "$(dirname "$0")/shell.sh"
# MPI itself keeps memory until the end
export ASAN_OPTIONS=detect_leaks=0 OMPI_MCA_btl=self,vader OMPI_MCA_plm=isolated OMPI_MCA_oob_tcp_if_include=lo
export TMPDIR="$dir" OMPI_MCA_orte_base_help_aggregate=0
ranks='mpirun --oversubscribe'
[ "$(id -u)" -eq 0 ] && ranks="$ranks --allow-run-as-root"
run() { # run RANKS ARGS...: into out, err, code
    n=$1
    shift
    timeout 250 $ranks -n "$n" "$program" "$@" >out 2>err </dev/null
    code=$?
}
# the answer without what differs from run to run
answer() { sed 's/,"run":.*//' out >"$1"; }
number() { sed "s/.*\"$1\":\([0-9]*\).*/\1/" out; } # number KEY: of out
said_once() { [ "$(grep -c 'palpate calibrate-mpi: ' err)" -eq 1 ]; }

beam="$problems/beam.json --case tip --resolution 10 --split 1"

begin "two ranks, and ranks of two workers, give the answer of one to the bit"
run 1 $beam --seed 3 --evaluations 110 --json
check "exit code $code" code_is 0
answer one.json
check "no error of it" has one.json '"error_percent":[0-9]'
check "110 evaluations" has one.json '"evaluations":110,'
check "one rank computes nothing in vain" test "$(number computed)" -eq 110
run 2 $beam --seed 3 --evaluations 110 --json --journal whole.txt
answer two.json
check "exit code $code" code_is 0
check "two ranks" has out '"ranks":2'
check "another answer of two ranks" same one.json two.json
run 2 $beam --seed 3 --evaluations 110 --json --workers 2
answer four.json
check "another answer of four workers" same one.json four.json
end

begin "a whole journal leaves nothing to compute"
run 1 $beam --seed 3 --evaluations 110 --json --journal whole.txt
answer again.json
check "exit code $code" code_is 0
check "another answer from the journal" same one.json again.json
check "$(number computed) computed" test "$(number computed)" -eq 0
check "$(number from_journal) from the journal, wanted 110" test "$(number from_journal)" -eq 110
end

begin "a killed rank loses nothing that was gathered: the job ends, and the next one with its journal ends as if undisturbed"
slow="$problems/beam.json --case tip --resolution 20 --split 1 --seed 5 --evaluations 160 --json"
run 2 $slow
answer undisturbed.json
check "exit code $code" code_is 0
$ranks -n 2 "$program" $slow --journal broken.txt >out 2>err </dev/null &
job=$!
check "no twenty lines in the journal" shows broken.txt "$job" "" 20
victim=$(ps -o pid= --ppid "$job" | tail -n 1 | tr -d ' ')
[ -n "$victim" ] && kill -9 "$victim"
wait "$job"
code=$?
kept=$(($(lines broken.txt) - 1))
check "mpirun says all is well" test "$code" -ne 0
check "$kept evaluations kept, wanted 19 to 150" test "$kept" -ge 19 -a "$kept" -le 150
printf '30153d1630bbe2bb 0x1.08' >>broken.txt
run 2 $slow --journal broken.txt
answer resumed.json
check "exit code $code after it" code_is 0
check "another answer than undisturbed" same undisturbed.json resumed.json
# the last batch may have got no further than the journal's own rank
check "$(number from_journal) of $kept from the journal" test "$(number from_journal)" -ge $((kept * 3 / 4))
check "the torn line is still there" test "$(grep -vc '^[0-9a-f]\{16\} .* = .* [0-9a-f]\{16\}$' broken.txt)" -eq 1
end

begin "several problems and seeds one after another; a refused one is named and does not stop the others"
run 2 "$problems/beam.json" "$problems/cube.json" --case tip --resolution 8 --split 1 --seed 1,2 --evaluations 20 --json -o study
check "exit code $code" code_is 1
check "no refusal of cube" has err 'cube.json: .*no load case or reference "tip"'
check "no first seed" has study/beam_1.json '"seed":	1'
check "no second seed" has study/beam_2.json '"seed":	2'
check "a file for what was refused" test ! -e study/cube_1.json
check "not ok" has out '^{"ok":false,"results":\[{"ok":true,.*{"ok":true,.*{"ok":false,"problem":'
end

begin "damaged journals are refused with their line, other files left as they are"
sed '3s/0x1/0x2/' whole.txt >damaged.txt
run 2 $beam --evaluations 5 --journal damaged.txt
check "exit code $code" code_is 1
check "another sentence" has err 'damaged.txt: line 3 is damaged: its check does not agree'
check "not once" said_once
cp "$problems/beam.obj" other.txt
run 1 $beam --evaluations 5 --journal other.txt
check "exit code $code" code_is 1
check "another sentence" has err 'other.txt: is not a journal'
check "it was written to" same other.txt "$problems/beam.obj"
end

begin "words that are none are refused once, by rank 0"
for words in "--case tip --seed 1,x" "--case tip --grid 3x3"; do
    run 2 "$problems/beam.json" $words
    check "exit code $code of $words" code_is 2
    check "not once: $words" said_once
done
end

finish
