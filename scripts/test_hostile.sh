#!/usr/bin/env bash
# What a hostile or unlucky user does to every command (tests/hostile): all tables, one line per case and a count.
# Usage: scripts/test_hostile.sh [-R TABLE]    renames alone takes 25 minutes, ends 11; before a release.
set -euo pipefail
cd "$(dirname "$0")/.."
cmake --preset release >/dev/null
cmake --build --preset release
ctest --test-dir build -R '^hostile_' --output-on-failure --no-tests=error "$@"
