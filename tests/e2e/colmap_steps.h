#pragma once
// The COLMAP steps that a user types before ours: features and matches, on the processor.

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

namespace roomtex {

inline int Shell(const std::string& line) { return std::system(line.c_str()); }

// Makes `database` from the photos in `images`; another one in every run: descriptors of COLMAP 3.8
// at a photo's border depend on what lies in memory, photos are numbered as they are ready, and
// FLANN, which matches, shuffles by std::random_device. camera_options: "--ImageReader.camera_model
// ..." and so on. COLMAP's log goes to `database`.log.
inline void ExtractAndMatch(const std::string& database, const std::string& images,
                            std::string camera_options) {
  while (!camera_options.empty() && camera_options.back() == '\n') camera_options.pop_back();
  const std::string log = " >>" + database + ".log 2>&1";
  ASSERT_EQ(
      Shell("QT_QPA_PLATFORM=offscreen colmap feature_extractor --database_path " + database +
            " --image_path " + images + " " + camera_options + " --SiftExtraction.use_gpu 0" + log),
      0);
  ASSERT_EQ(Shell("QT_QPA_PLATFORM=offscreen colmap exhaustive_matcher --database_path " +
                  database + " --SiftMatching.use_gpu 0" + log),
            0);
}

}  // namespace roomtex
