#!/bin/sh
# Commands in shards as a user runs them: merged they equal the run without shards to the bit, times excepted; a worker
# that died repeats only the result it was computing; wrong sets of shards are refused by name. Under plain processes,
# mpirun, and an array of a real Slurm. Prints "N passed, N failed, N skipped"; exit 1 when a check failed.
# usage: test_shards.sh PALPATE
set -u
PALPATE=$(realpath "$1")
export PALPATE
here=$(realpath "$(dirname "$0")")
shard=$(realpath "$here/../../deploy/batch/shard.sh")
. "$(dirname "$0")/shell.sh"
run() {
    timeout 100 "$PALPATE" "$@" >out 2>err </dev/null
    code=$?
}
# what --json prints without the processor times
untimed() { sed -E 's/"(cpu_s|ns)":[^,}]*//g' "$1"; }
equal() { [ -s "$1" ] && [ "$(untimed "$1")" = "$(untimed "$2")" ]; }

organs='robustness --generate branched:5,lobed:7,slender:1 --model fem --only inside --seconds 60'
merges() { # merges FOLDER: its merged report is that of the run without shards
    run $organs --merge "$1" --json
    check "exit code $code" code_is 0
    check "the merged report is not that of one run" equal out whole
}

begin "robustness: two shards equal one run"
run $organs --json
check "exit code $code" code_is 0
cp out whole
for i in 1 2; do
    run $organs --shard $i/2 --results plain
    check "exit code $code of shard $i" code_is 0
done
check "shard 1 has its head and 2 of 3 results" lines_are plain/robustness-1-of-2.jsonl 3
check "shard 2 has its head and 1 of 3 results" lines_are plain/robustness-2-of-2.jsonl 2
merges plain
run $organs --merge plain
check "the table has three rows" [ "$(grep -c '^| [a-z]* | fem |' out)" -eq 3 ]
end

begin "robustness: a worker that died repeats its own result only"
# a death while its second result was being written leaves half a line; processor times tell a repeated result. The two
# run side by side and stand in the order in which they ended
cp -r plain died
head -c -100 plain/robustness-1-of-2.jsonl >died/robustness-1-of-2.jsonl
run $organs --merge died
refused 1 'shard 1 of 2 is unfinished: result [02] is missing; run it with --shard 1/2'
run $organs --shard 1/2 --results died
check "exit code $code" code_is 0
head -n 2 plain/robustness-1-of-2.jsonl >before
head -n 2 died/robustness-1-of-2.jsonl >after
check "the finished result stands there as before, with its times" same before after
check "the other shard is untouched" same plain/robustness-2-of-2.jsonl died/robustness-2-of-2.jsonl
merges died
end

begin "robustness: a file that is missing now is no result"
run robustness nowhere.json --shard 1/1 --results lost
refused 1 'nowhere.json'
check "the file has its head only" lines_are lost/robustness-1-of-1.jsonl 1
end

begin "shards that do not belong together are refused"
run $organs --shard 3/2 --results plain
refused 2 '3/2: shards are numbered from 1 to 2'
run $organs --shard 0/2 --results plain
refused 2 '0/2: shards are numbered from 1 to 2'
run $organs --shard 1of2 --results plain
refused 2 '"1of2" is not I/N'
run $organs --shard 1/2
refused 2 'go together'
run $organs --seed 2 --shard 1/2 --results plain
refused 1 'robustness-1-of-2.jsonl: line 1: the results belong to other input'
run $organs --seed 2 --merge plain
refused 1 'robustness-1-of-2.jsonl: line 1: the results belong to other input'
cp -r plain odd
rm odd/robustness-2-of-2.jsonl
run $organs --merge odd
refused 1 'odd: shard 2 of 2 is missing'
cp plain/robustness-2-of-2.jsonl odd/robustness-2-of-3.jsonl
run $organs --merge odd
refused 1 'holds shards of 2 and of 3'
cp plain/robustness-2-of-2.jsonl odd/robustness-1-of-2.jsonl
rm odd/robustness-2-of-3.jsonl
run $organs --shard 1/2 --results odd
refused 1 'is not of shard 1 of 2, as its name says'
sed 's/"index":2/"index":1/' plain/robustness-1-of-2.jsonl >odd/robustness-1-of-2.jsonl
run $organs --shard 1/2 --results odd
refused 1 'robustness-1-of-2.jsonl: line [23] is damaged'
mkdir empty
run $organs --merge empty
refused 1 'empty: holds no results of palpate robustness'
end

# of a point of a study everything but what was timed, or is chosen by times
points() {
    grep -vE '"(ms|ms_p95|prepare_s|read_ms|predicted_ms|front|reason|command)":' "$1"
}
points_equal() { [ "$(points "$1")" = "$(points "$2")" ]; }
beam="study $problems/beam.json --case tip --quick --methods fem --seconds 0.05"

if long "study: two shards, one of which died, equal one run but for times"; then
    begin "$name"
    run $beam --out one
    check "exit code $code" code_is 0
    for i in 1 2; do
        run $beam --shard $i/2 --results parts
        check "exit code $code of shard $i" code_is 0
    done
    cp parts/study-1-of-2.jsonl before
    n=$(lines before)
    check "shard 1 has its head and some of the points" [ "$n" -gt 2 ]
    head -c -50 before >parts/study-1-of-2.jsonl
    run $beam --merge parts --out two
    refused 1 'shard 1 of 2 is unfinished'
    run $beam --shard 1/2 --results parts
    check "exit code $code of the shard started again" code_is 0
    check "it kept $((n - 2)) points" has out "$((n - 1)) results are in parts, $((n - 2)) of them from before"
    check "their lines stand as before" [ "$(head -n $((n - 1)) before)" = "$(head -n $((n - 1)) parts/study-1-of-2.jsonl)" ]
    run $beam --merge parts --out two
    check "exit code $code of the merge" code_is 0
    check "the merged study has other figures" points_equal one/study.json two/study.json
    cp two/study.json merged.json
    run $beam --merge parts --out two
    refused 1 'two/study.json: is there already: --again replaces it, --out keeps it'
    check "a refused merge changed the study" same two/study.json merged.json
    run $beam --merge parts --out two --again
    check "exit code $code of the merge with --again" code_is 0
    cp -r parts mixed
    sed 's/"machine":"[^"]*"/"machine":"another"/' parts/study-2-of-2.jsonl >mixed/study-2-of-2.jsonl
    run $beam --merge mixed --out three
    refused 1 'was measured on another processor, another, whose times do not compare'
    check "a page" has two/study.html "</html>"
    run study "$problems/beam.json" --case tip --quick --methods fem --seconds 0.06 --merge parts --out three
    refused 1 'the results belong to other input'
    run $beam --shard 1/2 --results parts --out three
    refused 2 'does not go with'
    end
fi

begin "solve: three shards equal one table but for seconds"
table="solve $problems/beam.json --case tip --element hex8_bbar,tet10:8 --resolution 6,8,12"
timed() { sed -E 's/"seconds":\{[^}]*\}//g' "$1"; }
run $table --json
check "exit code $code" code_is 0
timed out >whole_table
for i in 1 2 3; do
    run $table --shard $i/3 --results rows
    check "exit code $code of shard $i" code_is 0
done
check "the five rows are divided" [ "$(cat rows/solve-*-of-3.jsonl | grep -c '"index"')" -eq 5 ]
run $table --merge rows --json
check "exit code $code of the merge" code_is 0
timed out >merged_table
check "the merged table has other figures" same whole_table merged_table
run $table --nu 0.3 --merge rows
refused 1 'the results belong to other input'
end

searches="calibrate $problems/bar.json --case bend --resolution 8 --split 1 --method annealing --evaluations 30 --starts 3 --seed 7"
fits_equal() { # fits_equal A B: the scene, its mesh and the trajectory, to the bit
    same "$1/fit.json" "$2/fit.json" && same "$1/fit.palmesh" "$2/fit.palmesh" && same "$1/t.svg" "$2/t.svg"
}

begin "calibrate: two shards, one of which died, equal one run"
run $searches -o fit_whole/fit.json --trajectory fit_whole/t.svg --json
check "exit code $code" code_is 0
check "it does not tell which search is the best" has out '"starts":3,"seed":[789][,}]'
for i in 1 2; do
    run $searches --shard $i/2 --results fits
    check "exit code $code of shard $i" code_is 0
done
check "shard 1 has its head and 2 of 3 searches" lines_are fits/calibrate-1-of-2.jsonl 3
cp fits/calibrate-1-of-2.jsonl before
head -c -50 before >fits/calibrate-1-of-2.jsonl
run $searches --merge fits -o fit_merged/fit.json
refused 1 'shard 1 of 2 is unfinished: result 2 is missing'
run $searches --shard 1/2 --results fits
check "it kept its first search" has out 'shard 1 of 2: 2 results are in fits, 1 of them from before'
check "whose line stands as before" [ "$(head -n 2 before)" = "$(head -n 2 fits/calibrate-1-of-2.jsonl)" ]
run $searches --merge fits -o fit_merged/fit.json --trajectory fit_merged/t.svg --json
check "exit code $code of the merge" code_is 0
check "the merged fit is not that of one run" fits_equal fit_whole fit_merged
run $searches --decades 2 --merge fits -o other/fit.json
refused 1 'the results belong to other input'
run $searches --shard 1/2 --results fits -o fit_merged/fit.json
refused 2 'does not go with files to write'
run calibrate "$problems/bar.json" --case bend --starts 2 -o other/fit.json
refused 2 'adjoint is one search without a seed'
end

begin "shards of a scene whose mesh has changed are refused"
run prepare --procedural --resolution 6 --model fem -o meshed
run robustness meshed/scene.json --only inside --seconds 60 --shard 1/1 --results mesh_results
check "exit code $code" code_is 0
run robustness meshed/scene.json --only inside --seconds 60 --merge mesh_results
check "exit code $code of the merge" code_is 0
run prepare --procedural --resolution 7 --model fem -o finer
cp finer/organ.palmesh meshed/organ.palmesh
run robustness meshed/scene.json --only inside --seconds 60 --merge mesh_results
refused 1 'the results belong to other input'
end

if ! long "robustness: ranks of mpirun equal one run"; then
    :
elif command -v mpirun >/dev/null 2>&1; then
    begin "$name"
    export OMPI_MCA_btl=self,vader OMPI_MCA_plm=isolated OMPI_MCA_oob_tcp_if_include=lo TMPDIR="$dir"
    root=
    [ "$(id -u)" -eq 0 ] && root=--allow-run-as-root
    timeout 100 mpirun --oversubscribe $root -n 3 "$shard" "$dir/mpi" $organs >out 2>err </dev/null
    code=$?
    check "exit code $code" code_is 0
    merges mpi
    end
else
    skip "$name" "mpirun is not there (openmpi-bin)"
fi

if ! long "robustness: an array of Slurm equals one run"; then
    :
elif ! command -v slurmctld >/dev/null 2>&1 || ! command -v slurmd >/dev/null 2>&1; then
    skip "$name" "slurmctld and slurmd are not there (slurm-wlm)"
elif [ "$(id -u)" -ne 0 ] || ! unshare -n true 2>/dev/null; then
    skip "$name" "only root makes a network namespace"
else
    begin "$name"
    timeout 100 unshare -n "$here/slurm_array.sh" "$dir/slurm" 1-3 "$shard" "$dir/array" $organs >out 2>err </dev/null
    code=$?
    check "exit code $code" code_is 0
    merges array
    # only what is missing runs again, alone, in the same division
    rm array/robustness-2-of-3.jsonl
    SHARDS=3 timeout 100 unshare -n "$here/slurm_array.sh" "$dir/again" 2 "$shard" "$dir/array" $organs >out 2>err \
        </dev/null
    code=$?
    check "exit code $code of the task that was repeated" code_is 0
    merges array
    end
fi

finish
