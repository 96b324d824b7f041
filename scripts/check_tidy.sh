#!/usr/bin/env bash
# clang-tidy over all libraries and commands with the list of .clang-tidy; any finding fails. It reads the unity
# sources of a build of its own that is only configured, so that every header is parsed once for several files.
# Usage: scripts/check_tidy.sh [PATTERN]   only the unity sources whose path matches, e.g. align
set -euo pipefail
cd "$(dirname "$0")/.."
cmake --preset tidy >/dev/null
pattern=${1:-.}
mapfile -t sources < <(sed -nE 's/^ *"file": "(.*)",?$/\1/p' build-tidy/compile_commands.json |
  grep -v '/tests/\|_page[.]cc$\|precompiled[.]cc$' | grep -E -- "$pattern")
printf '%s\n' "${sources[@]}" |
  xargs -P "$(nproc)" -n 1 clang-tidy -p build-tidy --quiet --warnings-as-errors='*' 2>/dev/null
echo "check_tidy: ${#sources[@]} sources, no finding."
