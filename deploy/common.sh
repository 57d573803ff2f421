# Shared by run.sh and test.sh: folders, packages, build. Sourced, not run.
tree=$(cd "$(dirname "$0")/.." && pwd) || exit 1
build=${PALPATE_BUILD:-$tree/build}
tests=${PALPATE_TESTS:-OFF}
unset PALPATE_BUILD PALPATE_TESTS # the server takes PALPATE_* for its configuration

message() { echo "palpate: $*" >&2; }
fail() {
    echo "palpate: $*" >&2
    exit 1
}

# PACKAGE HOW: is the package of a line of packages.txt installed?
have() {
    case $2 in
    cmd:*) command -v "${2#cmd:}" >/dev/null 2>&1 ;;
    file:*) [ -e "${2#file:}" ] ;;
    *) dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q 'ok installed' ;;
    esac
}

missing() { # WHO...: packages that are not installed
    while read -r package who how; do
        case $package in '' | '#'*) continue ;; esac
        for wanted in "$@"; do
            [ "$who" = "$wanted" ] && ! have "$package" "$how" && echo "$package"
        done
    done <"$tree/deploy/packages.txt"
    return 0
}

install_missing() { # WHO...: on failure one line with the reason, and 1
    list=$(missing "$@" | tr '\n' ' ')
    [ -z "$list" ] && return 0
    if ! command -v apt-get >/dev/null 2>&1; then
        message "missing: ${list}- install them with the package manager of your system (this script uses apt-get)"
        return 1
    fi
    as_root=
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null 2>&1; then
            message "missing: ${list}- run as root: apt-get install $list"
            return 1
        fi
        as_root=sudo
    fi
    message "installing: $list"
    mkdir -p "$build"
    if ! { $as_root apt-get update -q && $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $list; } >"$build/install.log" 2>&1 ||
        [ -n "$(missing "$@")" ]; then
        message "could not install: $(missing "$@" | tr '\n' ' ')- see $build/install.log"
        return 1
    fi
}

build_release() { # FOLDER [cmake options]: a folder of the build folder; prints the log only when it fails
    folder=$build/$1
    shift
    mkdir -p "$build"
    log=$build/build.log
    if ! cmake -S "$tree" -B "$folder" -G Ninja -D PAL_PRESET=release -D PAL_VIEWER_PACKAGES="$build/viewer_packages" "$@" >"$log" 2>&1 ||
        ! cmake --build "$folder" >>"$log" 2>&1; then
        tail -n 30 "$log" >&2
        fail "the build failed, see $log"
    fi
}

# three.js for the viewer, by the lock file, into the build folder; no download when it is up to date
fetch_viewer() {
    from=$tree/clients/viewer to=$build/viewer_packages
    if [ -e "$to/node_modules/three/build/three.module.js" ] && cmp -s "$from/package-lock.json" "$to/package-lock.json"; then
        return 0
    fi
    message "downloading the packages of the viewer"
    mkdir -p "$to"
    cp "$from/package.json" "$from/package-lock.json" "$to/" || return 1
    (cd "$to" && npm ci --no-audit --no-fund --loglevel=error --fetch-retries=2 --fetch-timeout=60000) >"$build/npm.log" 2>&1
}

# Prometheus for the test of the dashboard, unpacked into the build folder: Debian's package starts a service when it is installed
fetch_prometheus() {
    ! command -v prometheus >/dev/null 2>&1 && [ ! -x "$build/prometheus/usr/bin/prometheus" ] || return 0
    message "downloading prometheus"
    mkdir -p "$build" || return 1
    (cd "$build" && apt-get download -q prometheus && dpkg -x prometheus_*.deb prometheus && rm prometheus_*.deb) >"$build/prometheus.log" 2>&1
}
