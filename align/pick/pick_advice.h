#pragma once
// What the page says about the picks, in sentences.

#include <string>
#include <vector>

#include "align/pick/pick_solution.h"

namespace roomtex {

// Metres along the ray of the nearest scan; 0 where nothing can be said, infinite where no scanner
// looked.
double DistanceFromSurface(const PickScene& scene, const Eigen::Vector3d& x_in_scan);

// With a capital letter and a full stop.
std::string AsSentence(std::string text);

// Exchanged, mirrored, bad. `on`: where the reviewed picks stand among all, which is their number
// (from 1) in the sentences.
std::vector<std::string> ReviewWarnings(const PickReview& review, const std::vector<int>& on,
                                        const std::string& azimuth);
// The same of picks that place the model together, no photo having enough of its own.
std::vector<std::string> SpreadWarnings(const SpreadPickFit& spread, const std::vector<int>& on,
                                        const std::string& azimuth);
// Nearly on one line, on one plane, crowded in a part of the photo.
std::vector<std::string> SpreadWarnings(const PointPairs& pairs, const Camera& camera);
// The picks of the photo agree with each other, but not with where the other photos have it.
std::string ModelWarning(const PickReview& review, const PhotoState& photo);
// Picks whose points do not lie on the scan that was read, perhaps because it is a mirror image of
// the one they were made on. picks: all; `on`: indices of those of one photo.
std::vector<std::string> SurfaceWarnings(const std::vector<SessionPick>& picks,
                                         const std::vector<int>& on, const PickScene& scene);
// What to do now.
std::string NextStep(const std::vector<SessionPick>& picks, const PickSolution& solution,
                     const PickScene& scene);

}  // namespace roomtex
