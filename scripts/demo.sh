#!/usr/bin/env bash
# From nothing to a coloured room: installs what is missing, builds, simulates a capture, runs every step as a
# user would type it, and prints where the result lies and how far it is from the truth.
# Usage: scripts/demo.sh [FOLDER]   (default: demo/)
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-demo}

scripts/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target roomtex-simulate roomtex-mapper roomtex-align roomtex-texture roomtex-evaluate
export PATH="$PWD/build/bin:$PATH" QT_QPA_PLATFORM=offscreen

if [ -e "$out" ] && [ ! -e "$out/.roomtex-demo" ]; then
  echo "demo: $out is there and was not made by this script; name another folder, or remove it." >&2
  exit 3
fi
rm -rf "$out"
mkdir -p "$out"
cd "$out"
touch .roomtex-demo

# Prints a command, runs it; what COLMAP prints goes to colmap.log.
say() { printf '\n$ %s\n' "$*"; }
run() { say "$@"; "$@"; }
run_colmap() {
  say "$@"
  "$@" >>colmap.log 2>&1 || { tail -n 20 colmap.log; exit 1; }
}

run roomtex-simulate --output_path capture --num_photos 20 --photo_width 1200 --photo_height 800 --shading 1 \
  --scan_columns 1600 --scan_rows 600
read -ra camera <capture/camera_options.txt

run_colmap colmap feature_extractor --database_path database.db --image_path capture/photos \
  "${camera[@]}" --SiftExtraction.use_gpu 0 --SiftExtraction.max_num_features 4096
run_colmap colmap exhaustive_matcher --database_path database.db --SiftMatching.use_gpu 0

run roomtex-mapper --database_path database.db --image_path capture/photos --output_path sparse
run roomtex-align --input_path sparse/0 --scan_path capture/scan.rtpi --picks_path capture/picks.csv \
  --image_path capture/photos --output_path aligned
run roomtex-texture --input_path aligned --image_path capture/photos --scan_path capture/scan.rtpi \
  --output_path textured
run roomtex-evaluate --truth_path capture/truth --input_path aligned --ply_path textured/model.ply

cat <<EOF

Done. Look at
  $out/textured/model.glb    the coloured room, for any glTF viewer
  $out/textured/model.ply    the same for CloudCompare and MeshLab
  $out/textured/texture.png  the colours in the scan's grid
  $out/aligned/              the sparse model in the scan: colmap gui --import_path $out/aligned \\
                             --database_path $out/database.db --image_path $out/capture/photos
or walk through it, and see where the picks lie, in a browser:
  cmake --build --preset release --target roomtex-view roomtex-pick
  build/bin/roomtex-view --input_path $out/textured --aligned $out/aligned --image_path $out/capture/photos
  build/bin/roomtex-pick --input_path $out/sparse/0 --image_path $out/capture/photos \
      --scan_path $out/capture/scan.rtpi --output_path $out/capture/picks.csv
The numbers above compare poses and colours with the truth of the simulation.
EOF
