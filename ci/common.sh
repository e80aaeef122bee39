# shellcheck shell=bash disable=SC2034  # the scripts that source this file use the variables
# Sourced by the scripts of ci/: paths, environment and messages. With --help among the arguments, it prints the head of the script and
# ends; otherwise sourcing it runs no program.

# usage: prints the comment at the head of the script.
usage() { sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//;p}' "$0"; }
case " $* " in *" --help "* | *" -h "*)
    usage
    exit 0
    ;;
esac

repo="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
target="${CARGO_TARGET_DIR:-$repo/target}"

# rustup installs into the home directory, which may not be on the PATH of the current shell.
[ -d "${CARGO_HOME:-$HOME/.cargo}/bin" ] && PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
export PATH CARGO_TERM_COLOR="${CARGO_TERM_COLOR:-never}"

# The profile of cargo, and its programs. `dev` is optimised and asserts, and tests and programs share it: .ci/run compiles once.
profile="${CI_PROFILE:-release}"
case "$profile" in dev) programs="$target/debug" ;; *) programs="$target/$profile" ;; esac

# By default OpenMPI refuses to run as root, as containers do, and to run more ranks than cores, as a test of
# 64 ranks on 2 cores does.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1

# log MESSAGE...: prints the current step and the seconds since the start, so that a log shows the time of each step.
log() { printf '[%4ds] %s: %s\n' "$SECONDS" "$(basename "$0")" "$*"; }

# step NAME COMMAND...: runs COMMAND, and names the step if it fails. What it cost goes to the file CI_COSTS, if that is set: wall time
# and CPU time in seconds, and the name.
step() {
    local name="$1" code spent TIMEFORMAT='%R %U %S'
    shift
    log "$name"
    # In a shell of its own, which -e or `fail` may end. `||` would switch -e off, also after a call of this function.
    set +e
    { spent="$({ time { (set -e; "$@") >&4 2>&3; }; } 2>&1)"; code=$?; } 3>&2 4>&1
    set -e
    [ -z "${CI_COSTS:-}" ] || awk -v name="$name" 'END { printf "%6.0f s %6.0f s  %s\n", $1, $2 + $3, name }' <<<"$spent" >>"$CI_COSTS"
    [ "$code" = 0 ] || fail "$code" "failed: $name"
}

# background COMMAND...: runs it beside the script, in a process group of its own, with which end_background also ends what it started.
background() {
    set -m
    "$@" </dev/null &
    set +m
}
end_background() {
    local group
    for group in $(jobs -p); do kill -- "-$group" 2>/dev/null || true; done
}

# build_programs: all programs. Those of the profile `dev` are made with the tests: alone, crates would be compiled again without what
# only tests use.
build_programs() {
    local features=()
    if command -v mpicc >/dev/null; then features=(--features mesher/mpi); fi
    case "$profile" in
    dev) cargo test --quiet --workspace "${features[@]}" --no-run ;;
    *) cargo build --quiet --profile "$profile" --workspace "${features[@]}" ;;
    esac
}

# build_static PACKAGE...: programs without MPI that need no library, so they run on every Linux of this processor, whatever its age.
# Sets `programs` to where they are.
build_static() {
    local host
    host="$(rustc -vV | sed -n 's/^host: //p')"
    # With --target, the flag does not reach macros and build scripts, which are libraries that the compiler loads.
    RUSTFLAGS="-C target-feature=+crt-static" cargo build --quiet --locked --profile "$profile" --target "$host" "${@/#/--package=}"
    programs="$target/$host/$(basename "$programs")"
}

# fail CODE MESSAGE...: prints one sentence and exits with CODE: 2 for invalid input, 3 if something is missing.
fail() {
    local code="$1"
    shift
    printf '%s: %s\n' "$(basename "$0")" "$*" >&2
    exit "$code"
}

# as_root COMMAND...: runs COMMAND as root, through sudo if necessary.
as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail 3 "\"$*\" requires root and sudo is not installed: run this script as root"
    fi
}

# Fetches the package lists, at most once and only if something is missing.
apt_updated=0
apt_update() {
    [ "$apt_updated" = 0 ] || return 0
    command -v apt-get >/dev/null || fail 3 "this machine has no apt-get: install these packages by hand: $*"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq update ||
        fail 3 "apt-get update failed: check the network and the Debian mirror"
    apt_updated=1
}

apt_install() {
    apt_update "$@"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 install -y \
        --no-install-recommends "$@" >/dev/null ||
        fail 3 "these packages could not be installed: $*"
}

is_installed() {
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

# install_packages PACKAGE...: installs those Debian packages that are not installed.
install_packages() {
    local package missing=()
    for package in "$@"; do
        is_installed "$package" || missing+=("$package")
    done
    if [ "${#missing[@]}" = 0 ]; then
        log "Debian packages: all installed"
        return
    fi
    log "Debian packages: installing ${missing[*]}"
    apt_install "${missing[@]}"
}

# pip and uv bring their own certificates; those of the system may include the certificate of a proxy.
use_system_certificates() {
    local certificates=/etc/ssl/certs/ca-certificates.crt
    if [ -f "$certificates" ]; then
        export PIP_CERT="${PIP_CERT:-$certificates}" UV_NATIVE_TLS="${UV_NATIVE_TLS:-1}"
    fi
}
