# Sourced by the programs of ci/: where things are, and how they speak. Defines; does nothing by itself.

repo="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
target="${CARGO_TARGET_DIR:-$repo/target}"

# A toolchain that rustup put into the home directory is used even if the shell has not been told of it.
[ -d "${CARGO_HOME:-$HOME/.cargo}/bin" ] && PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
export PATH CARGO_TERM_COLOR="${CARGO_TERM_COLOR:-never}"

# OpenMPI refuses root and more ranks than cores unless told otherwise; both are what a container and a
# 64-rank test on 2 cores are.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1

# say WHAT...: what is being done, with the seconds since the start, so that a log shows where time went.
say() { printf '[%4ds] %s: %s\n' "$SECONDS" "$(basename "$0")" "$*"; }

# fail CODE WHAT...: one sentence, and out. 2 the caller's input, 3 something missing.
fail() {
    local code="$1"
    shift
    printf '%s: %s\n' "$(basename "$0")" "$*" >&2
    exit "$code"
}
