#!/usr/bin/env bash
# Builds everything and runs the whole test suite. Arguments go to ctest, e.g. -L unit.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
cmake --preset release
cmake --build --preset release
ctest --test-dir build --output-on-failure -j "$(nproc)" "$@"
