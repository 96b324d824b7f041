#!/usr/bin/env bash
# Builds everything and runs the tests, apart from those labelled slow.
# Usage: scripts/test.sh [--slow] [OPTIONS of ctest]    --slow: only the slow ones
set -euo pipefail
cd "$(dirname "$0")/.."
which=(-LE '^slow$')
if [ "${1:-}" = --slow ]; then
  which=(-L '^slow$')
  shift
fi
scripts/setup.sh
cmake --preset release
cmake --build --preset release
ctest --test-dir build --output-on-failure --no-tests=error -j "$(nproc)" "${which[@]}" "$@"
