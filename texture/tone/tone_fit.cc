#include "texture/tone/tone_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "texture/tone/exposure.h"
#include "texture/tone/exposure_prior.h"

namespace roomtex {
namespace {

constexpr double kCauchyScale = 2.0;  // of the robust standard deviation
constexpr int kIterations = 8;
constexpr size_t kMostSamples = 20000;  // looked at: time stays bounded
constexpr int kLensTerms = 3;
constexpr int kCurveTerms = 6;

// Which unknowns there are, and what is known.
struct Unknowns {
  int num_photos = 0;  // a gain each; 0 = gains are known
  int num_lenses = 0;  // kLensTerms each
  int num_curve_terms = 0;

  int lens_begin() const { return num_photos; }
  int curve_begin() const { return num_photos + kLensTerms * num_lenses; }
  int count() const { return curve_begin() + num_curve_terms; }
};

// One view of one channel: log light = value + sum of coefficient * unknown.
struct Row {
  static constexpr int kMost = 1 + kLensTerms + kCurveTerms;
  int size = 0;
  std::array<int, kMost> index;
  std::array<double, kMost> coefficient;
  double value = 0, trust = 0;

  void Add(int unknown, double c) {
    index[size] = unknown;
    coefficient[size++] = c;
  }
  double At(const Eigen::VectorXd& x) const {
    double sum = value;
    for (int i = 0; i < size; ++i) sum += coefficient[i] * x[index[i]];
    return sum;
  }
};

// Views that see the same light: rows [begin[k], begin[k + 1]).
class LightFit {
 public:
  explicit LightFit(const Unknowns& unknowns) : unknowns_(unknowns) {}

  void AddRow(const Row& row) { rows_.push_back(row); }
  void EndLight() {
    if (rows_.size() >= begin_.back() + 2) {
      begin_.push_back(rows_.size());
    } else {
      rows_.resize(begin_.back());
    }
  }
  size_t num_rows() const { return rows_.size(); }

  // priors: value 0 known to these standard deviations, per unknown; 0 = exactly 0.
  Eigen::VectorXd Solve(const Eigen::VectorXd& start, const Eigen::VectorXd& priors) {
    Eigen::VectorXd x = start;
    weights_.assign(rows_.size(), 0);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      Reweigh(x, iteration == 0);
      const Eigen::VectorXd next = SolveOnce(priors);
      const double change = (next - x).cwiseAbs().maxCoeff();
      x = next;
      if (change < 1e-6) break;
    }
    return x;
  }

 private:
  void Reweigh(const Eigen::VectorXd& x, bool first) {
    std::vector<double> residuals(rows_.size());
    for (size_t k = 0; k + 1 < begin_.size(); ++k) {
      double light = 0, total = 0;
      std::vector<std::pair<double, double>> values;
      for (size_t i = begin_[k]; i < begin_[k + 1]; ++i) {
        residuals[i] = rows_[i].At(x);
        values.emplace_back(residuals[i], rows_[i].trust);
        light += weights_[i] * residuals[i];
        total += weights_[i];
      }
      light = first || !(total > 0) ? WeightedMedian(&values) : light / total;
      for (size_t i = begin_[k]; i < begin_[k + 1]; ++i) residuals[i] -= light;
    }
    std::vector<double> sizes(residuals.size());
    std::transform(residuals.begin(), residuals.end(), sizes.begin(),
                   [](double r) { return std::abs(r); });
    sigma_ = std::max(kSigmaPerMad * Median(std::move(sizes)), 1e-3);
    for (size_t i = 0; i < rows_.size(); ++i) {
      const double r = residuals[i] / (kCauchyScale * sigma_);
      weights_[i] = CauchyWeight(r, rows_[i].trust);
    }
  }

  Eigen::VectorXd SolveOnce(const Eigen::VectorXd& priors) const {
    const int n = unknowns_.count();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n), sum = Eigen::VectorXd::Zero(n);
    std::vector<int> touched;
    for (size_t k = 0; k + 1 < begin_.size(); ++k) {
      double total = 0, value = 0;
      touched.clear();
      for (size_t i = begin_[k]; i < begin_[k + 1]; ++i) {
        const Row& row = rows_[i];
        const double w = weights_[i];
        total += w;
        value += w * row.value;
        for (int a = 0; a < row.size; ++a) {
          const double wa = w * row.coefficient[a];
          if (sum[row.index[a]] == 0) touched.push_back(row.index[a]);
          sum[row.index[a]] += wa;
          right[row.index[a]] -= wa * row.value;
          for (int b = 0; b < row.size; ++b) {
            normal(row.index[a], row.index[b]) += wa * row.coefficient[b];
          }
        }
      }
      std::sort(touched.begin(), touched.end());
      touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
      for (const int a : touched) {
        right[a] += sum[a] * value / total;
        for (const int b : touched) normal(a, b) -= sum[a] * sum[b] / total;
      }
      for (const int a : touched) sum[a] = 0;
    }
    const double information = 1 / (sigma_ * sigma_);
    normal *= information;
    right *= information;
    for (int i = 0; i < n; ++i) normal(i, i) += 1 / (priors[i] * priors[i]);
    return SolveSymmetric(normal, right);
  }

  Unknowns unknowns_;
  std::vector<Row> rows_;
  std::vector<size_t> begin_ = {0};
  std::vector<double> weights_;
  double sigma_ = 1;
};

// Calls body(begin, end) with the views of about kMostSamples samples, evenly chosen.
template <typename Body>
void ForSomeSamples(const ExposureSamples& samples, const Body& body) {
  const size_t stride = samples.size() / kMostSamples + 1;
  for (size_t k = 0; k < samples.size(); k += stride) {
    body(samples.begin[k], samples.begin[k + 1]);
  }
}

void AddLensTerms(const Unknowns& unknowns, int lens, double radius2, Row* row) {
  double power = 1;
  for (int i = 0; i < kLensTerms; ++i) {
    row->Add(unknowns.lens_begin() + kLensTerms * lens + i, power *= radius2);
  }
}

// Radius^2 up to which there are views: all but half a percent of them lie within.
double LargestRadius2(const ExposureSamples& samples, const std::vector<int>& lens, int number) {
  std::vector<float> radii;
  for (const ExposureView& view : samples.views) {
    if (lens[view.photo] == number) radii.push_back(view.radius2);
  }
  constexpr size_t kFewest = 2000;
  if (radii.size() < kFewest) return 0;
  return std::min(AtRank(&radii, radii.size() * 199 / 200), 1.0f);
}

// None where there is little to correct, or where the fit is no vignetting: brighter corners.
Vignetting CheckVignetting(const Eigen::Vector3d& a, double largest_radius2) {
  constexpr double kLeast = 0.01, kMost = 3;
  Vignetting vignetting;
  vignetting.a = a;
  vignetting.largest_radius2 = largest_radius2;
  double lowest = 0, highest = 0;
  for (int i = 1; i <= 20; ++i) {
    const double log_factor = vignetting.LogFactor(largest_radius2 * i / 20);
    lowest = std::min(lowest, log_factor);
    highest = std::max(highest, log_factor);
  }
  if (highest < kLeast || highest > kMost || lowest < -0.25 * highest) return {};
  return vignetting;
}

}  // namespace

std::vector<Vignetting> FitVignetting(const ExposureSamples& samples, const std::vector<int>& lens,
                                      int num_lenses, const std::vector<double>& log_gains) {
  Unknowns unknowns;
  unknowns.num_photos = samples.num_photos;
  unknowns.num_lenses = num_lenses;
  LightFit fit(unknowns);
  ForSomeSamples(samples, [&](size_t begin, size_t end) {
    for (int channel = 0; channel < 3; ++channel) {
      for (size_t i = begin; i < end; ++i) {
        const ExposureView& view = samples.views[i];
        Row row;
        row.value = std::log(view.light[channel]);
        row.trust = view.trust;
        row.Add(view.photo, 1);
        AddLensTerms(unknowns, lens[view.photo], view.radius2, &row);
        fit.AddRow(row);
      }
      fit.EndLight();
    }
  });
  std::vector<Vignetting> result(num_lenses);
  if (fit.num_rows() == 0) return result;
  Eigen::VectorXd start = Eigen::VectorXd::Zero(unknowns.count());
  for (int i = 0; i < samples.num_photos; ++i) start[i] = log_gains[i];
  Eigen::VectorXd priors = Eigen::VectorXd::Constant(unknowns.count(), 0.5);
  priors.head(samples.num_photos).setConstant(10);
  const Eigen::VectorXd x = fit.Solve(start, priors);
  for (int i = 0; i < num_lenses; ++i) {
    const double largest = LargestRadius2(samples, lens, i);
    if (!(largest > 0)) continue;
    result[i] = CheckVignetting(x.segment<3>(unknowns.lens_begin() + kLensTerms * i), largest);
  }
  return result;
}

namespace {

// Noise of about 1.5 levels is a large share of dark light; it would bend the curve's dark end: a
// level that noise made dark is lighter in the other photos.
double CertaintyOf(double u) {
  constexpr double kNoise = 1.5 / 255, kFinest = 0.03;
  const double log_noise = kNoise * 2.4 / (u + 0.055) / kFinest;
  return 1 / (1 + std::pow(log_noise, 4));
}

double LevelOf(float light) { return SrgbFromLinear(light); }

// What is added to the logarithm of the sRGB curve, 0 at the level u = 1: gammas with sRGB's dark
// end and without it, and powers.
double CurveTerm(int term, double u) {
  if (term == 0) return std::log(LinearFromSrgb(u));
  if (term == 1) return std::log(u);
  return std::pow(u, term - 1) - 1;
}

// The table of a curve; none if it falls somewhere.
std::optional<ResponseCurve> CurveOf(const Eigen::VectorXd& b) {
  ResponseCurve::Table table{};
  for (int level = 1; level < ResponseCurve::kLevels; ++level) {
    const double u = level / 255.0;
    double log_light = std::log(LinearFromSrgb(u));
    for (int i = 0; i < b.size(); ++i) log_light += b[i] * CurveTerm(i, u);
    table[level].fill(static_cast<float>(std::exp(log_light)));
    if (level > 1 && !(table[level][0] > table[level - 1][0])) return std::nullopt;
  }
  return ResponseCurve(table);
}

// The curve, with as many terms as keep it rising, for known gains. used: photos that take part.
std::optional<ResponseCurve> FitCurve(const ExposureSamples& samples,
                                      const std::vector<Eigen::Vector3d>& log_gains,
                                      const std::vector<bool>& used) {
  for (int terms = kCurveTerms; terms >= 1; --terms) {
    Unknowns unknowns;
    unknowns.num_curve_terms = terms;
    unknowns.num_lenses = 1;
    LightFit fit(unknowns);
    ForSomeSamples(samples, [&](size_t begin, size_t end) {
      for (int channel = 0; channel < 3; ++channel) {
        for (size_t i = begin; i < end; ++i) {
          const ExposureView& view = samples.views[i];
          if (!used[view.photo]) continue;
          const double u = LevelOf(view.light[channel]);
          const double log_light = std::log(view.light[channel]);
          Row row;
          row.value = log_light + log_gains[view.photo][channel];
          row.trust = view.trust * CertaintyOf(u);
          AddLensTerms(unknowns, 0, view.radius2, &row);
          for (int k = 0; k < terms; ++k) row.Add(unknowns.curve_begin() + k, CurveTerm(k, u));
          fit.AddRow(row);
        }
        fit.EndLight();
      }
    });
    if (fit.num_rows() < 1000) return std::nullopt;
    Eigen::VectorXd priors = Eigen::VectorXd::Constant(unknowns.count(), 3);
    priors.head(kLensTerms).setConstant(0.5);
    const Eigen::VectorXd x = fit.Solve(Eigen::VectorXd::Zero(unknowns.count()), priors);
    const auto curve = CurveOf(x.tail(terms));
    if (curve) return curve;
  }
  return std::nullopt;
}

// The power that brings gains to what EXIF says: the slope of EXIF over the gains, because gains
// are the more exact.
double PowerOf(const std::vector<double>& log_gains, const ExposurePrior& prior,
               const std::vector<bool>& used) {
  double mean_exif = 0, mean = 0, count = 0;
  for (size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    mean_exif += *prior.log_gain[i];
    mean += log_gains[i];
    ++count;
  }
  double product = 0, square = 0;
  for (size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    const double gain = log_gains[i] - mean / count;
    product += gain * (*prior.log_gain[i] - mean_exif / count);
    square += gain * gain;
  }
  return square > 0 ? product / square : 0;
}

// Photos whose EXIF compares and that overlaps hold together: the most there are.
std::vector<bool> ComparablePhotos(const ExposurePrior& prior, const std::vector<int>& groups) {
  std::vector<int> keys;
  for (size_t i = 0; i < groups.size(); ++i) {
    keys.push_back(prior.kind[i] < 0 ? -1 - static_cast<int>(i)
                                     : groups[i] * prior.num_kinds + prior.kind[i]);
  }
  const int largest = LargestGroup(keys);
  std::vector<bool> used;
  for (const int key : keys) used.push_back(key >= 0 && key == largest);
  return used;
}

}  // namespace

void ApplyResponse(const ResponseCurve& curve, ExposureSamples* samples) {
  for (ExposureView& view : samples->views) {
    for (int k = 0; k < 3; ++k) {
      view.light[k] = std::max(1e-5f, curve.LinearFromSrgbLinear(view.light[k], k));
    }
  }
}

void ApplyVignetting(const std::vector<Vignetting>& of_lens, const std::vector<int>& lens,
                     ExposureSamples* samples) {
  for (ExposureView& view : samples->views) {
    view.light *= static_cast<float>(std::exp(of_lens[lens[view.photo]].LogFactor(view.radius2)));
  }
}

ResponseFit FitResponse(const ExposureSamples& samples,
                        const std::vector<ExposureData>& exposures) {
  ResponseFit result;
  const ExposurePrior prior = PriorFromExif(exposures, false);
  const std::vector<int> groups = GroupPhotos(samples.num_photos, FindOverlaps(samples), nullptr);
  const std::vector<bool> used = ComparablePhotos(prior, groups);
  std::vector<Eigen::Vector3d> log_gains(used.size(), Eigen::Vector3d::Zero());
  double lowest = 1e300, highest = -1e300;
  for (size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    log_gains[i].setConstant(*prior.log_gain[i]);
    lowest = std::min(lowest, log_gains[i][0]);
    highest = std::max(highest, log_gains[i][0]);
  }
  constexpr double kLeastSpread = 0.66;  // an EV, nearly
  if (!(highest - lowest > kLeastSpread)) {
    result.reason = "the exposures in EXIF of photos that overlap do not vary by an EV";
    return result;
  }
  // EXIF says which power the curve has; its rounding is taken out by gains from overlaps, brought
  // to the same power.
  for (int round = 0; round < 2; ++round) {
    const auto curve = FitCurve(samples, log_gains, used);
    if (!curve) {
      result.reason = "no rising curve explains the photos";
      return result;
    }
    result.curve = *curve;
    ExposureSamples corrected = samples;
    ApplyResponse(*curve, &corrected);
    const ExposureSolution solution =
        SolveExposure(std::vector<ExposureData>(exposures.size()), FindOverlaps(corrected), {});
    std::vector<Eigen::Vector3d> log_matched;
    std::vector<double> matched;  // all channels together
    for (const Eigen::Vector3f& gain : solution.gains) {
      log_matched.push_back(gain.array().log().matrix().cast<double>());
      matched.push_back(log_matched.back().mean());
    }
    const double power = PowerOf(matched, prior, used);
    for (size_t i = 0; i < used.size(); ++i) {
      matched[i] *= power;
      log_matched[i] *= power;
    }
    const auto scatter = ExifScatter(prior, groups, matched);
    constexpr double kMostScatter = 0.2;
    if (!(power > 0.5 && power < 2) || (scatter && *scatter > kMostScatter)) {
      result.curve = ResponseCurve();
      result.reason = "the exposures in EXIF contradict what the photos show";
      return result;
    }
    log_gains = log_matched;
  }
  result.determined = true;
  return result;
}

}  // namespace roomtex
