#!/usr/bin/env bash
# Makes the Debian package from the build folder, installs it in a bare Debian 12 with nothing but what it declares,
# and runs every command there, the job from a capture to a coloured scan included. Then roomtex-dev: the example of
# docs/examples/ is built and run. Needs root and debootstrap; the packages come from where this machine's apt has
# them. Not part of the gate: it downloads 0.7 GB.
#   scripts/check_package.sh [--keep FOLDER] [--without-dev]
# --keep: the bare Debian stays in FOLDER and is taken again next time, the packages installed anew.
set -euo pipefail
cd "$(dirname "$0")/.."

keep=""
with_dev=1
while [ $# -gt 0 ]; do
  case "$1" in
    --keep) keep=$2; shift 2 ;;
    --without-dev) with_dev=0; shift ;;
    *) echo "Say: scripts/check_package.sh [--keep FOLDER] [--without-dev]" >&2; exit 2 ;;
  esac
done
[ "$(id -u)" -eq 0 ] || { echo "check_package: debootstrap needs root." >&2; exit 1; }
command -v debootstrap >/dev/null || { echo "check_package: install debootstrap first." >&2; exit 1; }

work=$(mktemp -d)
root=${keep:-$work/root}
finish() {
  for mounted in proc dev; do
    mountpoint -q "$root/$mounted" && umount "$root/$mounted"
  done
  rm -rf --one-file-system "$work"
}
trap finish EXIT

cmake --preset release >"$work/configure.log" || { cat "$work/configure.log"; exit 1; }
cmake --build --preset release >"$work/build.log" || { tail -n 40 "$work/build.log"; exit 1; }
(cd build && cpack -G DEB -B "$work/packages" >"$work/cpack.log") || { cat "$work/cpack.log"; exit 1; }
rm -rf "$work/packages/_CPack_Packages"
for package in "$work"/packages/*.deb; do
  echo "== $(basename "$package"), $(du -h "$package" | cut -f 1)"
  dpkg-deb --field "$package" Depends Recommends Suggests
done

# Debian's own lines of this machine's apt, written as sources.list has them.
sources=$(apt-get indextargets --format '$(ORIGIN) deb $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Identifier: Packages' |
  sed -n 's/^Debian //p' | sort -u)
mirror=$(awk '$3 == "bookworm" { print $2; exit }' <<<"$sources")
[ -n "$mirror" ] || { echo "check_package: this machine's apt knows no Debian 12." >&2; exit 1; }
if [ ! -x "$root/usr/bin/apt-get" ]; then
  debootstrap --variant=minbase bookworm "$root" "$mirror" >"$work/debootstrap.log" ||
    { tail -n 20 "$work/debootstrap.log"; exit 1; }
fi
echo "$sources" >"$root/etc/apt/sources.list"
cp /etc/resolv.conf "$root/etc/resolv.conf"
# The way to the packages is this machine's own.
apt-config dump | grep -E '^Acquire::https?::[^"]*(Proxy|CaInfo)' >"$root/etc/apt/apt.conf.d/90machine" || true
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
inside() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
  DEBIAN_FRONTEND=noninteractive http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" "$@"; }

rm -rf "$root/roomtex"
mkdir "$root/roomtex"
cp "$work"/packages/*.deb "$root/roomtex/"
cp -r docs/examples "$root/roomtex/"
inside apt-get update -q >"$work/apt.log" 2>&1 || { tail -n 20 "$work/apt.log"; exit 1; }
inside apt-get remove -q -y roomtex roomtex-dev >>"$work/apt.log" 2>&1 || true
inside sh -c 'apt-get install -q -y --no-install-recommends /roomtex/roomtex_*.deb' >>"$work/apt.log" 2>&1 ||
  { tail -n 20 "$work/apt.log"; exit 1; }

# Every command starts and knows its version, which is that of the package.
version=$(dpkg-deb --field "$work"/packages/roomtex_*.deb Version)
count=0
for command in $(dpkg-deb --contents "$work"/packages/roomtex_*.deb | sed -n 's#.* \./usr/bin/##p'); do
  said=$(inside "$command" --version)
  case "$said" in
    *"$version"*) echo "$said" ;;
    *) echo "check_package: $command says \"$said\", the package $version" >&2; exit 1 ;;
  esac
  count=$((count + 1))
done
echo "$count commands start."

# The main job, small. COLMAP comes with the package.
cat >"$root/roomtex/job.sh" <<'JOB'
set -eu
cd /roomtex
export QT_QPA_PLATFORM=offscreen
roomtex-simulate --quiet --output_path capture --num_photos 14 --photo_width 960 --photo_height 640 \
  --scan_columns 1000 --scan_rows 380
roomtex-import --quiet --input_path capture/scan.rtpi --output_path scan.ply
colmap feature_extractor --database_path database.db --image_path capture/photos --SiftExtraction.use_gpu 0 \
  $(cat capture/camera_options.txt) >colmap.log 2>&1
colmap exhaustive_matcher --database_path database.db --SiftMatching.use_gpu 0 >>colmap.log 2>&1
roomtex-mapper --quiet --database_path database.db --image_path capture/photos --output_path sparse
roomtex-align --quiet --input_path sparse/0 --scan_path capture/scan.rtpi --picks_path capture/picks.csv \
  --output_path aligned
roomtex-texture --quiet --input_path aligned --image_path capture/photos --scan_path capture/scan.rtpi \
  --output_path textured --report_path textured.json
grep -E '"(coverage|trusted)"' textured.json
JOB
inside sh /roomtex/job.sh
echo "roomtex: from a capture to $(du -h "$root/roomtex/textured/model.ply" | cut -f 1) of coloured scan."

if [ $with_dev -eq 1 ]; then
  inside sh -c 'apt-get install -q -y --no-install-recommends /roomtex/roomtex-dev_*.deb g++ cmake make' \
    >>"$work/apt.log" 2>&1 || { tail -n 20 "$work/apt.log"; exit 1; }
  inside sh -c 'cd /roomtex && cmake -S examples -B example && cmake --build example' >"$work/example.log" 2>&1 ||
    { tail -n 30 "$work/example.log"; exit 1; }
  inside sh -c 'cd /roomtex && example/color_scan capture/scan.rtpi sparse/0 capture/picks.csv capture/photos \
    example.ply'
fi
echo "The packages are whole."
