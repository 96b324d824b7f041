#pragma once
// Which photos were taken with one camera at one focal length, by their EXIF.

#include <cstdint>
#include <map>
#include <string>

namespace roomtex {

struct LensLabel {
  std::string text;                    // the same for photos of one camera and focal length
  double focal_length_mm = 0;          // 0 = not said
  double focal_length_on_film_mm = 0;  // on 35 mm film, rounded; 0 = not said

  // How many times longer this lens is than the other, in pixels of photos of one size. The lenses
  // of a telephone have sensors of several sizes, which millimetres do not tell.
  double TimesLongerThan(const LensLabel& other) const;
};
using LensLabels = std::map<uint32_t, LensLabel>;  // by image_id

// Photos whose EXIF names the same camera, and focal lengths that differ by 1 % at most from one to
// the next, have the same label. Photos without either, or that cannot be read, have none. names:
// image_id -> name below the folder; nothing without a folder.
LensLabels ReadLensLabels(const std::map<uint32_t, std::string>& names,
                          const std::string& image_path);

}  // namespace roomtex
