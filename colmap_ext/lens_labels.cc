#include "colmap_ext/lens_labels.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/photo.h"
#include "core/stays_inside.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr double kSameFocalShare = 0.01;

}  // namespace

LensLabels ReadLensLabels(const std::map<uint32_t, std::string>& names,
                          const std::string& image_path) {
  LensLabels labels;
  if (image_path.empty()) return labels;
  std::map<std::string, std::vector<std::pair<double, uint32_t>>> of_camera;
  for (const auto& [id, name] : names) {
    if (!StaysInside(name)) continue;
    const LensData data = ReadLensData(image_path + "/" + name);
    if (data.camera.empty() && !data.focal_length_mm) continue;
    of_camera[data.camera].emplace_back(data.focal_length_mm.value_or(0), id);
  }
  for (auto& [camera, photos] : of_camera) {
    std::sort(photos.begin(), photos.end());
    double first = 0, last = 0;
    for (const auto& [focal_length, id] : photos) {
      if (!(focal_length <= last * (1 + kSameFocalShare))) first = focal_length;
      last = focal_length;
      labels[id] = {camera + (first > 0 ? " at " + Number(first, 2) + " mm" : ""), focal_length};
    }
  }
  return labels;
}

}  // namespace roomtex
