#include "colmap_ext/expected_sightings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "core/camera_model.h"
#include "core/frames.h"
#include "core/projections.h"

namespace roomtex {
namespace {

// Points that a photo is asked for: enough to tell a share of a tenth from one of a third.
constexpr size_t kPointsPerPhoto = 400;
// Of the model, and for each photo: pairs of photos have a share of their own.
constexpr size_t kMinPointsAsked = 40000, kPointsAskedPerPhoto = 200;
// Another photo has seen a point as this one would: from a direction no farther off, and from a
// distance that differs by no more than this factor.
constexpr double kLikeAngleDeg = 25, kLikeDistance = 1.5;
// Cells of the picture, and points of one that is looked at.
constexpr int kCellColumns = 8, kCellRows = 6, kMinPointsOfPart = 5;

// The picture divided into square cells, so many along its longer side.
template <int kCells>
class CellGrid {
 public:
  explicit CellGrid(const Camera& camera)
      : cell_px_(std::max(camera.width, camera.height) / static_cast<double>(kCells)) {}

  // Keypoints of a file may lie anywhere.
  bool Holds(const Eigen::Vector2d& x) const {
    return x.minCoeff() >= 0 && x.maxCoeff() < kCells * cell_px_;
  }
  size_t CellOf(const Eigen::Vector2d& x) const {
    return static_cast<size_t>(Index(x.y())) * kCells + static_cast<size_t>(Index(x.x()));
  }
  // The nine cells about a position.
  template <typename Visit>
  void VisitNear(const Eigen::Vector2d& x, const Visit& visit) const {
    const int column = Index(x.x()), row = Index(x.y());
    for (int r = std::max(0, row - 1); r <= std::min(kCells - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(kCells - 1, column + 1); ++c) {
        visit(static_cast<size_t>(r) * kCells + static_cast<size_t>(c));
      }
    }
  }
  static constexpr size_t kNumCells = static_cast<size_t>(kCells) * kCells;

 private:
  int Index(double x) const {
    return static_cast<int>(std::clamp(x / cell_px_, 0.0, kCells - 1.0));
  }

  double cell_px_;
};

// How many keypoints a photo has round a position: blurred and dark parts have few, and cannot show
// what others found there.
class KeypointDensity {
 public:
  KeypointDensity(const SparseImage& image, const Camera& camera)
      : grid_(camera), counts_(grid_.kNumCells, 0) {
    for (const Eigen::Vector2d& x : image.points2d) {
      if (grid_.Holds(x)) ++counts_[grid_.CellOf(x)];
    }
  }

  int Near(const Eigen::Vector2d& x) const {
    int sum = 0;
    grid_.VisitNear(x, [&](size_t cell) { sum += counts_[cell]; });
    return sum;
  }

 private:
  CellGrid<40> grid_;
  std::vector<int> counts_;
};

// How far the points of a photo lie, by where it has them.
class OwnDepths {
 public:
  OwnDepths(const SparseModel& model, const SparseImage& image)
      : grid_(model.cameras.at(image.camera_id)), depths_(grid_.kNumCells) {
    for (size_t i = 0; i < image.points2d.size(); ++i) {
      if (image.point3d_ids[i] == kInvalidPoint3dId || !grid_.Holds(image.points2d[i])) continue;
      const Eigen::Vector3d& x = model.points.at(image.point3d_ids[i]).x_in_model;
      depths_[grid_.CellOf(image.points2d[i])].push_back((image.cam_from_model * x).norm());
    }
  }

  bool Hide(const Eigen::Vector2d& x_in_img, double depth) const {
    constexpr int kLeast = 3;
    constexpr double kNearer = 0.8, kAlike = 0.1;
    int num_nearer = 0, num_alike = 0;
    grid_.VisitNear(x_in_img, [&](size_t cell) {
      for (const double own : depths_[cell]) {
        num_nearer += own < kNearer * depth;
        num_alike += std::abs(own - depth) < kAlike * depth;
      }
    });
    return num_nearer >= kLeast && num_alike == 0;
  }

 private:
  CellGrid<16> grid_;                        // a photo has some hundred points
  std::vector<std::vector<double>> depths_;  // by cell, from the camera's centre
};

class SightingSearch {
 public:
  SightingSearch(const SparseModel& model, const HidesPoint& hides,
                 const std::set<uint32_t>& not_believed)
      : model_(model), hides_(hides), not_believed_(not_believed) {
    projections_ = ProjectionsOf(model.cameras);
    for (const auto& [id, image] : model.images) {
      centres_[id] = image.cam_from_model.TargetOriginInSource();
      densities_.emplace(id, KeypointDensity(image, model.cameras.at(image.camera_id)));
    }
    const size_t asked = std::max(kMinPointsAsked, kPointsAskedPerPhoto * model.images.size());
    stride_ = model.points.size() / asked + 1;
    size_t next = 0;
    for (const auto& [id, point] : model.points) {
      if (next++ % stride_ == 0) points_.push_back(&point);
    }
  }

  std::vector<ExpectedSighting> Of(const SparseImage& image) const {
    const CameraProjection& projection = projections_.at(image.camera_id);
    struct Candidate {
      const SparsePoint* point;
      ExpectedSighting sighting;
    };
    std::vector<Candidate> candidates;
    for (const SparsePoint* const point : points_) {
      const auto x_in_img = projection.ImgFromCam(image.cam_from_model * point->x_in_model);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      if (!IsOthersPoint(*point, image.image_id)) continue;
      std::vector<uint32_t> witnesses = Witnesses(*point, image.image_id, *x_in_img);
      if (!witnesses.empty()) candidates.push_back({point, {*x_in_img, false, witnesses, 1}});
    }
    std::vector<ExpectedSighting> in_sight;
    const size_t stride = candidates.size() / kPointsPerPhoto + 1;
    for (size_t i = 0; i < candidates.size(); i += stride) {
      Candidate& candidate = candidates[i];
      if (hides_(image, candidate.sighting.x_in_img, candidate.point->x_in_model)) continue;
      const std::vector<TrackElement>& track = candidate.point->track;
      candidate.sighting.is_found = std::any_of(
          track.begin(), track.end(),
          [&](const TrackElement& element) { return element.image_id == image.image_id; });
      candidate.sighting.num_like = static_cast<double>(stride * stride_);
      in_sight.push_back(std::move(candidate.sighting));
    }
    return in_sight;
  }

 private:
  bool IsBelieved(uint32_t image_id) const { return not_believed_.count(image_id) == 0; }

  // Whether two others than this photo see the point.
  bool IsOthersPoint(const SparsePoint& point, uint32_t image_id) const {
    uint32_t first = image_id;
    for (const TrackElement& element : point.track) {
      if (element.image_id == image_id || element.image_id == first) continue;
      if (!IsBelieved(element.image_id)) continue;
      if (first != image_id) return true;
      first = element.image_id;
    }
    return false;
  }

  // Others that see a point as this photo, which has it at x_in_img, would, with no more than twice
  // the keypoints round it.
  std::vector<uint32_t> Witnesses(const SparsePoint& point, uint32_t image_id,
                                  const Eigen::Vector2d& x_in_img) const {
    const Eigen::Vector3d own = centres_.at(image_id) - point.x_in_model;
    const double range = own.norm(), like_cosine = std::cos(RadFromDeg(kLikeAngleDeg));
    const int num_near = densities_.at(image_id).Near(x_in_img);
    std::vector<uint32_t> witnesses;
    for (const TrackElement& element : point.track) {
      if (element.image_id == image_id || !IsBelieved(element.image_id)) continue;
      const Eigen::Vector3d other = centres_.at(element.image_id) - point.x_in_model;
      const double distance = other.norm();
      if (!(own.dot(other) > like_cosine * range * distance) ||
          !(range < kLikeDistance * distance) || !(distance < kLikeDistance * range)) {
        continue;
      }
      const SparseImage& image = model_.images.at(element.image_id);
      if (2 * num_near >=
          densities_.at(element.image_id).Near(image.points2d[element.point2d_index])) {
        witnesses.push_back(element.image_id);
      }
    }
    return witnesses;
  }

  const SparseModel& model_;
  const HidesPoint& hides_;
  const std::set<uint32_t>& not_believed_;
  std::map<uint32_t, CameraProjection> projections_;  // by camera_id
  std::map<uint32_t, Eigen::Vector3d> centres_;
  std::map<uint32_t, KeypointDensity> densities_;
  std::vector<const SparsePoint*> points_;  // every so many of the model's
  size_t stride_ = 1;
};

}  // namespace

HidesPoint HiddenByOwnPoints(const SparseModel& model) {
  const auto depths = std::make_shared<std::map<uint32_t, OwnDepths>>();
  for (const auto& [id, image] : model.images) depths->emplace(id, OwnDepths(model, image));
  return [depths](const SparseImage& image, const Eigen::Vector2d& x_in_img,
                  const Eigen::Vector3d& x_in_model) {
    return depths->at(image.image_id).Hide(x_in_img, (image.cam_from_model * x_in_model).norm());
  };
}

ExpectedSightings FindExpectedSightings(const SparseModel& model, const HidesPoint& hides,
                                        const std::set<uint32_t>& not_believed) {
  std::set<uint32_t> all;
  for (const auto& [id, image] : model.images) all.insert(id);
  return FindExpectedSightings(model, hides, not_believed, all);
}

ExpectedSightings FindExpectedSightings(const SparseModel& model, const HidesPoint& hides,
                                        const std::set<uint32_t>& not_believed,
                                        const std::set<uint32_t>& asked) {
  const SightingSearch search(model, hides, not_believed);
  ExpectedSightings expected;
  for (const uint32_t id : asked) expected[id] = search.Of(model.images.at(id));
  return expected;
}

SightSummary SummarizeSightings(const std::vector<ExpectedSighting>& expected,
                                const Camera& camera) {
  SightSummary summary;
  summary.num_expected = static_cast<int>(expected.size());
  summary.share = summary.unevenness = std::numeric_limits<double>::quiet_NaN();
  if (expected.empty()) return summary;
  struct Part {
    int num_expected = 0, num_found = 0;
  };
  std::vector<Part> parts(static_cast<size_t>(kCellColumns) * kCellRows);
  const auto cell = [](double x, int size, int count) {
    return std::clamp(static_cast<int>(x * count / size), 0, count - 1);
  };
  int num_found = 0;
  for (const ExpectedSighting& one : expected) {
    num_found += one.is_found;
    Part& part =
        parts[static_cast<size_t>(cell(one.x_in_img.y(), camera.height, kCellRows)) * kCellColumns +
              cell(one.x_in_img.x(), camera.width, kCellColumns)];
    ++part.num_expected;
    part.num_found += one.is_found;
  }
  const double share = static_cast<double>(num_found) / summary.num_expected;
  summary.share = share;
  if (!(share > 0 && share < 1)) return summary;
  double chi_square = 0;
  int num_parts = 0;
  for (const Part& part : parts) {
    if (part.num_expected < kMinPointsOfPart) continue;
    ++num_parts;
    chi_square += std::pow(part.num_found - share * part.num_expected, 2) /
                  (share * (1 - share) * part.num_expected);
  }
  if (num_parts > 1) summary.unevenness = chi_square / (num_parts - 1);
  return summary;
}

CommonOfPairs CountCommonSightings(const ExpectedSightings& expected) {
  CommonOfPairs pairs;
  for (const auto& [id, sightings] : expected) {
    for (const ExpectedSighting& one : sightings) {
      for (const uint32_t witness : one.witnesses) {
        CommonSightings& common = pairs[std::minmax(id, witness)];
        ++common.num_expected;
        common.num_found += one.is_found;
      }
    }
  }
  return pairs;
}

}  // namespace roomtex
