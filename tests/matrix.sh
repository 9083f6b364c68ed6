#!/usr/bin/env bash
# `make test-all` on every supported Debian, each in a throw-away root folder; a table of versions and results.
#
#   make matrix                                  bookworm, trixie and sid, all tests
#   SUITES=sid make matrix                       some of them
#   MATRIX_TARGET=test make matrix               another target of make, here without the slow tests
#   MATRIX_TESTS="tests/form/test_forms.py" ...       some of pytest's files (cargo's tests run always)
#   MATRIX_ROOT=/var/tmp ...                     where the root folders are made
#   MATRIX_MINUTES=90 ...                        time limit of each run of make
#   MATRIX_MIRROR=URL ...                        Debian's mirror; by default that of the host's apt
#
# The present commit is cloned, without changes that are not committed. Mounts are in a separate
# namespace and end with it; the folder is removed in every case.
set -euo pipefail

say() { printf 'matrix: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

repository=$(cd "$(dirname "$0")/.." && pwd)
results=${MATRIX_RESULTS:-$repository/results/matrix}
minutes=${MATRIX_MINUTES:-90}
target=${MATRIX_TARGET:-test-all}

# -- inside a suite's root ---------------------------------------------------

# Mounts, then the command in the root, with no stdin: called in namespaces of its own.
enter() {
    local root=$1
    shift
    mount -t proc proc "$root/proc"
    mount --rbind /dev "$root/dev"
    mount --rbind /sys "$root/sys" # MPI looks for processors and network devices there
    mount -t tmpfs tmpfs "$root/tmp"
    if [ -d "$root/opt/rust" ]; then
        mount --bind "$MATRIX_RUST" "$root/opt/rust"
        mount -o remount,bind,ro "$root/opt/rust"
    fi
    local kept=()
    while IFS= read -r variable; do kept+=("$variable"); done < <(
        env | grep -E '^((https?|ftp|all|no)_proxy|(HTTPS?|FTP|ALL|NO)_PROXY|SSL_CERT_(FILE|DIR)|[A-Z]+_CA_BUNDLE|PIP_(INDEX_URL|EXTRA_INDEX_URL|CERT|TRUSTED_HOST|DEFAULT_TIMEOUT|RETRIES)|CARGO_(HTTP|NET|REGISTRIES|SOURCE)_[A-Z_]*)='
    )
    exec chroot "$root" /usr/bin/env -i "${kept[@]}" HOME=/root LC_ALL=C.UTF-8 TERM=dumb \
        PATH=/opt/rust/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@" </dev/null
}
if [ "${1:-}" = --enter ]; then
    shift
    enter "$@"
fi

# root command ...: ends with all processes of the command. The first process of the namespace is a shell,
# because orphans become its children: for some programs a parent with number 1 means that theirs has ended.
within() {
    local root=$1
    shift
    # shellcheck disable=SC2016 # the shell inside fills it in, and does not replace itself by the command
    unshare --mount --propagation private --pid --fork --kill-child "$0" --enter "$root" \
        /bin/sh -c '"$@"; exit "$?"' sh "$@"
}

# -- requirements ------------------------------------------------------------

[ "$(id -u)" = 0 ] || die "root is needed to make root folders: run 'sudo make matrix'"
for tool in debootstrap unshare git; do
    command -v "$tool" >/dev/null || die "$tool was not found: run 'apt-get install debootstrap util-linux git' as root"
done
read -r -a suites <<<"${SUITES:-bookworm trixie sid}"
for suite in "${suites[@]}"; do
    case $suite in
    bookworm | trixie | sid) ;;
    *) die "SUITES holds '$suite': expected bookworm, trixie or sid" ;;
    esac
done
[[ $minutes =~ ^[1-9][0-9]*$ ]] || die "MATRIX_MINUTES=$minutes: expected a whole number of minutes"
# shellcheck disable=SC2016 # apt fills it in
mirror=${MATRIX_MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' \
    'Created-By: Packages' 'Origin: Debian' 'Label: Debian' 2>/dev/null | sort -u | head -n 1)}
[ -n "$mirror" ] || die "apt knows no mirror of Debian: run 'apt-get update', or set MATRIX_MIRROR"
rust=$(rustc --print sysroot 2>/dev/null || true)
[ "$rust" != /usr ] || rust=
export MATRIX_RUST=$rust

mkdir -p "$results"
commit=$(git -C "$repository" rev-parse HEAD)
[ -z "$(git -C "$repository" status --porcelain)" ] ||
    say "what is not committed is not part of it: the commit $commit is tested"
base=$(mktemp -d "${MATRIX_ROOT:-${TMPDIR:-/tmp}}/tawami-matrix.XXXXXX")
running=

# shellcheck disable=SC2317 # called by the traps
cleanup() {
    local status=$?
    trap - EXIT INT TERM HUP
    if [ -n "$running" ]; then
        # unshare ignores SIGTERM while it waits; its end is that of its namespace
        kill -KILL -- "-$running" 2>/dev/null || true
        wait "$running" 2>/dev/null || true
    fi
    # nothing that is mounted is ever removed
    if grep -qF " $base" /proc/self/mounts; then
        awk -v base="$base" 'index($2, base) == 1 { print $2 }' /proc/self/mounts | sort -r |
            while IFS= read -r place; do umount -l "$place" || true; done
    fi
    rm -rf --one-file-system "$base"
    exit "$status"
}
trap cleanup EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

# -- one suite ---------------------------------------------------------------

prepare() { # suite root
    local suite=$1 root=$2
    unshare --mount --propagation private debootstrap --variant=minbase \
        --include=ca-certificates,make,git "$suite" "$root" "$mirror" </dev/null || return
    # apt, pip and cargo inside reach what they reach outside
    apt-config dump | grep -E '^Acquire::(https?|Retries|Check-Valid-Until)' >"$root/etc/apt/apt.conf.d/90host" || true
    for file in /etc/resolv.conf /etc/hosts /etc/pip.conf; do
        [ ! -e "$file" ] || cp -L "$file" "$root$file"
    done
    if compgen -G '/usr/local/share/ca-certificates/*.crt' >/dev/null; then
        cp -L /usr/local/share/ca-certificates/*.crt "$root/usr/local/share/ca-certificates/"
        within "$root" update-ca-certificates || return
    fi
    # Open MPI 5 warns where it finds no way through the network, and these ranks need none
    mkdir -p "$root/root/.openmpi"
    echo 'btl_tcp_if_include = lo' >"$root/root/.openmpi/mca-params.conf"
    if [ -n "$rust" ]; then
        mkdir -p "$root/opt/rust" "$root/root/.cargo"
        [ ! -e "${CARGO_HOME:-$HOME/.cargo}/config.toml" ] ||
            cp -L "${CARGO_HOME:-$HOME/.cargo}/config.toml" "$root/root/.cargo/"
    else # Debian's own, which make refuses where it is too old
        within "$root" sh -c 'apt-get update -qq && apt-get install -qq -y cargo' || return
    fi
    git clone --quiet --no-hardlinks "$repository" "$root/opt/tawami" || return
    git -C "$root/opt/tawami" checkout --quiet --detach "$commit"
}

versions='
import dolfinx, sys
from petsc4py import PETSc
print(dolfinx.__version__, ".".join(map(str, PETSc.Sys.getVersion())), ".".join(map(str, sys.version_info[:3])))
'

counted() { # pattern log: sum over cargo's 'N passed; M failed' and pytest's 'M failed, N passed in 9.9s'
    { grep -aE '^test result:|(passed|failed|errors?)\>.* in [0-9.]+s' "$2" | grep -oE "[0-9]+ $1" || true; } |
        awk '{ n += $1 } END { print n + 0 }'
}

try_suite() { # suite: writes its log, and its row of the table beside it
    local suite=$1 root=$base/$1 log=$results/$1.log start=$SECONDS status=0 found
    {
        prepare "$suite" "$root" &&
            within "$root" timeout --kill-after=30 $((60 * minutes)) \
                make -C /opt/tawami "$target" TESTS="${MATRIX_TESTS:-}"
    } >"$log" 2>&1 || status=$?
    [ "$status" != 124 ] || echo "make $target was ended after $minutes minutes" >>"$log"
    found=$(within "$root" /opt/tawami/.venv/bin/python -c "$versions" 2>/dev/null) || found='- - -'
    local passed failed
    passed=$(counted passed "$log")
    failed=$(counted '(failed|error)' "$log")
    local verdict="$passed passed, $failed failed"
    [ "$status" = 0 ] || [ "$failed" != 0 ] || verdict="$verdict; ended with $status"
    read -r dolfinx petsc python <<<"$found"
    printf '| %s | %s | %s | %s | %s | %d |\n' "$suite" "$dolfinx" "$petsc" "$python" "$verdict" \
        $(((SECONDS - start + 30) / 60)) >"$results/$suite.row"
    rm -rf --one-file-system "$root"
    return "$status"
}

set -m # each suite is a process group, which ends as a whole
bad=0
for suite in "${suites[@]}"; do
    say "$suite: $results/$suite.log"
    try_suite "$suite" & # a child, so that Ctrl-C is answered at once
    running=$!
    if ! wait "$running"; then
        bad=1
        say "$suite failed; the end of its log:"
        tail -n 15 "$results/$suite.log" >&2
    fi
    running=
done
{
    echo '| Debian | dolfinx | PETSc | Python | tests | minutes |'
    echo '| --- | --- | --- | --- | --- | --- |'
    for suite in "${suites[@]}"; do cat "$results/$suite.row"; done
} | tee "$results/table.md"
exit "$bad"
