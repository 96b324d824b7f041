#!/usr/bin/env bash
# Makes the Debian packages from the build folder, installs roomtex in a bare Debian 12 with nothing but what it
# declares, and there runs every command's --help, roomtex-auto from photos to report, the bare commands, and the pages.
# Then roomtex-dev: the example of docs/examples/ is built and run. Needs root and debootstrap; Debian's packages come
# from where this machine's apt has them. Not part of the gate (label slow): it downloads 0.7 GB.
#   scripts/check_package.sh [--keep FOLDER] [--packages FOLDER] [--without-dev]
# --keep: the bare Debian stays in FOLDER and is taken again next time, the packages installed anew.
# --packages: those that lie there are tried; nothing is built.
# Ends with 77 where it cannot be tried.
set -euo pipefail
cd "$(dirname "$0")/.."

keep=""
packages=""
with_dev=1
while [ $# -gt 0 ]; do
  case "$1" in
    --keep) keep=$2; shift 2 ;;
    --packages) packages=$2; shift 2 ;;
    --without-dev) with_dev=0; shift ;;
    *) echo "Say: scripts/check_package.sh [--keep FOLDER] [--packages FOLDER] [--without-dev]" >&2; exit 2 ;;
  esac
done
[ "$(id -u)" -eq 0 ] || { echo "check_package: a bare Debian needs root." >&2; exit 77; }
[ -x "${keep:-/none}/usr/bin/apt-get" ] || command -v debootstrap >/dev/null ||
  { echo "check_package: install debootstrap first." >&2; exit 77; }

work=$(mktemp -d)
root=${keep:-$work/root}
finish() {
  for mounted in proc dev; do
    mountpoint -q "$root/$mounted" && umount "$root/$mounted"
  done
  rm -rf --one-file-system "$work"
}
trap finish EXIT

if [ -n "$packages" ]; then
  mkdir "$work/packages"
  cp "$packages"/*.deb "$work/packages/"
else
  cmake --preset release >"$work/configure.log" || { cat "$work/configure.log"; exit 1; }
  cmake --build --preset release >"$work/build.log" || { tail -n 40 "$work/build.log"; exit 1; }
  (cd build && cpack -G DEB -B "$work/packages" >"$work/cpack.log") || { cat "$work/cpack.log"; exit 1; }
  rm -rf "$work/packages/_CPack_Packages"
fi
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
  inside "$command" --help >"$work/help"
  grep -q "^Example:" "$work/help" && grep -q -- "--report_path" "$work/help" ||
    { echo "check_package: $command --help says nothing." >&2; exit 1; }
  count=$((count + 1))
done
echo "$count commands start and have a help."

# The main job, small. COLMAP comes with the package.
cat >"$root/roomtex/job.sh" <<'JOB'
set -eu
cd /roomtex
roomtex-simulate --quiet --output_path capture --num_photos 14 --photo_width 960 --photo_height 640 \
  --scan_columns 1000 --scan_rows 380
roomtex-auto --quiet --image_path capture/photos --scan_path capture/scan.rtpi --output_path result \
  --picks_path capture/picks.csv --quality low
for file in database.db sparse/0/points3D.bin aligned/alignment.json textured/model.glb report.html report.json; do
  test -s result/$file || { echo "roomtex-auto left no $file" >&2; exit 1; }
done
JOB
inside sh /roomtex/job.sh || { tail -n 20 "$root"/roomtex/result/log/*.log; exit 1; }
grep -o '"headline": "[^"]*"' "$root/roomtex/result/report.json"
echo "roomtex-auto: from photos to a report of $(du -h "$root/roomtex/result/report.html" | cut -f 1)."

# The commands by hand, from what roomtex-auto has matched.
cat >"$root/roomtex/by_hand.sh" <<'JOB'
set -eu
cd /roomtex
roomtex-import --quiet --input_path capture/scan.rtpi --output_path scan.ply
roomtex-mapper --quiet --database_path result/database.db --image_path capture/photos --output_path sparse
roomtex-align --quiet --input_path sparse/0 --scan_path capture/scan.rtpi --picks_path capture/picks.csv \
  --output_path aligned
roomtex-texture --quiet --input_path aligned --image_path capture/photos --scan_path capture/scan.rtpi \
  --output_path textured --report_path textured.json
grep -E '"(coverage|trusted)"' textured.json
roomtex-export --quiet --input_path aligned --scan_path capture/scan.rtpi --image_path capture/photos \
  --format nerfstudio --output_path exported
roomtex-calibrate --quiet --board 9x6 --square 0.025 --board_path board.pdf
roomtex-pattern --quiet --output_path pattern.png --width 800 --height 600
roomtex-view --quiet --input_path textured --aligned aligned --image_path capture/photos --output_path page
test -s page/index.html
JOB
inside sh /roomtex/by_hand.sh

# The pages answer. There is no browser in a bare Debian; tests/browser has one.
cat >"$root/roomtex/pages.sh" <<'JOB'
set -eu
cd /roomtex
ask() {  # COMMAND ... : starts it, and asks for its page
  rm -f address  # or that of the last one is read, before this one's begins
  "$@" --quiet --port 0 >address &
  server=$!
  for _ in $(seq 200); do
    grep -q -s ^http address && break
    sleep 0.1
  done
  url=$(head -n 1 address)
  port=${url#http://127.0.0.1:}
  path=/${port#*/}
  port=${port%%/*}
  exec 3<>"/dev/tcp/127.0.0.1/$port"
  printf 'GET %s HTTP/1.1\r\nHost: 127.0.0.1:%s\r\nConnection: close\r\n\r\n' "$path" "$port" >&3
  answer=$(tr -d '\0' <&3)
  exec 3<&-
  kill $server
  wait $server || true  # it says by which signal it ended
  case "$answer" in
    *"200 OK"*"<title>"*) echo "$1 serves its page." ;;
    *) echo "$1 serves no page: $answer" >&2; exit 1 ;;
  esac
}
ask roomtex-view --input_path textured --aligned aligned --image_path capture/photos
ask roomtex-pick --input_path sparse/0 --image_path capture/photos --scan_path capture/scan.rtpi --output_path own.csv
JOB
inside bash /roomtex/pages.sh

if [ $with_dev -eq 1 ]; then
  inside sh -c 'apt-get install -q -y --no-install-recommends /roomtex/roomtex-dev_*.deb g++ cmake make' \
    >>"$work/apt.log" 2>&1 || { tail -n 20 "$work/apt.log"; exit 1; }
  inside sh -c 'cd /roomtex && cmake -S examples -B example && cmake --build example' >"$work/example.log" 2>&1 ||
    { tail -n 30 "$work/example.log"; exit 1; }
  inside sh -c 'cd /roomtex && example/color_scan capture/scan.rtpi sparse/0 capture/picks.csv capture/photos \
    example.ply'
fi
echo "The packages are whole."
