#include "align/trust/photo_verdict.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <vector>

#include <fmt/core.h>

#include "align/fit/similarity_fit.h"
#include "colmap_ext/expected_sightings.h"
#include "colmap_ext/lookalike_rooms.h"
#include "colmap_ext/match_support.h"
#include "colmap_ext/view_graph.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Metres and share of the distance; what lies in front of a point by more hides it.
constexpr double kInFrontBy = 0.05, kInFrontShare = 0.02;

// A photo is doubtful that found less than this share of what photos usually find here, unevenly
// over its picture; or hardly anything, where that cannot be told. Photos of another room with the
// same walls (eight, of two rooms): 0.25 to 0.45 of the median with an unevenness of 3.1 to 9.2,
// and 0.14 to 0.19 with 1.2 to 2.3. Right photos, blurred by the hand: 0.21 and 0.24 (desk, 0.7 and
// 1.2), 0.45 (desk, 2.2), 0.31 (kitchen, 1.1); all others of these 0.5 and more.
constexpr double kLeastSightShare = 0.5, kUneven = 2.5, kHardlyAnything = 0.2;
// Less unevenness will do of a photo that stands apart from the others of this model: strangers at
// 0.22 and 0.23 of the median, 3.2 and 4.2 robust deviations below it, have 2.1 and 2.3. Right ones
// at 0.23 and 0.24 (desk, where shares scatter) are 1.4 to 1.9 deviations below.
constexpr double kRareShare = 0.3, kRareSigmas = 2.5, kUnevenOfRare = 1.5;
// And a little more than half will do where it is all in one part of the picture: strangers at 0.52
// and 0.55 have 7.0 and 7.7. Right ones have 0.95 and more with 5 (kitchen, desk, people in half of
// the photos), 0.75 with 4.1 (blurred), 0.59 with 3.2 (desk).
constexpr double kShareOfPart = 0.6, kUnevenOfPart = 5;
constexpr size_t kMinExpected = 60;
// What a surface share rests on. It says something of the photo, but no doubt follows from it: a
// right photo that looks past what was scanned (desk) has 0.07.
constexpr double kMinJudgedOfPhoto = 10;

// Of rooms that are alike, those of all but the one that photos are known to be of, or the largest:
// the room of each photo of the others.
std::map<uint32_t, int> InOtherRooms(const SparseModel& aligned, const ExpectedSightings& expected,
                                     const std::set<uint32_t>& known) {
  std::vector<std::set<uint32_t>> rooms = FindLookalikeRooms(aligned, expected).rooms;
  const auto num_known = [&](const std::set<uint32_t>& room) {
    return std::count_if(room.begin(), room.end(),
                         [&](uint32_t id) { return known.count(id) > 0; });
  };
  const auto own = std::max_element(rooms.begin(), rooms.end(), [&](const auto& a, const auto& b) {
    return num_known(a) < num_known(b);
  });
  std::map<uint32_t, int> elsewhere;
  for (auto room = rooms.begin(); room != rooms.end(); ++room) {
    if (room == own) continue;
    for (const uint32_t id : *room) elsewhere[id] = static_cast<int>(room - rooms.begin());
  }
  return elsewhere;
}

// Photos that do not belong to the most that find what each other found. Photos of another room
// that came together find each other's points, and lack those of all others, as these lack theirs:
// the shares of both suffer, and do not tell which is which. With those that are `elsewhere`.
std::set<uint32_t> OutsideLargestGroup(const ExpectedSightings& expected,
                                       const std::map<uint32_t, int>& elsewhere) {
  std::map<uint32_t, int> index;
  for (const auto& [id, points] : expected) index.emplace(id, static_cast<int>(index.size()));
  CommonOfPairs pairs = CountCommonSightings(expected);
  for (auto pair = pairs.begin(); pair != pairs.end();) {
    const auto& [id1, id2] = pair->first;
    const bool is_of_room = elsewhere.count(id1) == 0 && elsewhere.count(id2) == 0;
    pair = is_of_room ? std::next(pair) : pairs.erase(pair);
  }
  std::vector<double> shares;
  for (const auto& [pair, common] : pairs) {
    if (common.num_expected >= kMinExpectedOfPair) shares.push_back(common.Share());
  }
  std::set<uint32_t> outside;
  for (const auto& [id, room] : elsewhere) outside.insert(id);
  if (shares.empty()) return outside;
  const double least = kLeastSightShare * Median(&shares);
  DisjointSets sets(static_cast<int>(index.size()));
  for (const auto& [pair, common] : pairs) {
    const bool may_tell = common.num_expected >= kMinExpectedOfPair;
    if (may_tell && common.Share() >= least) sets.Join(index.at(pair.first), index.at(pair.second));
  }
  const int largest = sets.Groups()[0][0];
  for (const auto& [id, i] : index) {
    if (sets.Find(i) != largest) outside.insert(id);
  }
  return outside;
}

// Sets num_expected, sight_share and unevenness; leaves them where fewer than `least` are expected.
void CountSights(const std::vector<ExpectedSighting>& expected, const Camera& camera, size_t least,
                 PhotoVerdict* photo) {
  if (expected.size() < least) {
    if (std::isnan(photo->sight_share)) photo->num_expected = static_cast<int>(expected.size());
    return;
  }
  const SightSummary summary = SummarizeSightings(expected, camera);
  photo->num_expected = summary.num_expected;
  photo->sight_share = summary.share;
  photo->unevenness = summary.unevenness;
}

// Sets surface_share.
void CountOnSurface(const SparseModel& aligned, const ScanPatches& surface,
                    const FreeSpace& free_space, double tolerance, double sigma_px,
                    std::map<uint32_t, PhotoVerdict>* photos) {
  const double reach = std::hypot(tolerance, surface.cell_size());
  std::map<uint32_t, double> judged, on_surface;  // sums of weights
  for (const SurfacePoint& point : FindSurfacePoints(aligned, 2, sigma_px)) {
    const auto nearest = surface.FindNearest(point.x_in_sparse, reach);
    const bool is_on = nearest && std::abs(nearest->distance) < tolerance;
    if (!is_on) {
      // What stands before the surface is known to be off it; behind, and where nobody measured,
      // there may be something.
      if (!free_space.HasStations()) continue;
      const double own = 3 * std::sqrt(point.covariance.trace());
      if (free_space.Locate(point.x_in_sparse, std::max(2 * tolerance, own)) !=
          FreeSpace::Place::kFloating) {
        continue;
      }
    }
    const SparsePoint& sparse = aligned.points.at(point.point3d_id);
    const double weight = 2.0 / static_cast<double>(sparse.track.size());
    for (const TrackElement& element : sparse.track) {
      judged[element.image_id] += weight;
      if (is_on) on_surface[element.image_id] += weight;
    }
  }
  for (auto& [id, photo] : *photos) {
    if (judged[id] >= kMinJudgedOfPhoto) photo.surface_share = on_surface[id] / judged[id];
  }
}

// Of a photo that stands apart, few points that the others found have to do.
void CountSights(const ExpectedSightings& expected, const std::set<uint32_t>& outside,
                 const SparseModel& aligned, std::map<uint32_t, PhotoVerdict>* photos) {
  for (const auto& [id, sightings] : expected) {
    const size_t least = outside.count(id) == 0 ? kMinExpected : kMinExpectedOfPair;
    CountSights(sightings, aligned.cameras.at(aligned.images.at(id).camera_id), least,
                &photos->at(id));
  }
}

// Over the photos where it is known; NaN without any.
struct UsualSights {
  double median = kUnknownShare, sigma = kUnknownShare;  // robust
};
UsualSights UsualSightShare(const std::map<uint32_t, PhotoVerdict>& photos) {
  std::vector<double> shares;
  for (const auto& [id, photo] : photos) {
    if (std::isfinite(photo.sight_share)) shares.push_back(photo.sight_share);
  }
  if (shares.empty()) return {};
  const double median = Median(&shares);
  return {median, kSigmaPerMad * MedianAbsoluteDeviation(shares, median)};
}

bool LacksWhatOthersFound(const PhotoVerdict& photo, const UsualSights& usual) {
  const double share = photo.sight_share;
  if (share < kHardlyAnything * usual.median) return true;
  if (share < kLeastSightShare * usual.median && photo.unevenness > kUneven) return true;
  if (share < kShareOfPart * usual.median && photo.unevenness > kUnevenOfPart) return true;
  return share < kRareShare * usual.median && share < usual.median - kRareSigmas * usual.sigma &&
         photo.unevenness > kUnevenOfRare;
}

}  // namespace

std::map<uint32_t, PhotoVerdict> JudgePhotos(const SparseModel& aligned, const ScanPatches& surface,
                                             const FreeSpace& free_space, double tolerance,
                                             double sigma_px,
                                             const std::map<uint32_t, double>& match_support,
                                             const std::set<uint32_t>& picked) {
  std::map<uint32_t, PhotoVerdict> photos;
  for (const auto& [id, image] : aligned.images) {
    PhotoVerdict& photo = photos[id];
    photo.num_points = static_cast<size_t>(
        std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(),
                      [](uint64_t point) { return point != kInvalidPoint3dId; }));
    const auto support = match_support.find(id);
    if (support != match_support.end()) photo.match_support = support->second;
  }
  CountOnSurface(aligned, surface, free_space, tolerance, sigma_px, &photos);
  const HidesPoint hides = [&](const SparseImage& image, const Eigen::Vector2d&,
                               const Eigen::Vector3d& x) {
    const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
    const Eigen::Vector3d ray = x - centre;
    const double range = ray.norm();
    const auto met = free_space.Look(centre, ray / range);
    return met &&
           (met->x_in_scan - centre).norm() < range - std::max(kInFrontBy, kInFrontShare * range);
  };
  // By what photos found that belong together; what strangers found together the right ones lack.
  ExpectedSightings expected = FindExpectedSightings(aligned, hides, {});
  CountSights(expected, {}, aligned, &photos);
  const std::map<uint32_t, int> elsewhere = InOtherRooms(aligned, expected, picked);
  std::set<uint32_t> outside = OutsideLargestGroup(expected, elsewhere);
  if (!outside.empty()) {
    expected = FindExpectedSightings(aligned, hides, outside);
    CountSights(expected, outside, aligned, &photos);
  }

  const UsualSights usual = UsualSightShare(photos);
  const double least_support = SupportLimit(match_support, kMinSupport);
  for (auto& [id, photo] : photos) {
    if (photo.match_support < least_support) {
      photo.doubt = "only " + Percent(photo.match_support) +
                    " of its verified matches obey the poses of the model (usual here: more than " +
                    Percent(least_support) + "). ";
    } else if (elsewhere.count(id) > 0) {
      photo.other_room = elsewhere.at(id);
      photo.doubt = fmt::format(
          "{} photos show what they find in each other, and not what the rest shows at the same "
          "places: another room that is alike, or this one when things stood otherwise. ",
          elsewhere.size());
    } else if (LacksWhatOthersFound(photo, usual)) {
      photo.lacks_sights = true;
      photo.doubt = "of the sparse points that it ought to show it has only " +
                    Percent(photo.sight_share) + " (usual here: " + Percent(usual.median) + "). ";
    } else {
      continue;
    }
    if (elsewhere.count(id) == 0)
      photo.doubt +=
          "It may show another room, a repeated pattern or things that were moved, or stand wrong.";
  }
  return photos;
}

void BelieveWhatShowsTheSame(const std::map<uint32_t, DetailAgreement>& details,
                             std::map<uint32_t, PhotoVerdict>* photos) {
  std::map<int, DetailAgreement> of_rooms;
  for (const auto& [id, detail] : details) {
    PhotoVerdict& photo = photos->at(id);
    photo.detail = detail;
    if (photo.other_room < 0) {
      if (detail.Agrees()) photo.doubt.clear();
      continue;
    }
    DetailAgreement& of_room = of_rooms[photo.other_room];
    of_room.num_windows += detail.num_windows;
    of_room.num_alike += detail.num_alike;
  }
  for (auto& [id, photo] : *photos) {
    const auto of_room = of_rooms.find(photo.other_room);
    if (of_room != of_rooms.end() && of_room->second.Agrees()) photo.doubt.clear();
  }
}

}  // namespace roomtex
