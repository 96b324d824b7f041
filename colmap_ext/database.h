#pragma once
// COLMAP's database.db, read only, 3.7 to 4.x (docs/colmap.md).

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

struct DatabaseImage {
  uint32_t image_id = 0;
  uint32_t camera_id = 0;
  std::string name;
};

// Verified matches of a pair (table two_view_geometries); image_id1 < image_id2.
struct DatabasePair {
  uint32_t image_id1 = 0;
  uint32_t image_id2 = 0;
  int config = 0;  // COLMAP's TwoViewGeometry::ConfigurationType
  std::vector<Eigen::Vector2i> matches;  // keypoint rows in image 1 and image 2
};

// Opens read-only, also in a folder that may not be written and with a WAL file beside it; never changes
// the user's file. Throws InputError: missing, not SQLite, not COLMAP's, truncated.
class Database {
 public:
  explicit Database(const std::string& path);
  ~Database();

  // Keyed by id, ordered. Cameras with Problems() make an InputError.
  std::map<uint32_t, Camera> ReadCameras() const;
  std::map<uint32_t, DatabaseImage> ReadImages() const;
  // Positions in `img`, one per keypoint row; empty if the image has none. (2, 4 or 6 columns.)
  std::vector<Eigen::Vector2d> ReadKeypoints(uint32_t image_id) const;
  // Pairs with at least min_matches verified matches, ordered by pair id. Match rows outside the keypoints
  // are found by the caller with CheckPair().
  std::vector<DatabasePair> ReadPairs(int min_matches) const;

  const std::string& path() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
