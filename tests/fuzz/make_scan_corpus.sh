#!/bin/sh
# Small good scan files of every format to begin fuzzing with.
# make_scan_corpus.sh ROOMTEX_IMPORT FOLDER
set -e
import=$1
folder=$2
mkdir -p "$folder"
{
  printf '3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n'
  for column in 1.0 1.1 1.2; do
    for z in -0.1 0.0 0.1 0.2; do echo "$column 2 $z 0.5"; done
  done
} > "$folder/scan.ptx"
for extension in rtpi pcd ply e57 las; do
  "$import" --quiet --input_path "$folder/scan.ptx" --output_path "$folder/scan.$extension" > /dev/null
done
sed 's/binary/ascii/; s/HEIGHT.*/HEIGHT 2/; s/WIDTH.*/WIDTH 2/; s/POINTS.*/POINTS 4/; /^DATA/q' \
  "$folder/scan.pcd" > "$folder/ascii.pcd"
printf '1 2 3 4\n2 2 3 4\n3 2 3 4\n4 2 3 4\n' >> "$folder/ascii.pcd"
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n' \
  > "$folder/ascii.ply"
printf '3\n1 2 3 0.5 1 2 3\n2 2 3 0.5 1 2 3\n3 2 3 0.5 1 2 3\n' > "$folder/scan.pts"
printf '# points\nx,y,z,intensity\n1,2,3,4\n5,6,7,8\n' > "$folder/scan.csv"
