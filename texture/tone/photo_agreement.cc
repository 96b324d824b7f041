#include "texture/tone/photo_agreement.h"

#include <algorithm>
#include <cmath>

#include "core/cpu_stages.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kMaxSamples = 1'000'000;  // that are looked at; more say nothing new
constexpr float kClipped = 0.99f;
constexpr size_t kMinSamples = 1000;  // fewer say nothing
constexpr double kFurther = 1.3;      // than the median photo
constexpr float kDifferent = 0.1f;    // brightness, on a scale about even to the eye

// Sums over the samples of a photo, of its brightness p and the others' median o.
struct Sums {
  double n = 0, p = 0, o = 0, pp = 0, oo = 0, po = 0;

  void Add(double photo, double others) {
    n += 1;
    p += photo;
    o += others;
    pp += photo * photo;
    oo += others * others;
    po += photo * others;
  }
  PhotoAgreement Agreement() const {
    PhotoAgreement result;
    result.num_samples = static_cast<size_t>(n);
    if (n < 2) return result;
    const double var_p = pp / n - p * p / (n * n), var_o = oo / n - o * o / (n * n);
    const double cov = po / n - p * o / (n * n);
    if (var_p > 0 && var_o > 0) result.correlation = cov / std::sqrt(var_p * var_o);
    if (var_p > 0) {
      const double explained = std::max(0.0, result.correlation);
      result.difference = std::sqrt(var_p * (1 - explained * explained));
    }
    return result;
  }
};

// visit: of samples, evenly chosen, that least_views photos and more show, each photo and its
// brightness there; observations in doubt and clipped ones left out.
template <typename Visit>
void VisitSamples(const ObservationStore& store, const std::vector<Eigen::Vector3f>& gains,
                  size_t least_views, const Visit& visit) {
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
    if (seen.size() >= least_views) visit(seen);
  }
}

// Two groups of two values and more, each of its own mind. values: sorted.
bool IsDivided(const std::vector<float>& values) {
  float gap = 0, spread = 0;
  for (size_t k = 2; k + 2 <= values.size(); ++k) {
    if (values[k] - values[k - 1] <= gap) continue;
    gap = values[k] - values[k - 1];
    spread = std::max(values[k - 1] - values.front(), values.back() - values[k]);
  }
  return gap > kDifferent && gap > 2 * spread;
}

}  // namespace

std::vector<PhotoAgreement> MeasureAgreement(const ObservationStore& store,
                                             const std::vector<Eigen::Vector3f>& gains) {
  const CpuTimer timer(CpuStage::kExposure, CpuTimer::Scope::kProcess);
  std::vector<Sums> sums(gains.size());
  std::vector<float> others;
  VisitSamples(store, gains, 3, [&](const std::vector<std::pair<int, float>>& seen) {
    for (const auto& [photo, brightness] : seen) {
      others.clear();
      for (const auto& [other, value] : seen) {
        if (other != photo) others.push_back(value);
      }
      sums[photo].Add(brightness, Median(&others));
    }
  });
  std::vector<PhotoAgreement> result;
  for (const Sums& sum : sums) result.push_back(sum.Agreement());
  return result;
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

DividedPhotos FindDividedPhotos(const ObservationStore& store,
                                const std::vector<Eigen::Vector3f>& gains) {
  const CpuTimer timer(CpuStage::kExposure, CpuTimer::Scope::kProcess);
  DividedPhotos divided;
  std::vector<float> values;
  VisitSamples(store, gains, 4, [&](const std::vector<std::pair<int, float>>& seen) {
    values.clear();
    for (const auto& [photo, brightness] : seen) values.push_back(brightness);
    std::sort(values.begin(), values.end());
    ++divided.num_samples;
    divided.num_unlike += values.back() - values.front() > kDifferent;
    divided.num_divided += IsDivided(values);
  });
  return divided;
}

bool DividedPhotos::Fold(const std::vector<PhotoAgreement>& agreement) const {
  // Two folded rooms: 0.13 and 0.18 of all, 0.54 and 0.70 of those that are unlike; the best
  // quarter of the photos correlates by 0.77 and 0.74. Right poses: kitchen, whose scan drifts,
  // 0.025, 0.11 and 0.96; people in half of twelve photos 0.004, 0.02 and 0.89.
  constexpr double kLeastOfAll = 0.05, kLeastOfUnlike = 0.3, kLeastCorrelation = 0.85;
  std::vector<double> correlations;
  for (const PhotoAgreement& photo : agreement) {
    if (photo.num_samples >= kMinSamples) correlations.push_back(photo.correlation);
  }
  return num_samples >= kMinSamples && ShareOfAll() > kLeastOfAll &&
         ShareOfUnlike() > kLeastOfUnlike && Quantile(&correlations, 0.75) < kLeastCorrelation;
}

}  // namespace roomtex
