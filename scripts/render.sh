#!/usr/bin/env bash
# Pictures of a coloured scan, without a display: from the photos' poses beside the photos, from new viewpoints in
# the room, and from outside with the ceiling cut; contact_sheet.png shows them all.
#
# Usage: scripts/render.sh FOLDER [OUTPUT] [--model DIR] [--images DIR] [--scan FILE] [-- OPTIONS]
#   FOLDER   textured/  (has model.ply; give --model and --images, unless they lie beside it as aligned/ and
#                       capture/photos, photos or images), or
#            a capture of roomtex-simulate (coloured first, with aligned/ in or beside it, else with true poses), or
#            aligned/   (coloured first; give --images, and --scan unless it remembers it)
#   OUTPUT   folder for the pictures; FOLDER/pictures if left out
#   OPTIONS  for roomtex-render (--width 1600, --num_photos 6, --num_ring 8), or with --color before them for
#            roomtex-texture (--color --azimuth counterclockwise)
set -euo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)

usage() { sed -n '5,14s/^# \{0,1\}//p' "$0" >&2; exit 2; }
[ $# -ge 1 ] || usage
case $1 in -*) usage ;; esac
folder=${1%/}; shift
out="" model="" images="" scan=""
if [ $# -ge 1 ] && [ "${1#-}" = "$1" ]; then out=${1%/}; shift; fi
render_options=() color_options=()
while [ $# -gt 0 ]; do
  case $1 in
    --model|--images|--scan)
      [ $# -ge 2 ] || usage
      case $1 in --model) model=$2 ;; --images) images=$2 ;; --scan) scan=$2 ;; esac
      shift 2 ;;
    --) shift
      to=render
      while [ $# -gt 0 ]; do
        if [ "$1" = --color ]; then to=color
        elif [ $to = color ]; then color_options+=("$1")
        else render_options+=("$1"); fi
        shift
      done ;;
    *) usage ;;
  esac
done
[ -d "$folder" ] || { echo "render: $folder is no folder" >&2; exit 3; }
out=${out:-$folder/pictures}

# The first of the given paths that is there.
first() { for path in "$@"; do [ -e "$path" ] && { echo "$path"; return; }; done; true; }
parent=$(dirname "$folder")
has_model() { [ -e "$1/images.bin" ] || [ -e "$1/images.txt" ]; }

bin=$here/build/bin
for program in roomtex-render roomtex-texture; do
  if [ ! -x "$bin/$program" ]; then
    (cd "$here" && cmake --preset release >/dev/null && cmake --build --preset release --target $program) >&2
  fi
done

if [ -e "$folder/model.ply" ]; then
  textured=$folder
  model=${model:-$(first "$parent/aligned" "$parent/truth" "$parent/capture/truth")}
  images=${images:-$(first "$parent/capture/photos" "$parent/photos" "$parent/images")}
else
  if has_model "$folder"; then
    model=${model:-$folder}
  else
    images=${images:-$(first "$folder/photos")}
    scan=${scan:-$(first "$folder/scan.rtpi")}
    model=${model:-$(first "$folder/aligned" "$parent/aligned" "$folder/truth")}
  fi
  remembers=$model/alignment.json  # the scan
  needs=("model:$model" "images:$images")
  [ -e "$remembers" ] || needs+=("scan:$scan")
  for need in "${needs[@]}"; do
    [ -n "${need#*:}" ] || { echo "render: give --${need%%:*}" >&2; exit 2; }
  done
  textured=$out/textured
  mkdir -p "$out"
  scan_option=()
  [ -n "$scan" ] && scan_option=(--scan_path "$scan")
  "$bin/roomtex-texture" --input_path "$model" --image_path "$images" "${scan_option[@]}" \
    --output_path "$textured" "${color_options[@]}" >/dev/null
fi
[ -n "$model" ] || { echo "render: give --model, the aligned COLMAP model" >&2; exit 2; }
beside=()
[ -n "$images" ] && beside=(--image_path "$images")
mesh=(--ply_path "$textured/model.ply")
[ -e "$textured/model.glb" ] && mesh=(--glb_path "$textured/model.glb")
exec "$bin/roomtex-render" "${mesh[@]}" --input_path "$model" "${beside[@]}" \
  --folder_path "$out" "${render_options[@]}"
