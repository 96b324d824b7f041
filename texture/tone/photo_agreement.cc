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

}  // namespace

std::vector<PhotoAgreement> MeasureAgreement(const ObservationStore& store,
                                             const std::vector<Eigen::Vector3f>& gains) {
  const CpuTimer timer(CpuStage::kExposure, CpuTimer::Scope::kProcess);
  std::vector<Sums> sums(gains.size());
  std::vector<std::pair<int, float>> seen;  // photo and brightness
  std::vector<float> others;
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
    if (seen.size() < 3) continue;
    for (const auto& [photo, brightness] : seen) {
      others.clear();
      for (const auto& [other, value] : seen) {
        if (other != photo) others.push_back(value);
      }
      sums[photo].Add(brightness, Median(&others));
    }
  }
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

bool ContradictEachOther(const std::vector<PhotoAgreement>& agreement) {
  // Medians of sets whose photos stand where they were: correlations of 0.95 (kitchen, whose scan
  // drifts) and more; of two folded rooms 0.55 and 0.73, with differences of 0.1.
  constexpr double kLeastCorrelation = 0.85, kMostDifference = 0.03;
  constexpr size_t kFewPhotos = 4;
  std::vector<double> correlations, differences;
  for (const PhotoAgreement& photo : agreement) {
    if (photo.num_samples < kMinSamples) continue;
    correlations.push_back(photo.correlation);
    differences.push_back(photo.difference);
  }
  return correlations.size() >= kFewPhotos && Median(&correlations) < kLeastCorrelation &&
         Median(&differences) > kMostDifference;
}

}  // namespace roomtex
