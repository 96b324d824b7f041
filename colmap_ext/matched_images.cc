#include "colmap_ext/matched_images.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <unordered_map>

#include "colmap_ext/two_view_geometry.h"
#include "core/similarity.h"

namespace roomtex {
namespace {

constexpr int kWatermark = 7;  // COLMAP's TwoViewGeometry::WATERMARK

// The keypoints of one image; rays are made when asked for.
class ImageRays {
 public:
  ImageRays(const Camera& camera, std::vector<Eigen::Vector2d> keypoints)
      : projection_(camera), keypoints_(std::move(keypoints)), index_(keypoints_.size(), -1) {}

  const std::vector<Eigen::Vector2d>& keypoints() const { return keypoints_; }
  Ray At(int row) {
    if (index_[row] < 0) {
      index_[row] = static_cast<int>(rays_.size());
      rays_.push_back(RaysFromKeypoints(projection_, {keypoints_[row]})[0]);
    }
    return rays_[index_[row]];
  }

 private:
  CameraProjection projection_;
  std::vector<Eigen::Vector2d> keypoints_;
  std::vector<int> index_;
  std::vector<Ray> rays_;
};

// Keypoint rows of the other image, for the rows of one image of a pair.
void ForEachMatch(const DatabasePair& pair, uint32_t image_id,
                  const std::function<void(int own_row, int other_row)>& use) {
  const int own = pair.image_id1 == image_id ? 0 : 1;
  for (const Eigen::Vector2i& match : pair.matches) use(match[own], match[1 - own]);
}

}  // namespace

struct MatchedImages::Impl {
  std::map<uint32_t, Camera> cameras;
  std::map<uint32_t, DatabaseImage> images;
  std::vector<DatabasePair> pairs;
  KeypointReader read_keypoints;
  std::map<uint32_t, std::vector<size_t>> pairs_of_image;
  std::map<uint32_t, ImageRays> rays;

  void Index() {
    pairs.erase(std::remove_if(pairs.begin(), pairs.end(),
                               [](const DatabasePair& pair) {
                                 return pair.config == kWatermark || pair.matches.empty();
                               }),
                pairs.end());
    for (size_t i = 0; i < pairs.size(); ++i) {
      pairs_of_image[pairs[i].image_id1].push_back(i);
      pairs_of_image[pairs[i].image_id2].push_back(i);
    }
  }

  ImageRays& Rays(uint32_t image_id) {
    const auto found = rays.find(image_id);
    if (found != rays.end()) return found->second;
    const Camera& camera = cameras.at(images.at(image_id).camera_id);
    return rays.emplace(image_id, ImageRays(camera, read_keypoints(image_id))).first->second;
  }

  // Row in `image_id` of what the rows of a pair's image show; -2 = contradicting.
  void CollectSightings(uint32_t pair_image, const std::unordered_map<int, int>& match_of_row,
                        uint32_t other_pair_image,
                        std::map<uint32_t, std::map<int, int>>* row_of_match) const {
    const auto found = pairs_of_image.find(pair_image);
    if (found == pairs_of_image.end()) return;
    for (const size_t index : found->second) {
      const DatabasePair& pair = pairs[index];
      const uint32_t image_id = pair.image_id1 == pair_image ? pair.image_id2 : pair.image_id1;
      if (image_id == other_pair_image) continue;
      std::map<int, int>& rows = (*row_of_match)[image_id];
      ForEachMatch(pair, pair_image, [&](int own_row, int other_row) {
        const auto match = match_of_row.find(own_row);
        if (match == match_of_row.end()) return;
        const auto [entry, is_new] = rows.emplace(match->second, other_row);
        if (!is_new && entry->second != other_row) entry->second = -2;
      });
    }
  }
};

MatchedImages::MatchedImages(const Database& database)
    : MatchedImages(database.ReadCameras(), database.ReadImages(), database.ReadPairs(1),
                    [&database](uint32_t image_id) { return database.ReadKeypoints(image_id); }) {}

MatchedImages::MatchedImages(std::map<uint32_t, Camera> cameras,
                             std::map<uint32_t, DatabaseImage> images,
                             std::vector<DatabasePair> pairs, KeypointReader read_keypoints)
    : impl_(std::make_unique<Impl>()) {
  impl_->cameras = std::move(cameras);
  impl_->images = std::move(images);
  impl_->pairs = std::move(pairs);
  impl_->read_keypoints = std::move(read_keypoints);
  impl_->Index();
}

MatchedImages::~MatchedImages() = default;

const std::map<uint32_t, Camera>& MatchedImages::cameras() const { return impl_->cameras; }
const std::map<uint32_t, DatabaseImage>& MatchedImages::images() const { return impl_->images; }
const std::vector<DatabasePair>& MatchedImages::pairs() const { return impl_->pairs; }

const DatabaseImage* MatchedImages::FindImage(const std::string& name) const {
  for (const auto& [image_id, image] : impl_->images) {
    if (image.name == name) return &image;
  }
  return nullptr;
}

const std::vector<Eigen::Vector2d>& MatchedImages::Keypoints(uint32_t image_id) {
  return impl_->Rays(image_id).keypoints();
}

std::vector<RayMatch> MatchedImages::Matches(const DatabasePair& pair, int stride) {
  ImageRays& left = impl_->Rays(pair.image_id1);
  ImageRays& right = impl_->Rays(pair.image_id2);
  std::vector<RayMatch> matches;
  for (size_t i = 0; i < pair.matches.size(); i += stride) {
    const int left_row = pair.matches[i].x(), right_row = pair.matches[i].y();
    RayMatch match{left.At(left_row), right.At(right_row), left_row, right_row};
    if (match.left.valid && match.right.valid) matches.push_back(match);
  }
  return matches;
}

std::vector<ThirdView> MatchedImages::FindThirdViews(const DatabasePair& pair,
                                                     const std::vector<RayMatch>& matches,
                                                     int min_sightings, int max_views) {
  std::unordered_map<int, int> match_of_left_row, match_of_right_row;
  for (size_t m = 0; m < matches.size(); ++m) {
    match_of_left_row.emplace(matches[m].left_row, static_cast<int>(m));
    match_of_right_row.emplace(matches[m].right_row, static_cast<int>(m));
  }
  std::map<uint32_t, std::map<int, int>> row_of_match;  // image -> match -> keypoint row
  impl_->CollectSightings(pair.image_id1, match_of_left_row, pair.image_id2, &row_of_match);
  impl_->CollectSightings(pair.image_id2, match_of_right_row, pair.image_id1, &row_of_match);

  std::vector<ThirdView> views;
  for (const auto& [image_id, rows] : row_of_match) {
    if (static_cast<int>(rows.size()) < min_sightings) continue;
    ThirdView view;
    view.image_id = image_id;
    ImageRays& rays = impl_->Rays(image_id);
    std::set<int> used_rows;
    for (const auto& [match, row] : rows) {
      if (row < 0 || !used_rows.insert(row).second) continue;
      const Ray ray = rays.At(row);
      if (ray.valid) view.sightings.push_back({match, ray, row});
    }
    if (static_cast<int>(view.sightings.size()) >= min_sightings) views.push_back(std::move(view));
  }
  std::stable_sort(views.begin(), views.end(), [](const ThirdView& a, const ThirdView& b) {
    return a.sightings.size() > b.sightings.size();
  });
  if (static_cast<int>(views.size()) > max_views) views.resize(std::max(max_views, 0));
  return views;
}

double MedianParallax(const std::vector<RayMatch>& matches) {
  if (matches.size() < 3) return 0;
  std::vector<int> used(matches.size());
  std::iota(used.begin(), used.end(), 0);
  std::vector<double> angles(matches.size());
  constexpr int kNumRounds = 3;  // the second and third time without the worse half
  for (int round = 0; round < kNumRounds; ++round) {
    const auto rotation = FitRotation(matches, used);
    if (!rotation) return 0;
    for (size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector3d turned = *rotation * matches[i].left.Direction();
      const Eigen::Vector3d seen = matches[i].right.Direction();
      angles[i] = AngleBetween(turned, seen);
    }
    std::iota(used.begin(), used.end(), 0);
    std::stable_sort(used.begin(), used.end(), [&](int a, int b) { return angles[a] < angles[b]; });
    used.resize(std::max<size_t>(used.size() / 2, 2));
  }
  return angles[used.back()];
}

}  // namespace roomtex
