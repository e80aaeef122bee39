# shellcheck shell=bash disable=SC2034  # the scripts that source this file use the variables
# Sourced by the scripts of ci/: paths, environment and messages. Sourcing it runs no program.

repo="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
target="${CARGO_TARGET_DIR:-$repo/target}"

# rustup installs into the home directory, which may not be on the PATH of the current shell.
[ -d "${CARGO_HOME:-$HOME/.cargo}/bin" ] && PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
export PATH CARGO_TERM_COLOR="${CARGO_TERM_COLOR:-never}"

# By default OpenMPI refuses to run as root, as containers do, and to run more ranks than cores, as a test of
# 64 ranks on 2 cores does.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1

# log MESSAGE...: prints the current step and the seconds since the start, so that a log shows the time of each step.
log() { printf '[%4ds] %s: %s\n' "$SECONDS" "$(basename "$0")" "$*"; }

# fail CODE MESSAGE...: prints one sentence and exits with CODE: 2 for invalid input, 3 if something is missing.
fail() {
    local code="$1"
    shift
    printf '%s: %s\n' "$(basename "$0")" "$*" >&2
    exit "$code"
}
