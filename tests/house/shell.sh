# Shared by the shell tests of commands: a temporary folder, named checks, output of a run. Sourced; the test defines
# `run ARGS...`, which leaves the files out and err and the variable code.
. "$(dirname "$0")/../fixtures/wait_for.sh"
passed=0 failed=0 skipped=0 bad=0
problems=$(realpath "$(dirname "$0")/../../deploy/problems")
dir=$(mktemp -d) || exit 2
trap 'rm -rf "$dir"' EXIT
cd "$dir" || exit 2

begin() { name=$1 bad=0; }
# `if long SENTENCE; then begin "$name" ...`: a test that only runs the same code longer is left to the release build
long() {
    name=$1
    [ -n "${PAL_SANITIZED-}" ] || return 0
    echo "not in this build: $1"
    return 1
}
check() { # check SENTENCE CONDITION...: the condition is a command
    what=$1
    shift
    if "$@"; then return 0; fi
    echo "  $name: $what"
    bad=1
}
end() {
    if [ "$bad" -eq 0 ]; then
        passed=$((passed + 1))
        echo "ok   $name"
    else
        failed=$((failed + 1))
        echo "FAIL $name"
        tail -n 30 err | sed 's/^/    err: /'
    fi
}
skip() { # NAME REASON: data or a program that the test needs is missing
    skipped=$((skipped + 1))
    echo "SKIP $1: $2"
}
finish() { # prints the last line of a test; the result is its exit code, 77 when a part was skipped
    echo "$passed passed, $failed failed, $skipped skipped"
    [ "$failed" -eq 0 ] || return 1
    [ "$skipped" -eq 0 ] || return 77
}
code_is() { [ "$code" -eq "$1" ]; }
lines() { wc -l <"$1" | tr -d ' '; }
lines_are() { [ "$(lines "$1")" -eq "$2" ]; }
is_empty() { [ ! -s "$1" ]; }
has() { grep -q -- "$2" "$1"; } # has FILE TEXT
hasnt() { ! grep -q -- "$2" "$1"; }
same() { cmp -s "$1" "$2"; }
no_such() { [ ! -e "$1" ]; }
at_most() { awk "BEGIN { exit !($1 <= $2) }" </dev/null; } # at_most A B: numbers
refused() { # refused CODE TEXT: exit code, one line on stderr that has the text, nothing on stdout
    check "exit code $code, wanted $1" code_is "$1"
    check "$(lines err) lines on stderr, wanted 1" lines_are err 1
    check "stderr does not say \"$2\"" has err "$2"
    check "something is on stdout" is_empty out
}
