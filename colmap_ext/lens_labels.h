#pragma once
// Which photos were taken with one camera at one focal length, by their EXIF.

#include <cstdint>
#include <map>
#include <string>

namespace roomtex {

struct LensLabel {
  std::string text;            // the same for photos of one camera and focal length
  double focal_length_mm = 0;  // 0 = not said
};
using LensLabels = std::map<uint32_t, LensLabel>;  // by image_id

// Photos whose EXIF names the same camera, and focal lengths that differ by 1 % at most from one to
// the next, have the same label. Photos without either, or that cannot be read, have none. names:
// image_id -> name below the folder; nothing without a folder.
LensLabels ReadLensLabels(const std::map<uint32_t, std::string>& names,
                          const std::string& image_path);

}  // namespace roomtex
