#!/bin/sh
# The C package as a stranger uses it: installed into an empty folder, every header compiled alone from there, and the
# example built with what pkg-config says and run beside a real server. usage: test_c_package.sh PROGRAMS
bin=$(cd "$1" && pwd) # it changes its folder
here=$(cd "$(dirname "$0")" && pwd)
. "$here/rig.sh"
for tool in cc pkg-config cmake; do
    command -v $tool >/dev/null || {
        echo "SKIP all: no $tool"
        exit 77
    }
done
cmake --install "$bin/.." --prefix "$work/usr" --component dev >"$work/install.log" || exit 1
# 16 headers, the library, its .pc, the licence
check "files of the package" "$(find "$work/usr" -type f | wc -l)" == 19
export PKG_CONFIG_PATH="$work/usr/lib/pkgconfig"
flags=$(pkg-config --cflags --libs palpate-client) || exit 1
check "its version is that of the programs" "\"$(pkg-config --modversion palpate-client)\"" == \
    "\"$("$bin/palpate" --version | sed 's/^palpate \([0-9.]*\).*/\1/')\""
cd "$work/usr/include/palpate" || exit 1
for header in $(find . -name '*.h'); do
    echo "#include \"$header\"" | cc -std=c17 -D_GNU_SOURCE -Wall -Wextra -Wpedantic -Werror -I. -fsyntax-only -x c - ||
        check "$header alone" 1 == 0
done
cd "$work" || exit 1
cp "$here/../../clients/link/press.c" .
# shellcheck disable=SC2086
cc -std=c17 -Wall -Wextra -Wpedantic -Werror press.c $flags -o press
check "the example is built" $? == 0

make_scene
start_server --port 0
# a server that pauses for longer than a pose lasts: the pose is sent again
timeout 100 stdbuf -oL ./press "$url" >press.out 2>press.err &
press=$!
while [ "$(wc -l <press.out)" -lt 5 ] && kill -0 $press; do sleep 0.02; done
kill -STOP "$server_pid"
sleep 0.5
kill -CONT "$server_pid"
wait $press
check "the example runs to its end" $? == 0
check "steps" "$(wc -l <press.out)" == 61
check "no force 10 mm above the tissue, N" "$(sed -n 's/^-10.0 mm //p' press.out | cut -d' ' -f1)" == 0
timeout 100 ./press "http://127.0.0.1:$port/?session=none" >none.out 2>none.err
check "a session that is not there is told" $?/"$(grep -c 'press: the server refuses: 4004' none.err)" == 1/1
check "force at 20 mm, N" "$(sed -n 's/^20.0 mm //p' press.out | cut -d' ' -f1)" '>' 0.1
finish
