#pragma once
// The COLMAP steps that a user types before ours: features and matches, on the processor.

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

namespace roomtex {

inline int Shell(const std::string& line) { return std::system(line.c_str()); }

inline void Colmap(const std::string& step, const std::string& database,
                   const std::string& options) {
  ASSERT_EQ(Shell("QT_QPA_PLATFORM=offscreen colmap " + step + " --database_path " + database +
                  " " + options + " >>" + database + ".log 2>&1"),
            0);
}

// Makes `database` from the photos in `images`; another one in every run: descriptors of COLMAP 3.8
// at a photo's border depend on what lies in memory, photos are numbered as they are ready, and
// FLANN, which matches, shuffles by std::random_device. camera_options: "--ImageReader.camera_model
// ..." and so on. COLMAP's log goes to `database`.log.
inline void ExtractFeatures(const std::string& database, const std::string& images,
                            std::string camera_options) {
  while (!camera_options.empty() && camera_options.back() == '\n') camera_options.pop_back();
  Colmap("feature_extractor", database,
         "--image_path " + images + " " + camera_options + " --SiftExtraction.use_gpu 0");
}

// The same with matches of all pairs.
inline void ExtractAndMatch(const std::string& database, const std::string& images,
                            const std::string& camera_options) {
  ExtractFeatures(database, images, camera_options);
  Colmap("exhaustive_matcher", database, "--SiftMatching.use_gpu 0");
}

}  // namespace roomtex
