#include "align/trust/photo_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <Eigen/Geometry>

#include "align/trust/scan_cells.h"
#include "core/decompositions.h"
#include "core/frames.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/three_point_pose.h"
#include "core/twist.h"

namespace roomtex {
namespace {

constexpr int kSampleParts = 32, kKeptOfSamples = 6;  // of the samples: fixed, whatever the threads
constexpr size_t kRefined = 30;                       // of each focal length
// Of what makes two places: between those that are refined.
constexpr double kApart = 0.2;
constexpr double kSampleReach = 1.5;  // times the tolerance, before a sample is refined
constexpr double kLeastLength = 0.2;  // metres between the places of a sample
constexpr double kLeastAngle = 2, kMostAngle = 150;  // degrees between its rays
constexpr double kLeastDepth = 0.1;                  // metres
constexpr int kFitSteps = 20;
constexpr double kMostDamping = 1e6, kFitGain = 1e-4;  // of the sum of squares, for another step

// The matches under one focal length, in the order of the scan's cells.
class PhotoRays {
 public:
  PhotoRays(const std::vector<PhotoMatch>& matches, const Camera& camera,
            const PhotoSearchOptions& options)
      : options_(options) {
    const CameraProjection projection(camera);
    std::map<ScanCell, std::vector<int>> by_cell;
    for (size_t i = 0; i < matches.size(); ++i) {
      by_cell[ScanCellOf(matches[i].x_in_scan, options.cell)].push_back(static_cast<int>(i));
    }
    const double px = camera.MeanFocalLength() * RadFromDeg(options.photo_cell_deg);
    std::map<std::pair<int, int>, int> photo_cells;
    for (const auto& entry : by_cell) {
      firsts_.push_back(static_cast<int>(which_.size()));
      for (const int i : entry.second) {
        const auto plane = projection.CamFromImg(matches[i].x_in_img);
        if (!plane) continue;
        const std::pair<int, int> at(static_cast<int>(matches[i].x_in_img.x() / px),
                                     static_cast<int>(matches[i].x_in_img.y() / px));
        photo_cells_.push_back(
            photo_cells.try_emplace(at, static_cast<int>(photo_cells.size())).first->second);
        which_.push_back(i);
        planes_.push_back(*plane);
        rays_.push_back(plane->homogeneous().normalized());
        places_.push_back(matches[i].x_in_scan);
      }
      if (firsts_.back() == static_cast<int>(which_.size())) firsts_.pop_back();
    }
    firsts_.push_back(static_cast<int>(which_.size()));
    num_photo_cells_ = static_cast<int>(photo_cells.size());
  }

  int num_cells() const { return static_cast<int>(firsts_.size()) - 1; }

  // Up to four poses of three matches; mostly none.
  std::vector<Rigid> Sample(RandomStream* random) const {
    std::array<int, 3> one;
    for (int& i : one) {  // any cell: some have many matches, of a poster, say
      const int cell = random->Index(num_cells());
      i = firsts_[cell] + random->Index(firsts_[cell + 1] - firsts_[cell]);
    }
    for (int k = 0; k < 3; ++k) {
      const int i = one[k], j = one[(k + 1) % 3];
      if ((places_[i] - places_[j]).norm() < kLeastLength) return {};
      const double angle = AngleBetween(rays_[i], rays_[j]);
      if (angle < RadFromDeg(kLeastAngle) || angle > RadFromDeg(kMostAngle)) return {};
    }
    return SolveThreePointPose({places_[one[0]], places_[one[1]], places_[one[2]]},
                               {rays_[one[0]], rays_[one[1]], rays_[one[2]]});
  }

  // Matches within the tolerance.
  std::vector<int> Within(const Rigid& pose, double tolerance) const {
    const double least = std::cos(tolerance);
    const Eigen::Matrix3d turn = pose.rotation.toRotationMatrix();
    std::vector<int> within;
    for (size_t i = 0; i < rays_.size(); ++i) {
      const Eigen::Vector3d x = turn * places_[i] + pose.translation;
      if (x.z() > kLeastDepth && x.dot(rays_[i]) > least * x.norm()) {
        within.push_back(static_cast<int>(i));
      }
    }
    return within;
  }

  // Cells of the scan, or of the photo if these are fewer; and one match of each of the scan's.
  int CellsOf(const std::vector<int>& within, std::vector<int>* of_cells) const {
    std::vector<uint8_t> seen(num_photo_cells_, 0);
    int num = 0, num_in_photo = 0;
    size_t cell = 0;
    int last = -1;
    for (const int i : within) {
      while (firsts_[cell + 1] <= i) ++cell;
      num_in_photo += seen[photo_cells_[i]] == 0;
      seen[photo_cells_[i]] = 1;
      if (static_cast<int>(cell) == last) continue;
      last = static_cast<int>(cell);
      ++num;
      if (of_cells != nullptr) of_cells->push_back(which_[i]);
    }
    return std::min(num, num_in_photo);
  }

  int CellsWithin(const Rigid& pose, double tolerance) const {
    return CellsOf(Within(pose, tolerance), nullptr);
  }

  // Least squares over what agrees, at first within twice the tolerance; the best on the way.
  PhotoPlace Refined(const Rigid& guess) const {
    const double tolerance = RadFromDeg(options_.tolerance_deg);
    PhotoPlace best;
    best.cam_from_scan = guess;
    best.num_cells = CellsWithin(guess, tolerance);
    Rigid now = guess;
    for (const double wider : {2.0, 2.0, 1.5, 1.5, 1.0, 1.0}) {
      const std::vector<int> within = Within(now, wider * tolerance);
      if (within.size() < 5) break;
      now = Fitted(now, within);
      if (!now.rotation.coeffs().allFinite() || !now.translation.allFinite()) break;
      const int num_cells = CellsWithin(now, tolerance);
      if (num_cells <= best.num_cells) continue;
      best.cam_from_scan = now;
      best.num_cells = num_cells;
    }
    CellsOf(Within(best.cam_from_scan, tolerance), &best.agreeing);
    return best;
  }

 private:
  // Least squares of x/z and y/z, by Levenberg and Marquardt.
  Rigid Fitted(Rigid pose, const std::vector<int>& matches) const {
    double damping = 1e-3;
    NormalEquations normal = NormalAt(pose, matches);
    for (int step = 0; step < kFitSteps && damping < kMostDamping; ++step) {
      Eigen::Matrix<double, 6, 6> damped = normal.matrix;
      damped.diagonal() *= 1 + damping;
      const Eigen::Matrix<double, 6, 1> change = -SolveSymmetric(damped, normal.gradient);
      const Rigid moved = MovedInPlace(pose, change);
      const NormalEquations there = NormalAt(moved, matches);
      if (!(there.sum < normal.sum)) {
        damping *= 10;
        continue;
      }
      const bool is_done = there.sum > (1 - kFitGain) * normal.sum;
      pose = moved;
      normal = there;
      damping /= 10;
      if (is_done) break;
    }
    return pose;
  }

  // Of a turn about the axes of `cam`, where it stands, and a shift along them.
  struct NormalEquations {
    Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    double sum = 0;  // of squares; infinite where a place is not in front
  };
  NormalEquations NormalAt(const Rigid& pose, const std::vector<int>& matches) const {
    NormalEquations normal;
    const Eigen::Matrix3d turn = pose.rotation.toRotationMatrix();
    for (const int i : matches) {
      const Eigen::Vector3d x = turn * places_[i] + pose.translation;
      if (!(x.z() > kLeastDepth)) {
        normal.sum = std::numeric_limits<double>::infinity();
        return normal;
      }
      const Eigen::Vector2d at = x.hnormalized(), residual = at - planes_[i];
      Eigen::Matrix<double, 2, 3> by_x;
      by_x << 1, 0, -at.x(), 0, 1, -at.y();
      by_x /= x.z();
      Eigen::Matrix<double, 2, 6> jacobian;
      jacobian << by_x * -CrossMatrix(x), by_x;
      normal.matrix.noalias() += jacobian.transpose() * jacobian;
      normal.gradient.noalias() += jacobian.transpose() * residual;
      normal.sum += residual.squaredNorm();
    }
    return normal;
  }

  const PhotoSearchOptions& options_;
  std::vector<int> which_;               // of the matches
  std::vector<Eigen::Vector2d> planes_;  // x/z, y/z
  std::vector<Eigen::Vector3d> rays_, places_;
  std::vector<int> photo_cells_;  // of each match
  std::vector<int> firsts_;       // of each cell its first match, and where the last one ends
  int num_photo_cells_ = 0;
};

bool IsBetter(const PhotoPlace& a, const PhotoPlace& b) { return a.num_cells > b.num_cells; }

}  // namespace

int CountCells(const std::vector<PhotoMatch>& matches, double cell) {
  std::set<ScanCell> cells;
  for (const PhotoMatch& match : matches) cells.insert(ScanCellOf(match.x_in_scan, cell));
  return static_cast<int>(cells.size());
}

bool AreDistinct(const Rigid& a, const Rigid& b, const PhotoSearchOptions& options) {
  return (a.TargetOriginInSource() - b.TargetOriginInSource()).norm() > options.distinct ||
         RotationAngle(a.rotation, b.rotation) > RadFromDeg(options.distinct_deg);
}

Camera WithFocalScale(Camera camera, double scale) {
  camera.params[0] *= scale;
  const std::set<CameraModel> with_one = {
      CameraModel::kSimplePinhole,       CameraModel::kSimpleRadial,  CameraModel::kRadial,
      CameraModel::kSimpleRadialFisheye, CameraModel::kRadialFisheye, CameraModel::kSimpleDivision,
      CameraModel::kSimpleFisheye};
  if (with_one.count(camera.model) == 0) camera.params[1] *= scale;
  return camera;
}

std::vector<PhotoPlace> SearchPhotoPlaces(const std::vector<PhotoMatch>& matches,
                                          const Camera& camera, const PhotoSearchOptions& options,
                                          int num_threads) {
  std::vector<PhotoRays> rays;
  for (const double scale : options.focal_scales) {
    rays.emplace_back(matches, WithFocalScale(camera, scale), options);
  }
  const int num_scales = static_cast<int>(rays.size());
  std::vector<std::vector<PhotoPlace>> of_parts(static_cast<size_t>(kSampleParts) * num_scales);
  ParallelFor(num_threads, 0, static_cast<int>(of_parts.size()), [&](int part) {
    const PhotoRays& one = rays[part / kSampleParts];
    if (one.num_cells() < 4) return;
    RandomStream random(MixBits(0x9b070, static_cast<uint64_t>(part)));
    std::vector<PhotoPlace>& best = of_parts[part];
    const double reach = kSampleReach * RadFromDeg(options.tolerance_deg);
    for (int k = 0; k < options.num_samples / kSampleParts; ++k) {
      for (const Rigid& pose : one.Sample(&random)) {
        PhotoPlace place;
        place.cam_from_scan = pose;
        place.num_cells = one.CellsWithin(pose, reach);
        const auto at = std::upper_bound(best.begin(), best.end(), place, IsBetter);
        if (at - best.begin() >= kKeptOfSamples) continue;
        best.insert(at, place);
        if (best.size() > kKeptOfSamples) best.pop_back();
      }
    }
  });
  // The best of every focal length, whatever the others have, and not all of one place.
  PhotoSearchOptions apart = options;
  apart.distinct *= kApart;
  apart.distinct_deg *= kApart;
  std::vector<PhotoPlace> all, kept;
  for (int scale = 0; scale < num_scales; ++scale) {
    std::vector<PhotoPlace> of_scale;
    for (int part = scale * kSampleParts; part < (scale + 1) * kSampleParts; ++part) {
      for (PhotoPlace& place : of_parts[part]) {
        place.focal_scale = options.focal_scales[scale];
        of_scale.push_back(std::move(place));
      }
    }
    std::stable_sort(of_scale.begin(), of_scale.end(), IsBetter);
    const size_t first = all.size();
    for (PhotoPlace& place : of_scale) {
      if (all.size() == first + kRefined) break;
      const bool is_new = std::all_of(
          all.begin() + static_cast<long>(first), all.end(), [&](const PhotoPlace& other) {
            return AreDistinct(place.cam_from_scan, other.cam_from_scan, apart);
          });
      if (is_new) all.push_back(std::move(place));
    }
    ParallelFor(num_threads, static_cast<int>(first), static_cast<int>(all.size()), [&](int i) {
      const double focal_scale = all[i].focal_scale;
      all[i] = rays[scale].Refined(all[i].cam_from_scan);
      all[i].focal_scale = focal_scale;
    });
  }
  std::stable_sort(all.begin(), all.end(), IsBetter);
  for (const PhotoPlace& one : all) {
    if (static_cast<int>(kept.size()) == options.num_kept) break;
    const bool is_new = std::all_of(kept.begin(), kept.end(), [&](const PhotoPlace& other) {
      return AreDistinct(one.cam_from_scan, other.cam_from_scan, options);
    });
    if (is_new) kept.push_back(one);
  }
  return kept;
}

}  // namespace roomtex
