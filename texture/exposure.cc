#include "texture/exposure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Cholesky>

#include "texture/blend.h"

namespace roomtex {
namespace {

// Light that is neither noise nor near clipping.
constexpr float kDarkest = 0.02f, kLightest = 0.8f;
// Observations of less weight lie in a depth-boundary band or are clipped.
constexpr float kLeastWeight = 0.002f;

// One in this many samples is looked at, so that time stays bounded.
size_t SampleStride(const ObservationStore& store, size_t num_photos) {
  const size_t wanted = std::max<size_t>(60000, 1000 * num_photos);
  return store.num_samples() / wanted + 1;
}

// What two statements about log exposure are trusted to (standard deviations). A camera's nominal
// exposure is true to about a tenth; the median ratio of an overlap to a hundredth, because
// materials shine differently into different directions.
constexpr double kExifSigma = 0.1, kOverlapSigma = 0.01;
// Beyond this many standard deviations a statement loses its weight.
constexpr double kRobustScale = 3.0;

bool IsWellExposed(const Eigen::Vector3f& color) {
  return color.minCoeff() >= kDarkest && color.maxCoeff() <= kLightest;
}

float MedianInPlace(std::vector<float>* values) {
  const auto middle = values->begin() + values->size() / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

struct LogRatio {
  uint32_t pair;  // photo_a * num_photos + photo_b
  Eigen::Vector4f value;
};

Overlap SummariseOverlap(const LogRatio* begin, const LogRatio* end, int num_photos) {
  Overlap overlap;
  overlap.photo_a = static_cast<int>(begin->pair) / num_photos;
  overlap.photo_b = static_cast<int>(begin->pair) % num_photos;
  overlap.num_samples = static_cast<int>(end - begin);
  std::vector<float> values(end - begin);
  for (int channel = 0; channel < 4; ++channel) {
    std::transform(begin, end, values.begin(),
                   [channel](const LogRatio& ratio) { return ratio.value[channel]; });
    overlap.log_ratio[channel] = MedianInPlace(&values);
  }
  for (float& value : values) value = std::abs(value - overlap.log_ratio[3]);
  overlap.spread = 1.4826f * MedianInPlace(&values);
  return overlap;
}

// One statement: coefficients * x = value, known to sigma.
struct Equation {
  int plus, minus;  // unknowns with the coefficients +1 and -1; minus < 0 = none
  int third;        // unknown with the coefficient -1; < 0 = none
  double value, sigma;
  bool robust;
};

double Residual(const Equation& e, const Eigen::VectorXd& x) {
  return x[e.plus] - (e.minus >= 0 ? x[e.minus] : 0) - (e.third >= 0 ? x[e.third] : 0) - e.value;
}

// Iteratively reweighted least squares with Cauchy weights.
Eigen::VectorXd SolveRobust(const std::vector<Equation>& equations, int num_unknowns) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns);
  for (int iteration = 0; iteration < 30; ++iteration) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(num_unknowns, num_unknowns) * 1e-6;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(num_unknowns);
    for (const Equation& e : equations) {
      double weight = 1 / (e.sigma * e.sigma);
      if (e.robust && iteration > 0) {
        const double r = Residual(e, x) / e.sigma / kRobustScale;
        weight /= 1 + r * r;
      }
      const int index[3] = {e.plus, e.minus, e.third};
      const double sign[3] = {1, -1, -1};
      for (int i = 0; i < 3; ++i) {
        if (index[i] < 0) continue;
        right[index[i]] += weight * sign[i] * e.value;
        for (int j = 0; j < 3; ++j) {
          if (index[j] >= 0) normal(index[i], index[j]) += weight * sign[i] * sign[j];
        }
      }
    }
    const Eigen::VectorXd next = normal.ldlt().solve(right);
    const double change = (next - x).cwiseAbs().maxCoeff();
    x = next;
    if (change < 1e-9) break;
  }
  return x;
}

// log factor that undoes the exposure in EXIF; none without EXIF.
std::vector<std::optional<double>> ExifLogGains(const std::vector<ExposureData>& exposures) {
  std::vector<std::optional<double>> gains;
  for (const ExposureData& data : exposures) {
    const auto exposure = data.RelativeExposure();
    gains.push_back(exposure ? std::optional<double>(-std::log(*exposure)) : std::nullopt);
  }
  return gains;
}

// Photos that EXIF or a chain of overlaps ties to the largest group.
std::vector<int> FindUnconnected(const std::vector<std::optional<double>>& exif,
                                 const std::vector<Overlap>& overlaps) {
  const int n = static_cast<int>(exif.size());
  std::vector<int> group(n + 1);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&group](int i) {
    while (group[i] != i) i = group[i] = group[group[i]];
    return i;
  };
  for (const Overlap& overlap : overlaps) group[root(overlap.photo_a)] = root(overlap.photo_b);
  for (int i = 0; i < n; ++i) {
    if (exif[i]) group[root(i)] = root(n);
  }
  std::map<int, int> sizes;
  for (int i = 0; i < n; ++i) ++sizes[root(i)];
  int largest = root(0);
  for (const auto& [g, size] : sizes) {
    if (size > sizes[largest]) largest = g;
  }
  std::vector<int> unconnected;
  for (int i = 0; i < n; ++i) {
    if (root(i) != largest) unconnected.push_back(i);
  }
  return unconnected;
}

// Log gains of one channel (0..2) or of the sum (3). Unknowns: one per photo and one per kind of
// camera, because shutter times of two makes do not compare.
std::vector<double> SolveChannel(const std::vector<ExposureData>& exposures,
                                 const std::vector<std::optional<double>>& exif,
                                 const std::vector<Overlap>& overlaps, int channel,
                                 bool exif_rules) {
  const int n = static_cast<int>(exif.size());
  std::map<std::string, int> camera_unknown;
  std::vector<Equation> equations;
  for (int i = 0; i < n; ++i) {
    if (!exif[i]) continue;
    const int next = n + static_cast<int>(camera_unknown.size());
    const int camera =
        camera_unknown.emplace(exif_rules ? "" : exposures[i].camera, next).first->second;
    equations.push_back({i, camera, -1, *exif[i], exif_rules ? 1e-5 : kExifSigma, !exif_rules});
  }
  // Cameras compare loosely; the unknown of the first one stays free, the gains' common factor is
  // set later.
  for (const auto& [name, unknown] : camera_unknown) {
    if (unknown != n) equations.push_back({unknown, n, -1, 0.0, 0.5, true});
  }
  for (const Overlap& overlap : overlaps) {
    const double sigma2 =
        kOverlapSigma * kOverlapSigma + overlap.spread * overlap.spread * 2.0 / overlap.num_samples;
    equations.push_back({overlap.photo_a, overlap.photo_b, -1, -overlap.log_ratio[channel],
                         std::sqrt(sigma2), true});
  }
  const Eigen::VectorXd x = SolveRobust(equations, n + static_cast<int>(camera_unknown.size()));
  return {x.data(), x.data() + n};
}

}  // namespace

std::vector<std::string> ExposureOptions::Problems() const {
  if (mode != "exif" && mode != "match" && mode != "none") {
    return {"--Exposure.mode must be exif, match or none"};
  }
  return {};
}

std::vector<Overlap> FindOverlaps(const ObservationStore& store, int num_photos, int min_samples) {
  std::vector<LogRatio> ratios;
  const size_t stride = SampleStride(store, num_photos);
  for (size_t sample = 0; sample < store.num_samples(); sample += stride) {
    const Observation* observations = store.Begin(sample);
    std::array<std::pair<int, Eigen::Vector4f>, 64> usable;
    int count = 0;
    for (int i = 0; i < store.Count(sample) && count < 64; ++i) {
      if (UnpackWeight(observations[i].weight) < kLeastWeight) continue;
      const Eigen::Vector3f color = UnpackColor(observations[i].color);
      if (!IsWellExposed(color)) continue;
      Eigen::Vector4f logs;
      for (int k = 0; k < 3; ++k) logs[k] = std::log(color[k]);
      logs[3] = std::log(color.sum());
      usable[count++] = {observations[i].photo, logs};
    }
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < count; ++j) {
        if (usable[i].first >= usable[j].first) continue;
        const auto pair = static_cast<uint32_t>(usable[i].first * num_photos + usable[j].first);
        ratios.push_back({pair, usable[i].second - usable[j].second});
      }
    }
  }
  std::vector<uint32_t> order(ratios.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return ratios[a].pair != ratios[b].pair ? ratios[a].pair < ratios[b].pair : a < b;
  });
  std::vector<Overlap> overlaps;
  std::vector<LogRatio> of_pair;
  for (size_t begin = 0; begin < order.size();) {
    of_pair.clear();
    size_t end = begin;
    while (end < order.size() && ratios[order[end]].pair == ratios[order[begin]].pair) {
      of_pair.push_back(ratios[order[end++]]);
    }
    if (static_cast<int>(of_pair.size()) >= min_samples) {
      overlaps.push_back(
          SummariseOverlap(of_pair.data(), of_pair.data() + of_pair.size(), num_photos));
    }
    begin = end;
  }
  return overlaps;
}

ExposureSolution SolveExposure(const std::vector<ExposureData>& exposures,
                               const std::vector<Overlap>& overlaps,
                               const ExposureOptions& options) {
  const int n = static_cast<int>(exposures.size());
  ExposureSolution solution;
  solution.gains.assign(n, Eigen::Vector3f::Ones());
  if (options.mode == "none" || n == 0) return solution;
  const std::vector<std::optional<double>> exif = ExifLogGains(exposures);
  const bool exif_rules = options.mode == "exif";
  for (const auto& gain : exif) solution.without_exif += exif_rules && !gain;
  solution.unconnected = FindUnconnected(exif, overlaps);

  const std::vector<double> log_gains = SolveChannel(exposures, exif, overlaps, 3, exif_rules);
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return log_gains[a] != log_gains[b] ? log_gains[a] < log_gains[b] : a < b;
  });
  solution.reference_photo = order[(n - 1) / 2];
  const double reference = log_gains[solution.reference_photo];

  std::vector<double> exif_offsets;
  for (int i = 0; i < n; ++i) {
    if (exif[i]) exif_offsets.push_back(log_gains[i] - *exif[i]);
  }
  if (!exif_offsets.empty()) {
    const auto middle = exif_offsets.begin() + exif_offsets.size() / 2;
    std::nth_element(exif_offsets.begin(), middle, exif_offsets.end());
    for (int i = 0; i < n; ++i) {
      if (exif[i] && std::abs(log_gains[i] - *exif[i] - *middle) > 0.35) {
        solution.contradicted.push_back(i);
      }
    }
  }
  std::array<std::vector<double>, 3> channels = {log_gains, log_gains, log_gains};
  Eigen::Vector3d references = Eigen::Vector3d::Constant(reference);
  if (options.white_balance) {
    for (int k = 0; k < 3; ++k) {
      channels[k] = SolveChannel(exposures, exif, overlaps, k, false);
      references[k] = channels[k][solution.reference_photo];
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      // A photo that nothing ties to the others stays as it is.
      const bool tied =
          !std::binary_search(solution.unconnected.begin(), solution.unconnected.end(), i);
      solution.gains[i][k] =
          tied ? static_cast<float>(std::exp(channels[k][i] - references[k])) : 1.0f;
    }
  }
  return solution;
}

float OutputScale(const ObservationStore& store, const std::vector<Eigen::Vector3f>& gains) {
  std::vector<float> lightest;
  const size_t stride = SampleStride(store, gains.size());
  for (size_t sample = 0; sample < store.num_samples(); sample += stride) {
    if (store.Count(sample) == 0) continue;
    const BlendedSample blended =
        BlendSample(store.Begin(sample), store.Count(sample), gains, BlendOptions().outlier);
    if (blended.dominant_photo >= 0) lightest.push_back(blended.blend.maxCoeff());
  }
  if (lightest.empty()) return 1;
  const auto high =
      lightest.begin() + static_cast<long>(0.99 * static_cast<double>(lightest.size() - 1));
  std::nth_element(lightest.begin(), high, lightest.end());
  return std::clamp(1 / std::max(*high, 1e-6f), 0.5f, 1.0f);
}

Disagreement MeasureDisagreement(const ObservationStore& store,
                                 const std::vector<Eigen::Vector3f>& gains) {
  Disagreement result;
  const auto byte_difference = [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    int sum = 0;
    for (int k = 0; k < 3; ++k) {
      sum += std::abs(int{SrgbByteFromLinear(a[k])} - int{SrgbByteFromLinear(b[k])});
    }
    return sum / 3.0;
  };
  const size_t stride = SampleStride(store, gains.size());
  // A sample far away in the order, for the difference at random; golden-section steps visit all
  // parts.
  const auto far_step = static_cast<size_t>(0.381966 * static_cast<double>(store.num_samples()));
  size_t num_random = 0;
  for (size_t sample = 0; sample < store.num_samples(); sample += stride) {
    const Observation* o = store.Begin(sample);
    const size_t other = (sample + far_step) % store.num_samples();
    for (int i = 0; i < store.Count(sample); ++i) {
      const Eigen::Vector3f a = UnpackColor(o[i].color);
      const Eigen::Vector3f& gain_a = gains[o[i].photo];
      for (int j = i + 1; j < store.Count(sample); ++j) {
        const Eigen::Vector3f b = UnpackColor(o[j].color);
        result.before += byte_difference(a, b);
        result.after += byte_difference(a.cwiseProduct(gain_a), b.cwiseProduct(gains[o[j].photo]));
        ++result.num_pairs;
        if (store.Count(other) == 0) continue;
        const Observation& random = store.Begin(other)[0];
        result.at_random += byte_difference(
            a.cwiseProduct(gain_a), UnpackColor(random.color).cwiseProduct(gains[random.photo]));
        ++num_random;
      }
    }
  }
  if (result.num_pairs > 0) {
    result.before /= static_cast<double>(result.num_pairs);
    result.after /= static_cast<double>(result.num_pairs);
  }
  if (num_random > 0) result.at_random /= static_cast<double>(num_random);
  return result;
}

}  // namespace roomtex
