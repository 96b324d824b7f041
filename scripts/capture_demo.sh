#!/usr/bin/env bash
# What projected patterns are worth: a room with bare walls, every place photographed with and without the pattern,
# beside a furnished room of the same size. Every step as a user would type it, a table at the end (docs/capturing.md).
# Usage: scripts/capture_demo.sh [FOLDER] [OPTIONS of roomtex-simulate]   (default: capture_demo/)
set -euo pipefail
repository=$(cd "$(dirname "$0")/.." && pwd)
out=$repository/capture_demo
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then out=$(realpath -m "$1"); shift; fi
cd "$repository"
size=("$@")
[ $# -gt 0 ] || size=(--num_photos 16 --photo_width 1200 --photo_height 800 --scan_columns 1600 --scan_rows 800)

scripts/setup.sh
cmake --preset release >/dev/null
cmake --build --preset release
export PATH="$PWD/build/bin:$PATH" QT_QPA_PLATFORM=offscreen

if [ -e "$out" ] && [ ! -e "$out/.roomtex-demo" ]; then
  echo "capture_demo: $out is there and was not made by this script; name another folder, or remove it." >&2
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
# extract DATABASE IMAGES
extract() {
  run_colmap colmap feature_extractor --database_path "$1" --image_path "$2" "${camera[@]}" --SiftExtraction.use_gpu 0
}
# map NAME IMAGES: NAME.db, NAME/sparse/0; says so when it is refused.
map() {
  extract "$1.db" "$2"
  run_colmap colmap exhaustive_matcher --database_path "$1.db" --SiftMatching.use_gpu 0
  mkdir -p "$1"
  run roomtex-mapper --database_path "$1.db" --image_path "$2" --output_path "$1/sparse" \
    --report_path "$1/mapper.json" || echo "(exit code $?)"
}
# align NAME CAPTURE
align() {
  run roomtex-align --input_path "$1/sparse/0" --scan_path "$2/scan.rtpi" --picks_path "$2/picks.csv" \
    --output_path "$1/aligned"
}
# evaluate NAME CAPTURE [TEXTURED]
evaluate() {
  roomtex-evaluate --truth_path "$2/truth" --scan_path "$2/scan.rtpi" --input_path "$1/aligned" \
    --ply_path "$1/${3:-textured}/model.ply" >"$1/${3:-textured}.json"
}

run roomtex-simulate --output_path bare --projectors 2 "${size[@]}"
run roomtex-simulate --output_path furnished "${size[@]}"
read -ra camera <bare/camera_options.txt

# Which photos belong together.
run roomtex-associate --image_path bare/photos --output_path associations.csv --links_path linked

# The bare room without the pattern, and with it.
map plain linked/plain
map patterned linked/patterned
align patterned bare
run roomtex-texture --input_path patterned/aligned --image_path bare/photos --associations_path associations.csv \
  --scan_path bare/scan.rtpi --Texture.scale 1 --output_path patterned/textured
evaluate patterned bare
# What it looks like when the associations are forgotten.
run roomtex-texture --input_path patterned/aligned --image_path bare/photos \
  --scan_path bare/scan.rtpi --Texture.scale 1 --output_path patterned/with_pattern
evaluate patterned bare with_pattern

# The furnished room, to compare with.
map furnished furnished/photos
align furnished furnished
run roomtex-texture --input_path furnished/aligned --image_path furnished/photos \
  --scan_path furnished/scan.rtpi --Texture.scale 1 --output_path furnished/textured
evaluate furnished furnished

node - <<'EOF'
const fs = require('fs');
const read = (path) => (fs.existsSync(path) ? JSON.parse(fs.readFileSync(path)) : null);
const number = (value, digits, unit = '') => (value == null ? '-' : value.toFixed(digits) + unit);
console.log('\n| room, photos for COLMAP, photos for the colours | registered | points | poses, mm (median / worst) | ' +
            'rotation | colours | wrong by > 0.1 |\n|---|---|---|---|---|---|---|');
const row = (title, name, textured) => {
  const mapper = read(`${name}/mapper.json`) || {}, result = read(`${name}/${textured}.json`) || {};
  const poses = result.poses || {}, color = result.color || {};
  const of = mapper.num_images == null ? '' : ` of ${mapper.num_images}`;
  console.log(`| ${title} | ${mapper.num_reg_images || 0}${of} | ${mapper.num_points || 0} | ` +
              `${number(poses.position_median_mm, 2)} / ${number(poses.position_max_mm, 2)} | ` +
              `${number(poses.rotation_median_deg, 4, ' deg')} | ${number(color.psnr_db, 1, ' dB')} | ` +
              `${number(color.share_wrong && 100 * color.share_wrong, 2, ' %')} |`);
};
row('furnished, plain, plain', 'furnished', 'textured');
row('bare, plain, plain', 'plain', 'textured');
row('bare, patterned, plain', 'patterned', 'textured');
row('bare, patterned, patterned', 'patterned', 'with_pattern');
EOF
cat <<EOF

Look at $out/patterned/textured/model.glb (no pattern in it) and $out/patterned/with_pattern/model.glb.
EOF
