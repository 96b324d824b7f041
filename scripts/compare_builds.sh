#!/usr/bin/env bash
# Whether two builds give the same bytes: every command that writes files, run by both on the same inputs (simulated
# captures and, where it lies beside the checkout, the real kitchen). For changes that must change nothing.
# Usage: scripts/compare_builds.sh OLD_BIN NEW_BIN FOLDER
#   FOLDER is kept: inputs (made with OLD_BIN and COLMAP once), old/ and new/. old/ is not made again.
# Prints what differs, exits 1 if anything does. COLMAP's mapper gives the same bytes only with one thread: it gets one,
# and what follows it starts from models that were made once. Reports are compared without times, memory and version, logs not at all.
set -euo pipefail
[ $# -eq 3 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
old=$(realpath "$1") new=$(realpath "$2")
here=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$3"
cd "$3"
export QT_QPA_PLATFORM=offscreen
data=$here/../shared/data

# features DATABASE IMAGES OPTIONS...
features() {
  local database=$1 images=$2
  shift 2
  colmap feature_extractor --database_path "$database" --image_path "$images" "$@" \
    --SiftExtraction.use_gpu 0 --SiftExtraction.max_num_features 2500
  colmap exhaustive_matcher --database_path "$database" --SiftMatching.use_gpu 0
}

if [ ! -e inputs/.done ]; then
  rm -rf inputs
  mkdir inputs
  (
    cd inputs
    "$old/roomtex-simulate" --output_path room --num_photos 16 --photo_width 960 --photo_height 640 --shading 1 \
      --scan_columns 1200 --scan_rows 450 --vignetting 0.2 --white_balance_ev 0.2
    read -ra camera <room/camera_options.txt
    features room.db room/photos "${camera[@]}"
    "$old/roomtex-simulate" --output_path stations --num_photos 8 --photo_width 640 --photo_height 480 \
      --scan_columns 600 --scan_rows 225 --num_stations 2 --random_seed 3
    "$old/roomtex-simulate" --output_path projected --num_photos 8 --photo_width 960 --photo_height 640 \
      --scan_columns 400 --scan_rows 150 --projectors 2
    mkdir boards
    cp /usr/share/doc/opencv-doc/examples/data/left??.jpg boards/ 2>/dev/null ||
      find /usr/share -name 'left0*.jpg*' -exec cp {} boards/ \;
    if [ -e "$data/kitchen" ]; then
      features kitchen.db "$data/kitchen/images" --ImageReader.single_camera 1 \
        --ImageReader.camera_model SIMPLE_RADIAL --ImageReader.camera_params 525.9,320,240,-0.025
      "$old/roomtex-mapper" --database_path kitchen.db --image_path "$data/kitchen/images" --output_path kitchen_sparse
    fi
    "$old/roomtex-mapper" --database_path room.db --image_path room/photos --output_path room_sparse
  ) >inputs.log 2>&1 || { tail inputs.log; exit 1; }
  touch inputs/.done
fi
inputs=$PWD/inputs

# All commands of one build, in the working folder; a command that fails leaves its exit code.
run_all() {
  local bin=$1
  run() {
    local name=$1
    shift
    local code=0
    "$bin/$@" --quiet --num_threads 2 >"$name.out" 2>"$name.err" || code=$?
    echo $code >"$name.exit"
  }
  ln -sfn "$inputs" in
  ln -sfn "$data" data
  for size in "room 8 3" "other 5 7"; do
    set -- $size
    run "simulate_$1" roomtex-simulate --output_path "simulated_$1" --num_photos "$2" --random_seed "$3" \
      --photo_width 480 --photo_height 320 --scan_columns 400 --scan_rows 150 --strangers 0.2 --bend 0.003
  done
  run simulate_projected roomtex-simulate --output_path simulated_projected --num_photos 4 --projectors 2 \
    --photo_width 480 --photo_height 320 --scan_columns 300 --scan_rows 120
  mkdir import
  run import roomtex-import --input_path in/room/scan.rtpi --output_path import/room.ply \
    --output_path import/room.pcd --output_path import/room.png --output_path import/room.rtpi \
    --output_path import/room.ptx --report_path import.json
  run mapper roomtex-mapper --database_path in/room.db --image_path in/room/photos --output_path sparse \
    --Mapper.num_threads 1 --report_path mapper.json
  run align roomtex-align --input_path in/room_sparse/0 --scan_path in/room/scan.rtpi --picks_path in/room/picks.csv \
    --image_path in/room/photos --output_path aligned --Plane.output_path planes.ply
  run align_picks roomtex-align --input_path in/room_sparse/0 --scan_path in/room/scan.rtpi \
    --picks_path in/room/picks.csv --plane_constrained 0 --output_path aligned_picks
  run align_lens roomtex-align --input_path in/room_sparse/0 --scan_path in/room/scan.rtpi \
    --picks_path in/room/picks.csv --refine_intrinsics 1 --output_path aligned_lens
  run align_mesh roomtex-align --input_path in/room_sparse/0 --scan_path import/room.ply \
    --picks_path in/room/picks.csv --output_path aligned_mesh
  run align_stations roomtex-align --input_path in/stations/truth --scan_path in/stations/scan.rtpi \
    --scan_path in/stations/scan_1.rtpi --scan_poses in/stations/scan_poses.txt \
    --picks_path in/stations/picks.csv --output_path aligned_stations
  run texture roomtex-texture --input_path aligned --image_path in/room/photos --scan_path in/room/scan.rtpi \
    --output_path textured
  run texture_thesis roomtex-texture --input_path aligned --image_path in/room/photos \
    --scan_path in/room/scan.rtpi --output_path textured_thesis --Texture.scale 1 --Exposure.mode exif
  mkdir -p aligned_anywhere && cp aligned/*.bin aligned_anywhere  # remembers no scan
  run texture_mesh roomtex-texture --input_path aligned_anywhere --image_path in/room/photos --scan_path import/room.ply \
    --output_path textured_mesh
  run texture_stations roomtex-texture --input_path in/stations/truth --image_path in/stations/photos \
    --scan_path in/stations/scan.rtpi --scan_path in/stations/scan_1.rtpi \
    --scan_poses in/stations/scan_poses.txt --output_path textured_stations
  run pattern roomtex-pattern --output_path pattern.png --width 640 --height 480 --report_path pattern.json
  run associate roomtex-associate --image_path in/projected/photos --output_path associations.csv \
    --report_path associate.json
  run calibrate roomtex-calibrate --image_path in/boards --board 9x6 --square 0.025 --output_path cameras.txt \
    --report_path calibrate.json
  if [ -e "$inputs/kitchen.db" ]; then
    run kitchen_align roomtex-align --input_path in/kitchen_sparse/0 --scan_path data/kitchen/scan.rtpi \
      --azimuth counterclockwise --picks_path data/kitchen/picks.csv --image_path data/kitchen/images \
      --output_path kitchen_aligned
    run kitchen_texture roomtex-texture --input_path kitchen_aligned --image_path data/kitchen/images \
      --scan_path data/kitchen/scan.rtpi --azimuth counterclockwise --output_path kitchen_textured
  fi
  for command in import mapper align texture pattern associate calibrate simulate; do
    run "help_$command" "roomtex-$command" --help
  done
}

if [ ! -e old/.done ]; then
  rm -rf old
  mkdir old
  (cd old && run_all "$old")
  touch old/.done
fi
rm -rf new
mkdir new
(cd new && run_all "$new")
touch new/.done

python3 - <<'END'
import filecmp, json, os, sys

def files(top):
    return {os.path.relpath(os.path.join(folder, name), top)
            for folder, _, names in os.walk(top) for name in names if not name.endswith('.log')}

def report(path):
    value = json.load(open(path))
    if isinstance(value, dict):
        for key in ('seconds', 'peak_memory_bytes', 'version', 'cpu_seconds'):
            value.pop(key, None)
    return value

old, new = files('old'), files('new')
different = sorted(old ^ new)
for name in sorted(old & new):
    a, b = 'old/' + name, 'new/' + name
    if filecmp.cmp(a, b, shallow=False):
        continue
    if name.endswith('.json') and report(a) == report(b):
        continue
    different.append(name)
for name in different:
    print(name if name in old and name in new else f'{name} (in {"old" if name in old else "new"} only)')
print(f'{len(old | new)} files, {len(different)} differ')
sys.exit(bool(different))
END
