#include "tests/benchmark/planar/pose_judge.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include <Eigen/Eigenvalues>

#include "colmap_ext/seed_bundle.h"

namespace roomtex {
namespace {

double Median(const std::vector<double>& ascending) {
  return ascending.empty() ? std::numeric_limits<double>::quiet_NaN()
                           : ascending[ascending.size() / 2];
}

// The true motion and its right observations.
struct TrueSeed {
  SeedGeometry geometry;
  std::vector<SeedObservation> observations;
};

TrueSeed MakeTrueSeed(const SimulatedViews& views, const DatabasePair& pair,
                      const std::vector<RayMatch>& matches, const std::vector<ThirdView>& thirds) {
  TrueSeed seed;
  SeedGeometry& start = seed.geometry;
  const Rigid& left_from_scene = views.cam_from_scene.at(pair.image_id1);
  Rigid truth = views.TrueRelativePose(pair.image_id1, pair.image_id2);
  const double baseline = truth.translation.norm();
  truth.translation /= baseline;
  start.views_from_left = {Rigid(), truth};
  const auto point_at = [&](uint32_t image_id, int row) {
    return views.point_of_keypoint.at(image_id)[row];
  };
  std::vector<int> index_of_match(matches.size(), -1);
  for (size_t m = 0; m < matches.size(); ++m) {
    const int point = point_at(pair.image_id1, matches[m].left_row);
    if (point != point_at(pair.image_id2, matches[m].right_row)) continue;
    const Eigen::Vector3d x = left_from_scene * views.points_in_scene[point];
    const int index = index_of_match[m] = static_cast<int>(start.points.size());
    start.points.emplace_back(x.x() / x.z(), x.y() / x.z(), baseline / x.z());
    seed.observations.push_back({0, index, matches[m].left});
    seed.observations.push_back({1, index, matches[m].right});
  }
  for (const ThirdView& third : thirds) {
    const int view = static_cast<int>(start.views_from_left.size());
    start.views_from_left.push_back(views.TrueRelativePose(pair.image_id1, third.image_id));
    start.views_from_left.back().translation /= baseline;
    for (const ThirdView::Sighting& sighting : third.sightings) {
      const int index = index_of_match[sighting.match];
      const int point = point_at(pair.image_id1, matches[sighting.match].left_row);
      if (index < 0 || point != point_at(third.image_id, sighting.row)) continue;
      seed.observations.push_back({view, index, sighting.ray});
    }
  }
  return seed;
}

// Where bundle adjustment ends when it starts at the truth.
Rigid OptimumFromTruth(const TrueSeed& seed) {
  SeedBundleOptions options;
  options.loss_scale_px = 0;  // no outliers among them
  options.max_iterations = 100;
  const SeedBundleResult adjusted = AdjustSeed(seed.geometry, seed.observations, options);
  return (adjusted.usable ? adjusted.geometry : seed.geometry).views_from_left[1];
}

// The rotation that the views' orientations ask for on average (Markley et al. 2007).
Eigen::Quaterniond MeanRotation(const SparseModel& model, const SimulatedViews& views) {
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (const auto& [image_id, image] : model.images) {
    const Eigen::Quaterniond scene_from_model =
        views.cam_from_scene.at(image_id).rotation.conjugate() * image.cam_from_model.rotation;
    sum += scene_from_model.coeffs() * scene_from_model.coeffs().transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
  Eigen::Quaterniond mean;
  mean.coeffs() = solver.eigenvectors().col(3);
  return mean.normalized();
}

// scale <= 0: a mirrored or collapsed model.
Similarity AlignToTruth(const SparseModel& model, const SimulatedViews& views) {
  Similarity result;
  result.rotation = MeanRotation(model, views);
  const double count = static_cast<double>(model.images.size());
  Eigen::Vector3d mean_turned = Eigen::Vector3d::Zero(), mean_truth = Eigen::Vector3d::Zero();
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> centres;
  for (const auto& [image_id, image] : model.images) {
    centres.emplace_back(result.rotation * image.cam_from_model.TargetOriginInSource(),
                         views.cam_from_scene.at(image_id).TargetOriginInSource());
    mean_turned += centres.back().first / count;
    mean_truth += centres.back().second / count;
  }
  double product = 0, square = 0;
  for (const auto& [turned, truth] : centres) {
    product += (turned - mean_turned).dot(truth - mean_truth);
    square += (turned - mean_turned).squaredNorm();
  }
  result.scale = square > 0 ? product / square : 0;
  result.translation = mean_truth - result.scale * mean_turned;
  return result;
}

// Of every point with a track that agrees on one true point.
std::vector<double> PointErrors(const SparseModel& model, const SimulatedViews& views,
                                const Similarity& scene_from_model) {
  std::vector<double> errors;
  for (const auto& [point_id, point] : model.points) {
    int truth = -1;
    bool agrees = !point.track.empty();
    for (const TrackElement& element : point.track) {
      const int seen = views.point_of_keypoint.at(element.image_id)[element.point2d_index];
      agrees &= truth < 0 || seen == truth;
      truth = seen;
    }
    if (!agrees) continue;
    errors.push_back((scene_from_model * point.x_in_model - views.points_in_scene[truth]).norm());
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

}  // namespace

MotionErrors CompareMotions(const Rigid& a, const Rigid& b) {
  return {DegFromRad(RotationAngle(a.rotation, b.rotation)),
          DegFromRad(BaselineAngle(a.translation, b.translation))};
}

PairVerdict JudgePair(const SimulatedViews& views, double noise_px, MatchedImages* images,
                      const DatabasePair& pair, const Rigid& right_from_left, int max_third_views) {
  const std::vector<RayMatch> matches = images->Matches(pair);
  std::vector<ThirdView> thirds;
  if (max_third_views > 0) {
    thirds =
        images->FindThirdViews(pair, matches, ThirdViewOptions().min_sightings, max_third_views);
  }
  const TrueSeed seed = MakeTrueSeed(views, pair, matches, thirds);
  const Rigid& truth = seed.geometry.views_from_left[1];
  const Rigid optimum = OptimumFromTruth(seed);
  PairVerdict verdict;
  verdict.from_truth = CompareMotions(right_from_left, truth);
  verdict.from_optimum = CompareMotions(right_from_left, optimum);
  verdict.optimum_from_truth = CompareMotions(optimum, truth);
  verdict.uncertainty = PairUncertainty(seed.geometry, seed.observations, noise_px);
  return verdict;
}

double PairVerdict::BaselineLimit() const {
  return std::clamp(3 * uncertainty.baseline_deg, kMaxPairBaselineDeg, kMaxUncertainBaselineDeg);
}

bool PairVerdict::Identifiable() const {
  return 3 * uncertainty.rotation_deg <= kMaxPairRotationDeg &&
         3 * uncertainty.baseline_deg <= kMaxUncertainBaselineDeg && Within(optimum_from_truth);
}

double ModelVerdict::MedianCentreError() const { return Median(centre_errors); }
double ModelVerdict::MedianRotationErrorDeg() const { return Median(rotation_errors_deg); }

ModelVerdict JudgeModel(SparseModel model, const SimulatedViews& views) {
  ModelVerdict verdict;
  verdict.num_registered = model.images.size();
  if (model.images.size() < 2) return verdict;
  const Similarity scene_from_model = AlignToTruth(model, views);
  for (const auto& [image_id, image] : model.images) {
    const Rigid& truth = views.cam_from_scene.at(image_id);
    const Eigen::Vector3d centre = scene_from_model * image.cam_from_model.TargetOriginInSource();
    verdict.centre_errors.push_back((centre - truth.TargetOriginInSource()).norm());
    const Eigen::Quaterniond cam_from_scene =
        image.cam_from_model.rotation * scene_from_model.rotation.conjugate();
    verdict.rotation_errors_deg.push_back(
        DegFromRad(RotationAngle(cam_from_scene, truth.rotation)));
  }
  std::sort(verdict.centre_errors.begin(), verdict.centre_errors.end());
  std::sort(verdict.rotation_errors_deg.begin(), verdict.rotation_errors_deg.end());
  verdict.median_point_error = Median(PointErrors(model, views, scene_from_model));
  verdict.poses_right = scene_from_model.scale > 0 &&
                        verdict.centre_errors.back() < kMaxCentreError &&
                        verdict.rotation_errors_deg.back() < kMaxViewRotationDeg &&
                        verdict.median_point_error < kMaxPointError;
  verdict.mean_reprojection_error_px = UpdateReprojectionErrors(&model).mean_px;
  return verdict;
}

SparseModel LargestModel(const std::string& folder) {
  SparseModel largest;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (!std::filesystem::exists(entry.path() / "images.bin")) continue;
    SparseModel model = ReadSparseModel(entry.path().string());
    if (model.images.size() > largest.images.size()) largest = std::move(model);
  }
  return largest;
}

}  // namespace roomtex
