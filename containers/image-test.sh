#!/usr/bin/env bash
# Tests the image `pneunet`: doctor, one finite element case on 2 ranks against the same case on this
# machine (to 1e-6), and the command line's tests.
set -euo pipefail

here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
root="$(dirname "$here")"
. "$here/tool.sh"
tool="$(container_tool)"
has_image "$image" || { echo "image-test: error: no image here, run 'make image' first" >&2; exit 1; }

out="$root/out/image-test"
rm -rf "$out"
mkdir -p "$out"
cd "$root"
say() { printf '\nimage-test: %s\n' "$*"; }

say "doctor in the image"
in_image "$out" pneunet doctor

say "the reference case on 2 ranks, in the image and here"
in_image "$out" sh -c 'cd /opt/pneunet && pneunet run -n 2 -- python -m pneunet.hifi.verification.reference_case /data/image.json'
.venv/bin/pneunet run -n 2 -- python -m pneunet.hifi.verification.reference_case "$out/native.json"
.venv/bin/python containers/compare.py "$out/native.json" "$out/image.json" --rtol 1e-6

say "tests of the command line in the image"
in_image "$out" sh -c 'cd /opt/pneunet && python -m pytest -q -p no:cacheprovider -n 2 --dist loadfile tests/pneunet'
say "passed"
