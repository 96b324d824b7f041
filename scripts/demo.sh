#!/usr/bin/env bash
# From nothing to a coloured room: installs what is missing, builds, simulates a capture, runs roomtex-auto on it as
# a user would, and prints where the result lies and how far it is from the truth.
# Usage: scripts/demo.sh [FOLDER]   (default: demo/)
set -euo pipefail
repository=$(cd "$(dirname "$0")/.." && pwd)
out=$(realpath -m "${1:-$repository/demo}")
cd "$repository"

scripts/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release --target roomtex-auto roomtex-simulate roomtex-mapper \
  roomtex-align roomtex-texture roomtex-render roomtex-associate roomtex-evaluate
export PATH="$PWD/build/bin:$PATH"

if [ -e "$out" ] && [ ! -e "$out/.roomtex-demo" ]; then
  echo "demo: $out is there and was not made by this script; name another folder, or remove it." >&2
  exit 3
fi
rm -rf "$out"
mkdir -p "$out"
cd "$out"
touch .roomtex-demo

# Prints a command, runs it.
run() { printf '\n$ %s\n' "$*"; "$@"; }

run roomtex-simulate --output_path capture --num_photos 20 --photo_width 1200 --photo_height 800 --shading 1 \
  --scan_columns 1600 --scan_rows 600
run roomtex-auto --image_path capture/photos --scan_path capture/scan.rtpi --cameras_path capture/cameras.txt \
  --picks_path capture/picks.csv --SiftExtraction.max_num_features 4096 --output_path result
run roomtex-evaluate --truth_path capture/truth --input_path result/aligned --ply_path result/textured/model.ply

cat <<EOF

Done. Look at
  $out/result/report.html           what came out, and how far to trust it, in any browser
  $out/result/textured/model.glb    the coloured room, for any glTF viewer
  $out/result/textured/model.ply    the same for CloudCompare and MeshLab
  $out/result/textured/texture.png  the colours in the scan's grid
  $out/result/aligned/              the sparse model in the scan: colmap gui --import_path $out/result/aligned \\
                             --database_path $out/result/database.db --image_path $out/capture/photos
or walk through it, and see where the picks lie, in a browser:
  (cd $repository && cmake --build --preset release --target roomtex-view roomtex-pick)
  $repository/build/bin/roomtex-view --input_path $out/result/textured --aligned $out/result/aligned --image_path $out/capture/photos
  $repository/build/bin/roomtex-pick --input_path $out/result/sparse/0 --image_path $out/capture/photos \
      --scan_path $out/capture/scan.rtpi --output_path $out/picks.csv
The numbers above compare poses and colours with the truth of the simulation.
EOF
