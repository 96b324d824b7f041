#pragma once
// COLMAP's database.db, read only, 3.7 to 4.x (docs/colmap.md).

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

class DatabaseFile;

struct DatabaseImage {
  uint32_t image_id = 0;
  uint32_t camera_id = 0;
  std::string name;
};

// Verified matches of a pair (table two_view_geometries); image_id1 < image_id2.
struct DatabasePair {
  uint32_t image_id1 = 0;
  uint32_t image_id2 = 0;
  int config = 0;                        // COLMAP's TwoViewGeometry::ConfigurationType
  std::vector<Eigen::Vector2i> matches;  // keypoint rows in image 1 and image 2
};

// Keypoints with their SIFT descriptors.
struct DatabaseFeatures {
  std::vector<Eigen::Vector2d> x_in_img;
  std::vector<uint8_t> descriptors;  // kSiftSize bytes per feature
};
inline constexpr int kSiftSize = 128;

// COLMAP's number of a pair of images, in either order, and back to {smaller id, larger id}.
uint64_t PairIdFromImages(uint32_t image_id1, uint32_t image_id2);
std::pair<uint32_t, uint32_t> ImagesFromPairId(uint64_t pair_id);

// Opens read-only, also in a folder that may not be written and with a WAL file beside it (its rows
// are seen); never changes the user's file or its WAL. Throws InputError: missing, not SQLite, not
// COLMAP's, truncated; every reading function throws it for rows that contradict each other or
// their own sizes.
class Database {
 public:
  explicit Database(const std::string& path);
  ~Database();

  // Keyed by id, ordered. Cameras with Problems() make an InputError.
  // Camera::has_prior_focal_length is the column prior_focal_length.
  std::map<uint32_t, Camera> ReadCameras() const;
  // Every image has a camera in ReadCameras() and a name of its own.
  std::map<uint32_t, DatabaseImage> ReadImages() const;
  // Number of keypoints of every image that has a row of them, without reading the keypoints.
  std::map<uint32_t, size_t> CountKeypoints() const;
  // Positions in `img`, one per keypoint row; empty if the image has none. (2, 4 or 6 columns.)
  std::vector<Eigen::Vector2d> ReadKeypoints(uint32_t image_id) const;
  // The max_features keypoints of the largest scale, largest first (equal ones by their row).
  // Throws InputError for descriptors that are not SIFT's or do not belong to the keypoints.
  DatabaseFeatures ReadLargestFeatures(uint32_t image_id, int max_features) const;
  // Pairs with at least min_matches verified matches, ordered by pair id. All matches lie within
  // the keypoints of their images, or this is an InputError. Pairs of images that the database no
  // longer holds are left out, as COLMAP does.
  std::vector<DatabasePair> ReadPairs(int min_matches) const;
  // Number of pairs with a verified match, without reading them.
  size_t CountPairs() const;
  // Number of verified matches of every pair that was ever matched, 0 if none was verified, without
  // reading the matches; smaller id first. Pairs of images that are gone are left out.
  std::map<std::pair<uint32_t, uint32_t>, size_t> CountMatches() const;

  // Writes at `path` (which must not exist) a database with everything that COLMAP's mapper reads,
  // i.e. without the rows of descriptors and raw matches, most of the bytes. COLMAP opens databases
  // for writing; it gets this one instead of the user's. kColmap39: in the tables that COLMAP up to
  // 3.9 reads, whatever the version of this database.
  enum class Schema { kAsIs, kColmap39 };
  void CopyForMapper(const std::string& path, Schema schema) const;

  // Writes at `path` (missing or empty) the whole database, with these rows of the table cameras
  // (which it must have) replaced. Needs no WAL file beside it.
  void CopyWithCameras(const std::string& path, const std::map<uint32_t, Camera>& cameras) const;

  // The same with the rows of `copies` for pairs that this one has not matched (tables matches and
  // two_view_geometries); of a pair in several copies, that of the first. Throws InputError for a
  // copy whose photos or numbers of keypoints are not these.
  void CopyWithMatches(const std::string& path, const std::vector<const Database*>& copies) const;

  // Takes the verified pairs out of a copy that CopyForMapper made, but for those between these
  // photos.
  static void KeepPairsBetween(const std::string& copy_path, const std::set<uint32_t>& image_ids);

  // Gives the images of a copy that CopyForMapper made these cameras, and each camera a rig of its
  // own where the copy has rigs (COLMAP 3.12 to 4.x). False, and nothing done, where a rig holds
  // several cameras.
  static bool SetCameras(const std::string& copy_path, const std::map<uint32_t, Camera>& cameras,
                         const std::map<uint32_t, DatabaseImage>& images);

  const std::string& path() const;

 private:
  std::unique_ptr<DatabaseFile> file_;
};

}  // namespace roomtex
