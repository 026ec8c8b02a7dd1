#!/usr/bin/env bash
# Renders a small scene on an emulated CPU without AVX and compares the picture with the one this machine makes. An
# instruction that leaked from a kernel of a wider instruction set into common code ends the emulated run with SIGILL.
#
#   tests/cli/baseline_cpu.sh RELIEF
set -euo pipefail
relief=$1
make_examples=$(dirname "${BASH_SOURCE[0]}")/../../scripts/make_examples

# Intel's Core 2: x86-64 with SSSE3, and nothing after it.
cpu=core2duo
command -v qemu-x86_64 >/dev/null || {
  echo "baseline_cpu: qemu-x86_64 is missing; scripts/install_dependencies test installs it (package qemu-user)" >&2
  exit 1
}

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$make_examples" cornell --output "$folder"
scene=$folder/cornell/cornell.gltf
options=(--resolution 32x32 --spp 16 --seed 1 --threads 1 --progress none)
"$relief" render "$scene" "${options[@]}" -o "$folder/native.exr"
qemu-x86_64 -cpu "$cpu" "$relief" render "$scene" "${options[@]}" -o "$folder/baseline.exr" --stats "$folder/stats.json"
grep -q '"isa": *"baseline"' "$folder/stats.json" || {
  echo "baseline_cpu: the emulated run did not choose the baseline kernels:" >&2
  cat "$folder/stats.json" >&2
  exit 1
}
"$relief" compare "$folder/native.exr" "$folder/baseline.exr" --max-rmse 0.01
