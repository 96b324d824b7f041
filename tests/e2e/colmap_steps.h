#pragma once
// The COLMAP steps that a user types before ours: features and matches, on the processor.

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

namespace roomtex {

inline int Shell(const std::string& line) { return std::system(line.c_str()); }

// Makes `database` from the photos in `images`, all from one calibrated camera. The log goes to
// `database`.log.
inline void ExtractAndMatch(const std::string& database, const std::string& images,
                            const std::string& camera_model, const std::string& camera_params) {
  const std::string log = " >>" + database + ".log 2>&1";
  ASSERT_EQ(Shell("QT_QPA_PLATFORM=offscreen colmap feature_extractor --database_path " + database +
                  " --image_path " + images + " --ImageReader.single_camera 1" +
                  " --ImageReader.camera_model " + camera_model + " --ImageReader.camera_params " +
                  camera_params + " --SiftExtraction.use_gpu 0" + log),
            0);
  ASSERT_EQ(Shell("QT_QPA_PLATFORM=offscreen colmap exhaustive_matcher --database_path " + database +
                  " --SiftMatching.use_gpu 0" + log),
            0);
}

}  // namespace roomtex
