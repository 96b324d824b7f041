#include "align/trust/photo_verdict.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "align/fit/similarity_fit.h"
#include "colmap_ext/match_support.h"
#include "colmap_ext/view_graph.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Points that a photo is asked for: enough to tell a share of a tenth from one of a third.
constexpr size_t kPointsPerPhoto = 400;
constexpr size_t kMaxPointsAsked = 40000;  // of the model
// Another photo has seen a point as this one would: from a direction no farther off, and from a
// distance that differs by no more than this factor.
constexpr double kLikeAngleDeg = 25, kLikeDistance = 1.5;
// Metres and share of the distance; what lies in front of a point by more hides it.
constexpr double kInFrontBy = 0.05, kInFrontShare = 0.02;
// Cells of the picture, and points of one that is looked at.
constexpr int kCellColumns = 8, kCellRows = 6, kMinPointsOfPart = 5;

// A photo is doubtful that found less than this share of what photos usually find here, unevenly
// over its picture; or hardly anything, where that cannot be told. Photos of another room with the
// same walls (eight, of two rooms): 0.25 to 0.45 of the median with an unevenness of 3.1 to 9.2,
// and 0.14 to 0.19 with 1.2 to 2.3. Right photos, blurred by the hand: 0.21 and 0.24 (desk, 0.7 and
// 1.2), 0.45 (desk, 2.2), 0.31 (kitchen, 1.1); all others of these 0.5 and more.
constexpr double kLeastSightShare = 0.5, kUneven = 2.5, kHardlyAnything = 0.2;
constexpr size_t kMinExpected = 60;
constexpr int kMinExpectedOfPair = 20;  // of two photos
// What a surface share rests on. It says something of the photo, but no doubt follows from it: a
// right photo that looks past what was scanned (desk) has 0.07.
constexpr double kMinJudgedOfPhoto = 10;

// How many keypoints a photo has round a position: blurred and dark parts have few, and cannot show
// what others found there.
class KeypointDensity {
 public:
  KeypointDensity(const SparseImage& image, const Camera& camera)
      : cell_px_(std::max(camera.width, camera.height) / static_cast<double>(kCells)),
        counts_(static_cast<size_t>(kCells) * kCells, 0) {
    for (const Eigen::Vector2d& x : image.points2d) {
      // Keypoints of a file may lie anywhere.
      if (!(x.minCoeff() >= 0) || !(x.maxCoeff() < kCells * cell_px_)) continue;
      ++counts_[static_cast<size_t>(Cell(x.y())) * kCells + Cell(x.x())];
    }
  }

  // In the nine cells about a position.
  int Near(const Eigen::Vector2d& x) const {
    int sum = 0;
    const int column = Cell(x.x()), row = Cell(x.y());
    for (int r = std::max(0, row - 1); r <= std::min(kCells - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(kCells - 1, column + 1); ++c) {
        sum += counts_[static_cast<size_t>(r) * kCells + c];
      }
    }
    return sum;
  }

 private:
  static constexpr int kCells = 40;  // along the longer side
  int Cell(double x) const { return static_cast<int>(std::clamp(x / cell_px_, 0.0, kCells - 1.0)); }

  double cell_px_;
  std::vector<int> counts_;
};

// Where the photos stand and look, and the keypoints that they have.
struct PhotosInScan {
  explicit PhotosInScan(const SparseModel& aligned) : model(aligned) {
    for (const auto& [id, camera] : model.cameras) projections.emplace(id, camera);
    for (const auto& [id, image] : model.images) {
      centres[id] = image.cam_from_model.TargetOriginInSource();
      densities.emplace(id, KeypointDensity(image, model.cameras.at(image.camera_id)));
    }
  }

  bool IsWitness(uint32_t image_id) const { return not_believed.count(image_id) == 0; }

  // Whether another photo than `image_id`, which has the point at x_in_img, sees it as this one
  // would, with no more than twice the keypoints round it.
  bool IsSeenAlike(const SparsePoint& point, uint32_t image_id,
                   const Eigen::Vector2d& x_in_img) const {
    const Eigen::Vector3d own = centres.at(image_id) - point.x_in_model;
    const double range = own.norm(), like_cosine = std::cos(RadFromDeg(kLikeAngleDeg));
    const int num_near = densities.at(image_id).Near(x_in_img);
    return std::any_of(point.track.begin(), point.track.end(), [&](const TrackElement& element) {
      if (element.image_id == image_id || !IsWitness(element.image_id)) return false;
      const Eigen::Vector3d other = centres.at(element.image_id) - point.x_in_model;
      const double distance = other.norm();
      if (!(own.dot(other) > like_cosine * range * distance) ||
          !(range < kLikeDistance * distance) || !(distance < kLikeDistance * range)) {
        return false;
      }
      const SparseImage& image = model.images.at(element.image_id);
      return 2 * num_near >=
             densities.at(element.image_id).Near(image.points2d[element.point2d_index]);
    });
  }

  const SparseModel& model;
  std::map<uint32_t, CameraProjection> projections;  // by camera_id
  std::map<uint32_t, Eigen::Vector3d> centres;
  std::map<uint32_t, KeypointDensity> densities;
  std::set<uint32_t> not_believed;  // what these found, others need not show
};

bool IsInTrack(const SparsePoint& point, uint32_t image_id) {
  return std::any_of(point.track.begin(), point.track.end(),
                     [&](const TrackElement& element) { return element.image_id == image_id; });
}

// Whether two others than this photo see the point.
bool IsOthersPoint(const PhotosInScan& photos, const SparsePoint& point, uint32_t image_id) {
  uint32_t first = image_id;
  for (const TrackElement& element : point.track) {
    if (element.image_id == image_id || element.image_id == first) continue;
    if (!photos.IsWitness(element.image_id)) continue;
    if (first != image_id) return true;
    first = element.image_id;
  }
  return false;
}

struct ExpectedPoint {
  const SparsePoint* point;
  Eigen::Vector2d x_in_img;
};

std::vector<ExpectedPoint> PointsExpected(const PhotosInScan& photos, const SparseImage& image,
                                          const std::vector<const SparsePoint*>& points,
                                          const FreeSpace& free_space) {
  const CameraProjection& projection = photos.projections.at(image.camera_id);
  const Eigen::Vector3d& centre = photos.centres.at(image.image_id);
  std::vector<ExpectedPoint> expected;
  for (const SparsePoint* const point : points) {
    const auto x_in_img = projection.ImgFromCam(image.cam_from_model * point->x_in_model);
    if (!x_in_img || !projection.InImage(*x_in_img)) continue;
    if (!IsOthersPoint(photos, *point, image.image_id)) continue;
    if (photos.IsSeenAlike(*point, image.image_id, *x_in_img))
      expected.push_back({point, *x_in_img});
  }
  std::vector<ExpectedPoint> in_sight;
  const size_t stride = expected.size() / kPointsPerPhoto + 1;
  for (size_t i = 0; i < expected.size(); i += stride) {
    const Eigen::Vector3d ray = expected[i].point->x_in_model - centre;
    const double range = ray.norm();
    const auto met = free_space.Look(centre, ray / range);
    const bool is_hidden = met && (met->x_in_scan - centre).norm() <
                                      range - std::max(kInFrontBy, kInFrontShare * range);
    if (!is_hidden) in_sight.push_back(expected[i]);
  }
  return in_sight;
}

using Expectations = std::map<uint32_t, std::vector<ExpectedPoint>>;  // by image_id

Expectations FindExpected(const PhotosInScan& photos, const std::vector<const SparsePoint*>& points,
                          const FreeSpace& free_space) {
  Expectations expected;
  for (const auto& [id, image] : photos.model.images) {
    expected[id] = PointsExpected(photos, image, points, free_space);
  }
  return expected;
}

// Photos that do not belong to the most that find what each other found. Photos of another room
// that came together find each other's points, and lack those of all others, as these lack theirs:
// the shares of both suffer, and do not tell which is which.
std::set<uint32_t> OutsideLargestGroup(const Expectations& expected) {
  struct Common {
    int num_expected = 0, num_found = 0;
    double Share() const { return static_cast<double>(num_found) / num_expected; }
  };
  std::map<uint32_t, int> index;
  for (const auto& [id, points] : expected) index.emplace(id, static_cast<int>(index.size()));
  std::map<std::pair<int, int>, Common> pairs;
  for (const auto& [id, points] : expected) {
    for (const ExpectedPoint& one : points) {
      const bool is_found = IsInTrack(*one.point, id);
      for (const TrackElement& element : one.point->track) {
        if (element.image_id == id) continue;
        Common& common = pairs[std::minmax(index.at(id), index.at(element.image_id))];
        ++common.num_expected;
        common.num_found += is_found;
      }
    }
  }
  std::vector<double> shares;
  for (const auto& [pair, common] : pairs) {
    if (common.num_expected >= kMinExpectedOfPair) shares.push_back(common.Share());
  }
  if (shares.empty()) return {};
  const double least = kLeastSightShare * Median(&shares);
  DisjointSets sets(static_cast<int>(index.size()));
  for (const auto& [pair, common] : pairs) {
    const bool may_tell = common.num_expected >= kMinExpectedOfPair;
    if (may_tell && common.Share() >= least) sets.Join(pair.first, pair.second);
  }
  const int largest = sets.Groups()[0][0];
  std::set<uint32_t> outside;
  for (const auto& [id, i] : index) {
    if (sets.Find(i) != largest) outside.insert(id);
  }
  return outside;
}

// Sets num_expected, sight_share and unevenness; leaves them where fewer than `least` are expected.
void CountSights(const std::vector<ExpectedPoint>& expected, uint32_t image_id,
                 const Camera& camera, size_t least, PhotoVerdict* photo) {
  if (expected.size() < least) {
    if (std::isnan(photo->sight_share)) photo->num_expected = static_cast<int>(expected.size());
    return;
  }
  struct Part {
    int num_expected = 0, num_seen = 0;
  };
  std::vector<Part> parts(static_cast<size_t>(kCellColumns) * kCellRows);
  const auto cell = [](double x, int size, int count) {
    return std::clamp(static_cast<int>(x * count / size), 0, count - 1);
  };
  int num_seen = 0;
  for (const ExpectedPoint& one : expected) {
    const bool is_seen = IsInTrack(*one.point, image_id);
    num_seen += is_seen;
    Part& part =
        parts[static_cast<size_t>(cell(one.x_in_img.y(), camera.height, kCellRows)) * kCellColumns +
              cell(one.x_in_img.x(), camera.width, kCellColumns)];
    ++part.num_expected;
    part.num_seen += is_seen;
  }
  photo->num_expected = static_cast<int>(expected.size());
  const double share = static_cast<double>(num_seen) / photo->num_expected;
  photo->sight_share = share;
  photo->unevenness = kUnknownShare;
  if (!(share > 0 && share < 1)) return;
  double chi_square = 0;
  int num_parts = 0;
  for (const Part& part : parts) {
    if (part.num_expected < kMinPointsOfPart) continue;
    ++num_parts;
    chi_square += std::pow(part.num_seen - share * part.num_expected, 2) /
                  (share * (1 - share) * part.num_expected);
  }
  if (num_parts > 1) photo->unevenness = chi_square / (num_parts - 1);
}

// Sets surface_share.
void CountOnSurface(const SparseModel& aligned, const ScanPatches& surface,
                    const FreeSpace& free_space, double tolerance, double sigma_px,
                    std::map<uint32_t, PhotoVerdict>* photos) {
  const double reach = std::hypot(tolerance, surface.cell_size());
  std::map<uint32_t, double> judged, on_surface;  // sums of weights
  for (const SurfacePoint& point : FindSurfacePoints(aligned, 2, sigma_px)) {
    const auto nearest = surface.FindNearest(point.x_in_sparse, reach);
    const bool is_on = nearest && std::abs(nearest->distance) < tolerance;
    if (!is_on) {
      // What stands before the surface is known to be off it; behind, and where nobody measured,
      // there may be something.
      if (!free_space.HasStations()) continue;
      const double own = 3 * std::sqrt(point.covariance.trace());
      if (free_space.Locate(point.x_in_sparse, std::max(2 * tolerance, own)) !=
          FreeSpace::Place::kFloating) {
        continue;
      }
    }
    const SparsePoint& sparse = aligned.points.at(point.point3d_id);
    const double weight = 2.0 / static_cast<double>(sparse.track.size());
    for (const TrackElement& element : sparse.track) {
      judged[element.image_id] += weight;
      if (is_on) on_surface[element.image_id] += weight;
    }
  }
  for (auto& [id, photo] : *photos) {
    if (judged[id] >= kMinJudgedOfPhoto) photo.surface_share = on_surface[id] / judged[id];
  }
}

// Of a photo that stands apart, few points that the others found have to do.
void CountSights(const Expectations& expected, const PhotosInScan& in_scan,
                 std::map<uint32_t, PhotoVerdict>* photos) {
  for (const auto& [id, points] : expected) {
    const Camera& camera = in_scan.model.cameras.at(in_scan.model.images.at(id).camera_id);
    const size_t least = in_scan.IsWitness(id) ? kMinExpected : kMinExpectedOfPair;
    CountSights(points, id, camera, least, &photos->at(id));
  }
}

// Of the photos where it is known; NaN without any.
double UsualSightShare(const std::map<uint32_t, PhotoVerdict>& photos) {
  std::vector<double> shares;
  for (const auto& [id, photo] : photos) {
    if (std::isfinite(photo.sight_share)) shares.push_back(photo.sight_share);
  }
  return shares.empty() ? kUnknownShare : Median(&shares);
}

}  // namespace

std::map<uint32_t, PhotoVerdict> JudgePhotos(const SparseModel& aligned, const ScanPatches& surface,
                                             const FreeSpace& free_space, double tolerance,
                                             double sigma_px,
                                             const std::map<uint32_t, double>& match_support) {
  PhotosInScan in_scan(aligned);
  std::vector<const SparsePoint*> points;
  const size_t stride = aligned.points.size() / kMaxPointsAsked + 1;
  size_t next = 0;
  for (const auto& [id, point] : aligned.points) {
    if (next++ % stride == 0) points.push_back(&point);
  }
  std::map<uint32_t, PhotoVerdict> photos;
  for (const auto& [id, image] : aligned.images) {
    PhotoVerdict& photo = photos[id];
    photo.num_points = static_cast<size_t>(
        std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(),
                      [](uint64_t point) { return point != kInvalidPoint3dId; }));
    const auto support = match_support.find(id);
    if (support != match_support.end()) photo.match_support = support->second;
  }
  CountOnSurface(aligned, surface, free_space, tolerance, sigma_px, &photos);
  // By what photos found that belong together; what strangers found together the right ones lack.
  Expectations expected = FindExpected(in_scan, points, free_space);
  CountSights(expected, in_scan, &photos);
  in_scan.not_believed = OutsideLargestGroup(expected);
  if (!in_scan.not_believed.empty()) {
    expected = FindExpected(in_scan, points, free_space);
    CountSights(expected, in_scan, &photos);
  }

  const double usual_sight = UsualSightShare(photos);
  const double least_support = SupportLimit(match_support, kMinSupport);
  for (auto& [id, photo] : photos) {
    if (photo.match_support < least_support) {
      photo.doubt = "only " + Percent(photo.match_support) +
                    " of its verified matches obey the poses of the model (usual here: more than " +
                    Percent(least_support) + "). ";
    } else if (photo.sight_share < kHardlyAnything * usual_sight ||
               (photo.sight_share < kLeastSightShare * usual_sight && photo.unevenness > kUneven)) {
      photo.doubt = "of the sparse points that it ought to show it has only " +
                    Percent(photo.sight_share) + " (usual here: " + Percent(usual_sight) + "). ";
    } else {
      continue;
    }
    photo.doubt +=
        "It may show another room, a repeated pattern or things that were moved, or stand wrong.";
  }
  return photos;
}

}  // namespace roomtex
