#!/usr/bin/env bash
# Many large photos on a large scan: peak memory and CPU seconds of roomtex-texture for 75, 150 and 300 photos.
# Ten poses are simulated; the photos of the sets are links to their ten pictures, under names of their own.
# Usage: tests/benchmark/texture/scale.sh FOLDER [WIDTH HEIGHT COLUMNS ROWS] [COUNT ...]
set -euo pipefail
[ $# -ge 1 ] || { sed -n '4s/^# //p' "$0" >&2; exit 2; }
bin=$(cd "$(dirname "$0")/../../.." && pwd)/build/bin
folder=$1 width=${2:-5472} height=${3:-3648} columns=${4:-5000} rows=${5:-2000}
counts=("${@:6}")
[ ${#counts[@]} -gt 0 ] || counts=(75 150 300)

capture=$folder/capture
[ -e "$capture/photos/photo_009.jpg" ] ||
  "$bin/roomtex-simulate" --quiet --seed 7 --num_photos 10 --photo_width "$width" --photo_height "$height" \
    --scan_columns "$columns" --scan_rows "$rows" --output_path "$capture" >/dev/null

echo "photos   CPU [s]   per photo   peak [MB]"
for count in "${counts[@]}"; do
  set=$folder/photos_$count
  mkdir -p "$set/model" "$set/photos"
  cp "$capture/truth/cameras.txt" "$set/model/"
  : >"$set/model/points3D.txt"
  # Lines of images.txt: ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then an empty one.
  awk -v count="$count" '!/^#/ && NF == 10 { pose[n++] = $2" "$3" "$4" "$5" "$6" "$7" "$8" "$9 }
    END { for (i = 0; i < count; ++i) printf "%d %s img_%04d.jpg\n\n", i + 1, pose[i % n], i }' \
    "$capture/truth/images.txt" >"$set/model/images.txt"
  for ((i = 0; i < count; ++i)); do
    ln -f "$(printf '%s/photos/photo_%03d.jpg' "$capture" $((i % 10)))" "$(printf '%s/photos/img_%04d.jpg' "$set" "$i")"
  done
  "$bin/roomtex-texture" --quiet --Texture.scale 1 --input_path "$set/model" --image_path "$set/photos" \
    --scan_path "$capture/scan.rtpi" --output_path "$set/textured" >/dev/null
  awk -v count="$count" '/"cpu_seconds"/ { inside = 1; next } inside && /}/ { inside = 0 }
    inside { sub(/,$/, "", $NF); cpu += $NF }
    /"peak_memory_bytes"/ { sub(/,$/, "", $NF); peak = $NF / 1e6 }
    END { printf "%6d %9.1f %11.2f %11.0f\n", count, cpu, cpu / count, peak }' "$set/textured/report.json"
done
