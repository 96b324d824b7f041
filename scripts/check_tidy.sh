#!/usr/bin/env bash
# clang-tidy over libraries and commands with the list of .clang-tidy; any finding fails. It reads the unity sources of
# a build of its own that is only configured, so that every header is parsed once for several files.
# Usage: scripts/check_tidy.sh [PATTERN]        all unity sources, or those whose path matches, e.g. align
#        scripts/check_tidy.sh --since '6 hours'  those with files that commits of the last six hours changed: the gate
set -euo pipefail
cd "$(dirname "$0")/.."

# The sources to read for what was changed within $1 before the last commit, or since it; fails when that is everything.
changed_sources() {
  local last base changed
  last=$(git log -1 --format=%cI 2>/dev/null) || return 1
  base=$(git rev-list -1 --before="$(date -u -d "$last $1 ago" +%FT%TZ)" HEAD)
  [ -n "$base" ] || return 1
  changed=$(git diff --name-only --diff-filter=d "$base")
  grep -qx '[.]clang-tidy\|scripts/check_tidy.sh' <<<"$changed" && return 1
  while read -r file; do
    case $file in
    tests/*) ;;
    *.cc) echo "$file" ;;
    *.h) # its own source, or one that includes it
      if [ -e "${file%.h}.cc" ]; then
        echo "${file%.h}.cc"
      else
        git grep -lF "\"$file\"" -- '*.cc' ':!tests' | head -n 1
      fi
      ;;
    esac
  done <<<"$changed"
}

# What it finds goes to stdout; its stderr, which is counts and warnings of the build's flags, is thrown away below.
command -v clang-tidy >/dev/null || { echo "check_tidy: clang-tidy is not there: scripts/setup.sh" >&2; exit 1; }
cmake --preset tidy >/dev/null
mapfile -t sources < <(sed -nE 's/^ *"file": "(.*)",?$/\1/p' build-tidy/compile_commands.json |
  grep -v '/tests/\|_page[.]cc$\|precompiled[.]cc$')
if [ "${1:-}" = --since ]; then
  if changed=$(changed_sources "$2"); then
    mapfile -t sources < <(printf '%s\n' "${sources[@]}" | xargs grep -lF "${changed:-no source}" || true)
  fi
elif [ $# -gt 0 ]; then
  mapfile -t sources < <(printf '%s\n' "${sources[@]}" | grep -E -- "$1" || true)
fi
if [ ${#sources[@]} -gt 0 ]; then
  printf '%s\n' "${sources[@]}" |
    xargs -P "$(nproc)" -n 1 clang-tidy -p build-tidy --quiet --warnings-as-errors='*' 2>/dev/null
fi
echo "check_tidy: ${#sources[@]} sources, no finding."
