#!/usr/bin/env bash
# What reads files that somebody else wrote, under the address and undefined behaviour sanitizers: the unit tests of
# core, importers, colmap_ext and picks, and the fuzz corpora.
# Usage: scripts/test_sanitized.sh [--all | TEST...]    --all: the unit tests of all folders and the corpora of their
# readers, before a release; hours of two cores: every alignment takes minutes here
set -euo pipefail
cd "$(dirname "$0")/.."
tests=(colmap_ext_test core_test importers_test align_clicks_test)
corpora=(alignment_record camera database e57 e57_images http_request las photo picks project_file scan_poses
  scan_reader sparse_model)
if [ "${1:-}" = --all ]; then
  # These need align, texture, view, building and workflow built: minutes, to read a few small files.
  corpora+=(associations colored_ply glb outline pick_json result_files room_files)
  mapfile -t tests < <(sed -n '/LABEL/d; s/^ *roomtex_test(\([a-z_]\+\).*/\1/p' tests/*/CMakeLists.txt)
elif [ $# -gt 0 ]; then
  tests=("$@")
fi
# Repeated over and over for a statistic, up to half a minute each here, and tests of a command that is not built here.
left_out='ModelCheck.*:LensCheck.*:Initializer.IsRightBeforeAWall:LensPose.AWrongPickIsFoundWithTheLens'
left_out+=':PickReview.NamesTheOneBadPickAmong*:PickReview.Keeps*:PickReview.NamesExchangedPicks'
left_out+=':PickReview.RecognisesAMirroredScan:PairsCommand.*'
export GTEST_FILTER="-$left_out"
cmake --preset asan >/dev/null
cmake --build --preset asan --target "${tests[@]}" "${corpora[@]/%/_replay}" roomtex-import
# Readers must refuse what does not fit into memory: an allocation that fails is theirs to handle.
export ASAN_OPTIONS=allocator_may_return_null=1 UBSAN_OPTIONS=print_stacktrace=1

run() {
  local log=build-asan/$1.log
  if build-asan/bin/"$@" >"$log" 2>&1; then
    echo "$1: $(tail -n 1 "$log")"
  else
    tail -n 60 "$log"
    echo "$1: FAILED"
    return 1
  fi
}
export -f run
{
  printf '%s\n' "${tests[@]}"
  for corpus in "${corpora[@]}"; do echo "${corpus}_replay tests/fuzz/corpus/$corpus"; done
} | xargs -P "$(nproc)" -I{} bash -c 'run {}'
