#include "dense/patch_match.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "colmap_ext/dense_workspace.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr int kBlockPx = 4;          // of the raster of open space
constexpr double kNearest = 0.35;    // metres: nearer than any thing that is photographed sharply
constexpr double kBeyondRoom = 0.1;  // metres that surfaces may lie outside the scan's box
constexpr int kNormalRadiusPx = 3;   // of the scan's normals
constexpr int kSide = 5;             // samples of a window, each way ...
constexpr int kStep = 2;             // ... so many pixels apart
constexpr int kSamples = kSide * kSide;
constexpr int kLanes = 4;  // that the processor takes at a time
constexpr int kPadded = (kSamples + kLanes - 1) / kLanes * kLanes;
constexpr int kMaxSources = 20;
constexpr int kCompared = 4;             // sources at the full resolution, pixel by pixel
constexpr int kBest = 2;                 // sources that count: others may not see the place
constexpr float kSigmaColor = 25;        // grey levels: what is of another colour is another thing
constexpr float kMinDeviation = 2.5f;    // grey levels; flatter windows say nothing
constexpr float kLeastDepth = 1e-3f;     // share: a window that reaches beside the camera
constexpr float kMaxSlope = 5;           // tangent of the angle to a plane that faces the camera
constexpr float kSameDepth = 0.01f;      // share
constexpr float kAlreadyThere = 0.002f;  // share: what is there already is only refined
constexpr float kNoMatch = 2;            // cost of a hypothesis that no two sources see

using Plane = InverseDepthPlane;

struct Source {
  const cv::Mat1f* grey;
  Eigen::Matrix3f turned;  // pixel of the reference, at infinity, to that of the source
  Eigen::Vector3f moved;   // times the inverse depth
};

// `img` to `img`, homogeneous: turned * x + moved * w.
Source MakeSource(const StereoPicture& reference, const Camera& reference_camera,
                  const StereoPicture& source, const Camera& source_camera, const cv::Mat1f* grey) {
  const auto matrix = [](const Camera& camera) {
    Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
    k(0, 0) = camera.params[0], k(1, 1) = camera.params[1];
    k(0, 2) = camera.params[2], k(1, 2) = camera.params[3];
    return k;
  };
  const Rigid source_from_reference = source.cam_from_scan * reference.cam_from_scan.Inverse();
  const Eigen::Matrix3d k = matrix(source_camera);
  return {
      grey,
      (k * source_from_reference.rotation.toRotationMatrix() * matrix(reference_camera).inverse())
          .cast<float>(),
      (k * source_from_reference.translation).cast<float>()};
}

Eigen::Vector3f NormalFromPlane(const Plane& plane, const Camera& camera, float x, float y) {
  const std::vector<double>& p = camera.params;
  const Eigen::Vector3f away(static_cast<float>(p[0]) * plane.a, static_cast<float>(p[1]) * plane.b,
                             plane.w - (x - static_cast<float>(p[2])) * plane.a -
                                 (y - static_cast<float>(p[3])) * plane.b);
  return -away.normalized();
}

constexpr int Dx(int k) { return (k % kSide - kSide / 2) * kStep; }
constexpr int Dy(int k) { return (k / kSide - kSide / 2) * kStep; }

struct WindowOffsets {
  std::array<float, kPadded> dx{}, dy{};
  constexpr WindowOffsets() {
    for (int k = 0; k < kSamples; ++k) {
      dx[k] = static_cast<float>(Dx(k));
      dy[k] = static_cast<float>(Dy(k));
    }
  }
};
constexpr WindowOffsets kOffsets;

// The window of the reference around one pixel, with bilateral weights.
class Window {
 public:
  // False if it is too flat.
  bool Set(const cv::Mat1f& grey, int x, int y) {
    const float centre = grey(y, x);
    sum_ = mean_ = 0;
    for (int k = 0; k < kSamples; ++k) {
      const int column = std::clamp(x + Dx(k), 0, grey.cols - 1);
      const int row = std::clamp(y + Dy(k), 0, grey.rows - 1);
      value_[k] = grey(row, column);
      const float difference = (value_[k] - centre) / kSigmaColor;
      weight_[k] = 1 / (1 + difference * difference);
      sum_ += weight_[k];
      mean_ += weight_[k] * value_[k];
    }
    mean_ /= sum_;
    variance_ = 0;
    for (int k = 0; k < kSamples; ++k) {
      value_[k] -= mean_;
      variance_ += weight_[k] * value_[k] * value_[k];
    }
    variance_ /= sum_;
    return variance_ > kMinDeviation * kMinDeviation;
  }

  // 1 - normalised cross-correlation, 0..2.
  float Cost(const Source& source, float x, float y, const Plane& plane) const {
    const cv::Mat1f& grey = *source.grey;
    const Eigen::Vector3f at = source.turned * Eigen::Vector3f(x, y, 1) + source.moved * plane.w;
    const Eigen::Vector3f right = source.turned.col(0) + source.moved * plane.a;
    const Eigen::Vector3f down = source.turned.col(1) + source.moved * plane.b;
    const auto max_x = static_cast<float>(grey.cols - 1), max_y = static_cast<float>(grey.rows - 1);
    // The window is a convex quadrilateral there: in the picture if its corners are.
    constexpr auto kReach = static_cast<float>(kSide / 2 * kStep);
    for (const float dy : {-kReach, kReach}) {
      for (const float dx : {-kReach, kReach}) {
        const Eigen::Vector3f corner = at + dx * right + dy * down;
        if (!(corner.z() > kLeastDepth)) return kNoMatch;
        const float u = corner.x() / corner.z() - 0.5f, v = corner.y() / corner.z() - 0.5f;
        if (!(u >= 0 && v >= 0 && u < max_x && v < max_y)) return kNoMatch;
      }
    }
    // Without a branch, four samples at a time.
    alignas(32) std::array<float, kPadded> us, vs, values;
    for (int k = 0; k < kPadded; ++k) {
      const float inverse = 1 / (at.z() + kOffsets.dx[k] * right.z() + kOffsets.dy[k] * down.z());
      us[k] = (at.x() + kOffsets.dx[k] * right.x() + kOffsets.dy[k] * down.x()) * inverse - 0.5f;
      vs[k] = (at.y() + kOffsets.dx[k] * right.y() + kOffsets.dy[k] * down.y()) * inverse - 0.5f;
    }
    const float* const pixels = grey[0];
    const auto stride = static_cast<int>(grey.step1());
    for (int k = 0; k < kSamples; ++k) {
      // Rounding may lead over the edge, and far where a corner is almost beside the camera.
      const int column = std::clamp(static_cast<int>(us[k]), 0, grey.cols - 2);
      const int row = std::clamp(static_cast<int>(vs[k]), 0, grey.rows - 2);
      const float s = us[k] - static_cast<float>(column), t = vs[k] - static_cast<float>(row);
      const float* above = pixels + static_cast<ptrdiff_t>(row) * stride + column;
      const float* below = above + stride;
      const float top = above[0] + s * (above[1] - above[0]);
      const float bottom = below[0] + s * (below[1] - below[0]);
      values[k] = top + t * (bottom - top);
    }
    for (int k = kSamples; k < kPadded; ++k) values[k] = 0;
    std::array<float, kLanes> sums{}, squares{}, crosses{};
    for (int k = 0; k < kPadded; k += kLanes) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const float weighted = weight_[k + lane] * values[k + lane];
        sums[lane] += weighted;
        squares[lane] += weighted * values[k + lane];
        crosses[lane] += weighted * value_[k + lane];
      }
    }
    float sum = 0, square = 0, cross = 0;
    for (int lane = 0; lane < kLanes; ++lane) {
      sum += sums[lane], square += squares[lane], cross += crosses[lane];
    }
    const float mean = sum / sum_;
    const float variance = square / sum_ - mean * mean;
    if (!(variance > 0.25f * kMinDeviation * kMinDeviation)) return kNoMatch;
    return 1 - cross / sum_ / std::sqrt(variance * variance_);
  }

 private:
  alignas(32) std::array<float, kPadded> value_{}, weight_{};  // 0 beyond kSamples
  float sum_ = 0, mean_ = 0, variance_ = 0;
};

// One level of resolution.
class Level {
 public:
  Level(const StereoPicture& reference, const std::vector<StereoPicture>& sources,
        const OpenSpace& open, int shrink, uint64_t seed, int num_threads)
      : open_(open), camera_(reference.camera), seed_(seed), num_threads_(num_threads) {
    const auto shrunk = [shrink](const StereoPicture& picture, Camera* camera) {
      cv::Mat1f grey = picture.grey;
      if (shrink > 1) {
        camera->Resize(picture.camera.width / shrink, picture.camera.height / shrink);
        cv::resize(picture.grey, grey, {camera->width, camera->height}, 0, 0, cv::INTER_AREA);
      }
      return grey;
    };
    grey_ = shrunk(reference, &camera_);
    greys_.reserve(sources.size());
    for (const StereoPicture& source : sources) {
      Camera camera = source.camera;
      greys_.push_back(shrunk(source, &camera));
      sources_.push_back(MakeSource(reference, camera_, source, camera, &greys_.back()));
    }
    planes_.resize(grey_.total());
    costs_.assign(grey_.total(), kNoMatch);
    all_sources_ = (uint32_t{1} << sources_.size()) - 1;
    compared_.assign(grey_.total(), all_sources_);
    scan_.resize(grey_.total());
    bins_.assign(grey_.total(), 0);
    FindOpenPixels();
  }

  // Starts from the surface beside the holes, or from a coarser level.
  void Start(const Level* coarser) {
    const std::vector<std::array<int, 4>> beside =
        coarser == nullptr ? FixedBeside() : std::vector<std::array<int, 4>>();
    ForOpenPixels(-1, [&](int x, int y, Window* window) {
      const int pixel = y * grey_.cols + x;
      RandomStream random(MixBits(seed_, pixel, 0));
      if (coarser != nullptr) {
        const int there = coarser->PixelForFiner(x, y, grey_.size());
        compared_[pixel] = coarser->compared_[there];
        Try(x, y, coarser->PlaneForFiner(x, y, grey_.size()), *window);
      } else {
        for (const int other : beside[pixel]) {
          if (other >= 0) TryFrom(x, y, other, scan_[other], *window);
        }
        for (int k = 0; k < 4; ++k) Try(x, y, RandomPlane(pixel, &random), *window);
      }
      if (scan_[pixel].w > 0) Try(x, y, scan_[pixel], *window);
    });
  }

  // Starts from what was found before.
  void Start(const DepthEstimate& before) {
    ForOpenPixels(-1, [&](int x, int y, Window* window) {
      const float depth = before.depth(y, x);
      compared_[y * grey_.cols + x] = static_cast<uint32_t>(before.compared(y, x));
      if (depth > 0) Try(x, y, PlaneAt(x, y, depth, before.normals), *window);
      const Plane& scan = scan_[y * grey_.cols + x];
      if (scan.w > 0) Try(x, y, scan, *window);
    });
  }

  // What another photo has found is tried where it shows here, and beside it.
  void TryFromView(const DepthOfSource& other, const Rigid& cam_from_scan) {
    const Rigid here_from_other = cam_from_scan * other.cam_from_scan.Inverse();
    const Eigen::Matrix3f turned = here_from_other.rotation.toRotationMatrix().cast<float>();
    const CameraProjection projection(camera_), other_projection(other.camera);
    std::vector<Plane> shown(grey_.total());  // the nearest of those that show at a pixel
    for (int y = 0; y < other.depth.rows; ++y) {
      for (int x = 0; x < other.depth.cols; ++x) {
        const float depth = other.depth(y, x);
        if (!(depth > 0)) continue;
        const Eigen::Vector3d place =
            here_from_other *
            (*other_projection.RayFromImg({x + 0.5, y + 0.5}) * static_cast<double>(depth));
        const auto at = projection.ImgFromCam(place);
        if (!at || !projection.InImage(*at)) continue;
        const int column = std::min(static_cast<int>(at->x()), grey_.cols - 1);
        const int row = std::min(static_cast<int>(at->y()), grey_.rows - 1);
        const int pixel = row * grey_.cols + column;
        const auto z = static_cast<float>(place.z());
        if (bins_[pixel] == 0 || 1 / z < shown[pixel].w) continue;
        const Eigen::Vector3f normal(other.normals[0](y, x), other.normals[1](y, x),
                                     other.normals[2](y, x));
        shown[pixel] = PlaneFromNormal(z, turned * normal, camera_, static_cast<float>(at->x()),
                                       static_cast<float>(at->y()));
        const float dx = static_cast<float>(column) + 0.5f - static_cast<float>(at->x());
        const float dy = static_cast<float>(row) + 0.5f - static_cast<float>(at->y());
        shown[pixel].w = shown[pixel].At(dx, dy);
      }
    }
    ForOpenPixels(-1, [&](int x, int y, Window* window) {
      const int pixel = y * grey_.cols + x;
      const Plane& plane = shown[pixel];
      // What is there already is refined anyway.
      if (!(plane.w > 0) || std::abs(plane.w - planes_[pixel].w) < kAlreadyThere * plane.w) return;
      const uint32_t compared = compared_[pixel];
      compared_[pixel] = all_sources_;  // these were the best for something else
      Try(x, y, plane, *window);
      compared_[pixel] = planes_[pixel].w == plane.w ? BestSources(x, y, *window) : compared;
    });
  }

  void Iterate(int iteration, bool far) {
    for (int color = 0; color < 2; ++color) {
      ForOpenPixels(color, [&](int x, int y, Window* window) {
        const int pixel = y * grey_.cols + x;
        // An odd number of pixels away: of the other colour, which stays as it is meanwhile.
        for (const int distance : {1, 5, 15}) {
          if (!far && distance > 1) break;
          for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
            const int ox = x + dx * distance, oy = y + dy * distance;
            if (ox < 0 || oy < 0 || ox >= grey_.cols || oy >= grey_.rows) continue;
            const int other = oy * grey_.cols + ox;
            const Plane& plane = bins_[other] != 0 ? planes_[other] : scan_[other];
            if (plane.w > 0) TryFrom(x, y, other, plane, *window);
          }
        }
        RandomStream random(MixBits(seed_, pixel, 2 + 2 * iteration + color));
        if (far) Try(x, y, RandomPlane(pixel, &random), *window);
        float size = std::ldexp(0.04f, -iteration);
        for (int k = 0; k < 3; ++k, size /= 4) {
          Plane plane = planes_[pixel];
          if (!(plane.w > 0)) break;
          const auto change = [&] { return static_cast<float>(random.Uniform(-1, 1)) * size; };
          plane.w *= 1 + change();
          plane.a += 15 * change() * plane.w / focal();
          plane.b += 15 * change() * plane.w / focal();
          Try(x, y, plane, *window);
        }
      });
    }
  }

  // What is found from now on, and by a finer level, is compared with fewer sources.
  void ChooseSources() {
    ForOpenPixels(-1, [&](int x, int y, Window* window) {
      compared_[y * grey_.cols + x] = BestSources(x, y, *window);
    });
  }

  DepthEstimate Result() const {
    DepthEstimate result;
    result.compared = cv::Mat1i(grey_.size());
    result.depth = cv::Mat1f::zeros(grey_.size());
    result.score = cv::Mat1f::zeros(grey_.size());
    for (int k = 0; k < 3; ++k) result.normals.emplace_back(cv::Mat1f::zeros(grey_.size()));
    size_t num_open = 0;
    for (int y = 0; y < grey_.rows; ++y) {
      for (int x = 0; x < grey_.cols; ++x) {
        const int pixel = y * grey_.cols + x;
        result.compared(y, x) = static_cast<int>(compared_[pixel]);
        num_open += bins_[pixel] != 0;
        if (bins_[pixel] == 0 || !(planes_[pixel].w > 0)) continue;
        result.depth(y, x) = 1 / planes_[pixel].w;
        result.score(y, x) = std::clamp(1 - costs_[pixel], 0.0f, 1.0f);
        const Eigen::Vector3f normal = NormalFromPlane(
            planes_[pixel], camera_, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        for (int k = 0; k < 3; ++k) result.normals[k](y, x) = normal[k];
      }
    }
    result.share_open = static_cast<double>(num_open) / static_cast<double>(grey_.total());
    return result;
  }

 private:
  float focal() const { return static_cast<float>(camera_.params[0]); }

  Plane PlaneAt(int x, int y, float depth, const std::vector<cv::Mat1f>& normals) const {
    return PlaneFromNormal(depth, {normals[0](y, x), normals[1](y, x), normals[2](y, x)}, camera_,
                           static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  }

  // The sources that correlate best with what was found at a pixel.
  uint32_t BestSources(int x, int y, const Window& window) const {
    const Plane& plane = planes_[y * grey_.cols + x];
    if (!(plane.w > 0) || sources_.size() <= kCompared) return all_sources_;
    std::array<std::pair<float, int>, kMaxSources> costs;
    for (size_t i = 0; i < sources_.size(); ++i) {
      costs[i] = {window.Cost(sources_[i], static_cast<float>(x) + 0.5f,
                              static_cast<float>(y) + 0.5f, plane),
                  static_cast<int>(i)};
    }
    std::partial_sort(costs.begin(), costs.begin() + kCompared,
                      costs.begin() + static_cast<ptrdiff_t>(sources_.size()));
    uint32_t best = 0;
    for (int k = 0; k < kCompared; ++k) best |= uint32_t{1} << costs[k].second;
    return best;
  }

  void FindOpenPixels() {
    const cv::Mat1f& depth = open_.scan_depth();
    ParallelFor(num_threads_, 0, grey_.rows, [&](int y) {
      for (int x = 0; x < grey_.cols; ++x) {
        const int pixel = y * grey_.cols + x;
        const double x_share = (x + 0.5) / grey_.cols, y_share = (y + 0.5) / grey_.rows;
        const int column = static_cast<int>(x_share * depth.cols);
        const int row = static_cast<int>(y_share * depth.rows);
        const float z = depth(row, column);
        bins_[pixel] = open_.BinsInFront(x_share, y_share);
        if (z > 0) {
          const Eigen::Vector3f normal(open_.scan_normals()[0](row, column),
                                       open_.scan_normals()[1](row, column),
                                       open_.scan_normals()[2](row, column));
          scan_[pixel] = PlaneFromNormal(z, normal, camera_, static_cast<float>(x) + 0.5f,
                                         static_cast<float>(y) + 0.5f);
        }
      }
    });
  }

  // color: 0, 1 = of the chequerboard; -1 = all. Rows side by side.
  template <typename Body>
  void ForOpenPixels(int color, const Body& body) const {
    ParallelFor(num_threads_, 0, grey_.rows, [&](int y) {
      Window window;
      for (int x = 0; x < grey_.cols; ++x) {
        if (color >= 0 && (x + y) % 2 != color) continue;
        if (bins_[y * grey_.cols + x] == 0 || !window.Set(grey_, x, y)) continue;
        body(x, y, &window);
      }
    });
  }

  bool IsAllowed(int pixel, const Plane& plane) const {
    if (!(plane.w > 0) || !(std::abs(plane.a) * focal() < kMaxSlope * plane.w) ||
        !(std::abs(plane.b) * focal() < kMaxSlope * plane.w)) {
      return false;
    }
    const float of_scan = scan_[pixel].w;
    if (of_scan > 0 && IsSameDepth(plane.w, of_scan)) return true;
    const int bin = open_.Bin(plane.w);
    return plane.w >= open_.first() && bin < OpenSpace::kBins && (bins_[pixel] >> bin & 1) != 0;
  }

  void Try(int x, int y, const Plane& plane, const Window& window) {
    const int pixel = y * grey_.cols + x;
    if (!IsAllowed(pixel, plane)) return;
    std::array<float, kBest> best;
    best.fill(kNoMatch);
    for (size_t i = 0; i < sources_.size(); ++i) {
      if ((compared_[pixel] >> i & 1) == 0) continue;
      const float cost = window.Cost(sources_[i], static_cast<float>(x) + 0.5f,
                                     static_cast<float>(y) + 0.5f, plane);
      if (cost < best[0]) {
        best[1] = best[0];
        best[0] = cost;
      } else if (cost < best[1]) {
        best[1] = cost;
      }
    }
    const float cost = 0.5f * (best[0] + best[1]);
    if (cost < costs_[pixel]) {
      costs_[pixel] = cost;
      planes_[pixel] = plane;
    }
  }

  void TryFrom(int x, int y, int other, const Plane& plane, const Window& window) {
    Plane moved = plane;
    moved.w = plane.At(static_cast<float>(x - other % grey_.cols),
                       static_cast<float>(y - other / grey_.cols));
    Try(x, y, moved, window);
  }

  Plane RandomPlane(int pixel, RandomStream* random) const {
    const uint64_t bins = bins_[pixel];
    int number = random->Index(__builtin_popcountll(bins));
    int bin = 0;
    for (; bin < OpenSpace::kBins; ++bin) {
      if ((bins >> bin & 1) != 0 && number-- == 0) break;
    }
    Plane plane;
    plane.w =
        open_.first() + (open_.last() - open_.first()) *
                            (static_cast<float>(bin) + static_cast<float>(random->Uniform())) /
                            OpenSpace::kBins;
    plane.a = static_cast<float>(random->Uniform(-2, 2)) * plane.w / focal();
    plane.b = static_cast<float>(random->Uniform(-2, 2)) * plane.w / focal();
    return plane;
  }

  // Per pixel the nearest pixels left, right, above and below that only the scan can be at; -1 =
  // none.
  std::vector<std::array<int, 4>> FixedBeside() const {
    std::vector<std::array<int, 4>> beside(grey_.total(), {-1, -1, -1, -1});
    const auto fixed = [this](int pixel) { return bins_[pixel] == 0 && scan_[pixel].w > 0; };
    const auto walk = [&](int count, int direction, const auto& pixel_at) {
      int last = -1;
      for (int i = 0; i < count; ++i) {
        const int pixel = pixel_at(i);
        if (fixed(pixel)) last = pixel;
        beside[pixel][direction] = last;
      }
    };
    const int columns = grey_.cols, rows = grey_.rows;
    for (int y = 0; y < rows; ++y) {
      walk(columns, 0, [&](int i) { return y * columns + i; });
      walk(columns, 1, [&](int i) { return y * columns + columns - 1 - i; });
    }
    for (int x = 0; x < columns; ++x) {
      walk(rows, 2, [&](int i) { return i * columns + x; });
      walk(rows, 3, [&](int i) { return (rows - 1 - i) * columns + x; });
    }
    return beside;
  }

  int PixelForFiner(int x, int y, const cv::Size& size) const {
    const int column = static_cast<int>((x + 0.5) * grey_.cols / size.width);
    const int row = static_cast<int>((y + 0.5) * grey_.rows / size.height);
    return std::min(row, grey_.rows - 1) * grey_.cols + std::min(column, grey_.cols - 1);
  }

  Plane PlaneForFiner(int x, int y, const cv::Size& size) const {
    const float scale_x = static_cast<float>(grey_.cols) / static_cast<float>(size.width);
    const float scale_y = static_cast<float>(grey_.rows) / static_cast<float>(size.height);
    const float at_x = (static_cast<float>(x) + 0.5f) * scale_x;
    const float at_y = (static_cast<float>(y) + 0.5f) * scale_y;
    const int column = std::min(static_cast<int>(at_x), grey_.cols - 1);
    const int row = std::min(static_cast<int>(at_y), grey_.rows - 1);
    const Plane& plane = planes_[row * grey_.cols + column];
    return {
        plane.At(at_x - static_cast<float>(column) - 0.5f, at_y - static_cast<float>(row) - 0.5f),
        plane.a * scale_x, plane.b * scale_y};
  }

  const OpenSpace& open_;
  Camera camera_;
  uint64_t seed_;
  int num_threads_;
  cv::Mat1f grey_;
  std::vector<cv::Mat1f> greys_;
  std::vector<Source> sources_;
  std::vector<Plane> planes_, scan_;  // w = 0: none
  std::vector<float> costs_;
  std::vector<uint32_t> compared_;  // sources, one bit each
  uint32_t all_sources_ = 0;
  std::vector<uint64_t> bins_;  // 0 = only the scan's surface can be there
};

int FineRounds(const PatchMatchOptions& options) { return (options.num_iterations + 1) / 2; }

}  // namespace

void PatchMatchOptions::Declare(OptionFields* fields) {
  fields
      ->Int(
          "PatchMatch.num_sources", &num_sources,
          "Photos that each photo is compared with: at half the resolution with all of them, then, "
          "place by place, with the four that correlate best. More = more complete, slower.")
      .Within(2, kMaxSources, "photos");
  fields
      ->Int("PatchMatch.num_iterations", &num_iterations,
            "Rounds of propagation and refinement at each of two resolutions. More = slower, and "
            "more complete where there is little texture.")
      .Within(1, 20);
}

std::vector<std::string> PatchMatchOptions::Problems() const { return ProblemsOf(*this); }

OpenSpace::OpenSpace(const ScanSpace& space, const StereoPicture& picture, double margin,
                     int num_threads)
    : scan_depth_(
          DepthOfSurface(space.surface(), picture.camera, picture.cam_from_scan, num_threads)),
      scan_normals_(NormalsOfDepth(scan_depth_, picture.camera.params, kNormalRadiusPx)),
      columns_((picture.camera.width + kBlockPx - 1) / kBlockPx),
      rows_((picture.camera.height + kBlockPx - 1) / kBlockPx) {
  const Eigen::Vector3d centre = picture.cam_from_scan.TargetOriginInSource();
  const Eigen::Vector3d size = space.bounds().max - space.bounds().min;
  const Eigen::Vector3d middle = 0.5 * (space.bounds().max + space.bounds().min);
  const double farthest = (centre - middle).norm() + 0.5 * size.norm() + kBeyondRoom;
  first_ = static_cast<float>(1 / farthest);
  last_ = static_cast<float>(1 / kNearest);
  const CameraProjection projection(picture.camera);
  const Rigid scan_from_cam = picture.cam_from_scan.Inverse();
  std::vector<uint64_t> raw(static_cast<size_t>(columns_) * rows_, 0);
  ParallelFor(num_threads, 0, rows_, [&](int row) {
    for (int column = 0; column < columns_; ++column) {
      const int x = std::min(column * kBlockPx + kBlockPx / 2, picture.camera.width - 1);
      const int y = std::min(row * kBlockPx + kBlockPx / 2, picture.camera.height - 1);
      const Eigen::Vector3d ray = *projection.RayFromImg({x + 0.5, y + 0.5});
      const double scan = scan_depth_(y, x) > 0 ? scan_depth_(y, x) - margin : farthest;
      uint64_t bins = 0;
      for (int bin = 0; bin < kBins; ++bin) {
        const double depth = 1 / (first_ + (last_ - first_) * (bin + 0.5) / kBins);
        if (depth > scan) continue;
        const Eigen::Vector3d place = scan_from_cam * (ray * depth);
        // A ray that nears a wall passes through what no scanner could see empty: nothing is there.
        if (space.IsInRoom(place, kBeyondRoom) && !space.IsSeenEmpty(place, margin) &&
            !space.surface().DistanceTo(place, 2 * margin)) {
          bins |= uint64_t{1} << bin;
        }
      }
      raw[static_cast<size_t>(row) * columns_ + column] = bins;
    }
  });
  // What is open beside a block or a bin may be open here: places are looked at one by one later.
  bins_ = raw;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      uint64_t bins = 0;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, rows_ - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, columns_ - 1); ++c) {
          bins |= raw[static_cast<size_t>(r) * columns_ + c];
        }
      }
      bins_[static_cast<size_t>(row) * columns_ + column] = bins | bins << 1 | bins >> 1;
    }
  }
}

uint64_t OpenSpace::BinsAt(double x_share, double y_share) const {
  const int column =
      std::clamp(static_cast<int>(x_share * scan_depth_.cols) / kBlockPx, 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(y_share * scan_depth_.rows) / kBlockPx, 0, rows_ - 1);
  return bins_[static_cast<size_t>(row) * columns_ + column];
}

uint64_t OpenSpace::BinsInFront(double x_share, double y_share) const {
  const float z = scan_depth_(static_cast<int>(y_share * scan_depth_.rows),
                              static_cast<int>(x_share * scan_depth_.cols));
  const uint64_t bins = BinsAt(x_share, y_share);
  if (!(z > 0)) return bins;
  const int last = Bin(1 / z);
  return last >= kBins - 1 ? 0 : bins >> (last + 1) << (last + 1);
}

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

bool IsSameDepth(float a, float b) { return std::abs(a - b) < kSameDepth * b; }

DepthEstimate EstimateDepth(const StereoPicture& reference,
                            const std::vector<StereoPicture>& sources, const OpenSpace& open,
                            const PatchMatchOptions& options, uint64_t seed, int num_threads) {
  Level coarse(reference, sources, open, 2, MixBits(seed, 2), num_threads);
  coarse.Start(nullptr);
  for (int i = 0; i < options.num_iterations; ++i) coarse.Iterate(i, true);
  coarse.ChooseSources();
  Level fine(reference, sources, open, 1, MixBits(seed, 1), num_threads);
  fine.Start(&coarse);
  // Half of the rounds are left to RefineDepth.
  for (int i = 0; i < FineRounds(options) - FineRounds(options) / 2; ++i)
    fine.Iterate(i + 1, false);
  return fine.Result();
}

DepthEstimate RefineDepth(const StereoPicture& reference, const std::vector<StereoPicture>& sources,
                          const OpenSpace& open, const DepthEstimate& before, int num_found,
                          const std::function<DepthOfSource(int)>& found,
                          const PatchMatchOptions& options, uint64_t seed, int num_threads) {
  Level level(reference, sources, open, 1, seed, num_threads);
  level.Start(before);
  for (int i = 0; i < num_found; ++i) level.TryFromView(found(i), reference.cam_from_scan);
  const int rounds = std::max(FineRounds(options) / 2, 1);
  for (int i = 0; i < rounds; ++i) level.Iterate(i + 2, false);
  return level.Result();
}

}  // namespace roomtex
