#include "colmap_ext/match_support.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "colmap_ext/two_view_geometry.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// An epipolar error of a model is that of its keypoints and that of its poses.
constexpr double kPoseErrorFactor = 2;

// Below this share a photo is doubtful even if all of them are alike.
constexpr double kLeastSupport = 0.4;

}  // namespace

Rigid ModelMotion(const SparseModel& model, const DatabasePair& pair) {
  Rigid motion = model.images.at(pair.image_id2).cam_from_model *
                 model.images.at(pair.image_id1).cam_from_model.Inverse();
  motion.translation.normalize();
  return motion;
}

std::map<uint32_t, MatchCount> CountObeyingMatches(MatchedImages* images, const SparseModel& model,
                                                   const HypothesisOptions& pair_options) {
  const double limit2 = std::pow(kPoseErrorFactor * pair_options.MaxEpipolarErrorPx(), 2);
  std::map<uint32_t, MatchCount> counts;
  for (const DatabasePair& pair : images->pairs()) {
    if (static_cast<int>(pair.matches.size()) < pair_options.min_num_inliers) continue;
    if (model.images.count(pair.image_id1) == 0 || model.images.count(pair.image_id2) == 0) {
      continue;
    }
    const Eigen::Matrix3d essential = EssentialFromPose(ModelMotion(model, pair));
    const std::vector<RayMatch> matches = images->Matches(pair);
    const auto num_obeying = std::count_if(
        matches.begin(), matches.end(),
        [&](const RayMatch& match) { return EpipolarError2(essential, match) < limit2; });
    if (matches.empty()) continue;
    for (const uint32_t image_id : {pair.image_id1, pair.image_id2}) {
      counts[image_id].num_obeying += static_cast<size_t>(num_obeying);
      counts[image_id].num_matches += matches.size();
    }
  }
  return counts;
}

std::map<uint32_t, double> MatchSupport(const Database& database, const SparseModel& model,
                                        const HypothesisOptions& pair_options) {
  // The model's photos under the database's ids, and its pairs of them.
  SparseModel poses;
  poses.cameras = model.cameras;
  std::map<uint32_t, DatabaseImage> images;
  std::map<uint32_t, uint32_t> id_of;  // in the model
  for (const auto& [id, row] : database.ReadImages()) {
    const SparseImage* const image = model.FindImage(row.name);
    if (image == nullptr) continue;
    images[id] = {id, image->camera_id, row.name};
    poses.images[id] = {id, image->camera_id, row.name, image->cam_from_model, {}, {}};
    id_of[id] = image->image_id;
  }
  std::vector<DatabasePair> pairs = database.ReadPairs(pair_options.min_num_inliers);
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(),
                             [&](const DatabasePair& pair) {
                               return images.count(pair.image_id1) == 0 ||
                                      images.count(pair.image_id2) == 0;
                             }),
              pairs.end());
  MatchedImages matched(model.cameras, std::move(images), std::move(pairs),
                        [&](uint32_t id) { return database.ReadKeypoints(id); });
  std::map<uint32_t, double> support;
  for (const auto& [id, count] : CountObeyingMatches(&matched, poses, pair_options)) {
    support[id_of.at(id)] = count.Share();
  }
  return support;
}

double SupportLimit(const std::map<uint32_t, double>& support, double min_support) {
  if (support.empty()) return 0;
  std::vector<double> shares;
  for (const auto& [id, share] : support) shares.push_back(share);
  // The better photos tell what the matches are worth; the median may be dragged down by what is
  // looked for.
  return std::max(kLeastSupport, min_support * AtRank(&shares, shares.size() * 3 / 4));
}

}  // namespace roomtex
