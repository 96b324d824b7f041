#pragma once
// The COLMAP steps that a user types before ours: features and matches, on the processor.

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

namespace roomtex {

inline int Shell(const std::string& line) { return std::system(line.c_str()); }

// The start of a shell line that runs COLMAP. Descriptors of COLMAP 3.8 at a photo's border depend
// on what lies in memory, a few in ten thousand: where the system allows it, addresses are the same
// in every run.
inline std::string Colmap() {
  static const bool same_addresses = Shell("setarch -R true 2>/dev/null") == 0;
  return std::string("QT_QPA_PLATFORM=offscreen ") + (same_addresses ? "setarch -R " : "") +
         "colmap ";
}

// With one thread photos are numbered in their order and the trees of the matcher, which draw from
// one generator, are the same: databases and models are the same in every run.
inline std::string ColmapFeatures() {
  return Colmap() + "feature_extractor --SiftExtraction.use_gpu 0 --SiftExtraction.num_threads 1 ";
}
inline std::string ColmapMatches() {
  return Colmap() + "exhaustive_matcher --SiftMatching.use_gpu 0 --SiftMatching.num_threads 1 ";
}

// Makes `database` from the photos in `images`. camera_options: "--ImageReader.camera_model ..."
// and so on. COLMAP's log goes to `database`.log.
inline void ExtractAndMatch(const std::string& database, const std::string& images,
                            std::string camera_options) {
  while (!camera_options.empty() && camera_options.back() == '\n') camera_options.pop_back();
  const std::string log = " >>" + database + ".log 2>&1";
  ASSERT_EQ(Shell(ColmapFeatures() + "--database_path " + database + " --image_path " + images +
                  " " + camera_options + log),
            0);
  ASSERT_EQ(Shell(ColmapMatches() + "--database_path " + database + log), 0);
}

}  // namespace roomtex
