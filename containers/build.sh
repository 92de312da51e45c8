#!/usr/bin/env bash
# Builds the image `pneunet` with podman, docker or buildah, whichever is there.
# Without a registry to pull Debian from, the base image is made with debootstrap (as root).
#   PNEUNET_BASE             base image (default: Debian 13 from the registry, else debootstrap)
#   PNEUNET_DEBIAN_MIRROR    mirror for debootstrap (default: debootstrap's own)
set -euo pipefail

here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
root="$(dirname "$here")"
. "$here/tool.sh"

say() { printf 'image: %s\n' "$*"; }
die() {
    printf 'image: error: %s\n' "$*" >&2
    exit 1
}

tool="$(container_tool)"
[ -n "$tool" ] || die "none of podman, docker (with its daemon) or buildah is here: apt-get install buildah debootstrap"
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT

registry_base=docker.io/library/debian:trixie-slim
own_base=localhost/pneunet-base:trixie
base="${PNEUNET_BASE:-}"
if [ -z "$base" ]; then
    if has_image "$own_base"; then
        base="$own_base"
    elif has_image "$registry_base" || timeout 120 "$tool" pull -q "$registry_base" >/dev/null 2>&1; then
        base="$registry_base"
    else
        say "no registry to pull Debian 13 from: making the base with debootstrap"
        command -v debootstrap >/dev/null || die "debootstrap is not here: apt-get install debootstrap"
        [ "$(id -u)" = 0 ] || die "debootstrap needs root: run 'make image' as root"
        debootstrap --variant=minbase --arch="$arch" trixie "$scratch/base" ${PNEUNET_DEBIAN_MIRROR:+"$PNEUNET_DEBIAN_MIRROR"} \
            >"$scratch/debootstrap.log" || { tail -n 5 "$scratch/debootstrap.log" >&2; die "debootstrap failed"; }
        rm -rf "$scratch"/base/var/cache/apt/archives/*.deb "$scratch"/base/var/lib/apt/lists/*
        tar -C "$scratch/base" -cf "$scratch/base.tar" --exclude './dev/*' .
        import_base "$scratch/base.tar" "$own_base"
        base="$own_base"
    fi
fi

# The context: what git has or would have, so that .venv and results stay out.
mkdir "$scratch/context"
(cd "$root" && git ls-files -z --cached --others --exclude-standard --deduplicate |
    while IFS= read -r -d '' file; do [ ! -e "$file" ] || printf '%s\0' "$file"; done |
    tar --null -T - -cf -) | tar -C "$scratch/context" -xf -

# There is no history in it, so a file says which revision it is.
revision="$(git -C "$root" describe --always --dirty --abbrev=12)"
echo "$revision" >"$scratch/context/.revision"

say "building with $tool on $base"
# Empty on the first build: buildah ends with an error for an image that it does not know.
previous="$("$tool" images -q "$image" 2>/dev/null | head -n 1 || true)"
build_image "$base" "$scratch/context" "$image" "$revision"
# The image that lost its name to the new one; layers that the new one uses stay.
if [ -n "$previous" ] && [ "$("$tool" images -q "$image" | head -n 1)" != "$previous" ]; then
    "$tool" rmi "$previous" >/dev/null 2>&1 || true
fi
say "done: $image"
