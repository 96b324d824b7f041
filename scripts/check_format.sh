#!/usr/bin/env bash
# Every C++ file as clang-format leaves it. Usage: scripts/check_format.sh [--fix]
set -euo pipefail
cd "$(dirname "$0")/.."
mode=(--dry-run -Werror)
[ "${1:-}" = --fix ] && mode=(-i)
git ls-files --cached --others --exclude-standard '*.cc' '*.h' | xargs -P "$(nproc)" -n 32 clang-format "${mode[@]}"
