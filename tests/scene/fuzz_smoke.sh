#!/usr/bin/env bash
# Fuzzes the scene loader for a short while, from the seed corpus: enough to notice when a change lets broken files crash
# it. Builds the fuzzer first (preset fuzz).
#
#   tests/scene/fuzz_smoke.sh SECONDS
#
# For a long run keep the corpus: make_fuzz_corpus.py FOLDER, then relief_fuzz_scene_load -dict=... FOLDER.
set -euo pipefail
seconds=$1
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$here/../.."
command -v clang++ >/dev/null || {
  echo "fuzz_smoke: clang++ is missing; scripts/install_dependencies test installs it (clang, libclang-rt-14-dev)" >&2
  exit 1
}

[[ -f build/fuzz/build.ninja ]] || cmake --preset fuzz
cmake --build --preset fuzz --parallel 1

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 "$here/make_fuzz_corpus.py" "$folder/corpus"
# A fixed seed, so that a failure comes again; the input that failed is printed in base64 and can be kept as a test.
build/fuzz/tests/scene/relief_fuzz_scene_load -dict="$here/fuzz_scene_load.dict" -seed=1 -max_total_time="$seconds" \
  -timeout=10 -rss_limit_mb=3000 -print_final_stats=1 -artifact_prefix="$folder/" "$folder/corpus"
