#include "colmap_ext/lens_labels.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/photo.h"
#include "core/stays_inside.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr double kSameFocalShare = 0.01;

}  // namespace

double LensLabel::TimesLongerThan(const LensLabel& other) const {
  constexpr double kSameSensor = 0.1;  // share; equivalents on film are rounded
  const double times = focal_length_mm / other.focal_length_mm;
  if (!(focal_length_on_film_mm > 0 && other.focal_length_on_film_mm > 0)) return times;
  const double on_film = focal_length_on_film_mm / other.focal_length_on_film_mm;
  return std::abs(on_film / times - 1) > kSameSensor ? on_film : times;
}

LensLabels ReadLensLabels(const std::map<uint32_t, std::string>& names,
                          const std::string& image_path) {
  LensLabels labels;
  if (image_path.empty()) return labels;
  struct Photo {
    double focal_length, on_film;
    uint32_t id;
  };
  std::map<std::string, std::vector<Photo>> of_camera;
  for (const auto& [id, name] : names) {
    if (!StaysInside(name)) continue;
    const LensData data = ReadLensData(image_path + "/" + name);
    if (data.camera.empty() && !data.focal_length_mm) continue;
    of_camera[data.camera].push_back(
        {data.focal_length_mm.value_or(0), data.focal_length_on_film_mm.value_or(0), id});
  }
  for (auto& [camera, photos] : of_camera) {
    std::sort(photos.begin(), photos.end(), [](const Photo& a, const Photo& b) {
      return std::pair(a.focal_length, a.id) < std::pair(b.focal_length, b.id);
    });
    double first = 0, last = 0;
    for (const auto& [focal_length, on_film, id] : photos) {
      if (!(focal_length <= last * (1 + kSameFocalShare))) first = focal_length;
      last = focal_length;
      labels[id] = {camera + (first > 0 ? " at " + Number(first, 2) + " mm" : ""), focal_length,
                    on_film};
    }
  }
  return labels;
}

}  // namespace roomtex
