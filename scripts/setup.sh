#!/usr/bin/env bash
# Installs every dependency from Debian 12's packages. Idempotent; uses sudo only when not root.
# Usage: scripts/setup.sh [--site | --slurm]
#   --site: Snakemake, too, for docs/site.md (80 packages, 0.7 GB); --slurm: and Slurm, for scripts/test_slurm.sh
set -euo pipefail
case "${1:-}" in
  "" | --site | --slurm) ;;
  *) echo "Say: scripts/setup.sh [--site | --slurm]" >&2; exit 2 ;;
esac

packages=(
  build-essential cmake ninja-build ccache git pkg-config
  colmap
  libeigen3-dev libceres-dev libopencv-dev libpcl-dev libembree-dev libgeographiclib-dev
  libexiv2-dev libsqlite3-dev libsqlitecpp-dev libtinygltf-dev libcli11-dev nlohmann-json3-dev
  libcpp-httplib-dev libfmt-dev libpugixml-dev
  libmeshoptimizer-dev
  libboost-dev libgtest-dev libgmock-dev libbenchmark-dev
  clang-format clang-tidy  # the gate: .ci/run
  xdg-utils                # opens pages in the browser
  chromium
  opencv-doc  # its sample photos of a calibration board, for a test
)
# The page of roomtex-view is built with npm, the browser tests run with Node: any that is there already
# will do.
command -v node >/dev/null || packages+=(nodejs)
command -v npm >/dev/null || packages+=(npm)
command -v python3 >/dev/null || packages+=(python3)  # tests/hostile
[ -z "${1:-}" ] || packages+=(snakemake)
[ "${1:-}" != --slurm ] || packages+=(slurm-wlm munge)

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' ||
    missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: everything is installed."
  exit 0
fi

sudo=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup: run as root, or install sudo." >&2; exit 1; }
  sudo=(sudo)
fi
export DEBIAN_FRONTEND=noninteractive
echo "setup: installing ${missing[*]}"
"${sudo[@]}" apt-get update -q
"${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"
