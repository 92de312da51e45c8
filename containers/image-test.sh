#!/usr/bin/env bash
# Tests the image `pneunet`, as somebody whom it does not know: doctor, mpirun, one finite element case on 2 ranks
# against the same case on this machine (to 1e-6), and all tests, or those that PNEUNET_IMAGE_TESTS names. What it
# leaves in out/image-test is what `make bench ONLY=image` reads.
set -euo pipefail

here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
root="$(dirname "$here")"
. "$here/tool.sh"
tool="$(container_tool)"
has_image "$image" || { echo "image-test: error: no image here, run 'make image' first" >&2; exit 1; }

out="$root/out/image-test"
rm -rf "$out"
mkdir -p "$out"
# Root may be anybody; others are who they are.
[ "$(id -u)" != 0 ] || chown 4711:4711 "$out"
cd "$root"
say() { printf '\nimage-test: %s\n' "$*"; }
case=pneunet.hifi.verification.reference_case

say "doctor in the image"
in_image "$out" pneunet doctor

say "the reference case on 2 ranks, in the image and here"
in_image "$out" mpirun -n 2 python -m "$case" /data/image.json
.venv/bin/pneunet run -n 2 -- python -m "$case" "$out/native.json" "$out/image.json"

say "whose the results are"
[ "$(stat -c %u:%g "$out/image.json")" = "$(stat -c %u:%g "$out")" ]

tests="${PNEUNET_IMAGE_TESTS:-tests}"
say "$tests in the image"
in_image "$out" sh -c "cd /opt/pneunet &&
    python -m pytest -q -p no:cacheprovider -n 2 --dist worksteal --junitxml /data/tests.xml $tests"
say "passed"
