#!/usr/bin/env bash
# Runs the tests that are quick with address and undefined-behaviour sanitizers (tests/CMakeLists.txt lists them). Builds them first
# (preset fuzz).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
[[ -f build/fuzz/build.ninja ]] || cmake --preset fuzz
cmake --build --preset fuzz --parallel 1 --target relief_sanitized_tests

export ASAN_OPTIONS=detect_stack_use_after_return=1:check_initialization_order=1:strict_init_order=1
export UBSAN_OPTIONS=print_stacktrace=1
while read -r program; do
  "$program" --gtest_brief=1 < /dev/null
done < build/fuzz/sanitized_tests.txt
