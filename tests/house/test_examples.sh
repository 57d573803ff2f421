#!/bin/sh
# Every example that --help prints runs as printed and exits 0, in a folder that holds nothing but the tree's deploy and
# tests; every command has one. Prints "N passed, N failed, N skipped"; exit 1 when an example failed.
# usage: test_examples.sh PALPATE [PALPATE-CALIBRATE-MPI|none]
set -u
palpate=$(realpath "$1")
mpi=${2:-none}
[ "$mpi" = none ] || mpi=$(realpath "$mpi")
. "$(dirname "$0")/shell.sh"
PATH=$(dirname "$palpate"):$PATH
# as root, and on fewer cores than ranks
export PATH OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1

examples_of() { # PROGRAM...: its examples, a line each
    "$@" --help | sed -n '/^EXAMPLES/,/^$/s/^  //p'
}
try() { # NAME PROGRAM...
    name=$1
    shift
    mkdir "$dir/$name"
    cd "$dir/$name" || exit 2
    ln -s "$problems/.." deploy
    ln -s "$problems/../../tests" tests
    examples_of "$@" >lines
    begin "$name has examples"
    : >err
    check "--help prints none" [ -s lines ]
    end
    while read -r line; do
        begin "$line"
        timeout 120 sh -c "$line" >out 2>err </dev/null
        code=$?
        check "exit code $code" code_is 0
        end
    done <lines
}

commands=$("$palpate" --help | sed -n 's/^  \([a-z]*\)  *.*/\1/p')
begin "palpate --help lists the commands"
: >err
check "fewer than ten" [ "$(echo "$commands" | wc -l)" -ge 10 ]
end
for command in $commands; do try "$command" "$palpate" "$command"; done
if [ "$mpi" != none ] && command -v mpirun >/dev/null; then
    try calibrate-mpi "$mpi"
else
    skip "examples of palpate-calibrate-mpi" "it is not built, or there is no mpirun"
fi
finish
