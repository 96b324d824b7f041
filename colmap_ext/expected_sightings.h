#pragma once
// What the photos of a sparse model ought to show: points that others found, in the picture, with
// nothing in front, seen by another photo from about the same side and distance among about as many
// keypoints. Right photos miss some of them; a photo of another room, however alike, misses all
// that the rooms have not in common. (Missing correspondences as evidence: Zach, Irschara and
// Bischof 2008, "What Can Missing Correspondences Tell Us About 3D Structure and Motion?")

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// A point that a photo ought to show.
struct ExpectedSighting {
  Eigen::Vector2d x_in_img = Eigen::Vector2d::Zero();
  bool is_found = false;            // the photo does show it
  std::vector<uint32_t> witnesses;  // other photos that saw it as this one would, by image_id
  double num_like = 1;  // points of the model that it stands for, of which it was chosen
};
using ExpectedSightings = std::map<uint32_t, std::vector<ExpectedSighting>>;  // by image_id

// Whether something is known to stand between a photo and a point of the model that it would have
// at x_in_img.
using HidesPoint = std::function<bool(const SparseImage& image, const Eigen::Vector2d& x_in_img,
                                      const Eigen::Vector3d& x_in_model)>;
// By what the photo itself has round there: points that are much nearer, and none about as far.
// model must outlive it.
HidesPoint HiddenByOwnPoints(const SparseModel& model);

// Of each photo of the model, or of those asked for, an even choice of at most some 400. What
// photos in `not_believed` found, others need not show.
ExpectedSightings FindExpectedSightings(const SparseModel& model, const HidesPoint& hides,
                                        const std::set<uint32_t>& not_believed);
ExpectedSightings FindExpectedSightings(const SparseModel& model, const HidesPoint& hides,
                                        const std::set<uint32_t>& not_believed,
                                        const std::set<uint32_t>& asked);

// How much of what a photo ought to show it does show. unevenness: how unevenly that lies over the
// picture, chi-square per degree of freedom over cells: a blurred photo finds little anywhere, one
// of another room nothing where that differs. NaN where it cannot be told.
struct SightSummary {
  int num_expected = 0;
  double share = 0, unevenness = 0;
};
SightSummary SummarizeSightings(const std::vector<ExpectedSighting>& expected,
                                const Camera& camera);

// Of fewer common points two photos say nothing of each other.
inline constexpr int kMinExpectedOfPair = 20;

// Of what one of two photos saw the other ought to show so many, and shows so many.
struct CommonSightings {
  int num_expected = 0, num_found = 0;
  double Share() const { return static_cast<double>(num_found) / num_expected; }
};
// By image_id, the smaller first.
using CommonOfPairs = std::map<std::pair<uint32_t, uint32_t>, CommonSightings>;
CommonOfPairs CountCommonSightings(const ExpectedSightings& expected);

}  // namespace roomtex
