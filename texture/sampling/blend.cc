#include "texture/sampling/blend.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/option_fields.h"
#include "core/photo.h"

namespace roomtex {
namespace {

// Bytes from here on may be clipped; JPEG smears 255 a little.
constexpr float kClipStart = 244, kClipEnd = 254;
// What is left of the weight of a clipped colour when another photo has it unclipped, and when the
// best photos of a sample are chosen.
constexpr float kClippedReliability = 0.04f, kClippedRank = 0.5f;

float ReliabilityOfByte(int brightest) {
  const float share =
      std::clamp((kClipEnd - static_cast<float>(brightest)) / (kClipEnd - kClipStart), 0.0f, 1.0f);
  return kClippedRank + (1 - kClippedRank) * share;
}

// Catmull-Rom spline: weights of the four pixels around a place, t = 0..1 behind the second one.
std::array<float, 4> CubicWeights(float t) {
  const float t2 = t * t, t3 = t2 * t;
  return {-0.5f * t3 + t2 - 0.5f * t, 1.5f * t3 - 2.5f * t2 + 1, -1.5f * t3 + 2 * t2 + 0.5f * t,
          0.5f * t3 - 0.5f * t2};
}

// Square roots: distances are about even to the eye.
Eigen::Vector3f Root(const Eigen::Vector3f& linear) { return linear.cwiseMax(0).cwiseSqrt(); }

// Two photos that look from different places give the same colour only if they see the surface
// itself and not something in front of it.
bool TwoAgree(const Observation* observations, int count,
              const std::vector<Eigen::Vector3f>& gains) {
  constexpr float kAlike = 0.05f;
  const auto root = [&](int i) {
    return Root(UnpackColor(observations[i].color).cwiseProduct(gains[observations[i].photo]));
  };
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3f here = root(i);
    for (int j = i + 1; j < count; ++j) {
      if ((here - root(j)).norm() < kAlike) return true;
    }
  }
  return false;
}

}  // namespace

void BlendOptions::Declare(OptionFields* fields) {
  fields->Choice(
      "Blend.mode", &mode, {"auto", "average", "select"},
      "Where the detail of a place comes from: average, the photos that see it together; "
      "select, one of them, chosen with its neighbours so that seams lie where photos "
      "agree; auto, one of them as far as they disagree. With Blend.detail 1 it is of no "
      "effect.");
  fields
      ->Int("Blend.max_views", &max_views,
            "Photos blended per sample, the best ones. Larger = smoother; 8 bytes a sample "
            "each.")
      .Within(1, 64);
  fields->Bool("Blend.angle_weight", &angle_weight,
               "Less weight for photos that see a sample at a slant.");
  fields->Bool("Blend.resolution_weight", &resolution_weight,
               "More weight for photos with more pixels per sample.");
  fields->Bool("Blend.sharpness_weight", &sharpness_weight,
               "Less weight for photos that are blurred against the others at the same surface.");
  fields
      ->Number("Blend.outlier", &outlier,
               "Colour difference (0..1) from the other photos at which half the weight is "
               "lost, where most photos agree; 0 = never.")
      .NotNegative();
  fields->Bool("Blend.leave_out_moving", &leave_out_moving,
               "What stands before the surface in one photo and is outvoted by others (people, "
               "moved chairs) gives no colour anywhere in that photo. Needs Blend.outlier.");
  fields
      ->Number("Blend.min_agreement", &min_agreement,
               "A photo is left out, and named, when its brightness correlates less than this with "
               "what the other photos show at the same samples: it shows another room, or moved "
               "furniture. Larger = more are left out, at most a fifth of all; 0 = none.")
      .Within(0, 0.95);
  fields
      ->Number("Blend.footprint", &footprint,
               "Share of the sample spacing over which photo pixels are averaged. Larger = "
               "smoother; 0 = the colour at the sample.")
      .Within(0, 4, "sample spacings");
  fields->Bool("Blend.detail", &detail,
               "Put back the detail that blending loses, from the dominant photo (thesis).");
}

std::vector<std::string> BlendOptions::Problems() const { return ProblemsOf(*this); }

float ResolutionWeight(float pixels_per_sample) {
  constexpr float kPlenty = 25;
  return std::max(pixels_per_sample, 1e-3f) / (kPlenty + pixels_per_sample);
}

float AngleWeight(const Eigen::Vector3f& to_camera, const Eigen::Vector3f& to_scanner,
                  const Eigen::Vector3f& normal) {
  if (normal.isZero() || to_scanner.isZero()) return 1;
  const float camera_cosine = std::max(normal.dot(to_camera), 0.05f);
  const Eigen::Vector3f shift = to_scanner - to_camera * (normal.dot(to_scanner) / camera_cosine);
  const float slant = 1 / (camera_cosine * camera_cosine) - 1;  // tan^2
  return 1 / (1 + shift.squaredNorm() + slant);
}

PhotoColor LookUpPhoto(const cv::Mat& photo, float x, float y) {
  const std::array<float, 256>& linear = LinearFromSrgbByte();
  const float px = std::clamp(x - 0.5f, 0.0f, static_cast<float>(photo.cols - 1));
  const float py = std::clamp(y - 0.5f, 0.0f, static_cast<float>(photo.rows - 1));
  const int column = static_cast<int>(px), row = static_cast<int>(py);
  const std::array<float, 4> wx = CubicWeights(px - static_cast<float>(column));
  const std::array<float, 4> wy = CubicWeights(py - static_cast<float>(row));
  int offset[4];
  for (int i = 0; i < 4; ++i) offset[i] = 3 * std::clamp(column - 1 + i, 0, photo.cols - 1);
  float sum[3] = {0, 0, 0};  // b, g, r
  int brightest = 0;
  for (int j = 0; j < 4; ++j) {
    const uint8_t* line = photo.ptr<uint8_t>(std::clamp(row - 1 + j, 0, photo.rows - 1));
    const bool inner = j == 1 || j == 2;
    for (int k = 0; k < 3; ++k) {
      const int a = line[offset[0] + k], b = line[offset[1] + k], c = line[offset[2] + k],
                d = line[offset[3] + k];
      if (inner) brightest = std::max({brightest, b, c});
      sum[k] +=
          wy[j] * (wx[0] * linear[a] + wx[1] * linear[b] + wx[2] * linear[c] + wx[3] * linear[d]);
    }
  }
  return {Eigen::Vector3f(sum[2], sum[1], sum[0]).cwiseMax(0.0f), ReliabilityOfByte(brightest)};
}

PhotoColor LookUpPhoto(const cv::Mat& photo, float x, float y, float side) {
  // As many lookups as the square has pixels, each way.
  const int count = std::clamp(static_cast<int>(std::lround(side)), 1, 16);
  if (count == 1) return LookUpPhoto(photo, x, y);
  PhotoColor mean{Eigen::Vector3f::Zero(), 1};
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      const float dx = ((static_cast<float>(j) + 0.5f) / static_cast<float>(count) - 0.5f) * side;
      const float dy = ((static_cast<float>(i) + 0.5f) / static_cast<float>(count) - 0.5f) * side;
      const PhotoColor color = LookUpPhoto(photo, x + dx, y + dy);
      mean.linear += color.linear;
      mean.reliability = std::min(mean.reliability, color.reliability);
    }
  }
  mean.linear /= static_cast<float>(count * count);
  return mean;
}

namespace {

constexpr float kFits = 0.5f;                         // agreement
constexpr float kHalf = 0.5f, kClearMajority = 0.7f;  // three of four have it
constexpr int kMostViews = 64;                        // BlendOptions::Problems

// The observation that most weight agrees with (of equals the heavier one), and the share of all
// observations that do.
struct Consensus {
  int central = 0;
  float share = 0;

  // How much of its weight what contradicts it loses: at an edge that photos show beside its place
  // they are divided, and the mean of both sides is nearer to either than the wrong one is.
  float Decided() const {
    return std::clamp((share - kHalf) / (kClearMajority - kHalf), 0.0f, 1.0f);
  }
};

// The observations of one sample, brought to one exposure.
struct SampleViews {
  int count = 0;
  std::array<Eigen::Vector3f, kMostViews> colors, roots;
  std::array<Eigen::Array3i, kMostViews> clipped;  // 1 = the surface is this light or lighter
  std::array<float, kMostViews> reliability;       // 1, less towards clipped colours
  std::array<float, kMostViews> weights;

  // 1 for equal colours, 1/2 at the distance `outlier`, flat where noise and resolution differ and
  // steep beyond. A clipped channel agrees with everything lighter.
  float Agreement(int i, int j, float outlier) const {
    const Eigen::Array3f step = (roots[j] - roots[i]).array();
    float square = 0;
    for (int k = 0; k < 3; ++k) {
      if ((clipped[i][k] != 0 && step[k] > 0) || (clipped[j][k] != 0 && step[k] < 0)) continue;
      square += step[k] * step[k];
    }
    const float ratio = square / (outlier * outlier);
    return 1 / (1 + ratio * ratio);
  }

  Consensus FindConsensus(float outlier) const {
    Consensus consensus;
    float most = -1;
    for (int i = 0; i < count; ++i) {
      float sum = 0;
      for (int j = 0; j < count; ++j) sum += weights[j] * Agreement(i, j, outlier);
      if (sum > most) {
        most = sum;
        consensus.central = i;
      }
    }
    float num_agree = 0;
    for (int i = 0; i < count; ++i) num_agree += Agreement(consensus.central, i, outlier);
    consensus.share = num_agree / static_cast<float>(count);
    return consensus;
  }
};

SampleViews UnpackViews(const Observation* observations, int count,
                        const std::vector<Eigen::Vector3f>& gains) {
  constexpr float kUnclipped = 0.75f, kClipped = 0.92f;  // linear light of the bytes 225 and 246
  SampleViews views;
  views.count = std::min(count, kMostViews);
  for (int i = 0; i < views.count; ++i) {
    const Eigen::Vector3f color = UnpackColor(observations[i].color);
    views.colors[i] = color.cwiseProduct(gains[observations[i].photo]);
    views.roots[i] = Root(views.colors[i]);
    views.clipped[i] = (color.array() > kClipped).cast<int>();
    const float share = (kClipped - color.maxCoeff()) / (kClipped - kUnclipped);
    views.reliability[i] = std::clamp(share, kClippedReliability, 1.0f);  // even: no visible step
    views.weights[i] = UnpackWeight(observations[i].weight);
  }
  return views;
}

}  // namespace

void CastVotes(const Observation* observations, int count,
               const std::vector<Eigen::Vector3f>& gains, double outlier, Vote* votes) {
  std::fill(votes, votes + count, Vote::kNone);
  while (count > 0 && observations[count - 1].in_doubt != 0) --count;
  count = std::min(count, kMostViews);
  if (count < 2) return;
  const SampleViews views = UnpackViews(observations, count, gains);
  const auto scale = static_cast<float>(outlier);
  const int central = views.FindConsensus(scale).central;
  int num_agree = 0;
  for (int i = 0; i < count; ++i) {
    const bool agrees = views.Agreement(central, i, scale) > kFits;
    votes[i] = agrees ? Vote::kAgrees : Vote::kOutvoted;
    num_agree += agrees;
  }
  if (2 * num_agree <= count) std::fill(votes, votes + count, Vote::kOpen);
}

int NumThatCount(const Observation* observations, int count,
                 const std::vector<Eigen::Vector3f>& gains) {
  if (count <= 0) return 0;
  if (observations[0].in_doubt != 0) return TwoAgree(observations, count, gains) ? count : 0;
  while (observations[count - 1].in_doubt != 0) --count;  // they come last
  return count;
}

BlendedSample BlendSample(const Observation* observations, int count,
                          const std::vector<Eigen::Vector3f>& gains, double outlier,
                          float* shares) {
  BlendedSample result;
  if (shares != nullptr) std::fill(shares, shares + std::max(count, 0), 0.0f);
  count = NumThatCount(observations, count, gains);
  if (count == 0) return result;
  SampleViews views = UnpackViews(observations, count, gains);
  // S by the geometry alone: it changes where the best photo changes, not from sample to sample.
  result.dominant = views.colors[0];
  result.dominant_photo = observations[0].photo;
  result.dominant_fits = views.reliability[0] > 0.5f;
  if (outlier > 0 && views.count > 1) {
    const auto scale = static_cast<float>(outlier);
    const Consensus consensus = views.FindConsensus(scale);
    result.dominant_fits =
        result.dominant_fits && views.Agreement(consensus.central, 0, scale) > kFits;
    const float lost = consensus.Decided();
    for (int i = 0; i < views.count; ++i) {
      const float share = views.Agreement(consensus.central, i, scale);
      views.weights[i] *= 1 - lost * (1 - share * share);
    }
  }
  float sum = 0;
  for (int i = 0; i < views.count; ++i) {
    // Clipped colours lose their weight only here, after the vote: on a bright surface most photos
    // are clipped, and they must be able to outvote the one that shows something else.
    views.weights[i] *= views.reliability[i];
    sum += views.weights[i];
    result.blend += views.weights[i] * views.colors[i];
  }
  result.blend /= sum;
  for (int i = 0; shares != nullptr && i < views.count; ++i) shares[i] = views.weights[i] / sum;
  return result;
}

}  // namespace roomtex
