// Colours a range scan: COLMAP's sparse model goes into the scan by picks, its photos give the
// colours.
//   color_scan SCAN MODEL PICKS PHOTOS OUTPUT.ply

#include <cstdio>

#include "align/alignment.h"
#include "importers/scan_reader.h"
#include "texture/colorize.h"
#include "texture/output/write_ply.h"
#include "texture/sampling/photo_list.h"

using namespace roomtex;

int main(int argc, char** argv) try {
  if (argc != 6) throw UsageError("say: color_scan SCAN MODEL PICKS PHOTOS OUTPUT.ply");
  const std::vector<Scan> scans = {ReadScan(argv[1], ScanReaderOptions())};
  SparseModel model = ReadSparseModel(argv[2]);
  const std::vector<Pick> picks = ReadPicks(argv[3]);

  Progress progress(/*quiet=*/false);
  const SurveyedScans surveyed(scans);
  const Alignment alignment =
      AlignToScan({model, surveyed, picks, argv[3], "clockwise"}, AlignmentOptions(), &progress);
  for (const std::string& reason : alignment.reasons) std::fprintf(stderr, "%s\n", reason.c_str());
  if (!alignment.reasons.empty()) return 4;
  TransformModel(alignment.scan_from_sparse, &model);

  PhotoSources sources;
  sources.image_path = argv[4];
  const PhotoList list = ListPhotos(model, sources);
  const ColorizeResult colored =
      ColorizeScans(scans, list.photos, ColorizeOptions(), /*num_threads=*/-1, &progress);
  WriteColoredPly(scans, colored.scans, argv[5]);
  std::printf("%zu of %zu vertices have a colour\n", colored.num_colored, colored.num_vertices);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 3;
}
