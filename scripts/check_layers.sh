#!/usr/bin/env bash
# No folder includes upward or sideways, and no room of a folder either: each may include itself and what its row
# names (docs/architecture.md). A room is named after its folder: align/fit. Nothing in a floor below, and no
# other room, needs to be named twice: what a row names stands for all its rooms.
set -euo pipefail
cd "$(dirname "$0")/.."

below="core colmap_ext importers"
declare -A allowed=(
  [core]=""
  [colmap_ext]="core"
  [importers]="core"

  [align]="$below align/geo align/trust align/search align/fit align/clicks align/surface"
  [align/geo]="$below"
  [align/trust]="$below align/search align/fit align/clicks align/surface"
  [align/search]="$below align/fit align/clicks align/surface"
  [align/fit]="$below align/clicks align/surface"
  [align/clicks]="$below"
  [align/surface]="$below"
  [align/join]="$below"
  [align/command]="$below align align/geo align/trust align/search align/fit align/clicks align/surface"
  [align/pick]="$below align align/trust align/search align/fit align/clicks align/surface"

  [texture]="$below texture/output texture/texels texture/tone texture/registration texture/sampling"
  [texture/output]="$below texture/texels texture/sampling"
  [texture/texels]="$below texture/sampling"
  [texture/registration]="$below texture/sampling"
  [texture/tone]="$below texture/sampling"
  [texture/sampling]="$below"
  [texture/export]="$below texture texture/output texture/texels texture/tone texture/registration texture/sampling"
  [texture/render]="$below"
  [texture/view]="$below texture/output texture/texels texture/sampling"

  [building]="$below"
  [building/window]="$below building"
  [dense]="$below"

  [workflow]="core"

  [capture]="$below capture/pattern capture/simulation"
  [capture/pattern]="$below"
  [capture/calibration]="$below"
  [capture/association]="$below"
  [capture/simulation]="$below"
)
status=0
# The room of a file: its folder, pages apart.
while IFS=: read -r file line include; do
  room=${file%/*}
  target=${include#*\"}
  target=${target%%\"*}
  target=${target%/*}
  if [ -z "${allowed[$room]+known}" ]; then
    echo "$file: $room/ has no row in scripts/check_layers.sh"
    status=1
    continue
  fi
  case " $room ${allowed[$room]} " in
    *" $target "*) ;;
    *) echo "$file:$line: $room/ must not include $target/"; status=1 ;;
  esac
done < <(grep -nE '^#include "[a-z_]+/' -r core colmap_ext importers align texture building capture dense workflow --include='*.h' --include='*.cc')

# No two headers include each other, over any number of steps.
circles=$(grep -E '^#include "[a-z_]+/' -r core colmap_ext importers align texture building capture dense workflow --include='*.h' |
  sed -E 's/:#include "/ /; s/".*//' | tsort 2>&1 >/dev/null | sed -nE 's/^tsort: ([^-].*\.h)$/  \1/p' || true)
if [ -n "$circles" ]; then
  printf 'These headers include each other in a circle:\n%s\n' "$circles"
  status=1
fi
[ $status -eq 0 ] && echo "Every folder and room includes only what stands below it."
exit $status
