#pragma once
// The images of a database with their verified matches, as rays. Keypoints are read and unprojected
// when they are first asked for, so a large database costs what is used of it.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "colmap_ext/database.h"
#include "colmap_ext/third_view.h"
#include "colmap_ext/view_rays.h"

namespace roomtex {

class MatchedImages {
 public:
  // Gives the keypoints (`img`) of an image in row order.
  using KeypointReader = std::function<std::vector<Eigen::Vector2d>(uint32_t image_id)>;

  // Reads cameras, images and verified pairs now, keypoints later; `database` must outlive this.
  explicit MatchedImages(const Database& database);
  // The same from memory.
  MatchedImages(std::map<uint32_t, Camera> cameras, std::map<uint32_t, DatabaseImage> images,
                std::vector<DatabasePair> pairs, KeypointReader read_keypoints);
  ~MatchedImages();

  const std::map<uint32_t, Camera>& cameras() const;
  const std::map<uint32_t, DatabaseImage>& images() const;
  // Verified pairs without watermarks, ordered by pair id.
  const std::vector<DatabasePair>& pairs() const;
  // nullptr if there is none of that name.
  const DatabaseImage* FindImage(const std::string& name) const;

  // Not safe from several threads, because they read and unproject on demand.
  const std::vector<Eigen::Vector2d>& Keypoints(uint32_t image_id);
  // Every `stride`-th match of a pair; matches whose rays are not valid are left out.
  std::vector<RayMatch> Matches(const DatabasePair& pair, int stride = 1);
  // What other images see of the matches of image_id1 (left) and image_id2 (right): through matches
  // with either of them; sightings that the two contradict are left out. Those with at least
  // min_sightings, most first, at most max_views.
  std::vector<ThirdView> FindThirdViews(const DatabasePair& pair,
                                        const std::vector<RayMatch>& matches, int min_sightings,
                                        int max_views);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Median angle between the rays of matches that no common rotation explains, radians: a quick lower
// bound of the parallax. Small for pure rotations, and for small baselines.
double MedianParallax(const std::vector<RayMatch>& matches);

}  // namespace roomtex
