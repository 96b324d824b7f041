#include "dense/supplement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "core/cell_key.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "importers/ply.h"

namespace roomtex {
namespace {

constexpr double kMaxReprojection_px = 2;
constexpr double kMatch_px = 0.4;       // standard deviation of a match, for the uncertainty
constexpr double kOutsideBox = 0.1;     // metres outside the scan's box
constexpr double kSpeckleShare = 2e-4;  // of a picture: smaller islands of depth are chance
constexpr double kDepthSteps = 4000;    // per unit of the logarithm of the depth, for 16 bits
constexpr int kTrimPx = 4;              // half a window of the matching
constexpr int kThroughPx = 2;           // around a position that a photo sees through
constexpr float kBehind = 0.02f;        // share of the depth: another thing
constexpr float kSameSurface = 0.02f;   // share of the depth per vertex step

// Islands of few pixels, by depth: 0.
void RemoveSpeckles(cv::Mat1b* is_new, const cv::Mat1f& depth) {
  cv::Mat1s code(depth.size(), int16_t{0});
  for (int y = 0; y < code.rows; ++y) {
    for (int x = 0; x < code.cols; ++x) {
      if ((*is_new)(y, x) == 0) continue;
      const double steps = kDepthSteps * std::log(depth(y, x) / 0.1);
      code(y, x) = static_cast<int16_t>(std::clamp(steps, 1.0, 32000.0));
    }
  }
  const int smallest =
      std::max(40, static_cast<int>(kSpeckleShare * static_cast<double>(code.total())));
  cv::filterSpeckles(code, 0, smallest, kDepthSteps * 0.01);
  is_new->setTo(0, code == 0);
}

// A window beside an edge shows the nearer thing, and so matches at its depth: what is new within
// half a window of something farther behind it is taken out.
void TrimEdges(const DepthEstimate& estimate, const cv::Mat1f& scan_only, const Camera& camera,
               int num_threads, cv::Mat1b* is_new) {
  const cv::Mat1b before = is_new->clone();
  const auto is_beside_farther = [&](int x, int y) {
    const Eigen::Vector3f normal(estimate.normals[0](y, x), estimate.normals[1](y, x),
                                 estimate.normals[2](y, x));
    const InverseDepthPlane plane =
        PlaneFromNormal(estimate.depth(y, x), normal, camera, static_cast<float>(x) + 0.5f,
                        static_cast<float>(y) + 0.5f);
    for (int dy = -kTrimPx; dy <= kTrimPx; ++dy) {
      for (int dx = -kTrimPx; dx <= kTrimPx; ++dx) {
        const int column = std::clamp(x + dx, 0, before.cols - 1);
        const int row = std::clamp(y + dy, 0, before.rows - 1);
        const float depth =
            estimate.depth(row, column) > 0 ? estimate.depth(row, column) : scan_only(row, column);
        const float here = plane.At(static_cast<float>(column - x), static_cast<float>(row - y));
        if (depth > 0 && depth * here > 1 + kBehind) return true;
      }
    }
    return false;
  };
  ParallelFor(num_threads, 0, before.rows, [&](int y) {
    for (int x = 0; x < before.cols; ++x) {
      if (before(y, x) != 0 && is_beside_farther(x, y)) (*is_new)(y, x) = 0;
    }
  });
}

// Whether everything around that position is farther than `depth`.
bool SeesThrough(const cv::Mat1f& seen, const Eigen::Vector2d& at, double depth) {
  const auto farther = static_cast<float>((1 + kBehind) * depth);
  for (int dy = -kThroughPx; dy <= kThroughPx; dy += kThroughPx) {
    for (int dx = -kThroughPx; dx <= kThroughPx; dx += kThroughPx) {
      const int column = std::clamp(static_cast<int>(at.x()) + dx, 0, seen.cols - 1);
      const int row = std::clamp(static_cast<int>(at.y()) + dy, 0, seen.rows - 1);
      if (!(seen(row, column) > farther)) return false;
    }
  }
  return true;
}

}  // namespace

void SupplementOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Fusion.min_correlation", &min_correlation,
               "Normalised cross-correlation with the best two photos below which a depth counts "
               "for nothing, 0 to 1. Larger = stricter.")
      .Within(0, 1);
  fields
      ->Int("Fusion.min_support", &min_support,
            "Photos that a place must be found from, from places 2 degrees apart as it sees them: "
            "copies count once. Larger = stricter.")
      .Within(2, kMaxConfirming + 1, "photos");
  fields
      ->Number("Fusion.min_pair_correlation", &min_pair_correlation,
               "Normalised cross-correlation with which two photos are enough, 0 to 1 (1 = never). "
               "Larger = stricter.")
      .Within(0, 1);
  fields
      ->Number("Fusion.max_depth_difference", &max_depth_difference,
               "Depths of two photos agree within this share of the depth. Larger = more tolerant.")
      .Between(0, 0.5);
  fields
      ->Number("Fusion.distance_to_scan", &distance_to_scan,
               "What is nearer to the scan's surface, or to what the scanner saw empty, is not "
               "added, metres; never less than twice the expected error of the alignment. Larger = "
               "less is added.")
      .Within(0.001, 1, "metres");
  fields
      ->Number("Fusion.spacing", &spacing,
               "Distance between vertices, metres, but at most one per pixel. Smaller = finer.")
      .Within(0.0005, 1, "metres");
}

std::vector<std::string> SupplementOptions::Problems() const { return ProblemsOf(*this); }

ConfirmedDepth ConfirmDepth(const StereoView& view, const DepthEstimate& estimate,
                            const cv::Mat1f& scan_only, const std::vector<DepthOfView>& others,
                            const ScanSpace& space, const SupplementOptions& options,
                            int num_threads) {
  const cv::Size size = estimate.depth.size();
  ConfirmedDepth result{scan_only.clone(),
                        {},
                        cv::Mat1b(size, uint8_t{0}),
                        cv::Mat1f::zeros(size),
                        cv::Mat1b(size, uint8_t{0})};
  for (const cv::Mat1f& normal : estimate.normals) result.normals.push_back(normal.clone());
  const CameraProjection projection(view.camera);
  const Rigid scan_from_cam = view.cam_from_scan.Inverse();
  std::vector<CameraProjection> other_projections;
  std::vector<Rigid> scan_from_others;
  for (const DepthOfView& other : others) {
    other_projections.emplace_back(other.view->camera);
    scan_from_others.push_back(other.view->cam_from_scan.Inverse());
  }
  const double focal = view.camera.params[0];
  const double same_place = std::cos(RadFromDeg(kSamePlace_deg));
  ParallelFor(num_threads, 0, size.height, [&](int y) {
    std::vector<double> depths;
    std::vector<Eigen::Vector3d> counted;  // directions from the place to the photos that found it
    for (int x = 0; x < size.width; ++x) {
      const float depth = estimate.depth(y, x);
      if (!(depth > 0)) continue;
      const Eigen::Vector2d at(x + 0.5, y + 0.5);
      const Eigen::Vector3d ray = *projection.RayFromImg(at);
      const Eigen::Vector3d place = scan_from_cam * (ray * depth);
      depths.assign(1, depth);
      counted.assign(1, (scan_from_cam.translation - place).normalized());
      double baselines2 = 0;
      bool is_seen_through = false;
      for (size_t k = 0; k < others.size(); ++k) {
        const Eigen::Vector3d in_other = others[k].view->cam_from_scan * place;
        const auto there = other_projections[k].ImgFromCam(in_other);
        if (!there || !other_projections[k].InImage(*there)) continue;
        if (SeesThrough(others[k].depth, *there, in_other.z())) {
          is_seen_through = true;
          break;
        }
        const int column = std::min(static_cast<int>(there->x()), others[k].depth.cols - 1);
        const int row = std::min(static_cast<int>(there->y()), others[k].depth.rows - 1);
        const double seen = others[k].depth(row, column);
        if (!(seen > 0) ||
            std::abs(seen - in_other.z()) > options.max_depth_difference * in_other.z()) {
          continue;
        }
        const Eigen::Vector3d its_place =
            scan_from_others[k] *
            (*other_projections[k].RayFromImg({column + 0.5, row + 0.5}) * seen);
        const Eigen::Vector3d back = view.cam_from_scan * its_place;
        const auto here = projection.ImgFromCam(back);
        if (!here || (*here - at).norm() > kMaxReprojection_px) continue;
        // A photo from where another one was taken, a copy or one of a burst, is no second witness.
        const Eigen::Vector3d towards = (scan_from_others[k].translation - place).normalized();
        if (std::any_of(counted.begin(), counted.end(), [&](const Eigen::Vector3d& direction) {
              return direction.dot(towards) > same_place;
            })) {
          continue;
        }
        counted.push_back(towards);
        // What is nearer or farther there is so here, to first order: the views look alike.
        depths.push_back(depth + (seen - in_other.z()));
        const Eigen::Vector3d baseline =
            scan_from_others[k].translation - scan_from_cam.translation;
        const Eigen::Vector3d direction = (place - scan_from_cam.translation).normalized();
        baselines2 += (baseline - direction.dot(baseline) * direction).squaredNorm();
      }
      const int support = static_cast<int>(depths.size());
      const bool is_pair = support == 2 && options.min_pair_correlation < 1 &&
                           estimate.score(y, x) >= options.min_pair_correlation;
      if (is_seen_through || (support < options.min_support && !is_pair)) continue;
      const double fused = MidpointMedian(depths);
      const Eigen::Vector3d fused_place = scan_from_cam * (ray * fused);
      result.depth(y, x) = static_cast<float>(fused);
      result.support(y, x) = static_cast<uint8_t>(std::min(support, 255));
      result.uncertainty(y, x) = static_cast<float>(fused * fused / focal * kMatch_px /
                                                    std::sqrt(std::max(baselines2, 1e-6)));
      if (!space.IsInRoom(fused_place, kOutsideBox) ||
          space.IsSeenEmpty(fused_place, options.distance_to_scan) ||
          space.surface().DistanceTo(fused_place, options.distance_to_scan)) {
        continue;
      }
      result.is_new(y, x) = 255;
    }
  });
  TrimEdges(estimate, scan_only, view.camera, num_threads, &result.is_new);
  RemoveSpeckles(&result.is_new, result.depth);
  // A depth of one's own that is neither new nor the scan's is an error.
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (result.support(y, x) == 0 || result.is_new(y, x) != 0) continue;
      const Eigen::Vector3d place =
          scan_from_cam * (*projection.RayFromImg({x + 0.5, y + 0.5}) * result.depth(y, x));
      if (space.surface().DistanceTo(place, options.distance_to_scan)) continue;
      result.depth(y, x) = 0;
      result.support(y, x) = 0;
    }
  }
  return result;
}

// Cells that earlier photos have filled. A photo whose vertices lie further apart fills larger
// ones: each level's are twice as large as those of the one before.
struct SupplementBuilder::Taken {
  static constexpr int kNumLevels = 10;
  std::array<std::unordered_map<uint64_t, int>, kNumLevels> photo_of_cell;
  int num_photos = 0;

  static double CellSize(const SupplementOptions& options, int level) {
    return 2 * options.spacing * (1 << level);
  }
  // Of a photo with a vertex every `pitch` metres.
  static int LevelOf(const SupplementOptions& options, double pitch) {
    constexpr double kVertexDistances = 1.3;  // so that no cell of a sheet stays empty
    int level = 0;
    while (level + 1 < kNumLevels && CellSize(options, level) < kVertexDistances * pitch) ++level;
    return level;
  }

  // False where another photo has filled the place, whatever the size of its cells.
  bool Take(const Eigen::Vector3d& x_in_scan, int photo, int level,
            const SupplementOptions& options) {
    for (int other = 0; other < kNumLevels; ++other) {
      const auto& cells = photo_of_cell[other];
      const auto found = cells.find(CellKey(x_in_scan, CellSize(options, other)));
      if (found != cells.end() && found->second != photo) return false;
    }
    photo_of_cell[level].emplace(CellKey(x_in_scan, CellSize(options, level)), photo);
    return true;
  }
};

SupplementBuilder::SupplementBuilder(const SupplementOptions& options)
    : options_(options), taken_(std::make_unique<Taken>()) {}
SupplementBuilder::~SupplementBuilder() = default;

void SupplementBuilder::Add(const StereoView& view, const ConfirmedDepth& confirmed,
                            const cv::Mat1f& score, const cv::Mat& picture) {
  const int photo = taken_->num_photos++;
  std::vector<float> depths;
  for (int y = 0; y < confirmed.depth.rows; ++y) {
    for (int x = 0; x < confirmed.depth.cols; ++x) {
      if (confirmed.is_new(y, x) != 0) depths.push_back(confirmed.depth(y, x));
    }
  }
  if (depths.empty()) return;
  const double pixel = Median(&depths) / view.camera.params[0];
  const int step = std::max(1, static_cast<int>(std::lround(options_.spacing / pixel)));
  const int level = Taken::LevelOf(options_, step * pixel);
  const CameraProjection projection(view.camera);
  const Rigid scan_from_cam = view.cam_from_scan.Inverse();
  const int columns = confirmed.depth.cols / step, rows = confirmed.depth.rows / step;
  std::vector<int> vertex_of(static_cast<size_t>(columns) * rows, -1);
  std::vector<SupplementVertex> vertices;
  std::vector<float> vertex_depths;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int x = column * step + step / 2, y = row * step + step / 2;
      if (confirmed.is_new(y, x) == 0) continue;
      const float depth = confirmed.depth(y, x);
      SupplementVertex vertex;
      vertex.x_in_scan = scan_from_cam * (*projection.RayFromImg({x + 0.5, y + 0.5}) * depth);
      if (!taken_->Take(vertex.x_in_scan, photo, level, options_)) continue;
      const Eigen::Vector3d normal(confirmed.normals[0](y, x), confirmed.normals[1](y, x),
                                   confirmed.normals[2](y, x));
      vertex.normal = (scan_from_cam.rotation * normal).cast<float>();
      const auto& bgr = picture.at<cv::Vec3b>(y, x);
      vertex.rgb = {bgr[2], bgr[1], bgr[0]};
      vertex.support = confirmed.support(y, x);
      vertex.confidence = score(y, x);
      vertex.uncertainty = confirmed.uncertainty(y, x);
      vertex_of[static_cast<size_t>(row) * columns + column] = static_cast<int>(vertices.size());
      vertices.push_back(vertex);
      vertex_depths.push_back(depth);
    }
  }
  std::vector<Triangle> triangles;
  const auto add = [&](int a, int b, int c) {
    if (a < 0 || b < 0 || c < 0) return;
    const auto [low, high] = std::minmax({vertex_depths[a], vertex_depths[b], vertex_depths[c]});
    if (high - low < kSameSurface * low) triangles.push_back({a, b, c});
  };
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const int* above = &vertex_of[static_cast<size_t>(row) * columns + column];
      const int* below = above + columns;
      // Counter-clockwise as the photo sees it, y down.
      if (above[1] >= 0 && below[0] >= 0) {
        add(above[0], below[0], above[1]);
        add(above[1], below[0], below[1]);
      } else {
        add(above[0], below[0], below[1]);
        add(above[0], below[1], above[1]);
      }
    }
  }
  // Vertices without a triangle are strays.
  std::vector<int> number(vertices.size(), -1);
  for (const Triangle& triangle : triangles) {
    for (const int corner : triangle) number[corner] = 0;
  }
  for (size_t i = 0; i < vertices.size(); ++i) {
    if (number[i] < 0) continue;
    number[i] = static_cast<int>(supplement_.vertices.size());
    supplement_.vertices.push_back(vertices[i]);
  }
  for (const auto& [a, b, c] : triangles) {
    supplement_.triangles.push_back({number[a], number[b], number[c]});
  }
}

void WriteSupplement(const Supplement& supplement, const Scan& scan, const std::string& path) {
  double largest = 0;
  for (const SupplementVertex& vertex : supplement.vertices) {
    largest = std::max(largest, vertex.x_in_scan.cwiseAbs().maxCoeff());
  }
  const bool as_double = largest > kLargeCoordinate;
  const char* const type = as_double ? "double" : "float";
  OutputFile file(path);
  std::ostream& stream = file.stream();
  stream
      << "ply\nformat binary_little_endian 1.0\ncomment roomtex-dense: surface from photos, scan "
         "frame, metres; support = photos, confidence = correlation 0..1, uncertainty = standard "
         "deviation of the matching (without the photos' poses), metres\n"
      << PlyUpComment(scan) << "element vertex " << supplement.vertices.size() << "\n";
  for (const char* name : {"x", "y", "z"}) stream << "property " << type << " " << name << "\n";
  for (const char* name : {"nx", "ny", "nz"}) stream << "property float " << name << "\n";
  for (const char* name : {"red", "green", "blue", "support"}) {
    stream << "property uchar " << name << "\n";
  }
  stream << "property float confidence\nproperty float uncertainty\nelement face "
         << supplement.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&stream](const void* value, size_t size) {
    stream.write(static_cast<const char*>(value), static_cast<std::streamsize>(size));
  };
  for (const SupplementVertex& vertex : supplement.vertices) {
    const Eigen::Vector3f place = vertex.x_in_scan.cast<float>();
    as_double ? put(vertex.x_in_scan.data(), 24) : put(place.data(), 12);
    put(vertex.normal.data(), 12);
    put(vertex.rgb.data(), 3);
    const auto support = static_cast<uint8_t>(std::min(vertex.support, 255));
    put(&support, 1);
    put(&vertex.confidence, 4);
    put(&vertex.uncertainty, 4);
  }
  for (const Triangle& triangle : supplement.triangles) {
    const uint8_t count = 3;
    put(&count, 1);
    for (const int corner : triangle) {
      const auto index = static_cast<int32_t>(corner);
      put(&index, 4);
    }
  }
  file.Commit();
}

}  // namespace roomtex
