#include "colmap_ext/third_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "core/frames.h"
#include "core/three_point_pose.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Points = std::vector<std::optional<InverseDepthPoint>>;

// Poses of a view that sees three points.
std::vector<Rigid> SolveThreePoints(const Points& points,
                                    const std::array<const ThirdView::Sighting*, 3>& sample) {
  std::array<Eigen::Vector3d, 3> x_in_left, rays;
  for (int i = 0; i < 3; ++i) {
    x_in_left[i] = PointInLeft(*points[sample[i]->match]);
    rays[i] = sample[i]->ray.x.homogeneous();
  }
  return SolveThreePointPose(x_in_left, rays);
}

// Truncated cost of a view's sightings.
double ViewCost(const Points& points, const std::vector<const ThirdView::Sighting*>& sightings,
                const Rigid& view_from_left, double max_error_px, int* num_inliers) {
  const double limit2 = max_error_px * max_error_px;
  double cost = 0;
  *num_inliers = 0;
  for (const ThirdView::Sighting* sighting : sightings) {
    const auto x = ProjectPoint(view_from_left, *points[sighting->match]);
    const double error2 = x ? sighting->ray.PixelError(*x).squaredNorm() : limit2;
    if (error2 < limit2) ++*num_inliers;
    cost += std::min(error2, limit2);
  }
  return cost;
}

struct PoseMode {
  Rigid view_from_left;
  double cost = std::numeric_limits<double>::infinity();
};

// The best pose and the best one that looks from elsewhere: on a plane they may be hard to tell
// apart before refinement.
class BestModes {
 public:
  void Offer(const Rigid& pose, double cost) {
    if (Near(pose, first_.view_from_left) || !std::isfinite(first_.cost)) {
      if (cost < first_.cost) first_ = {pose, cost};
    } else if (cost < first_.cost) {
      second_ = first_;
      first_ = {pose, cost};
    } else if (cost < second_.cost) {
      second_ = {pose, cost};
    }
  }
  const PoseMode& first() const { return first_; }
  const PoseMode& second() const { return second_; }

 private:
  static bool Near(const Rigid& a, const Rigid& b) {
    return RotationAngle(a.rotation, b.rotation) < RadFromDeg(5);
  }
  PoseMode first_, second_;
};

Rigid RefineView(const Points& points, const std::vector<const ThirdView::Sighting*>& sightings,
                 const Rigid& start, const ThirdViewOptions& options) {
  SeedGeometry geometry;
  geometry.views_from_left = {Rigid(), start};
  std::vector<SeedObservation> observations;
  for (const ThirdView::Sighting* sighting : sightings) {
    observations.push_back({1, static_cast<int>(geometry.points.size()), sighting->ray});
    geometry.points.push_back(*points[sighting->match]);
  }
  SeedBundleOptions bundle;
  bundle.loss_scale_px = 2 * options.pair.keypoint_noise_px;
  return AdjustView(geometry, 1, observations, bundle);
}

// One hypothesis with all the views it could place.
struct JointModel {
  bool usable = false;
  SeedGeometry geometry;                // views: left, right, then those placed
  std::vector<int> point_of_match;      // -1 = none
  std::vector<int> view_of_third_view;  // -1 = not placed
};

std::vector<SeedObservation> JointObservations(const std::vector<RayMatch>& matches,
                                               const std::vector<ThirdView>& views,
                                               const JointModel& model) {
  std::vector<SeedObservation> observations;
  for (size_t m = 0; m < matches.size(); ++m) {
    const int point = model.point_of_match[m];
    if (point < 0) continue;
    observations.push_back({0, point, matches[m].left});
    observations.push_back({1, point, matches[m].right});
  }
  for (size_t k = 0; k < views.size(); ++k) {
    const int view = model.view_of_third_view[k];
    if (view < 0) continue;
    for (const ThirdView::Sighting& sighting : views[k].sightings) {
      const int point = model.point_of_match[sighting.match];
      if (point >= 0) observations.push_back({view, point, sighting.ray});
    }
  }
  return observations;
}

JointModel BuildJointModel(const std::vector<RayMatch>& matches,
                           const TwoViewHypothesis& hypothesis, const std::vector<ThirdView>& views,
                           const std::vector<bool>& use_match, const ThirdViewOptions& options) {
  JointModel model;
  model.geometry.views_from_left = {Rigid(), hypothesis.right_from_left};
  model.point_of_match.assign(matches.size(), -1);
  model.view_of_third_view.assign(views.size(), -1);
  Points points(matches.size());
  for (size_t i = 0; i < hypothesis.inliers.size(); ++i) {
    const int match = hypothesis.inliers[i];
    points[match] = hypothesis.points[i];
    if (!use_match[match]) continue;
    model.point_of_match[match] = static_cast<int>(model.geometry.points.size());
    model.geometry.points.push_back(hypothesis.points[i]);
  }
  for (size_t k = 0; k < views.size(); ++k) {
    const auto pose = PlaceView(points, views[k], options);
    if (!pose) continue;
    model.view_of_third_view[k] = static_cast<int>(model.geometry.views_from_left.size());
    model.geometry.views_from_left.push_back(*pose);
  }
  SeedBundleOptions bundle;
  bundle.loss_scale_px = 2 * options.pair.keypoint_noise_px;
  const SeedBundleResult adjusted =
      AdjustSeed(model.geometry, JointObservations(matches, views, model), bundle);
  model.usable = adjusted.usable;
  if (adjusted.usable) model.geometry = adjusted.geometry;
  return model;
}

// Squared errors of every observation that any hypothesis could explain, truncated: of the pair's
// used matches (left, right) and of every third view's sightings, in a fixed order.
std::vector<double> TruncatedErrors(const std::vector<RayMatch>& matches,
                                    const std::vector<ThirdView>& views,
                                    const std::vector<bool>& use_match, const JointModel& model,
                                    double max_error_px) {
  const double limit2 = max_error_px * max_error_px;
  std::vector<double> errors;
  const auto add = [&](int view, int point, const Ray& ray) {
    double error2 = limit2;
    if (model.usable && view >= 0 && point >= 0) {
      const auto x =
          ProjectPoint(model.geometry.views_from_left[view], model.geometry.points[point]);
      if (x) error2 = std::min(limit2, ray.PixelError(*x).squaredNorm());
    }
    errors.push_back(error2);
  };
  for (size_t m = 0; m < matches.size(); ++m) {
    if (!use_match[m]) continue;
    add(0, model.point_of_match[m], matches[m].left);
    add(1, model.point_of_match[m], matches[m].right);
  }
  for (size_t k = 0; k < views.size(); ++k) {
    for (const ThirdView::Sighting& sighting : views[k].sightings) {
      if (!use_match[sighting.match]) continue;
      add(model.view_of_third_view[k], model.point_of_match[sighting.match], sighting.ray);
    }
  }
  return errors;
}

// At most max_points matches, those that third views see first.
std::vector<bool> ChooseMatches(size_t num_matches, const std::vector<ThirdView>& views,
                                const ThirdViewOptions& options) {
  std::vector<int> num_sightings(num_matches, 0);
  for (const ThirdView& view : views) {
    for (const ThirdView::Sighting& sighting : view.sightings) ++num_sightings[sighting.match];
  }
  // Shuffled once, so that equal ones are not all from one corner of the photo.
  std::vector<int> order = RandomSubset(static_cast<int>(num_matches),
                                        static_cast<int>(num_matches), options.pair.random_seed);
  std::mt19937_64 random(options.pair.random_seed);
  for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random() % i]);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return num_sightings[a] > num_sightings[b]; });
  std::vector<bool> use(num_matches, false);
  const size_t limit = static_cast<size_t>(std::max(options.pair.max_points, 1));
  for (size_t i = 0; i < order.size() && i < limit; ++i) use[order[i]] = true;
  return use;
}

}  // namespace

std::optional<Rigid> PlaceView(const Points& points, const ThirdView& view,
                               const ThirdViewOptions& options) {
  std::vector<const ThirdView::Sighting*> sightings;
  for (const ThirdView::Sighting& sighting : view.sightings) {
    const auto& point = points[sighting.match];
    if (point && point->z() > 1e-6) sightings.push_back(&sighting);
  }
  const int count = static_cast<int>(sightings.size());
  if (count < std::max(options.min_sightings, 4)) return std::nullopt;
  const double max_error_px = options.pair.MaxErrorPx();
  std::mt19937_64 random(options.pair.random_seed + view.image_id);
  BestModes modes;
  int needed = 200;
  for (int sample = 0; sample < needed; ++sample) {
    const int a = static_cast<int>(random() % count), b = static_cast<int>(random() % count),
              c = static_cast<int>(random() % count);
    if (a == b || a == c || b == c) continue;
    for (const Rigid& pose : SolveThreePoints(points, {sightings[a], sightings[b], sightings[c]})) {
      // Noise of three points is magnified over the picture: a wider limit while searching.
      int num_inliers = 0;
      modes.Offer(pose, ViewCost(points, sightings, pose, 2 * max_error_px, &num_inliers));
      const double clean = std::pow(1.0 * num_inliers / count, 3);
      if (clean > 1e-9) needed = std::min(needed, 40 + static_cast<int>(10 / clean));
    }
  }
  std::optional<Rigid> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const PoseMode* mode : {&modes.first(), &modes.second()}) {
    if (!std::isfinite(mode->cost)) continue;
    const Rigid refined = RefineView(points, sightings, mode->view_from_left, options);
    int num_inliers = 0;
    const double cost = ViewCost(points, sightings, refined, max_error_px, &num_inliers);
    if (num_inliers < options.min_sightings || num_inliers < options.min_share * count) continue;
    if (cost < best_cost) {
      best_cost = cost;
      best = refined;
    }
  }
  return best;
}

ThirdViewDecision DecideByThirdViews(const std::vector<RayMatch>& matches,
                                     const std::vector<TwoViewHypothesis>& hypotheses,
                                     const std::vector<ThirdView>& views,
                                     const ThirdViewOptions& options) {
  ThirdViewDecision decision;
  if (hypotheses.empty()) return decision;
  const std::vector<bool> use_match = ChooseMatches(matches.size(), views, options);
  const double max_error_px = options.pair.MaxErrorPx();
  const double limit2 = max_error_px * max_error_px;
  std::vector<std::vector<double>> errors;
  for (const TwoViewHypothesis& hypothesis : hypotheses) {
    const JointModel model = BuildJointModel(matches, hypothesis, views, use_match, options);
    errors.push_back(TruncatedErrors(matches, views, use_match, model, max_error_px));
    HypothesisVerdict verdict;
    verdict.right_from_left = model.geometry.views_from_left[1];
    for (const int view : model.view_of_third_view) {
      verdict.views_from_left.emplace_back();
      if (view >= 0) verdict.views_from_left.back() = model.geometry.views_from_left[view];
    }
    decision.verdicts.push_back(verdict);
  }
  // Observations that no hypothesis explains are mismatches and say nothing.
  size_t num_explained = 0;
  for (size_t i = 0; i < errors[0].size(); ++i) {
    const bool explained =
        std::any_of(errors.begin(), errors.end(), [&](const auto& e) { return e[i] < limit2; });
    if (!explained) continue;
    ++num_explained;
    for (size_t h = 0; h < errors.size(); ++h) decision.verdicts[h].cost += errors[h][i];
  }
  double best = std::numeric_limits<double>::infinity(), second = best;
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    const double cost = decision.verdicts[h].cost;
    if (cost < best) {
      second = best;
      best = cost;
      decision.best = static_cast<int>(h);
    } else {
      second = std::min(second, cost);
    }
  }
  for (const auto& view : decision.verdicts[decision.best].views_from_left) {
    if (view) ++decision.num_views;
  }
  // Keeps the ratio finite on data without noise.
  const double floor = 1e-3 * limit2 * static_cast<double>(num_explained) + 1e-12;
  const bool any_view_placed =
      std::any_of(decision.verdicts.begin(), decision.verdicts.end(), [](const auto& verdict) {
        return std::any_of(verdict.views_from_left.begin(), verdict.views_from_left.end(),
                           [](const auto& view) { return view.has_value(); });
      });
  if (any_view_placed) decision.confidence = (second + floor) / (best + floor);
  return decision;
}

}  // namespace roomtex
