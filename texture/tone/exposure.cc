#include "texture/tone/exposure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "core/cpu_stages.h"
#include "core/decompositions.h"
#include "core/option_fields.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "texture/sampling/blend.h"
#include "texture/tone/exposure_prior.h"

namespace roomtex {
namespace {

// Standard deviation of the median log ratio of an overlap, because materials shine differently
// into different directions.
constexpr double kOverlapSigma = 0.01;
// Cameras of two kinds compare to this.
constexpr double kKindSigma = 0.5;
// White balance, per channel.
constexpr double kTintSigma = 0.1;
// Beyond this many standard deviations a statement loses its weight.
constexpr double kRobustScale = 3.0;
// EXIF that is off by more (a third of an EV, robust standard deviation) says nothing.
constexpr double kUselessExif = 0.23;
constexpr double kBestExif = 0.03;
// Half an EV.
constexpr double kContradiction = 0.35;

// One statement: x[plus] - x[minus] = value, known to sigma.
struct Equation {
  int plus, minus;
  double value, sigma;
};

// Iteratively reweighted least squares with Cauchy weights.
Eigen::VectorXd SolveRobust(const std::vector<Equation>& equations, int num_unknowns) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns);
  for (int iteration = 0; iteration < 30; ++iteration) {
    // What nothing ties down stays near 0.
    Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(num_unknowns, num_unknowns) * 1e-6;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(num_unknowns);
    for (const Equation& e : equations) {
      double weight = 1 / (e.sigma * e.sigma);
      if (iteration > 0) {
        const double r = (x[e.plus] - x[e.minus] - e.value) / e.sigma / kRobustScale;
        weight = CauchyWeight(r, weight);
      }
      right[e.plus] += weight * e.value;
      right[e.minus] -= weight * e.value;
      normal(e.plus, e.plus) += weight;
      normal(e.minus, e.minus) += weight;
      normal(e.plus, e.minus) -= weight;
      normal(e.minus, e.plus) -= weight;
    }
    const Eigen::VectorXd next = SolveSymmetric(normal, right);
    const double change = (next - x).cwiseAbs().maxCoeff();
    x = next;
    if (change < 1e-9) break;
  }
  return x;
}

double OverlapSigma(const Overlap& overlap) {
  const double noise2 = overlap.spread * overlap.spread * 2.0 / overlap.num_samples;
  return std::sqrt(kOverlapSigma * kOverlapSigma + noise2);
}

// Log gains of the channels' sum. Unknowns: one per photo and one per kind of EXIF.
std::vector<double> SolveBrightness(const ExposurePrior& prior,
                                    const std::vector<Overlap>& overlaps) {
  const int n = static_cast<int>(prior.kind.size());
  std::vector<Equation> equations;
  for (int i = 0; i < n; ++i) {
    if (prior.log_gain[i]) {
      equations.push_back({i, n + prior.kind[i], *prior.log_gain[i], prior.sigma});
    }
  }
  for (int kind = 1; kind < prior.num_kinds; ++kind) {
    equations.push_back({n + kind, n, 0.0, kKindSigma});
  }
  for (const Overlap& overlap : overlaps) {
    equations.push_back(
        {overlap.photo_a, overlap.photo_b, -overlap.log_ratio[3], OverlapSigma(overlap)});
  }
  const Eigen::VectorXd x = SolveRobust(equations, n + prior.num_kinds);
  return {x.data(), x.data() + n};
}

// Log gains of a channel beside those of the sum; photos do not differ without a reason.
std::vector<double> SolveTints(int num_photos, const std::vector<Overlap>& overlaps, int channel) {
  std::vector<Equation> equations;
  for (int i = 0; i < num_photos; ++i) equations.push_back({i, num_photos, 0.0, kTintSigma});
  for (const Overlap& overlap : overlaps) {
    const double ratio = overlap.log_ratio[channel] - overlap.log_ratio[3];
    equations.push_back({overlap.photo_a, overlap.photo_b, -ratio, OverlapSigma(overlap)});
  }
  const Eigen::VectorXd x = SolveRobust(equations, num_photos + 1);
  return {x.data(), x.data() + num_photos};
}

void FindContradictions(const ExposurePrior& prior, const std::vector<double>& log_gains,
                        ExposureSolution* solution) {
  for (int kind = 0; kind < prior.num_kinds; ++kind) {
    std::vector<double> departures;
    for (size_t i = 0; i < log_gains.size(); ++i) {
      if (prior.kind[i] == kind) departures.push_back(log_gains[i] - *prior.log_gain[i]);
    }
    const double middle = Median(departures);
    for (size_t i = 0; i < log_gains.size(); ++i) {
      if (prior.kind[i] != kind) continue;
      if (std::abs(log_gains[i] - *prior.log_gain[i] - middle) > kContradiction) {
        solution->contradicted.push_back(static_cast<int>(i));
      }
    }
  }
  std::sort(solution->contradicted.begin(), solution->contradicted.end());
}

// What ties the photos' exposures together.
struct ExposureTies {
  ExposurePrior prior;
  std::vector<int> overlap_groups, groups;  // by overlaps alone, with EXIF
};

// Also fills in what the solution says about them.
ExposureTies TieExposures(const std::vector<ExposureData>& exposures,
                          const std::vector<Overlap>& overlaps, const ExposureOptions& options,
                          ExposureSolution* solution) {
  const int n = static_cast<int>(exposures.size());
  const bool exif_rules = options.mode == "exif";
  ExposureTies ties;
  ties.prior = PriorFromExif(exposures, exif_rules);
  ties.overlap_groups = GroupPhotos(n, overlaps, nullptr);
  if (exif_rules) {
    ties.prior.sigma = 1e-5;
    for (const auto& gain : ties.prior.log_gain) solution->without_exif += !gain;
  } else {
    ExposurePrior none = ties.prior;
    none.Forget();
    solution->exif_scatter =
        ExifScatter(ties.prior, ties.overlap_groups, SolveBrightness(none, overlaps));
    if (solution->exif_scatter) {
      ties.prior.sigma = std::max(*solution->exif_scatter, kBestExif);
      solution->exif_ignored = ties.prior.sigma > kUselessExif;
      if (solution->exif_ignored) ties.prior.Forget();
    }
  }
  ties.groups = GroupPhotos(n, overlaps, &ties.prior);
  const int largest_overlap = LargestGroup(ties.overlap_groups),
            largest = LargestGroup(ties.groups);
  for (int i = 0; i < n; ++i) {
    if (ties.groups[i] != largest) {
      solution->unconnected.push_back(i);
    } else if (ties.overlap_groups[i] != largest_overlap && !exif_rules) {
      solution->by_exif.push_back(i);
    }
  }
  return ties;
}

// Gains of log gains per channel and photo: the photo of median exposure gets 1, in the largest
// group and in every group that nothing ties to it.
void FinishGains(const ExposureTies& ties, const std::array<std::vector<double>, 3>& log_gains,
                 ExposureSolution* solution) {
  const int n = static_cast<int>(ties.groups.size());
  const auto brightness = [&](int i) {
    return (log_gains[0][i] + log_gains[1][i] + log_gains[2][i]) / 3;
  };
  std::map<int, std::vector<int>> photos_of;
  for (int i = 0; i < n; ++i) photos_of[ties.groups[i]].push_back(i);
  solution->gains.assign(n, Eigen::Vector3f::Ones());
  for (auto& [group, photos] : photos_of) {
    std::sort(photos.begin(), photos.end(), [&](int a, int b) {
      return brightness(a) != brightness(b) ? brightness(a) < brightness(b) : a < b;
    });
    // The photo of median exposure sets the brightness, the median over all photos the balance of
    // the colours: one tinted photo must not tint the result.
    const int reference = photos[(photos.size() - 1) / 2];
    if (group == LargestGroup(ties.groups)) solution->reference_photo = reference;
    for (int k = 0; k < 3; ++k) {
      std::vector<double> tints;
      for (const int i : photos) tints.push_back(log_gains[k][i] - brightness(i));
      const double from = brightness(reference) + Median(tints);
      for (const int i : photos) {
        solution->gains[i][k] = static_cast<float>(std::exp(log_gains[k][i] - from));
      }
    }
  }
}

}  // namespace

void ExposureOptions::Declare(OptionFields* fields) {
  fields->Choice("Exposure.mode", &mode, {"exif", "match", "none"},
                 "exif: shutter time, aperture and ISO; match: from what several photos see, "
                 "with EXIF as a prior; none: photos as they are.");
  fields->Bool("Exposure.white_balance", &white_balance,
               "Match red, green and blue one by one (white balance that changed); with "
               "--Exposure.mode match.");
  fields->Bool("Exposure.vignetting", &vignetting,
               "Find and undo the darkening towards the photos' corners.");
  fields->Text("Exposure.response", &response,
               "How bytes become light: srgb; estimate (from photos that overlap, needs EXIF "
               "exposures that differ by an EV); or a file with a line per level 0-255: its "
               "linear light, one number or three (red green blue).");
  fields->Require(mode != "none" || (!vignetting && response != "estimate"),
                  "--Exposure.mode none leaves photos as they are: --Exposure.vignetting and "
                  "--Exposure.response estimate go with exif or match");
  fields->Require(!response.empty(), "--Exposure.response must be srgb, estimate or a file");
  fields->InputPath("Exposure.bracket_path", &bracket_path,
                    "Folder with photos of one still scene, exposed differently (EXIF): the "
                    "response is found from them.");
  fields->Require(bracket_path.empty() || response == "srgb",
                  "--Exposure.bracket_path and --Exposure.response are two sources of one "
                  "curve: give one of them");
}

std::vector<std::string> ExposureOptions::Problems() const { return ProblemsOf(*this); }

ExposureSolution SolveExposure(const std::vector<ExposureData>& exposures,
                               const std::vector<Overlap>& overlaps,
                               const ExposureOptions& options) {
  ExposureSolution solution;
  solution.gains.assign(exposures.size(), Eigen::Vector3f::Ones());
  if (options.mode == "none" || exposures.empty()) return solution;
  const ExposureTies ties = TieExposures(exposures, overlaps, options, &solution);
  const std::vector<double> log_gains = SolveBrightness(ties.prior, overlaps);
  if (options.mode == "exif") {
    const ExposurePrior doubted = PriorFromExif(exposures, true);
    FindContradictions(doubted, SolveBrightness(doubted, overlaps), &solution);
  } else if (!solution.exif_ignored) {
    FindContradictions(ties.prior, log_gains, &solution);
  }
  std::array<std::vector<double>, 3> channels = {log_gains, log_gains, log_gains};
  if (options.white_balance && options.mode == "match") {
    for (int k = 0; k < 3; ++k) {
      const std::vector<double> tints = SolveTints(static_cast<int>(exposures.size()), overlaps, k);
      for (size_t i = 0; i < tints.size(); ++i) channels[k][i] += tints[i];
    }
  }
  FinishGains(ties, channels, &solution);
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
  return std::clamp(1 / std::max(Quantile(&lightest, 0.99), 1e-6f), 0.5f, 1.0f);
}

namespace {

using Bytes = std::array<int, 3>;  // sRGB

Bytes ToBytes(const Eigen::Vector3f& light) {
  return {SrgbByteFromLinear(light[0]), SrgbByteFromLinear(light[1]), SrgbByteFromLinear(light[2])};
}

double Difference(const Bytes& a, const Bytes& b) {
  return (std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2])) / 3.0;
}

}  // namespace

Disagreement MeasureDisagreement(const ObservationStore& store,
                                 const std::vector<Eigen::Vector3f>& gains) {
  const CpuTimer timer(CpuStage::kExposure, CpuTimer::Scope::kProcess);
  Disagreement result;
  const auto bytes_after = [&gains](const Observation& observation) {
    return ToBytes(UnpackColor(observation.color).cwiseProduct(gains[observation.photo]));
  };
  const size_t stride = SampleStride(store, gains.size());
  // A sample far away in the order, for the difference at random; golden-section steps visit all
  // parts.
  const auto far_step = static_cast<size_t>(0.381966 * static_cast<double>(store.num_samples()));
  size_t num_random = 0;
  std::vector<Bytes> before, after;
  for (size_t sample = 0; sample < store.num_samples(); sample += stride) {
    const Observation* o = store.Begin(sample);
    const int count = NumThatCount(o, store.Count(sample), gains);
    if (count < 2) continue;
    before.clear();
    after.clear();
    for (int i = 0; i < count; ++i) {
      before.push_back(ToBytes(UnpackColor(o[i].color)));
      after.push_back(bytes_after(o[i]));
    }
    const size_t other = (sample + far_step) % store.num_samples();
    const bool has_other = store.Count(other) > 0;
    const Bytes random = has_other ? bytes_after(store.Begin(other)[0]) : Bytes{};
    for (int i = 0; i < count; ++i) {
      const int num_pairs = count - 1 - i;
      for (int j = i + 1; j < count; ++j) {
        result.before += Difference(before[i], before[j]);
        result.after += Difference(after[i], after[j]);
      }
      result.num_pairs += num_pairs;
      if (!has_other) continue;
      result.at_random += num_pairs * Difference(after[i], random);
      num_random += num_pairs;
    }
  }
  if (result.num_pairs > 0) {
    result.before /= static_cast<double>(result.num_pairs);
    result.after /= static_cast<double>(result.num_pairs);
  }
  if (num_random > 0) result.at_random /= static_cast<double>(num_random);
  return result;
}

float SampleDisagreement(const Observation* observations, int count,
                         const std::vector<Eigen::Vector3f>& gains) {
  count = NumThatCount(observations, count, gains);
  if (count < 2) return std::numeric_limits<float>::quiet_NaN();
  std::vector<Bytes> after;
  after.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    const Observation& o = observations[i];
    after.push_back(ToBytes(UnpackColor(o.color).cwiseProduct(gains[o.photo])));
  }
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) sum += Difference(after[i], after[j]);
  }
  return static_cast<float>(sum / (0.5 * count * (count - 1)));
}

}  // namespace roomtex
