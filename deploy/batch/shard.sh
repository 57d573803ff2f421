#!/bin/sh
#SBATCH --job-name=palpate
#SBATCH --output=palpate-%A-%a.log
#SBATCH --cpus-per-task=1
#SBATCH --requeue
# One shard of a palpate command, whose number comes from the scheduler that started this script.
#
#   sbatch --array=1-8 shard.sh FOLDER robustness --generate all      a Slurm array
#   mpirun -n 8 shard.sh FOLDER robustness --generate all             Open MPI, MPICH or Intel MPI
#   kubernetes_job.yaml beside this file                              a Kubernetes Job with completionMode Indexed
#   palpate robustness --generate all --merge FOLDER                  afterwards: the whole report
#
# FOLDER is on a file system that all shards share. A shard that died continues from its own lines when it is started
# again with the same numbers; of a Slurm array: SHARDS=8 sbatch --array=3 shard.sh FOLDER ...
# PALPATE names the program (palpate).
set -eu
if [ $# -lt 2 ]; then
    echo "usage: shard.sh FOLDER COMMAND [WORDS...]" >&2
    exit 2
fi
if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then
    shard=$SLURM_ARRAY_TASK_ID n=${SHARDS:-$SLURM_ARRAY_TASK_COUNT}
elif [ -n "${OMPI_COMM_WORLD_RANK:-}" ]; then
    shard=$((OMPI_COMM_WORLD_RANK + 1)) n=$OMPI_COMM_WORLD_SIZE
elif [ -n "${PMI_RANK:-}" ]; then
    shard=$((PMI_RANK + 1)) n=$PMI_SIZE
elif [ -n "${JOB_COMPLETION_INDEX:-}" ]; then
    shard=$((JOB_COMPLETION_INDEX + 1)) n=${SHARDS:?is the number of completions}
else
    echo "shard.sh: started by none of a Slurm array, mpirun and an indexed Job" >&2
    exit 2
fi
folder=$1
shift
exec "${PALPATE:-palpate}" "$@" --shard "$shard/$n" --results "$folder"
