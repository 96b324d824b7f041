#include "dense/stereo_window.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

// Twice as many numbers at a time, where the processor can. Without fused multiplication, which
// would round differently.
#if defined(__x86_64__) && defined(__GNUC__)
#define ROOMTEX_HAS_AVX2 1
#else
#define ROOMTEX_HAS_AVX2 0
#endif

namespace roomtex {
namespace {

constexpr int kSide = 5;  // samples of a window, each way ...
constexpr int kStep = 2;  // ... so many pixels apart
constexpr int kMiddle = kSide * kSide / 2;
constexpr int kSums = 8;           // of every eighth sample each: the same sums on every processor
constexpr float kSigmaColor = 25;  // grey levels: what is of another colour is another thing
constexpr float kMinDeviation = 2.5f;  // grey levels; flatter windows say nothing
constexpr float kLeastDepth = 1e-3f;   // share: a window that reaches beside the camera
constexpr float kReach = StereoWindow::kReachPx;
static_assert(StereoWindow::kReachPx == kSide / 2 * kStep);

// GCC's and Clang's vectors.
template <int kLanes>
struct Lanes {
  typedef float Floats __attribute__((vector_size(kLanes * sizeof(float))));
  typedef int Ints __attribute__((vector_size(kLanes * sizeof(int))));
};

struct WindowOffsets {
  static constexpr int kCount = kSide * kSide - 1;
  std::array<int, kCount> x{}, y{};
  alignas(32) std::array<float, kCount> dx{}, dy{};
  constexpr WindowOffsets() {
    for (int i = 0, k = 0; i < kSide * kSide; ++i) {
      if (i == kMiddle) continue;
      x[k] = (i % kSide - kSide / 2) * kStep;
      y[k] = (i / kSide - kSide / 2) * kStep;
      dx[k] = static_cast<float>(x[k]);
      dy[k] = static_cast<float>(y[k]);
      ++k;
    }
  }
};
constexpr WindowOffsets kOffsets;

Eigen::Matrix3d CalibrationMatrix(const Camera& camera) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = camera.params[0], k(1, 1) = camera.params[1];
  k(0, 2) = camera.params[2], k(1, 2) = camera.params[3];
  return k;
}

// All four values of a bilinear sample in one read.
cv::Mat1i MakeQuads(const cv::Mat1b& grey) {
  cv::Mat1i quads(grey.rows, grey.cols);
  for (int y = 0; y < grey.rows; ++y) {
    const uchar* const above = grey[y];
    const uchar* const below = grey[std::min(y + 1, grey.rows - 1)];
    int* const quad = quads[y];
    for (int x = 0; x < grey.cols; ++x) {
      const int right = std::min(x + 1, grey.cols - 1);
      quad[x] = static_cast<int>(
          static_cast<uint32_t>(above[x]) | static_cast<uint32_t>(above[right]) << 8 |
          static_cast<uint32_t>(below[x]) << 16 | static_cast<uint32_t>(below[right]) << 24);
    }
  }
  return quads;
}

}  // namespace

InverseDepthPlane PlaneFromNormal(float depth, const Eigen::Vector3f& normal, const Camera& camera,
                                  float x, float y) {
  const std::vector<double>& p = camera.params;
  const Eigen::Vector3f ray((x - static_cast<float>(p[2])) / static_cast<float>(p[0]),
                            (y - static_cast<float>(p[3])) / static_cast<float>(p[1]), 1);
  InverseDepthPlane plane{1 / depth, 0, 0};
  const float slant = normal.dot(ray);
  if (!(slant < -0.05f * ray.norm())) return plane;  // no normal, or a grazing one
  plane.a = normal.x() * plane.w / slant / static_cast<float>(p[0]);
  plane.b = normal.y() * plane.w / slant / static_cast<float>(p[1]);
  return plane;
}

Eigen::Vector3f NormalFromPlane(const InverseDepthPlane& plane, const Camera& camera, float x,
                                float y) {
  const std::vector<double>& p = camera.params;
  const Eigen::Vector3f away(static_cast<float>(p[0]) * plane.a, static_cast<float>(p[1]) * plane.b,
                             plane.w - (x - static_cast<float>(p[2])) * plane.a -
                                 (y - static_cast<float>(p[3])) * plane.b);
  return -away.normalized();
}

StereoSource::StereoSource(const Camera& reference_camera, const Rigid& reference_cam_from_scan,
                           const Camera& source_camera, const Rigid& source_cam_from_scan,
                           const cv::Mat1b& grey)
    : quads_(MakeQuads(grey)) {
  // `img` to `img`, homogeneous: turned * x + moved * w.
  const Rigid source_from_reference = source_cam_from_scan * reference_cam_from_scan.Inverse();
  const Eigen::Matrix3d k = CalibrationMatrix(source_camera);
  turned_ = (k * source_from_reference.rotation.toRotationMatrix() *
             CalibrationMatrix(reference_camera).inverse())
                .cast<float>();
  moved_ = (k * source_from_reference.translation).cast<float>();
}

bool StereoWindow::Set(const cv::Mat1b& grey, int x, int y) {
  x_ = static_cast<float>(x) + 0.5f;
  y_ = static_cast<float>(y) + 0.5f;
  const float centre = grey(y, x);
  std::array<float, kSamples> value;
  if (x >= kReachPx && y >= kReachPx && x + kReachPx < grey.cols && y + kReachPx < grey.rows) {
    const uchar* const middle = grey[y] + x;
    const auto stride = static_cast<ptrdiff_t>(grey.step1());
    for (int k = 0; k < kSamples; ++k) value[k] = middle[kOffsets.y[k] * stride + kOffsets.x[k]];
  } else {
    for (int k = 0; k < kSamples; ++k) {
      value[k] = grey(std::clamp(y + kOffsets.y[k], 0, grey.rows - 1),
                      std::clamp(x + kOffsets.x[k], 0, grey.cols - 1));
    }
  }
  float sum = 0, mean = 0;
  for (int k = 0; k < kSamples; ++k) {
    const float difference = (value[k] - centre) / kSigmaColor;
    weight_[k] = 1 / (1 + difference * difference);
    sum += weight_[k];
    mean += weight_[k] * value[k];
  }
  mean /= sum;
  variance_ = 0;
  for (int k = 0; k < kSamples; ++k) {
    weight_[k] /= sum;
    weighted_[k] = weight_[k] * (value[k] - mean);
    variance_ += weighted_[k] * (value[k] - mean);
  }
  return variance_ > kMinDeviation * kMinDeviation;
}

template <int kLanes>
[[gnu::always_inline]] inline float StereoWindow::CostInLanes(
    const StereoSource& source, const InverseDepthPlane& plane) const {
  const float *const turned = source.turned_.data(), *const moved = source.moved_.data();
  std::array<float, 3> right, down, at;
  for (int i = 0; i < 3; ++i) {
    right[i] = turned[i] + moved[i] * plane.a;
    down[i] = turned[3 + i] + moved[i] * plane.b;
    at[i] = turned[i] * x_ + turned[3 + i] * y_ + turned[6 + i] + moved[i] * plane.w;
  }
  // The window is a convex quadrilateral there: before the camera and in the picture if its corners
  // are. Each bound is linear over the window, so that its least value is that at a corner.
  const int columns = source.quads_.cols, rows = source.quads_.rows;
  const float end_x = static_cast<float>(columns) - 0.5f, end_y = static_cast<float>(rows) - 0.5f;
  const auto least = [&](float x, float y, float z) {
    const auto at_place = [&](const std::array<float, 3>& p) {
      return x * p[0] + y * p[1] + z * p[2];
    };
    return at_place(at) - kReach * (std::abs(at_place(right)) + std::abs(at_place(down)));
  };
  const bool inside = least(0, 0, 1) > kLeastDepth && least(1, 0, -0.5f) >= 0 &&
                      least(0, 1, -0.5f) >= 0 && least(-1, 0, end_x) > 0 && least(0, -1, end_y) > 0;
  if (!inside) return kNoMatch;
  // Without a branch, several samples at a time. Rounding may lead over the edge, and far where a
  // corner is almost beside the camera.
  const auto last_x = static_cast<float>(columns - 2), last_y = static_cast<float>(rows - 2);
  const auto stride = static_cast<int>(source.quads_.step1());
  const int* const pixels = source.quads_[0];
  using Floats = typename Lanes<kLanes>::Floats;
  using Ints = typename Lanes<kLanes>::Ints;
  constexpr int kParts = kSums / kLanes;
  std::array<Floats, kParts> means{}, squares{}, crosses{};
  for (int k = 0; k < kSamples; k += kLanes) {
    const auto at_lane = [k](const auto& array) {
      return reinterpret_cast<const Floats*>(&array[k]);
    };
    const Floats &dx = *at_lane(kOffsets.dx), &dy = *at_lane(kOffsets.dy);
    const Floats inverse = 1 / (at[2] + dx * right[2] + dy * down[2]);
    const Floats u = (at[0] + dx * right[0] + dy * down[0]) * inverse - 0.5f;
    const Floats v = (at[1] + dx * right[1] + dy * down[1]) * inverse - 0.5f;
    const Floats end_u = Floats{} + last_x, end_v = Floats{} + last_y;
    Floats inside_u = u > 0 ? u : Floats{}, inside_v = v > 0 ? v : Floats{};
    inside_u = inside_u < end_u ? inside_u : end_u;
    inside_v = inside_v < end_v ? inside_v : end_v;
    const Ints column = __builtin_convertvector(inside_u, Ints);
    const Ints row = __builtin_convertvector(inside_v, Ints);
    const Floats s = u - __builtin_convertvector(column, Floats);
    const Floats t = v - __builtin_convertvector(row, Floats);
    const Ints where = row * stride + column;
    Ints quad;
    for (int lane = 0; lane < kLanes; ++lane) quad[lane] = pixels[where[lane]];
    const Floats above = __builtin_convertvector(quad & 255, Floats);
    const Floats above_right = __builtin_convertvector(quad >> 8 & 255, Floats);
    const Floats below = __builtin_convertvector(quad >> 16 & 255, Floats);
    const Floats below_right = __builtin_convertvector(quad >> 24 & 255, Floats);
    const Floats top = above + s * (above_right - above);
    const Floats bottom = below + s * (below_right - below);
    const Floats value = top + t * (bottom - top);
    const Floats weighted = *at_lane(weight_) * value;
    const int part = k / kLanes % kParts;
    means[part] += weighted;
    squares[part] += weighted * value;
    crosses[part] += *at_lane(weighted_) * value;
  }
  const auto sum_of = [](const std::array<Floats, kParts>& sums) {
    std::array<float, kSums> s;
    for (int i = 0; i < kSums; ++i) s[i] = sums[i / kLanes][i % kLanes];
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
  };
  const float mean = sum_of(means), square = sum_of(squares), cross = sum_of(crosses);
  const float variance = square - mean * mean;
  if (!(variance > 0.25f * kMinDeviation * kMinDeviation)) return kNoMatch;
  return 1 - cross / std::sqrt(variance * variance_);
}

float StereoWindow::CostOnAnyProcessor(const StereoSource& source,
                                       const InverseDepthPlane& plane) const {
  return CostInLanes<4>(source, plane);
}

#if ROOMTEX_HAS_AVX2
__attribute__((target("avx2"))) float StereoWindow::CostWithAvx2(
    const StereoSource& source, const InverseDepthPlane& plane) const {
  return CostInLanes<8>(source, plane);
}
#endif

float StereoWindow::Cost(const StereoSource& source, const InverseDepthPlane& plane) const {
#if ROOMTEX_HAS_AVX2
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return CostWithAvx2(source, plane);
#endif
  return CostOnAnyProcessor(source, plane);
}

}  // namespace roomtex
