#include "texture/sampling/visibility.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <opencv2/imgproc.hpp>

#include "core/cpu_stages.h"
#include "core/option_fields.h"
#include "texture/sampling/rasterizer.h"

namespace roomtex {
namespace {

// A triangle with a corner that has no image is split until the parts have one or are too small to
// matter.
constexpr int kMaxSplits = 16;
// All splits of one photo together: one per pixel of its raster and some per triangle. Ordinary
// rooms need a hundredth; without it a mesh of needles through the camera would take 2^16 each.
constexpr int64_t kSplitsPerTriangle = 8;
constexpr double kMinSize = 0.02;  // radians
// Half the widest gap that counts as a crack in the scan and not as a hole, sample spacings.
constexpr double kGapSpacings = 1.5;
// Shadows need not be exact to the pixel.
constexpr float kShadowEdgePx = 1e6f;
// Of a panorama: what is larger may meet the seam, or have bent edges; and what is as near to a
// pole as this share of the height.
constexpr float kMaxDirectPx = 4, kPoleShare = 0.06f;
// No lens sees nearer; keeps a surface that touches the camera from hiding everything.
constexpr double kNearDepth = 0.01;
// Automatic depth tolerance, shares of the depth.
constexpr float kNearlyExact = 0.001f, kUnknownNoise = 0.004f;
// Automatic width of the band beside depth boundaries, pixels of the photo.
constexpr double kBoundaryPx = 2;

cv::Mat Square(int radius) {
  return cv::getStructuringElement(cv::MORPH_RECT, {2 * radius + 1, 2 * radius + 1});
}

class TriangleSplitter {
 public:
  TriangleSplitter(const PhotoProjector& projector, float scale_x, float scale_y, float max_edge_px,
                   int64_t* splits_left, cv::Mat1f* out)
      : splits_left_(splits_left),
        projector_(projector),
        scale_x_(scale_x),
        scale_y_(scale_y),
        max_edge_px_(max_edge_px),
        out_(out) {}

  void Draw(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const {
    const auto in_cam = [this](const Eigen::Vector3d& x_in_scan) {
      return Eigen::Vector3d(projector_.cam_from_scan() * x_in_scan);
    };
    Split(in_cam(a), in_cam(b), in_cam(c), 0);
  }

 private:
  // Corners in `cam`.
  void Split(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
             int depth) const {
    const Eigen::Vector3d corners[3] = {a, b, c};
    RasterVertex drawn[3];
    int num_valid = 0, num_behind = 0;
    for (int k = 0; k < 3; ++k) {
      const double distance = projector_.camera().Depth(corners[k]);
      num_behind += distance < kNearDepth;
      if (distance < kNearDepth) continue;
      const auto position = projector_.camera().ImgFromCam(corners[k]);
      if (!position) continue;
      ++num_valid;
      drawn[k] = {static_cast<float>(position->x()) * scale_x_,
                  static_cast<float>(position->y()) * scale_y_, static_cast<float>(1 / distance)};
    }
    if (num_behind == 3) return;
    const Eigen::Vector3d centre = (a + b + c) / 3;
    const double size =
        2 * std::sqrt(std::max({(a - centre).squaredNorm(), (b - centre).squaredNorm(),
                                (c - centre).squaredNorm()}));
    if (num_valid == 3) {
      const float low_x = std::min({drawn[0].x, drawn[1].x, drawn[2].x});
      const float high_x = std::max({drawn[0].x, drawn[1].x, drawn[2].x});
      const float low_y = std::min({drawn[0].y, drawn[1].y, drawn[2].y});
      const float high_y = std::max({drawn[0].y, drawn[1].y, drawn[2].y});
      // Far outside nothing is drawn, however the sides are bent.
      const float margin = std::max(high_x - low_x, high_y - low_y);
      if (high_x + margin < 0 || high_y + margin < 0 || low_x - margin > out_->cols ||
          low_y - margin > out_->rows) {
        return;
      }
      if (margin <= max_edge_px_ || depth >= kMaxSplits || *splits_left_ <= 0) {
        DrawTriangle(drawn[0], drawn[1], drawn[2], out_);
        return;
      }
    } else if (depth >= kMaxSplits || *splits_left_ <= 0 || size < kMinSize * centre.norm() ||
               !projector_.MaySeeInCam(centre, size)) {
      return;
    }
    --*splits_left_;
    SplitLongestEdge(a, b, c, depth);
  }

  void SplitLongestEdge(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                        const Eigen::Vector3d& c, int depth) const {
    const double ab = (a - b).squaredNorm(), bc = (b - c).squaredNorm(), ca = (c - a).squaredNorm();
    if (ab >= bc && ab >= ca) {
      const Eigen::Vector3d middle = 0.5 * (a + b);
      Split(a, middle, c, depth + 1);
      Split(middle, b, c, depth + 1);
    } else if (bc >= ca) {
      SplitLongestEdge(b, c, a, depth);
    } else {
      SplitLongestEdge(c, a, b, depth);
    }
  }

  int64_t* splits_left_;
  const PhotoProjector& projector_;
  float scale_x_, scale_y_, max_edge_px_;
  cv::Mat1f* out_;
};

// The same for a panorama. Its raster is closed at the left and right, and straight lines are bent,
// the more the nearer to a pole. Whether an edge is split depends on it alone, so that triangles
// that share it leave no crack. What holds a pole is drawn from its sides to the border.
class PanoramaSplitter {
 public:
  PanoramaSplitter(const PhotoProjector& projector, float scale_x, float scale_y, float max_edge_px,
                   int64_t* splits_left, cv::Mat1f* out)
      : splits_left_(splits_left),
        projector_(projector),
        scale_x_(scale_x),
        scale_y_(scale_y),
        out_(out) {
    px_per_radian_ = projector.camera().camera().MeanFocalLength() * scale_x;
    max_edge_px_ = std::min<double>(max_edge_px, kMaxEdge * px_per_radian_);
    max_bend_px_ = max_edge_px < kShadowEdgePx ? kMaxBendPx : kMaxShadowBendPx;
  }

  void Draw(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const {
    const auto corner = [this](const Eigen::Vector3d& x_in_scan) {
      return MakeCorner(projector_.cam_from_scan() * x_in_scan);
    };
    Split(corner(a), corner(b), corner(c), 0);
  }

 private:
  static constexpr double kMaxEdge = 0.2;     // radians
  static constexpr double kMinEdgePx = 1.5;   // next to the poles
  static constexpr double kMaxBendPx = 0.05;  // of an edge, off its straight line
  static constexpr double kMaxShadowBendPx = 1;
  static constexpr int kMaxPanoramaSplits = 40;

  struct Corner {
    Eigen::Vector3d x_in_cam, ray;
    double distance;
  };
  static Corner MakeCorner(const Eigen::Vector3d& x_in_cam) {
    const double distance = x_in_cam.norm();
    return {x_in_cam, x_in_cam / std::max(distance, kNearDepth), distance};
  }

  // Pixels by which an edge is too long; 0 = it is not. An edge of length l is bent by
  // l^2 tan(latitude) / 8.
  double Excess(const Corner& a, const Corner& b) const {
    const double length = (a.ray - b.ray).norm() * px_per_radian_;
    const double sine = std::min(1.0, std::max(std::abs(a.ray.y()), std::abs(b.ray.y())));
    const double bend = sine / std::sqrt(std::max(1e-12, 1 - sine * sine)) / (8 * px_per_radian_);
    const double limit = std::clamp(std::sqrt(max_bend_px_ / std::max(bend, 1e-12)), kMinEdgePx,
                                    std::max(kMinEdgePx, max_edge_px_));
    return std::max(0.0, length - limit);
  }

  void Split(const Corner& a, const Corner& b, const Corner& c, int depth) const {
    if (std::max({a.distance, b.distance, c.distance}) < kNearDepth) return;
    const double ab = Excess(a, b), bc = Excess(b, c), ca = Excess(c, a);
    const double worst = std::max({ab, bc, ca});
    if (!(worst > 0) || depth >= kMaxPanoramaSplits || *splits_left_ <= 0) {
      if (std::min({a.distance, b.distance, c.distance}) >= kNearDepth) DrawSmall(a, b, c);
      return;
    }
    --*splits_left_;
    if (ab == worst) {
      Halve(a, b, c, depth);
    } else if (bc == worst) {
      Halve(b, c, a, depth);
    } else {
      Halve(c, a, b, depth);
    }
  }

  void Halve(const Corner& a, const Corner& b, const Corner& c, int depth) const {
    const Corner middle = MakeCorner(0.5 * (a.x_in_cam + b.x_in_cam));
    Split(a, middle, c, depth + 1);
    Split(middle, b, c, depth + 1);
  }

  void DrawSmall(const Corner& a, const Corner& b, const Corner& c) const {
    const auto width = static_cast<float>(out_->cols);
    RasterVertex corners[3];
    const Corner* const from[3] = {&a, &b, &c};
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d at = *projector_.camera().ImgFromCam(from[k]->x_in_cam);
      corners[k] = {static_cast<float>(at.x()) * scale_x_, static_cast<float>(at.y()) * scale_y_,
                    static_cast<float>(1 / from[k]->distance)};
    }
    const auto step = [width](const RasterVertex& p, const RasterVertex& q) {
      return std::remainder(q.x - p.x, width);
    };
    const float around =
        step(corners[0], corners[1]) + step(corners[1], corners[2]) + step(corners[2], corners[0]);
    if (std::abs(around) < 0.5f * width) {
      corners[1].x = corners[0].x + step(corners[0], corners[1]);
      corners[2].x = corners[0].x + step(corners[0], corners[2]);
      DrawWrapped(corners[0], corners[1], corners[2]);
      return;
    }
    const float pole_y = a.ray.y() > 0 ? static_cast<float>(out_->rows) : 0.0f;
    const float pole_w = (corners[0].w + corners[1].w + corners[2].w) / 3;
    for (int k = 0; k < 3; ++k) {
      const RasterVertex p = corners[k];
      RasterVertex q = corners[(k + 1) % 3];
      q.x = p.x + step(p, q);
      DrawWrapped(p, q, {q.x, pole_y, pole_w});
      DrawWrapped(p, {q.x, pole_y, pole_w}, {p.x, pole_y, pole_w});
    }
  }

  void DrawWrapped(const RasterVertex& a, const RasterVertex& b, const RasterVertex& c) const {
    const auto width = static_cast<float>(out_->cols);
    for (const float shift : {-width, 0.0f, width}) {
      if (std::max({a.x, b.x, c.x}) + shift < 0 || std::min({a.x, b.x, c.x}) + shift > width) {
        continue;
      }
      DrawTriangle({a.x + shift, a.y, a.w}, {b.x + shift, b.y, b.w}, {c.x + shift, c.y, c.w}, out_);
    }
  }

  int64_t* splits_left_;
  const PhotoProjector& projector_;
  float scale_x_, scale_y_;
  double px_per_radian_, max_edge_px_, max_bend_px_;
  cv::Mat1f* out_;
};

// A raster that goes on for `pad` columns beyond both borders: for filters of one that is closed.
template <typename Raster>
Raster Padded(const Raster& raster, int pad) {
  Raster padded;
  cv::copyMakeBorder(raster, padded, 0, 0, pad, pad, cv::BORDER_WRAP);
  return padded;
}
template <typename Raster>
Raster Cropped(const Raster& padded, int pad) {
  return padded.colRange(pad, padded.cols - pad).clone();
}
int PadOf(const cv::Mat& raster, double radius_px) {
  return std::min(raster.cols, static_cast<int>(std::ceil(radius_px)) + 2);
}

// A panorama's map spreads over four times the angle of a photo's.
constexpr int kPanoramaMapSizes = 4;

double MapScale(const PhotoProjector& projector, double angular_spacing,
                const OcclusionOptions& options) {
  const double photo_size = std::max(projector.width(), projector.height());
  const double spacing_px = angular_spacing * projector.camera().camera().MeanFocalLength();
  double size = options.depth_map_size;
  if (projector.camera().camera().IsPanorama()) size *= kPanoramaMapSizes;
  if (spacing_px > 0) size = std::max(size, 3 * photo_size / spacing_px);  // three pixels a sample
  return std::min(1.0, size / photo_size);
}

}  // namespace

void OcclusionOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Occlusion.depth_tolerance", &depth_tolerance,
               "Share of its depth by which a surface in front hides a sample; -1 = by the "
               "range noise of the scan. Larger = more tolerant.")
      .Between(0, 1)
      .Or(-1)
      .Says("must be -1 (automatic) or lie between 0 and 1 (a share of the depth)");
  fields
      ->Number("Occlusion.boundary_px", &boundary_px,
               "Width of the untrusted band beside depth boundaries, photo pixels; -1 = 2. "
               "Poses that are off by more need more.")
      .NotNegative()
      .Or(-1)
      .Says("must be -1 (automatic) or not negative");
  fields->Require(boundary_px <= 500, "--Occlusion.boundary_px must be at most 500");
  fields
      ->Number("Occlusion.boundary_jump", &boundary_jump,
               "Share of the depth that makes a jump a depth boundary. Larger = fewer.")
      .Positive();
  fields->Bool("Occlusion.shadows", &shadows,
               "Distrust lines of sight through space that the scanner could not see.");
  fields
      ->Int("Occlusion.depth_map_size", &depth_map_size,
            "Least length of a depth map's longer side, pixels.")
      .Within(64, 65536, "pixels");
}

std::vector<std::string> OcclusionOptions::Problems() const { return ProblemsOf(*this); }

DepthMap::DepthMap(int photo_width, int photo_height, double scale, bool wraps) : wraps_(wraps) {
  const int width = std::max(1, static_cast<int>(std::lround(photo_width * scale)));
  const int height = std::max(1, static_cast<int>(std::lround(photo_height * scale)));
  inverse_depth_ = cv::Mat1f(height, width, 0.0f);
  scale_x_ = static_cast<float>(width) / static_cast<float>(photo_width);
  scale_y_ = static_cast<float>(height) / static_cast<float>(photo_height);
}

int64_t DepthMap::Draw(const PhotoProjector& projector, const std::vector<MeshTile>& tiles,
                       float max_edge_px) {
  const CpuTimer timer(CpuStage::kDepthMap);
  const auto width = static_cast<float>(inverse_depth_.cols);
  const auto height = static_cast<float>(inverse_depth_.rows);
  const bool panorama = projector.camera().camera().IsPanorama();
  int64_t splits_left = static_cast<int64_t>(inverse_depth_.total());
  for (const MeshTile& tile : tiles) {
    splits_left += kSplitsPerTriangle * static_cast<int64_t>(tile.triangles.size());
  }
  const int64_t splits_at_most = splits_left;
  const TriangleSplitter splitter(projector, scale_x_, scale_y_, max_edge_px, &splits_left,
                                  &inverse_depth_);
  const PanoramaSplitter panorama_splitter(projector, scale_x_, scale_y_, max_edge_px, &splits_left,
                                           &inverse_depth_);
  // A triangle of a panorama that is small in the raster does not meet the seam; nor, away from
  // there, a pole.
  const float max_direct_px = panorama ? std::min(max_edge_px, kMaxDirectPx) : max_edge_px;
  const float pole_rows = panorama ? kPoleShare * height : -1;
  ProjectedBlock projected;
  std::vector<RasterVertex> vertices;
  for (const MeshTile& tile : tiles) {
    const PointBlock& points = tile.points;
    if (!projector.MaySee(points.origin, points.radius)) continue;
    projector.Project(points, &projected);
    vertices.resize(points.size());
    for (int i = 0; i < points.size(); ++i) {
      const float depth = projected.depth[i];
      vertices[i] = {projected.x[i] * scale_x_, projected.y[i] * scale_y_,
                     depth > static_cast<float>(kNearDepth) ? 1 / depth : 0.0f};
    }
    for (const auto& [ia, ib, ic] : tile.triangles) {
      const RasterVertex &a = vertices[ia], &b = vertices[ib], &c = vertices[ic];
      if (a.w > 0 && b.w > 0 && c.w > 0) {
        const float low_x = std::min({a.x, b.x, c.x}), high_x = std::max({a.x, b.x, c.x});
        const float low_y = std::min({a.y, b.y, c.y}), high_y = std::max({a.y, b.y, c.y});
        const float size = std::max(high_x - low_x, high_y - low_y);
        if (size <= max_direct_px &&
            (!panorama || (low_y > pole_rows && high_y < height - pole_rows))) {
          if (high_x < 0 || high_y < 0 || low_x > width || low_y > height) continue;
          DrawTriangle(a, b, c, &inverse_depth_);
          continue;
        }
      }
      const auto corner = [&points](int i) {
        return Eigen::Vector3d(points.origin +
                               Eigen::Vector3d(points.x[i], points.y[i], points.z[i]));
      };
      if (panorama) {
        panorama_splitter.Draw(corner(ia), corner(ib), corner(ic));
      } else {
        splitter.Draw(corner(ia), corner(ib), corner(ic));
      }
    }
  }
  return splits_at_most - splits_left;
}

void DepthMap::CloseGaps(int radius_px) {
  if (radius_px <= 0) return;
  const CpuTimer timer(CpuStage::kBoundaries);
  if (wraps_) {
    const int pad = PadOf(inverse_depth_, 2 * radius_px);
    wraps_ = false;
    inverse_depth_ = Padded(inverse_depth_, pad);
    CloseGaps(radius_px);
    inverse_depth_ = Cropped(inverse_depth_, pad);
    wraps_ = true;
    return;
  }
  const cv::Mat square = Square(radius_px);
  const cv::Mat1b holes = inverse_depth_ == 0;
  if (cv::countNonZero(holes) == 0) return;
  cv::Mat1b remaining;
  cv::morphologyEx(holes, remaining, cv::MORPH_OPEN, square);
  cv::Mat1f nearest;
  cv::dilate(inverse_depth_, nearest, square);
  nearest.copyTo(inverse_depth_, holes & ~remaining);
}

cv::Mat1b DepthBoundaries(const cv::Mat1f& inverse_depth, double jump, int hole_px) {
  const CpuTimer timer(CpuStage::kBoundaries);
  // 255 where there is a surface, or a hole too small to matter.
  cv::Mat1b covered = inverse_depth > 0;
  if (hole_px > 0) cv::morphologyEx(covered, covered, cv::MORPH_CLOSE, Square(hole_px));
  const auto threshold = static_cast<float>(jump);
  const auto is_jump = [&](float before, float here, float after) {
    return std::abs(before - 2 * here + after) > threshold * std::max({before, here, after});
  };
  cv::Mat1b edges(inverse_depth.size(), uint8_t{0});
  for (int row = 0; row < edges.rows; ++row) {
    const int up = std::max(row - 1, 0), down = std::min(row + 1, edges.rows - 1);
    const float *above = inverse_depth[up], *w = inverse_depth[row], *below = inverse_depth[down];
    for (int column = 0; column < edges.cols; ++column) {
      const int left = std::max(column - 1, 0), right = std::min(column + 1, edges.cols - 1);
      const bool whole =
          w[column] > 0 && w[left] > 0 && w[right] > 0 && above[column] > 0 && below[column] > 0;
      bool edge;
      if (whole) {
        edge = (left < column && column < right && is_jump(w[left], w[column], w[right])) ||
               (up < row && row < down && is_jump(above[column], w[column], below[column]));
      } else {
        // Behind the border of a large hole lies anything.
        edge =
            covered(row, column) != 0 && (covered(row, left) == 0 || covered(row, right) == 0 ||
                                          covered(up, column) == 0 || covered(down, column) == 0);
      }
      if (edge) edges(row, column) = 255;
    }
  }
  return edges;
}

cv::Mat1b BoundaryMask(const cv::Mat1b& boundaries, double radius_px) {
  const CpuTimer timer(CpuStage::kBoundaries);
  if (cv::countNonZero(boundaries) == 0) return cv::Mat1b(boundaries.size(), uint8_t{0});
  cv::Mat1f distance;
  cv::distanceTransform(boundaries == 0, distance, cv::DIST_L2, 3);
  return distance <= radius_px;
}

PhotoVisibility::PhotoVisibility(const PhotoProjector& projector,
                                 const std::vector<OccluderTiles>& occluders,
                                 double angular_spacing, const OcclusionOptions& options)
    : surface_(projector.width(), projector.height(), MapScale(projector, angular_spacing, options),
               projector.camera().camera().IsPanorama()),
      share_(static_cast<float>(options.depth_tolerance)),
      wraps_(projector.camera().camera().IsPanorama()) {
  if (options.depth_tolerance < 0) {
    double noise = 0;
    for (const OccluderTiles& tiles : occluders) noise = std::max(noise, tiles.range_noise);
    share_ = noise > 0 ? kNearlyExact : kUnknownNoise;
    distance_ = static_cast<float>(3 * noise);
  }
  const double spacing_px = angular_spacing * projector.camera().camera().MeanFocalLength();
  const auto map_px = [this](double px) {
    return static_cast<int>(std::ceil(px * surface_.scale_x()));
  };
  for (const OccluderTiles& tiles : occluders) {
    if (tiles.set_back == 0) surface_.Draw(projector, tiles.surface);
  }
  DrawSetBack(projector, occluders, angular_spacing, options);
  surface_.CloseGaps(map_px(kGapSpacings * spacing_px));
  if (options.shadows) {
    DepthMap shadow(projector.width(), projector.height(),
                    MapScale(projector, angular_spacing, options));
    for (const OccluderTiles& tiles : occluders)
      shadow.Draw(projector, tiles.shadows, kShadowEdgePx);
    shadow_ = shadow.inverse_depth();
    DepthMap fringe(projector.width(), projector.height(),
                    MapScale(projector, angular_spacing, options));
    for (const OccluderTiles& tiles : occluders)
      fringe.Draw(projector, tiles.fringes, kShadowEdgePx);
    fringe_ = fringe.inverse_depth();
  }
  const double radius = options.boundary_px >= 0 ? options.boundary_px : kBoundaryPx;
  const double radius_px = radius * surface_.scale_x();
  const int hole_px = map_px(kGapSpacings * spacing_px);
  const int pad = wraps_ ? PadOf(surface_.inverse_depth(), radius_px + 2 * hole_px) : 0;
  const cv::Mat1f map =
      wraps_ ? Padded(surface_.inverse_depth(), pad) : cv::Mat1f(surface_.inverse_depth());
  mask_ = BoundaryMask(DepthBoundaries(map, options.boundary_jump, hole_px), radius_px);
  if (wraps_) mask_ = Cropped(mask_, pad);
}

void PhotoVisibility::DrawSetBack(const PhotoProjector& projector,
                                  const std::vector<OccluderTiles>& occluders,
                                  double angular_spacing, const OcclusionOptions& options) {
  double set_back = 0;
  for (const OccluderTiles& tiles : occluders) set_back = std::max(set_back, tiles.set_back);
  if (set_back == 0) return;
  DepthMap coarse(projector.width(), projector.height(),
                  MapScale(projector, angular_spacing, options), wraps_);
  for (const OccluderTiles& tiles : occluders) {
    if (tiles.set_back > 0) coarse.Draw(projector, tiles.surface);
  }
  // Inverse depths: 1 / (1 / w + d) = w / (1 + w d).
  const cv::Mat1f& w = coarse.inverse_depth();
  const cv::Mat1f behind = w / (1 + w * set_back);
  surface_.inverse_depth() = cv::max(surface_.inverse_depth(), behind);
}

Sight PhotoVisibility::Look(float x, float y, float depth) const {
  const cv::Mat1f& map = surface_.inverse_depth();
  const float map_x = x * surface_.scale_x(), map_y = y * surface_.scale_y();
  const int left = static_cast<int>(std::floor(map_x - 0.5f));
  const int column = wraps_ ? (left + map.cols) % map.cols : std::clamp(left, 0, map.cols - 1);
  const int row = std::clamp(static_cast<int>(std::floor(map_y - 0.5f)), 0, map.rows - 1);
  const int right = wraps_ ? (column + 1) % map.cols : std::min(column + 1, map.cols - 1);
  const int below = std::min(row + 1, map.rows - 1);
  const float farthest =
      std::min({map(row, column), map(row, right), map(below, column), map(below, right)});
  // Thesis (8.4): |z_r / z - 1| < tau, for the surface in front of the sample.
  if (IsBehind(farthest, depth, 1)) return Sight::kHidden;
  const int nearest_column = std::clamp(static_cast<int>(map_x), 0, map.cols - 1);
  const int nearest_row = std::clamp(static_cast<int>(map_y), 0, map.rows - 1);
  if (!shadow_.empty()) {
    // They end at the samples around a depth jump, which are not behind them.
    if (IsBehind(shadow_(nearest_row, nearest_column), depth, 2)) return Sight::kShadow;
    if (IsBehind(fringe_(nearest_row, nearest_column), depth, 2)) return Sight::kFringe;
  }
  if (mask_(nearest_row, nearest_column) != 0) return Sight::kBoundary;
  return Sight::kClear;
}

}  // namespace roomtex
