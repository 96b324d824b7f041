#include "tests/benchmark/planar/pose_judge.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "colmap_ext/seed_bundle.h"
#include "core/decompositions.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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
  Eigen::Quaterniond mean;
  mean.coeffs() = SymmetricEigen(sum).vectors.col(3);
  return mean.normalized();
}

// What is where in the model's frame and in truth; equal total weights of centres and points.
struct Correspondences {
  std::vector<Eigen::Vector3d> in_model, in_scene;
  std::vector<double> weights;

  void Add(const Eigen::Vector3d& x_in_model, const Eigen::Vector3d& x_in_scene, double weight) {
    in_model.push_back(x_in_model);
    in_scene.push_back(x_in_scene);
    weights.push_back(weight);
  }
  // Scale and translation for the given rotation; scale 0 if there is none above.
  Similarity Fit(const Eigen::Quaterniond& rotation) const {
    Similarity result;
    result.rotation = rotation;
    double sum = 0, product = 0, square = 0;
    Eigen::Vector3d mean_turned = Eigen::Vector3d::Zero(), mean_scene = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < weights.size(); ++i) {
      sum += weights[i];
      mean_turned += weights[i] * (rotation * in_model[i]);
      mean_scene += weights[i] * in_scene[i];
    }
    mean_turned /= sum;
    mean_scene /= sum;
    for (size_t i = 0; i < weights.size(); ++i) {
      const Eigen::Vector3d turned = rotation * in_model[i] - mean_turned;
      product += weights[i] * turned.dot(in_scene[i] - mean_scene);
      square += weights[i] * turned.squaredNorm();
    }
    result.scale = square > 0 ? std::max(0.0, product / square) : 0;
    result.translation = mean_scene - result.scale * mean_turned;
    return result;
  }
};

// Points with a track that agrees on one true point: (in the model, number of the true point).
std::vector<std::pair<Eigen::Vector3d, int>> KnownPoints(const SparseModel& model,
                                                         const SimulatedViews& views) {
  std::vector<std::pair<Eigen::Vector3d, int>> known;
  for (const auto& [point_id, point] : model.points) {
    int truth = -1;
    bool agrees = !point.track.empty();
    for (const TrackElement& element : point.track) {
      const int seen = views.point_of_keypoint.at(element.image_id)[element.point2d_index];
      agrees &= truth < 0 || seen == truth;
      truth = seen;
    }
    if (agrees) known.emplace_back(point.x_in_model, truth);
  }
  return known;
}

std::vector<double> PointErrors(const std::vector<std::pair<Eigen::Vector3d, int>>& known,
                                const SimulatedViews& views, const Similarity& scene_from_model) {
  std::vector<double> errors;
  for (const auto& [x_in_model, point] : known) {
    errors.push_back((scene_from_model * x_in_model - views.points_in_scene[point]).norm());
  }
  return errors;
}

// Fitted once to all points and once more to the better half of them: a few far ones, whose rays
// are almost parallel, must not move it.
Similarity AlignToTruth(const SparseModel& model, const SimulatedViews& views,
                        const std::vector<std::pair<Eigen::Vector3d, int>>& known) {
  const Eigen::Quaterniond rotation = MeanRotation(model, views);
  Correspondences centres;
  for (const auto& [image_id, image] : model.images) {
    centres.Add(image.cam_from_model.TargetOriginInSource(),
                views.cam_from_scene.at(image_id).TargetOriginInSource(),
                1.0 / static_cast<double>(model.images.size()));
  }
  Similarity result = centres.Fit(rotation);
  if (known.empty()) return result;
  const double weight = 1.0 / static_cast<double>(known.size());
  double limit = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 2; ++round) {
    const std::vector<double> errors = PointErrors(known, views, result);
    Correspondences all = centres;
    for (size_t i = 0; i < known.size(); ++i) {
      if (errors[i] > limit) continue;
      all.Add(known[i].first, views.points_in_scene[known[i].second], weight);
    }
    result = all.Fit(rotation);
    std::vector<double> sorted = PointErrors(known, views, result);
    std::sort(sorted.begin(), sorted.end());
    limit = Median(sorted, kNaN);
  }
  return result;
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

double ModelVerdict::MedianCentreError() const { return Median(centre_errors, kNaN); }
double ModelVerdict::MedianRotationErrorDeg() const { return Median(rotation_errors_deg, kNaN); }

ModelVerdict JudgeModel(SparseModel model, const SimulatedViews& views) {
  ModelVerdict verdict;
  verdict.num_registered = model.images.size();
  if (model.images.size() < 2) return verdict;
  const auto known = KnownPoints(model, views);
  const Similarity scene_from_model = AlignToTruth(model, views, known);
  for (const auto& [image_id, image] : model.images) {
    const Rigid& truth = views.cam_from_scene.at(image_id);
    const Eigen::Vector3d centre = scene_from_model * image.cam_from_model.TargetOriginInSource();
    verdict.centre_errors.push_back((centre - truth.TargetOriginInSource()).norm());
    const Eigen::Quaterniond cam_from_scene =
        image.cam_from_model.rotation * scene_from_model.rotation.conjugate();
    verdict.rotation_errors_deg.push_back(
        DegFromRad(RotationAngle(cam_from_scene, truth.rotation)));
  }
  double extent = 0;
  for (const auto& [id1, image1] : model.images) {
    for (const auto& [id2, image2] : model.images) {
      const Rigid& truth1 = views.cam_from_scene.at(id1);
      const Rigid& truth2 = views.cam_from_scene.at(id2);
      const double error =
          RotationAngle((image1.cam_from_model * image2.cam_from_model.Inverse()).rotation,
                        (truth1 * truth2.Inverse()).rotation);
      verdict.max_relative_rotation_error_deg =
          std::max(verdict.max_relative_rotation_error_deg, DegFromRad(error));
      extent =
          std::max(extent, (truth1.TargetOriginInSource() - truth2.TargetOriginInSource()).norm());
    }
  }
  std::sort(verdict.centre_errors.begin(), verdict.centre_errors.end());
  std::sort(verdict.rotation_errors_deg.begin(), verdict.rotation_errors_deg.end());
  std::vector<double> point_errors = PointErrors(known, views, scene_from_model);
  std::sort(point_errors.begin(), point_errors.end());
  verdict.median_point_error = Median(point_errors, kNaN);
  verdict.poses_right = scene_from_model.scale > 0 &&
                        verdict.centre_errors.back() < std::min(kMaxCentreError, 0.2 * extent) &&
                        verdict.max_relative_rotation_error_deg < kMaxViewRotationDeg &&
                        verdict.median_point_error < kMaxPointError;
  verdict.mean_reprojection_error_px = UpdateReprojectionErrors(&model).mean_px;
  return verdict;
}

SimulatedViews WholeOptimumFromTruth(const SimulatedViews& views) {
  // A keypoint counts if a right match holds it.
  std::map<std::pair<uint32_t, int>, int> point_of_matched;
  for (const DatabasePair& pair : views.pairs) {
    for (const Eigen::Vector2i& match : pair.matches) {
      const int point = views.point_of_keypoint.at(pair.image_id1)[match.x()];
      if (point != views.point_of_keypoint.at(pair.image_id2)[match.y()]) continue;
      point_of_matched[{pair.image_id1, match.x()}] = point;
      point_of_matched[{pair.image_id2, match.y()}] = point;
    }
  }
  const Rigid first_from_scene = views.cam_from_scene.begin()->second;
  const Rigid scene_from_first = first_from_scene.Inverse();
  TrueSeed seed;
  std::map<uint32_t, int> view_of_image;
  for (const auto& [image_id, pose] : views.cam_from_scene) {
    view_of_image[image_id] = static_cast<int>(seed.geometry.views_from_left.size());
    seed.geometry.views_from_left.push_back(pose * scene_from_first);
  }
  std::map<int, int> index_of_point;
  MatchedImages images = views.Matched();
  for (const auto& [keypoint, point] : point_of_matched) {
    const auto [image_id, row] = keypoint;
    const auto [place, is_new] =
        index_of_point.emplace(point, static_cast<int>(seed.geometry.points.size()));
    if (is_new) {
      const Eigen::Vector3d x = first_from_scene * views.points_in_scene[point];
      seed.geometry.points.emplace_back(x.x() / x.z(), x.y() / x.z(), 1 / x.z());
    }
    const CameraProjection projection(views.cameras.at(views.images.at(image_id).camera_id));
    const Ray ray = RaysFromKeypoints(projection, {images.Keypoints(image_id)[row]})[0];
    if (ray.valid) seed.observations.push_back({view_of_image.at(image_id), place->second, ray});
  }
  SeedBundleOptions options;
  options.loss_scale_px = 0;
  options.max_iterations = 100;
  const SeedBundleResult adjusted = AdjustSeed(seed.geometry, seed.observations, options);
  SimulatedViews optimum = views;
  if (!adjusted.usable) return optimum;
  const double baseline = seed.geometry.views_from_left[1].translation.norm();
  for (auto& [image_id, pose] : optimum.cam_from_scene) {
    Rigid view_from_left = adjusted.geometry.views_from_left[view_of_image.at(image_id)];
    view_from_left.translation *= baseline;
    pose = view_from_left * first_from_scene;
  }
  for (const auto& [point, index] : index_of_point) {
    optimum.points_in_scene[point] =
        scene_from_first * (baseline * PointInLeft(adjusted.geometry.points[index]));
  }
  return optimum;
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
