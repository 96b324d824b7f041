// The built-in detailed image, and the spreading of grey values.

#include <algorithm>
#include <cmath>
#include <numeric>

#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern_steps.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr double kOctave = 1.5;     // from one size of shapes to the next
constexpr double kCovered = 0.25;   // share of the picture that the shapes of one size cover
constexpr double kSoftening = 0.8;  // pixels, Gaussian sigma
constexpr int kShift = 4;           // corners are drawn to a sixteenth of a pixel

// A convex polygon or an ellipse, of this mean diameter, at any place.
void DrawShape(double diameter, RandomStream* random, cv::Mat1b* image) {
  const double x = random->Uniform(-0.3 * diameter, image->cols + 0.3 * diameter);
  const double y = random->Uniform(-0.3 * diameter, image->rows + 0.3 * diameter);
  const int corners = random->Uniform() < 0.4 ? 12 : 3 + random->Index(3);
  const double turn = random->Uniform(0, 2 * kPi), stretch = random->Uniform(0.55, 1);
  const double axis = random->Uniform(0, 2 * kPi);
  const double radius = 0.5 * diameter / std::sqrt(stretch) * (corners < 12 ? 1.25 : 1);
  std::vector<cv::Point> points;
  for (int i = 0; i < corners; ++i) {
    const double jitter = corners < 12 ? random->Uniform(-0.35, 0.35) : 0;
    const double angle = turn + 2 * kPi * (i + jitter) / corners;
    const double u = radius * std::cos(angle), v = radius * stretch * std::sin(angle);
    const double px = x + std::cos(axis) * u - std::sin(axis) * v;
    const double py = y + std::sin(axis) * u + std::cos(axis) * v;
    points.emplace_back(static_cast<int>(std::lround(px * (1 << kShift))),
                        static_cast<int>(std::lround(py * (1 << kShift))));
  }
  cv::fillConvexPoly(*image, points, cv::Scalar(random->Index(256)), cv::LINE_AA, kShift);
}

}  // namespace

cv::Mat1b DrawDetail(int width, int height, double finest, uint64_t seed) {
  cv::Mat1b image(height, width, uchar{128});
  const double coarsest = std::max(2 * finest, height / 5.0);
  const int sizes = static_cast<int>(std::log(coarsest / finest) / std::log(kOctave));
  for (int size = sizes; size >= 0; --size) {
    RandomStream random(MixBits(seed, 0x5e7a11, size));
    const double low = finest * std::pow(kOctave, size);
    const double area = 0.785 * low * low * 1.5;
    // Shapes lie over each other: -log(1 - share) times the area covers the share.
    const double share = size == sizes ? 0.95 : kCovered;
    const auto count = static_cast<long>(-std::log(1 - share) * width * height / area);
    for (long i = 0; i < count; ++i) {
      DrawShape(low * std::pow(kOctave, random.Uniform()), &random, &image);
    }
  }
  // Without the steps of single pixels along edges, which give features that all look alike.
  cv::GaussianBlur(image, image, {}, kSoftening);
  return image;
}

cv::Mat1b SpreadGrey(const cv::Mat1w& image, double brightness) {
  cv::Mat1w smooth;
  cv::GaussianBlur(image, smooth, {}, 2);
  std::vector<int> order(image.total());
  std::iota(order.begin(), order.end(), 0);
  const uint16_t* value = image.ptr<uint16_t>();
  const uint16_t* tie = smooth.ptr<uint16_t>();
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    if (value[a] != value[b]) return value[a] < value[b];
    if (tie[a] != tie[b]) return tie[a] < tie[b];
    return a < b;
  });
  // The mean of u^p over u in 0..1 is 1 / (1 + p).
  const double power = 1 / brightness - 1;
  const auto total = static_cast<double>(order.size());
  cv::Mat1b spread(image.rows, image.cols);
  uchar* out = spread.ptr();
  for (size_t i = 0; i < order.size(); ++i) {
    const double u = (static_cast<double>(i) + 0.5) / total;
    out[order[i]] = static_cast<uchar>(std::lround(255 * std::pow(u, power)));
  }
  return spread;
}

}  // namespace roomtex
