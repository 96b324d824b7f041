#include "colmap_ext/view_placement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "colmap_ext/common_point.h"
#include "colmap_ext/two_view_geometry.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

// The poses that saw the common points carry errors of their own, beside those of the keypoints.
constexpr double kPoseErrorFactor = 1.5;
// Of the common points that must fit; the rest may be mismatches.
constexpr double kMinShareOfPoints = 0.5;
// Common points within a smaller part of the photo's diagonal agree with any scale and any pose.
constexpr double kMinExtent = 0.03;
// Of the pair's inliers that must survive the common points, and the final adjustment.
constexpr double kMinShareKept = 0.8;
// Growth of the error among the neighbours that counts as a jump.
constexpr double kMaxGrowth = 1.1;
// Poses nearer than this are one solution.
constexpr double kSameRotationDeg = 2, kEqualCentre = 0.1;
// Common points and pair points in the refinement of a pose; more hardly help.
constexpr int kMaxCommonPoints = 200, kMaxPairPoints = 250;

// One pose that a left-out view may have.
struct Candidate {
  ChainedView view;
  double cost = 0;      // truncated, over the common points, px^2
  double baseline = 0;  // to the neighbour, model units
};

bool SamePose(const Candidate& a, const Candidate& b) {
  const double distance =
      (a.view.cam_from_model.TargetOriginInSource() - b.view.cam_from_model.TargetOriginInSource())
          .norm();
  return RotationAngle(a.view.cam_from_model.rotation, b.view.cam_from_model.rotation) <
             RadFromDeg(kSameRotationDeg) &&
         distance < kEqualCentre * std::max(a.baseline, b.baseline);
}

// The unit-baseline motion of EvaluatePose and the essential matrix.
Rigid UnitBaseline(Rigid right_from_left) {
  right_from_left.translation.normalize();
  return right_from_left;
}

}  // namespace

void ChainOptions::Declare(OptionFields* fields) {
  fields->Bool("Chain.enabled", &enabled,
               "Register photos that COLMAP's mapper leaves out by their motion relative to a "
               "registered neighbour; 0 leaves them out.");
  fields
      ->Int("Chain.min_num_inliers", &min_num_inliers,
            "Matches with the neighbour that must obey that motion, and points that the photo "
            "must hold; larger = stricter.")
      .AtLeast(8);
  fields
      ->Int("Chain.min_common_points", &min_common_points,
            "Points of the model that give the scale; larger = stricter.")
      .AtLeast(3);
  fields
      ->Number("Chain.max_scale_spread", &max_scale_spread,
               "Largest relative spread of the scale over these points; larger = more "
               "tolerant.")
      .Positive();
  fields
      ->Number("Chain.min_confidence", &min_confidence,
               "How many times better than its rival a pose must explain these points to be "
               "believed; larger = stricter.")
      .AtLeast(1);
  fields
      ->Number("Chain.min_sight_share", &min_sight_share,
               "A photo so registered that has fewer than 100 points in common with the others "
               "must have this share of those that it ought to have: before a second cupboard of "
               "the same make it has not. Larger = stricter, 0 = not asked.")
      .AtLeast(0)
      .AtMost(1);
  fields
      ->Int("Chain.max_neighbors", &max_neighbors,
            "Registered neighbours that are tried per photo; larger = slower.")
      .AtLeast(1);
}

std::vector<std::string> ChainOptions::Problems() const { return ProblemsOf(*this); }

RatioAverage AverageRatios(const std::vector<double>& ratios) {
  RatioAverage average;
  if (ratios.empty()) return average;
  std::vector<double> logs;
  for (const double ratio : ratios) logs.push_back(std::log(ratio));
  const double median = Median(logs);
  average.spread = kSigmaPerMad * MedianAbsoluteDeviation(logs, median);
  double sum = 0;
  int count = 0;
  for (const double value : logs) {
    if (std::abs(value - median) > 3 * average.spread + 1e-12) continue;
    sum += value;
    ++count;
  }
  average.scale = std::exp(sum / count);
  return average;
}

Rigid ChainPose(const Rigid& left_from_model, const Rigid& right_from_left, double scale) {
  Rigid scaled = right_from_left;
  scaled.translation *= scale;
  return scaled * left_from_model;
}

struct ViewPlacer::Impl {
  MatchedImages* images;
  ChainOptions options;
  HypothesisOptions pair_options;
  int num_threads;
  std::map<uint32_t, std::vector<const DatabasePair*>> pairs_of_image;
  std::map<uint32_t, CameraProjection> projections;  // by camera id
  // By left-out view and neighbour; the matches do not change between the rounds.
  std::map<std::pair<uint32_t, uint32_t>, TwoViewAnalysis> analyses;

  static uint32_t Other(const DatabasePair& pair, uint32_t image_id) {
    return pair.image_id1 == image_id ? pair.image_id2 : pair.image_id1;
  }
  // The matches with the registered view on the left.
  std::vector<RayMatch> MatchesFrom(const DatabasePair& pair, uint32_t left_id) {
    std::vector<RayMatch> matches = images->Matches(pair);
    if (pair.image_id1 == left_id) return matches;
    for (RayMatch& match : matches) {
      std::swap(match.left, match.right);
      std::swap(match.left_row, match.right_row);
    }
    return matches;
  }
  Ray RayOf(uint32_t image_id, int row) {
    const uint32_t camera_id = images->images().at(image_id).camera_id;
    auto found = projections.find(camera_id);
    if (found == projections.end()) {
      found =
          projections.emplace(camera_id, CameraProjection(images->cameras().at(camera_id))).first;
    }
    return RaysFromKeypoints(found->second, {images->Keypoints(image_id)[row]})[0];
  }
  HypothesisOptions PairOptions(const DatabasePair& pair) const {
    HypothesisOptions result = pair_options;
    result.random_seed += PairIdFromImages(pair.image_id1, pair.image_id2);
    return result;
  }

  std::vector<const DatabasePair*> RegisteredPairs(uint32_t image_id, const SparseModel& model);
  std::map<int, CommonPoint> CommonPoints(uint32_t image_id, const SparseModel& model);
  void AnalysePairs(const std::vector<uint32_t>& image_ids, const SparseModel& model);
  ChainedView PlaceView(uint32_t image_id, const SparseModel& model);
  std::vector<Candidate> Candidates(uint32_t image_id, const DatabasePair& pair,
                                    const SparseModel& model,
                                    const std::map<int, CommonPoint>& common, std::string* problem);
  Rigid Refine(const Rigid& view_from_left, uint32_t left_id, const SparseModel& model,
               const std::vector<RayMatch>& matches, const TwoViewHypothesis& hypothesis,
               const std::map<int, CommonPoint>& common);
  void Score(const std::map<int, CommonPoint>& common, Candidate* candidate, int* num_fitting,
             double* extent) const;
  double EpipolarCost(const DatabasePair& pair, const SparseModel& model, size_t* count);
};

// Pairs of a left-out view with registered ones, most matches first.
std::vector<const DatabasePair*> ViewPlacer::Impl::RegisteredPairs(uint32_t image_id,
                                                                   const SparseModel& model) {
  std::vector<const DatabasePair*> pairs;
  for (const DatabasePair* pair : pairs_of_image[image_id]) {
    if (model.images.count(Other(*pair, image_id)) == 0) continue;
    if (static_cast<int>(pair->matches.size()) >= options.min_num_inliers) pairs.push_back(pair);
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const DatabasePair* a, const DatabasePair* b) {
    return a->matches.size() > b->matches.size();
  });
  return pairs;
}

// By keypoint row of the left-out view. Keypoints whose matches lead to different points are left
// out.
std::map<int, CommonPoint> ViewPlacer::Impl::CommonPoints(uint32_t image_id,
                                                          const SparseModel& model) {
  std::map<int, uint64_t> point_of_row;
  for (const DatabasePair* pair : pairs_of_image[image_id]) {
    const auto found = model.images.find(Other(*pair, image_id));
    if (found == model.images.end()) continue;
    const int own = pair->image_id1 == image_id ? 0 : 1;
    for (const Eigen::Vector2i& match : pair->matches) {
      const uint64_t point_id = found->second.point3d_ids[match[1 - own]];
      if (point_id == kInvalidPoint3dId) continue;
      const auto [entry, is_new] = point_of_row.emplace(match[own], point_id);
      if (!is_new && entry->second != point_id) entry->second = kInvalidPoint3dId;
    }
  }
  std::map<int, CommonPoint> common;
  for (const auto& [row, point_id] : point_of_row) {
    if (point_id == kInvalidPoint3dId) continue;
    CommonPoint point{
        RayOf(image_id, row), images->Keypoints(image_id)[row], &model.points.at(point_id), {}};
    if (!point.ray.valid) continue;
    for (const TrackElement& element : point.point->track) {
      const Ray ray = RayOf(element.image_id, static_cast<int>(element.point2d_index));
      if (!ray.valid) continue;
      point.sights.emplace_back(model.images.at(element.image_id).cam_from_model, ray);
    }
    common.emplace(row, std::move(point));
  }
  return common;
}

void ViewPlacer::Impl::AnalysePairs(const std::vector<uint32_t>& image_ids,
                                    const SparseModel& model) {
  struct Job {
    std::pair<uint32_t, uint32_t> key;
    std::vector<RayMatch> matches;
    HypothesisOptions options;
    TwoViewAnalysis analysis;
  };
  std::vector<Job> jobs;
  for (const uint32_t image_id : image_ids) {
    std::vector<const DatabasePair*> pairs = RegisteredPairs(image_id, model);
    if (static_cast<int>(pairs.size()) > options.max_neighbors) pairs.resize(options.max_neighbors);
    for (const DatabasePair* pair : pairs) {
      const uint32_t left_id = Other(*pair, image_id);
      if (analyses.count({image_id, left_id}) > 0) continue;
      jobs.push_back({{image_id, left_id}, MatchesFrom(*pair, left_id), PairOptions(*pair), {}});
    }
  }
  ParallelFor(num_threads, 0, static_cast<int>(jobs.size()),
              [&](int i) { jobs[i].analysis = AnalysePair(jobs[i].matches, jobs[i].options); });
  for (Job& job : jobs) analyses[job.key] = std::move(job.analysis);
}

// The pose and the points that the view sees, with the registered views held (thesis 6.2.3).
Rigid ViewPlacer::Impl::Refine(const Rigid& view_from_left, uint32_t left_id,
                               const SparseModel& model, const std::vector<RayMatch>& matches,
                               const TwoViewHypothesis& hypothesis,
                               const std::map<int, CommonPoint>& common) {
  const Rigid& left_from_model = model.images.at(left_id).cam_from_model;
  SeedGeometry geometry;
  geometry.views_from_left = {Rigid()};
  std::map<uint32_t, int> view_of_image = {{left_id, 0}};
  std::vector<SeedObservation> observations;
  std::vector<Ray> rays_in_view;  // one per point
  int num_common = 0;
  for (const auto& [row, point] : common) {
    const Eigen::Vector3d x_in_left = left_from_model * point.point->x_in_model;
    if (!(x_in_left.z() > 1e-9) || num_common++ >= kMaxCommonPoints) continue;
    const int index = static_cast<int>(geometry.points.size());
    geometry.points.emplace_back(x_in_left.x() / x_in_left.z(), x_in_left.y() / x_in_left.z(),
                                 1 / x_in_left.z());
    rays_in_view.push_back(point.ray);
    for (const TrackElement& element : point.point->track) {
      const auto [entry, is_new] = view_of_image.emplace(
          element.image_id, static_cast<int>(geometry.views_from_left.size()));
      if (is_new) {
        geometry.views_from_left.push_back(model.images.at(element.image_id).cam_from_model *
                                           left_from_model.Inverse());
      }
      const Ray ray = RayOf(element.image_id, static_cast<int>(element.point2d_index));
      if (ray.valid) observations.push_back({entry->second, index, ray});
    }
  }
  // The pair's other points tell of its motion; those in common are there already.
  const double scale = view_from_left.translation.norm();
  const int num_inliers = static_cast<int>(hypothesis.inliers.size());
  for (const int k : RandomSubset(num_inliers, kMaxPairPoints, pair_options.random_seed)) {
    const RayMatch& match = matches[hypothesis.inliers[k]];
    if (common.count(match.right_row) > 0) continue;
    InverseDepthPoint point = hypothesis.points[k];
    point.z() /= scale;
    observations.push_back({0, static_cast<int>(geometry.points.size()), match.left});
    geometry.points.push_back(point);
    rays_in_view.push_back(match.right);
  }
  SeedBundleOptions bundle;
  bundle.loss_scale_px = 2 * pair_options.keypoint_noise_px;
  bundle.num_fixed_views = static_cast<int>(geometry.views_from_left.size());
  if (bundle.num_fixed_views < 2) return view_from_left;  // nothing holds the scale
  geometry.views_from_left.push_back(view_from_left);
  for (size_t i = 0; i < rays_in_view.size(); ++i) {
    observations.push_back({bundle.num_fixed_views, static_cast<int>(i), rays_in_view[i]});
  }
  const SeedBundleResult adjusted = AdjustSeed(geometry, observations, bundle);
  return adjusted.usable ? adjusted.geometry.views_from_left.back() : view_from_left;
}

// extent: of the fitting points in the photo, share of its diagonal.
void ViewPlacer::Impl::Score(const std::map<int, CommonPoint>& common, Candidate* candidate,
                             int* num_fitting, double* extent) const {
  const double limit2 = std::pow(kPoseErrorFactor * pair_options.MaxErrorPx(), 2);
  Eigen::AlignedBox2d box;
  *num_fitting = 0;
  candidate->cost = 0;
  for (const auto& [row, point] : common) {
    const double error2 = std::min(limit2, GrowthByView(point, candidate->view.cam_from_model));
    candidate->cost += error2;
    if (!(error2 < limit2)) continue;
    ++*num_fitting;
    box.extend(point.x_in_img);
  }
  const Camera& camera =
      images->cameras().at(images->images().at(candidate->view.image_id).camera_id);
  *extent = box.isEmpty() ? 0 : box.diagonal().norm() / std::hypot(camera.width, camera.height);
}

// Poses by one neighbour that fit; `problem` tells why there are none.
std::vector<Candidate> ViewPlacer::Impl::Candidates(uint32_t image_id, const DatabasePair& pair,
                                                    const SparseModel& model,
                                                    const std::map<int, CommonPoint>& common,
                                                    std::string* problem) {
  const uint32_t left_id = Other(pair, image_id);
  const Rigid& left_from_model = model.images.at(left_id).cam_from_model;
  const TwoViewAnalysis& analysis = analyses.at({image_id, left_id});
  const std::vector<RayMatch> matches = MatchesFrom(pair, left_id);
  std::vector<Candidate> candidates;
  if (analysis.hypotheses.empty()) *problem = analysis.problem;
  for (const TwoViewHypothesis& hypothesis : analysis.hypotheses) {
    std::vector<double> ratios;
    for (size_t i = 0; i < hypothesis.inliers.size(); ++i) {
      const auto found = common.find(matches[hypothesis.inliers[i]].right_row);
      if (found == common.end()) continue;
      const double depth = (left_from_model * found->second.point->x_in_model).z();
      // Thesis 6.2.1: s = beta / alpha, alpha = 1 / inverse depth.
      if (depth > 0) ratios.push_back(depth * hypothesis.points[i].z());
    }
    if (static_cast<int>(ratios.size()) < options.min_common_points) {
      *problem = "only " + std::to_string(ratios.size()) + " points in common with the model, " +
                 std::to_string(options.min_common_points) + " are needed for the scale";
      continue;
    }
    const RatioAverage average = AverageRatios(ratios);
    if (!(average.spread <= options.max_scale_spread)) {
      *problem = "the scale differs by " + Percent(average.spread) + " between the " +
                 std::to_string(ratios.size()) + " common points";
      continue;
    }
    Candidate candidate;
    candidate.view.image_id = image_id;
    candidate.view.neighbor_id = left_id;
    candidate.view.scale_spread = average.spread;
    const Rigid start = ChainPose(Rigid(), hypothesis.right_from_left, average.scale);
    const Rigid refined = Refine(start, left_id, model, matches, hypothesis, common);
    candidate.baseline = refined.translation.norm();
    candidate.view.cam_from_model = refined * left_from_model;
    candidate.view.num_inliers =
        static_cast<int>(EvaluatePose(UnitBaseline(refined), matches, pair_options).inliers.size());
    int num_fitting = 0;
    double extent = 0;
    Score(common, &candidate, &num_fitting, &extent);
    candidate.view.num_common_points = num_fitting;
    if (num_fitting < options.min_common_points ||
        num_fitting < kMinShareOfPoints * static_cast<double>(common.size())) {
      *problem = "only " + std::to_string(num_fitting) + " of " + std::to_string(common.size()) +
                 " common points fit its pose";
    } else if (extent < kMinExtent) {
      *problem = "its common points lie within " + Percent(extent) + " of the photo's diagonal";
    } else if (candidate.view.num_inliers < options.min_num_inliers ||
               candidate.view.num_inliers <
                   kMinShareKept * static_cast<double>(hypothesis.inliers.size())) {
      *problem = "its matches and its common points contradict each other";
    } else {
      candidates.push_back(candidate);
    }
  }
  return candidates;
}

ChainedView ViewPlacer::Impl::PlaceView(uint32_t image_id, const SparseModel& model) {
  ChainedView none;
  none.image_id = image_id;
  std::vector<const DatabasePair*> pairs = RegisteredPairs(image_id, model);
  if (pairs.empty()) {
    none.problem = "no registered photo shares " + std::to_string(options.min_num_inliers) +
                   " verified matches with it";
    return none;
  }
  if (static_cast<int>(pairs.size()) > options.max_neighbors) pairs.resize(options.max_neighbors);
  const std::map<int, CommonPoint> common = CommonPoints(image_id, model);
  std::vector<Candidate> candidates;
  for (const DatabasePair* pair : pairs) {
    std::string problem;
    for (Candidate& candidate : Candidates(image_id, *pair, model, common, &problem)) {
      candidates.push_back(std::move(candidate));
    }
    if (problem.empty() || !none.problem.empty()) continue;
    none.neighbor_id = Other(*pair, image_id);
    none.problem = "by " + images->images().at(none.neighbor_id).name + ": " + problem;
  }
  if (candidates.empty()) return none;
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  ChainedView best = candidates[0].view;
  best.confidence = std::numeric_limits<double>::infinity();
  const double floor = 1e-3 + 1e-3 * candidates[0].cost;
  for (const Candidate& rival : candidates) {
    if (SamePose(rival, candidates[0])) continue;
    best.confidence = (rival.cost + floor) / (candidates[0].cost + floor);
    break;
  }
  if (best.confidence < options.min_confidence) {
    best.problem = "planar-ambiguous: two poses fit about equally well";
  }
  return best;
}

// Truncated cost of a pair's matches under the poses of a model, px^2.
double ViewPlacer::Impl::EpipolarCost(const DatabasePair& pair, const SparseModel& model,
                                      size_t* count) {
  const Rigid right_from_left = model.images.at(pair.image_id2).cam_from_model *
                                model.images.at(pair.image_id1).cam_from_model.Inverse();
  const Eigen::Matrix3d essential = EssentialFromPose(UnitBaseline(right_from_left));
  const double limit2 = std::pow(pair_options.MaxEpipolarErrorPx(), 2);
  double cost = 0;
  for (const RayMatch& match : images->Matches(pair)) {
    const double error2 = EpipolarError2(essential, match);
    cost += error2 < limit2 ? error2 : limit2;
    ++*count;
  }
  return cost;
}

ViewPlacer::ViewPlacer(MatchedImages* images, const ChainOptions& options,
                       const HypothesisOptions& pair, int num_threads)
    : impl_(std::make_unique<Impl>()) {
  impl_->images = images;
  impl_->options = options;
  impl_->pair_options = pair;
  impl_->pair_options.min_num_inliers = options.min_num_inliers;
  impl_->num_threads = num_threads;
  for (const DatabasePair& database_pair : images->pairs()) {
    impl_->pairs_of_image[database_pair.image_id1].push_back(&database_pair);
    impl_->pairs_of_image[database_pair.image_id2].push_back(&database_pair);
  }
}

ViewPlacer::~ViewPlacer() = default;

std::vector<ChainedView> ViewPlacer::Place(const std::vector<uint32_t>& image_ids,
                                           const SparseModel& model) {
  impl_->AnalysePairs(image_ids, model);
  std::vector<ChainedView> views;
  for (const uint32_t image_id : image_ids) views.push_back(impl_->PlaceView(image_id, model));
  return views;
}

std::string ViewPlacer::ProblemOf(const ChainedView& view, const SparseModel& before,
                                  const SparseModel& after) {
  const SparseImage& image = after.images.at(view.image_id);
  const auto num_points =
      image.point3d_ids.size() -
      std::count(image.point3d_ids.begin(), image.point3d_ids.end(), kInvalidPoint3dId);
  std::set<uint32_t> neighbors;
  int num_inliers = 0;
  for (const DatabasePair* pair : impl_->RegisteredPairs(view.image_id, before)) {
    const uint32_t left_id = Impl::Other(*pair, view.image_id);
    neighbors.insert(left_id);
    if (left_id != view.neighbor_id) continue;
    const Rigid pose = image.cam_from_model * after.images.at(left_id).cam_from_model.Inverse();
    num_inliers = static_cast<int>(
        EvaluatePose(UnitBaseline(pose), impl_->MatchesFrom(*pair, left_id), impl_->pair_options)
            .inliers.size());
  }
  double cost_before = 0, cost_after = 0;
  size_t count = 0;
  for (const uint32_t left_id : neighbors) {
    for (const DatabasePair* pair : impl_->pairs_of_image[left_id]) {
      if (pair->image_id1 != left_id || neighbors.count(pair->image_id2) == 0) continue;
      cost_before += impl_->EpipolarCost(*pair, before, &count);
      cost_after += impl_->EpipolarCost(*pair, after, &count);
    }
  }
  const double noise2 = std::pow(impl_->pair_options.keypoint_noise_px, 2);
  if (static_cast<int>(num_points) < impl_->options.min_num_inliers) {
    return "only " + std::to_string(num_points) + " points held after it";
  }
  if (num_inliers < kMinShareKept * view.num_inliers) {
    return "its matches no longer fit after the adjustment";
  }
  if (cost_after >
      kMaxGrowth * cost_before + (kMaxGrowth - 1) * noise2 * static_cast<double>(count) / 2) {
    return "the errors of its neighbours jumped with it";
  }
  return "";
}

}  // namespace roomtex
