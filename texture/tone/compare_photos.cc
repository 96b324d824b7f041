#include "texture/tone/compare_photos.h"

#include <cmath>
#include <utility>

#include "core/cpu_stages.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kMaxSamples = 1'000'000;  // that are looked at; more say nothing new
constexpr float kClipped = 0.99f;
constexpr size_t kMinSamples = 1000;  // fewer say nothing
constexpr double kFurther = 1.3;      // than the median photo

}  // namespace

PhotoComparison ComparePhotos(const ObservationStore& store,
                              const std::vector<Eigen::Vector3f>& gains) {
  const CpuTimer timer(CpuStage::kExposure, CpuTimer::Scope::kProcess);
  PhotoComparison comparison(gains.size());
  std::vector<std::pair<int, float>> seen;
  const size_t stride = store.num_samples() / kMaxSamples + 1;
  for (size_t sample = 0; sample < store.num_samples(); sample += stride) {
    const Observation* const first = store.Begin(sample);
    seen.clear();
    for (int i = 0; i < store.Count(sample); ++i) {
      const Eigen::Vector3f color = UnpackColor(first[i].color);
      if (first[i].in_doubt || color.maxCoeff() > kClipped) continue;
      seen.emplace_back(first[i].photo,
                        std::sqrt(color.cwiseProduct(gains[first[i].photo]).mean()));
    }
    comparison.Add(seen);
  }
  return comparison;
}

std::vector<int> FindForeignPhotos(const std::vector<PhotoAgreement>& agreement,
                                   double min_correlation) {
  std::vector<double> differences;
  for (const PhotoAgreement& photo : agreement) {
    if (photo.num_samples >= kMinSamples) differences.push_back(photo.difference);
  }
  const double usual = Median(&differences);
  std::vector<int> foreign;
  for (size_t i = 0; i < agreement.size(); ++i) {
    if (agreement[i].num_samples >= kMinSamples && agreement[i].correlation < min_correlation &&
        agreement[i].difference > kFurther * usual) {
      foreign.push_back(static_cast<int>(i));
    }
  }
  return foreign;
}

}  // namespace roomtex
