#include "align/clicks/pick_view.h"

#include <map>

namespace roomtex {
namespace {

PointPairs PairsOf(const std::vector<Pick>& picks, const std::vector<int>& indices) {
  const int n = static_cast<int>(indices.size());
  PointPairs pairs{Eigen::Matrix2Xd(2, n), Eigen::Matrix3Xd(3, n), Eigen::VectorXd(n)};
  for (int i = 0; i < n; ++i) {
    pairs.x_in_img.col(i) = picks[indices[i]].x_in_img;
    pairs.x_in_scan.col(i) = picks[indices[i]].x_in_scan;
    pairs.weight[i] = picks[indices[i]].weight;
  }
  return pairs;
}

// Three points fix a pose but for a choice, unless they lie on one line, and no further one takes
// that away: what else FindLayoutProblem() says of fewer than six makes the choice harder only.
std::string LayoutProblemOf(const PointPairs& pairs, const Camera& camera,
                            const PickReviewOptions& options) {
  if (pairs.size() >= kMinPicksPerPhoto) return FindLayoutProblem(pairs, camera, options);
  const Eigen::Vector3d extents = PrincipalExtents(pairs.x_in_scan);
  if (extents[1] > options.min_line_share * extents[0]) return "";
  return "the picks lie on one straight line, around which the camera could turn freely; pick a "
         "point beside it";
}

}  // namespace

std::vector<PickView> ReviewViews(const SparseModel& model, const std::vector<Pick>& picks,
                                  int min_picks, const PickReviewOptions& options,
                                  const PickReviewer& reviewer) {
  std::map<std::string, std::vector<int>> by_name;
  for (size_t i = 0; i < picks.size(); ++i) {
    if (!(picks[i].weight > 0)) continue;
    by_name[picks[i].image_name].push_back(static_cast<int>(i));
  }
  std::vector<PickView> views;
  for (const auto& [name, indices] : by_name) {
    if (static_cast<int>(indices.size()) < min_picks) continue;
    PickView view{name, model.FindImage(name), indices, PairsOf(picks, indices), "", {}};
    const Camera& camera = model.cameras.at(view.image->camera_id);
    view.layout_problem = LayoutProblemOf(view.pairs, camera, options);
    if (view.layout_problem.empty()) {
      view.review = reviewer(name, CameraProjection(camera), view.pairs);
    }
    views.push_back(std::move(view));
  }
  return views;
}

std::vector<PickView> ReviewViews(const SparseModel& model, const std::vector<Pick>& picks,
                                  const PickReviewOptions& options) {
  return ReviewViews(
      model, picks, kMinPicksPerPhoto, options,
      [&](const std::string&, const CameraProjection& projection, const PointPairs& pairs) {
        return ReviewPicks(projection, pairs, options);
      });
}

PoseChoice ChoosePoseOf(const PickView& view, const ScaleOptions& options, int min_features,
                        const ScaleOfPhoto& scale_of_photo) {
  return ChoosePose(view.review.poses, options, min_features,
                    [&](const Rigid& cam_from_scan, const ScaleOptions& scale_options) {
                      return scale_of_photo(*view.image, cam_from_scan, scale_options);
                    });
}

}  // namespace roomtex
