#include "dense/patch_match.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr int kMaxSources = 20;
constexpr int kCompared = 4;             // sources at the full resolution, pixel by pixel
constexpr float kMaxSlope = 5;           // tangent of the angle to a plane that faces the camera
constexpr float kSameDepth = 0.01f;      // share
constexpr float kAlreadyThere = 0.002f;  // share: what is there already is only refined

constexpr float kAlike_px = 0.02f;  // in the source that shows most of a difference
constexpr float kHopeless = 0.35f;  // of the cost: most sources are so much worse
constexpr float kFits = 0.1f;       // cost

using Plane = InverseDepthPlane;

// One level of resolution.
class Level {
 public:
  Level(const StereoPicture& reference, const std::vector<StereoPicture>& sources,
        const OpenSpace& open, int shrink, uint64_t seed, int num_threads)
      : open_(open), camera_(reference.camera), seed_(seed), num_threads_(num_threads) {
    const auto shrunk = [shrink](const StereoPicture& picture, Camera* camera) {
      cv::Mat1b grey = picture.grey;
      if (shrink > 1) {
        camera->Resize(picture.camera.width / shrink, picture.camera.height / shrink);
        cv::resize(picture.grey, grey, {camera->width, camera->height}, 0, 0, cv::INTER_AREA);
      }
      return grey;
    };
    grey_ = shrunk(reference, &camera_);
    for (const StereoPicture& source : sources) {
      Camera camera = source.camera;
      const cv::Mat1b grey = shrunk(source, &camera);
      sources_.emplace_back(camera_, reference.cam_from_scan, camera, source.cam_from_scan, grey);
    }
    float most_pixels = 1;
    for (const StereoSource& source : sources_) {
      most_pixels = std::max(most_pixels, source.PixelsPerInverseDepth());
    }
    alike_inverse_depth_ = kAlike_px / most_pixels;
    planes_.resize(grey_.total());
    costs_.assign(grey_.total(), StereoWindow::kNoMatch);
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
    ForOpenPixels(-1, [&](int x, int y, StereoWindow* window) {
      const int pixel = y * grey_.cols + x;
      RandomStream random(MixBits(seed_, pixel, 0));
      if (coarser != nullptr) {
        const int there = coarser->PixelForFiner(x, y, grey_.size());
        compared_[pixel] = coarser->compared_[there];
        Try(x, y, coarser->PlaneForFiner(x, y, grey_.size()), *window);
      } else {
        for (const int other : beside[pixel]) {
          if (other >= 0) Try(x, y, Moved(scan_[other], x, y, other), *window);
        }
        for (int k = 0; k < 4; ++k) Try(x, y, RandomPlane(pixel, &random), *window);
      }
      if (scan_[pixel].w > 0) Try(x, y, scan_[pixel], *window);
    });
  }

  // Starts from what was found before.
  void Start(const DepthEstimate& before) {
    ForOpenPixels(-1, [&](int x, int y, StereoWindow* window) {
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
    // What is there already is refined anyway.
    const auto is_news = [&](int pixel) {
      const Plane& plane = shown[pixel];
      return plane.w > 0 && !(std::abs(plane.w - planes_[pixel].w) < kAlreadyThere * plane.w) &&
             IsAllowed(pixel, plane);
    };
    ForOpenPixelsThat(is_news, [&](int x, int y, StereoWindow* window) {
      const int pixel = y * grey_.cols + x;
      const Plane& plane = shown[pixel];
      // Those that were compared were the best for something else.
      Costs costs = Compare(*window, plane, all_sources_, costs_[pixel]);
      const float cost = costs.Mean();
      if (!(cost < costs_[pixel])) return;
      costs_[pixel] = cost;
      planes_[pixel] = plane;
      compared_[pixel] = costs.Best();
    });
  }

  void Iterate(int iteration, bool far) {
    for (int color = 0; color < 2; ++color) {
      ForOpenPixels(color, [&](int x, int y, StereoWindow* window) {
        const int pixel = y * grey_.cols + x;
        const auto try_plane = [&](const Plane& plane) {
          // The scan's surface need not be found more exactly.
          if (IsScans(pixel) && IsSameDepth(plane.w, scan_[pixel].w)) return;
          Try(x, y, plane, *window);
        };
        // An odd number of pixels away: of the other colour, which stays as it is meanwhile.
        for (const int distance : {1, 5, 15}) {
          if (!far && distance > 1) break;
          for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
            const int ox = x + dx * distance, oy = y + dy * distance;
            if (ox < 0 || oy < 0 || ox >= grey_.cols || oy >= grey_.rows) continue;
            const int other = oy * grey_.cols + ox;
            const Plane& plane = bins_[other] != 0 ? planes_[other] : scan_[other];
            if (plane.w > 0) try_plane(Moved(plane, x, y, other));
          }
        }
        RandomStream random(MixBits(seed_, pixel, 2 + 2 * iteration + color));
        if (far) try_plane(RandomPlane(pixel, &random));
        float size = std::ldexp(0.04f, -iteration);
        for (int k = 0; k < 3; ++k, size /= 4) {
          Plane plane = planes_[pixel];
          if (!(plane.w > 0)) break;
          const auto change = [&] { return static_cast<float>(random.Uniform(-1, 1)) * size; };
          plane.w *= 1 + change();
          plane.a += 15 * change() * plane.w / focal();
          plane.b += 15 * change() * plane.w / focal();
          try_plane(plane);
        }
      });
    }
  }

  // What is found from now on, and by a finer level, is compared with fewer sources.
  void ChooseSources() {
    if (sources_.size() <= kCompared) return;
    ForOpenPixels(-1, [&](int x, int y, StereoWindow* window) {
      const int pixel = y * grey_.cols + x;
      const Plane& plane = planes_[pixel];
      if (!(plane.w > 0)) return;
      compared_[pixel] = Compare(*window, plane, all_sources_, StereoWindow::kNoMatch).Best();
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

  // Of the sources with a bit in `which`.
  struct Costs {
    std::array<std::pair<float, int>, kMaxSources> of_source;
    size_t count = 0;

    float Mean() const {  // of the best
      float best = StereoWindow::kNoMatch, second = StereoWindow::kNoMatch;
      for (size_t i = 0; i < count; ++i) {
        const float cost = of_source[i].first;
        if (cost < best) {
          second = best;
          best = cost;
        } else {
          second = std::min(second, cost);
        }
      }
      return 0.5f * (best + second);
    }
    // The sources that correlate best.
    uint32_t Best() {
      const size_t kept = std::min<size_t>(kCompared, count);
      std::partial_sort(of_source.begin(), of_source.begin() + kept, of_source.begin() + count);
      uint32_t best = 0;
      for (size_t k = 0; k < kept; ++k) best |= uint32_t{1} << of_source[k].second;
      return best;
    }
  };
  // Gives up, with costs that are too large, where all but the last quarter of the sources are far
  // worse than `bound`.
  Costs Compare(const StereoWindow& window, const Plane& plane, uint32_t which, float bound) const {
    const int count = __builtin_popcount(which), most = count - count / 4;
    Costs costs;
    float best = StereoWindow::kNoMatch;
    for (size_t i = 0; i < sources_.size(); ++i) {
      if ((which >> i & 1) == 0) continue;
      const float cost = window.Cost(sources_[i], plane);
      costs.of_source[costs.count++] = {cost, static_cast<int>(i)};
      best = std::min(best, cost);
      if (static_cast<int>(costs.count) == most && best > bound + kHopeless) break;
    }
    return costs;
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

  // color: 0, 1 = of the chequerboard; -1 = all.
  template <typename Body>
  void ForOpenPixels(int color, const Body& body) const {
    ForOpenPixelsThat(
        [&](int pixel) {
          return color < 0 || (pixel % grey_.cols + pixel / grey_.cols) % 2 == color;
        },
        body);
  }
  // Rows side by side.
  template <typename Wanted, typename Body>
  void ForOpenPixelsThat(const Wanted& is_wanted, const Body& body) const {
    ParallelFor(num_threads_, 0, grey_.rows, [&](int y) {
      StereoWindow window;
      for (int x = 0; x < grey_.cols; ++x) {
        const int pixel = y * grey_.cols + x;
        if (bins_[pixel] == 0 || !is_wanted(pixel) || !window.Set(grey_, x, y)) continue;
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

  // Whether no source could tell them from each other.
  bool IsAlike(const Plane& a, const Plane& b) const {
    constexpr float kReach = StereoWindow::kReachPx;
    return std::abs(a.w - b.w) + kReach * (std::abs(a.a - b.a) + std::abs(a.b - b.b)) <
           alike_inverse_depth_;
  }

  // Whether what was found is the scan's surface, and fits.
  bool IsScans(int pixel) const {
    const float of_scan = scan_[pixel].w;
    return of_scan > 0 && costs_[pixel] < kFits && IsSameDepth(planes_[pixel].w, of_scan);
  }

  void Try(int x, int y, const Plane& plane, const StereoWindow& window) {
    const int pixel = y * grey_.cols + x;
    if (!IsAllowed(pixel, plane) || IsAlike(plane, planes_[pixel])) return;
    const float cost = Compare(window, plane, compared_[pixel], costs_[pixel]).Mean();
    if (cost < costs_[pixel]) {
      costs_[pixel] = cost;
      planes_[pixel] = plane;
    }
  }

  // A plane of another pixel, at this one.
  Plane Moved(const Plane& plane, int x, int y, int other) const {
    return {plane.At(static_cast<float>(x - other % grey_.cols),
                     static_cast<float>(y - other / grey_.cols)),
            plane.a, plane.b};
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
  cv::Mat1b grey_;
  std::vector<StereoSource> sources_;
  std::vector<Plane> planes_, scan_;  // w = 0: none
  std::vector<float> costs_;
  std::vector<uint32_t> compared_;  // sources, one bit each
  uint32_t all_sources_ = 0;
  float alike_inverse_depth_ = 0;  // 1/metres: differences that no source shows
  std::vector<uint64_t> bins_;     // 0 = only the scan's surface can be there
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
