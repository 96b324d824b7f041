#pragma once
// Whether single photos of a model that lies in the scan are to be believed: one of another room,
// one that a repeated pattern has put elsewhere, or one that stands wrong agrees with nobody,
// though the model as a whole is right.

#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <string>

#include "align/surface/scan_patches.h"
#include "align/trust/free_space.h"
#include "align/trust/photo_detail.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

inline constexpr double kUnknownShare = std::numeric_limits<double>::quiet_NaN();

struct PhotoVerdict {
  size_t num_points = 0;  // sparse points that it has a keypoint for
  // Of the points that two others of the largest group of photos that find each other's points
  // found, and that this one ought to have found, too, how many it did find. It ought to: a point
  // in its picture, nothing of the scan in front, that another photo saw from about the same side
  // and distance among about as many keypoints.
  int num_expected = 0;
  double sight_share = kUnknownShare;
  // How unevenly what it found lies over the picture: chi-square per degree of freedom over cells.
  // A blurred photo finds little anywhere, one of another room nothing where that differs.
  double unevenness = kUnknownShare;
  // Of its points, where the scan knows: the share on its surface. A point that many photos see
  // says little of one of them, and counts less: twice the inverse of their number.
  double surface_share = kUnknownShare;
  // Share of its verified matches that obey the model's poses; unknown without a database.
  double match_support = kUnknownShare;
  std::string duplicate_of;  // a photo that shows the same from the same place; "" = none
  // What the doubt rests on where what photos show in detail may overrule it: it lacks what others
  // found, or is one of a group that finds what each other found and not what the rest did (groups
  // count from 0; -1: of none).
  bool lacks_sights = false;
  int other_room = -1;
  DetailAgreement detail;  // no windows = not asked
  // Why it is not to be believed, a sentence without the photo's name in front; "" = nothing speaks
  // against it.
  std::string doubt;
};

// By image_id, for every photo. aligned: in the scan frame. tolerance: metres, of the surface.
// sigma_px: of a keypoint's coordinate. match_support: as far as it is known (match_support.h), by
// image_id. picked: photos that are known to show what was scanned, as those with picks. Photos are
// compared with what is usual in this model.
std::map<uint32_t, PhotoVerdict> JudgePhotos(const SparseModel& aligned, const ScanPatches& surface,
                                             const FreeSpace& free_space, double tolerance,
                                             double sigma_px,
                                             const std::map<uint32_t, double>& match_support,
                                             const std::set<uint32_t>& picked);

// Ends doubts of photos that show what the others show, though they lack what these found: photos
// taken from far apart are not matched. Of a group that might be of another room all are believed
// or none, by what they show together: where a single right photo is blurred, the others tell.
void BelieveWhatShowsTheSame(const std::map<uint32_t, DetailAgreement>& details,
                             std::map<uint32_t, PhotoVerdict>* photos);

}  // namespace roomtex
