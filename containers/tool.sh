# Sourced by build.sh and image-test.sh: which container tool there is, and the same few verbs for each.
# PNEUNET_CONTAINER_TOOL=podman|docker|buildah chooses one.

image=pneunet
case "$(uname -m)" in aarch64) arch=arm64 ;; *) arch=amd64 ;; esac

# The first tool that works, or nothing. docker may be here without its daemon.
container_tool() {
    local tool
    for tool in ${PNEUNET_CONTAINER_TOOL:-podman docker buildah}; do
        command -v "$tool" >/dev/null || continue
        if [ "$tool" != docker ] || timeout 20 docker version --format '{{.Server.Version}}' >/dev/null 2>&1; then
            echo "$tool"
            return
        fi
    done
}

# buildah works without a daemon, and inside another container with chroot isolation.
export BUILDAH_ISOLATION="${BUILDAH_ISOLATION:-chroot}"

has_image() {
    [ -n "$("$tool" images -q "$1" 2>/dev/null)" ]
}

# import_base TAR NAME: makes an image of a root file system.
import_base() {
    local container
    if [ "$tool" = buildah ]; then
        container="$(buildah from scratch)"
        buildah add -q "$container" "$1" / >/dev/null
        buildah commit -q "$container" "$2" >/dev/null
        buildah rm "$container" >/dev/null
    else
        "$tool" import "$1" "$2" >/dev/null
    fi
}

# build_image BASE CONTEXT NAME REVISION
build_image() {
    local options=(--build-arg "BASE=$1" --build-arg "REVISION=$4" -f "$2/containers/Containerfile" -t "$3")
    local ca="${PIP_CERT:-${SSL_CERT_FILE:-}}"
    [ -z "$ca" ] || options+=(--secret "id=site-ca,src=$ca")
    case "$tool" in
        docker) DOCKER_BUILDKIT=1 docker build "${options[@]}" "$2" ;;
        *) "$tool" build --layers "${options[@]}" "$2" ;;
    esac
}

# in_image DIR COMMAND...: runs a command in the image as who owns DIR, which is seen as /data, without a network.
in_image() {
    local dir="$1" container code=0 pass=()
    shift
    pass=(--user "$(stat -c %u:%g "$dir")")
    # Some processors need to tell OpenBLAS which kernel to use.
    [ -z "${OPENBLAS_CORETYPE:-}" ] || pass+=(-e "OPENBLAS_CORETYPE=$OPENBLAS_CORETYPE")
    if [ "$tool" = buildah ]; then
        container="$(buildah from "$image")"
        buildah run "${pass[@]}" --volume "$dir:/data" "$container" -- "$@" </dev/null || code=$?
        buildah rm "$container" >/dev/null
        return "$code"
    fi
    "$tool" run --rm --network none "${pass[@]}" --volume "$dir:/data" --entrypoint "$1" "$image" "${@:2}" </dev/null
}
