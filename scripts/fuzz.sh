#!/usr/bin/env bash
# Every libFuzzer target with its corpus, 10^6 runs each or as many as are given; needs clang. Findings lie in build-fuzz/.
# Usage: scripts/fuzz.sh [RUNS] [TARGET...]
set -euo pipefail
cd "$(dirname "$0")/.."
# Targets write files over and over: in memory where that is possible.
[ -w /dev/shm ] && export TMPDIR=${TMPDIR:-/dev/shm}
runs=${1:-1000000}
targets=("${@:2}")
if [ ${#targets[@]} = 0 ]; then
  for file in tests/fuzz/*_fuzz.cc; do targets+=("$(basename "$file" _fuzz.cc)"); done
fi
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz --target "${targets[@]/%/_fuzz}"
for target in "${targets[@]}"; do
  mkdir -p "build-fuzz/corpus/$target"
  printf '\n== %s\n' "$target"
  build-fuzz/bin/"${target}"_fuzz -runs="$runs" -max_len=4096 -timeout=20 -rss_limit_mb=4096 -close_fd_mask=1 \
    -artifact_prefix="build-fuzz/$target-" "build-fuzz/corpus/$target" "tests/fuzz/corpus/$target"
done
