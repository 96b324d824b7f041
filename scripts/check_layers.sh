#!/usr/bin/env bash
# No folder includes upward or sideways: each may include itself and what its row names.
set -euo pipefail
cd "$(dirname "$0")/.."

declare -A allowed=(
  [core]="core"
  [colmap_ext]="core colmap_ext"
  [importers]="core importers"
  [align]="core colmap_ext importers align"
  [texture]="core colmap_ext importers texture"
  [capture]="core colmap_ext importers capture"
)
status=0
for folder in "${!allowed[@]}"; do
  while IFS=: read -r file line include; do
    target=${include#*\"}
    target=${target%%/*}
    case " ${allowed[$folder]} " in
      *" $target "*) ;;
      *) echo "$file:$line: $folder/ must not include $target/"; status=1 ;;
    esac
  done < <(grep -nE '^#include "[a-z_]+/' -r "$folder" --include='*.h' --include='*.cc' || true)
done
[ $status -eq 0 ] && echo "Every folder includes only what stands below it."
exit $status
