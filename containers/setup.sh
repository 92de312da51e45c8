#!/usr/bin/env bash
# Installs what pneunet needs on Debian 12 or 13: Debian packages, .venv, PyPI packages, pneunet itself.
# As root, or as a user with sudo. What is there already is left alone, so running it again is quick.
#
#   containers/setup.sh          everything
#   containers/setup.sh stack    everything but pneunet itself (a layer of the container image)
set -euo pipefail

here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
root="$(dirname "$here")"
venv="$root/.venv"
python=/usr/bin/python3 # dolfinx is installed for this one; a python3 found first on PATH may be another
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV

say() { printf 'setup: %s\n' "$*"; }
die() {
    printf 'setup: error: %s\n' "$*" >&2
    exit 1
}

check_distribution() {
    local name
    name="$(. /etc/os-release 2>/dev/null && echo "${ID:-unknown} ${VERSION_ID:-}")" || name="unknown system"
    case "$name" in
        "debian 12" | "debian 13") ;;
        *) die "this is ${name% }; pneunet is set up on Debian 12 or 13 only (elsewhere: 'make image', or use Debian in a container)" ;;
    esac
}

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    else
        command -v sudo >/dev/null || die "Debian packages are missing and sudo is not here: run 'make setup' once as root"
        sudo "$@"
    fi
}

install_debian_packages() {
    local wanted missing
    wanted="$(sed 's/#.*//' "$here/apt-packages.txt" | xargs -n1 | sort)"
    missing="$(comm -23 <(echo "$wanted") <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' | sed -n 's/^installed //p' | sort -u))"
    [ -n "$missing" ] || return 0
    say "installing Debian packages:" $missing
    # A source that cannot be read (a third party's, say) is no reason to stop: the install decides.
    as_root apt-get -q update </dev/null || say "warning: apt-get update did not read every source"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300 \
        install --no-install-recommends $missing </dev/null
    changed=1
}

# step NAME FILE... -- COMMAND...: runs COMMAND unless it ran before on the same FILEs.
step() {
    local name="$1" inputs=() key stamp
    shift
    while [ "$1" != -- ]; do
        inputs+=("$1")
        shift
    done
    shift
    stamp="$venv/stamp-$name"
    # The path counts too: a virtual environment cannot be moved.
    key="$({ echo "$venv"; "$python" -V; cat "${inputs[@]}"; } | sha256sum)"
    [ "$(cat "$stamp" 2>/dev/null)" = "$key" ] && return 0
    "$@"
    echo "$key" >"$stamp"
    changed=1
}

install_python_packages() {
    say "making .venv on $("$python" -V) with the packages of containers/requirements.txt"
    rm -rf "$venv"
    "$python" -m venv --system-site-packages "$venv"
    "$venv/bin/python" -m pip install --quiet --no-deps --only-binary :all: --disable-pip-version-check \
        -r "$here/requirements.txt"
    case "$("$venv/bin/python" -c 'import numpy; print(numpy.__file__)')" in
        /usr/lib/*) ;;
        *) die "a numpy other than Debian's would be used in .venv" ;;
    esac
}

install_pneunet() {
    say "installing pneunet into .venv (editable)"
    (cd "$root" && "$venv/bin/python" -m pip install --quiet --no-deps --no-build-isolation --no-index \
        --disable-pip-version-check -e .)
}

changed=
check_distribution
install_debian_packages
step stack "$here/setup.sh" "$here/requirements.txt" -- install_python_packages
[ "${1:-}" = stack ] || step pneunet "$root/pyproject.toml" -- install_pneunet
# What it took, for `make bench ONLY=setup`: one line for each run that installed something.
if [ -n "$changed" ]; then echo "$SECONDS" >>"$venv/setup-seconds"; say "done in $SECONDS s"; else say "everything is there, nothing to install"; fi
