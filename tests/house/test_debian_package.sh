#!/bin/sh
# The Debian packages of a build: what they hold and need, served from where they lie, installed, upgraded, removed and purged in
# a folder of their own, with fakes of the programs that change a system. usage: test_debian_package.sh BUILD
set -u
build=$(cd "$1" && pwd) || exit 2
. "$(dirname "$0")/shell.sh"
for tool in cpack dpkg-deb dpkg-shlibdeps file; do
    command -v $tool >/dev/null || skip all "no $tool"
done
[ -e "$build/share/palpate/viewer/vendor/three.core.min.js" ] || skip all "no packages of the viewer (deploy/common.sh fetches them)"
# files of packages belong to root
[ "$(id -u)" -eq 0 ] || [ -n "${PAL_NAMESPACE-}" ] || ! unshare -r true 2>/dev/null || PAL_NAMESPACE=yes exec unshare -r sh "$0" "$@"
[ "$(id -u)" -eq 0 ] || skip all "not root, and no user namespace"
[ "$skipped" -eq 0 ] || finish || exit

field() { dpkg-deb -f "$1" "$2"; }
starts() { case $1 in "$2"*) ;; *) false ;; esac; }
needs() { field "$1" Depends | tr ',' '\n' | grep -q "^ *$2\( \|\$\)"; } # needs FILE PACKAGE

begin "packs"
# palpate-mpi is palpate again with another library
cpack -G DEB -B "$dir/packs" --config "$build/CPackConfig.cmake" -D CPACK_COMPONENTS_ALL="palpate;service;dev" >out 2>err
check "cpack ends with $?" [ $? -eq 0 ]
main=$(ls "$dir"/packs/palpate_*.deb) dev=$(ls "$dir"/packs/palpate-dev_*.deb)
version=$("$build/bin/palpate" --version | sed 's/^palpate //')
for package in "$dir"/packs/*.deb; do
    check "version of $package" starts "$(field "$package" Version)+" "$version+"
    check "architecture of $package" [ "$(field "$package" Architecture)" = "$(dpkg --print-architecture)" ]
done
end
[ "$failed" -eq 0 ] || finish || exit

begin "needs what the programs link, and what the package config names"
for package in libc6 libwebsockets17 libcjson1 libcholmod3 liblz4-1 liblcm1 libnlopt0 libssl3 zlib1g libopenblas0-pthread adduser; do
    # numbers of sonames are those of the distribution
    stem=$(echo $package | sed 's/[0-9]*$//')
    check "no $package" needs "$main" "${stem}[0-9]*"
done
check "no openssl headers" needs "$dev" libssl-dev
check "MPI for all" [ "$(needs "$main" 'libopenmpi[0-9]*' && echo 1)" = "" ]
end

begin "holds programs, page, examples and documentation, readable for all"
dpkg-deb -c "$main" >list
sed 's/^[^ ]* *[^ ]* *[^ ]* *[^ ]* *[^ ]* \.//' list >names
for path in /usr/bin/palpate /usr/bin/palpate-client /usr/bin/palpate-bridge /usr/bin/palpate-lcm /usr/bin/palpate-relay /usr/lib/systemd/system/palpate.service \
    /usr/share/doc/palpate/README.md /usr/share/doc/palpate/copyright /usr/share/doc/palpate/CHANGELOG.md \
    /usr/share/doc/palpate/examples/haproxy.cfg /usr/share/doc/palpate/examples/batch/shard.sh /usr/share/doc/palpate/examples/demos/chair.orders \
    $(dpkg-deb --info "$main" conffiles); do
    check "no $path" grep -qx "$path" names
done
(cd "$build/share/palpate" && find viewer -type f) | sort >page
sed -n 's,^/usr/share/palpate/\(.*[^/]\)$,\1,p' names | sort >packed
check "the page is another" same page packed
check "not root's" [ "$(grep -vc ' root/root ' list)" -eq 0 ]
check "modes" [ "$(grep -vcE '^(drwxr-xr-x|-rw-r--r--|-rwxr-xr-x) ' list)" -eq 0 ]
check "elsewhere" [ "$(grep -vcE '^/(usr/((bin|lib/systemd/system|share/palpate|share/doc/palpate)/.*)?|usr/(lib|lib/systemd|share|share/doc)/|etc/(palpate/.*)?)$' names)" -eq 0 ]
check "a configuration file is no conffile" [ "$(grep '^/etc/.*[^/]$' names | sort | cksum)" = "$(dpkg-deb --info "$main" conffiles | sort | cksum)" ]
end

# fakes say what they were called with
mkdir fakes root
for program in adduser deluser deb-systemd-helper deb-systemd-invoke systemctl; do
    printf '#!/bin/sh\necho "%s $*" >>%s\n' $program "$dir/calls" >fakes/$program
done
chmod +x fakes/*
mkdir -p root/var/lib/dpkg/info root/var/lib/dpkg/updates root/run/systemd/system root/var/lib/palpate
touch root/var/lib/dpkg/status
package() { # package OPTION...: dpkg in the folder, without the packages that this one needs
    : >calls
    PATH="$dir/fakes:$PATH" dpkg --root="$dir/root" --log="$dir/dpkg.log" --force-depends --force-script-chrootless --force-confold "$@" >out 2>err
    code=$?
}
called() { grep -q "^$1" calls; }
left() { (cd root && find . -path ./var/lib/dpkg -prune -o ! -type d -print) | sed 's,^\./,,' | sort | xargs; }

begin "refuses a processor of other instructions"
dpkg-deb --info "$main" preinst | sed 's/^level=.*/level=x86-64-v9/' >preinst
sh preinst install >out 2>err
code=$?
refused 1 x86-64-v9
end

begin "installs, with a user and a service"
package -i "$main"
check "dpkg ends with $code" code_is 0
check "no user" called 'adduser .*--system .*palpate'
check "not enabled" called 'deb-systemd-helper enable palpate.service'
check "not started" called 'deb-systemd-invoke restart palpate.service'
check "version" [ "$(root/usr/bin/palpate --version)" = "palpate $version" ]
end

begin "serves its scene and page from where it lies"
touch root/var/lib/palpate/session.log
root/usr/bin/palpate ticket --keys root/var/lib/palpate/tickets.keys --new-key --quiet
mkfifo pipe
timeout 100 root/usr/bin/palpate serve root/etc/palpate/scene/scene.json --config root/etc/palpate/palpate.json --port 0 --health 127.0.0.1:0 \
    --keys root/var/lib/palpate/tickets.keys --record "$dir/record.log" --resume --json >pipe 2>err &
server=$!
read -r line <pipe
port=$(echo "$line" | sed 's/.*"port": *\([0-9]*\).*/\1/')
get() { node -e 'fetch(process.argv[1]).then(async r => console.log(r.status, await r.text()), () => console.log("no answer"))' "http://127.0.0.1:$port$1"; }
get / >index
check "no page" grep -q '<title>' index
get /vendor/three.core.min.js >three
check "another three.js" [ "$(cksum <three)" = "$( (printf '200 ' && cat root/usr/share/palpate/viewer/vendor/three.core.min.js && echo) | cksum)" ]
get /sessions >sessions
check "another session" grep -q '"name":"chair"' sessions
kill $server
wait $server
check "ends with $?" [ $? -eq 0 ]
end

if command -v systemd-analyze >/dev/null; then
    begin "its unit is sound"
    sed "s,/usr/bin/palpate,$dir/root&," root/usr/lib/systemd/system/palpate.service >palpate.service
    systemd-analyze verify ./palpate.service >out 2>err
    grep palpate err >stated
    check "systemd-analyze says $(cat stated)" is_empty stated
    end
else
    skip "its unit is sound" "no systemd-analyze"
fi

begin "an upgrade leaves what the administrator has changed"
echo '{"port": 8095}' >root/etc/palpate/palpate.json
package -i "$main"
check "dpkg ends with $code" code_is 0
check "configuration" has root/etc/palpate/palpate.json 8095
check "stopped for good" [ "$(called 'deb-systemd-helper mask' && echo 1)" = "" ]
end

begin "a removal stops the service and leaves configuration and data"
package -r palpate
check "dpkg ends with $code" code_is 0
check "not stopped" called 'deb-systemd-invoke stop palpate.service'
check "user removed" [ "$(called deluser && echo 1)" = "" ]
check "files" [ "$(left)" = "etc/palpate/palpate.json etc/palpate/scene/chair.palcells etc/palpate/scene/scene.json \
var/lib/palpate/session.log var/lib/palpate/tickets.keys" ]
end

begin "a purge leaves nothing but recordings, and their user"
package -P palpate
check "dpkg ends with $code" code_is 0
check "files" [ "$(left)" = var/lib/palpate/session.log ]
check "folders" no_such root/usr
check "user" [ "$(called deluser && echo 1)" = "" ]
package -i "$main"
rm root/var/lib/palpate/session.log
package -P palpate
check "folder of data" no_such root/var/lib/palpate
check "user stays without data" called 'deluser .*palpate'
end
finish
