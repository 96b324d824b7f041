#pragma once
// Associated views (thesis 5.1.2 and 6): places photographed twice without moving the camera, once
// with the projectors' pattern and once without.

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/progress.h"

namespace roomtex {

class OptionFields;

struct AssociateOptions {
  std::string image_path;     // folder with all photos; names are relative to it
  std::string database_path;  // "" = none; may lack photos and keypoints
  // Pixels by which the camera may have moved between the two; larger = more tolerant.
  double max_offset = 0.5;
  int num_threads = -1;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct AssociatedPair {
  std::string patterned_image, plain_image;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // x_in_patterned - x_in_plain, pixels
  double offset_px = 0;         // root mean square over the picture, with roll and zoom if any
  double offset_error_px = 0;   // its standard deviation
  double brightness_ratio = 1;  // linear light, patterned over plain; exposures of EXIF taken out
  bool exif_brightness = false;
  // Keypoints of the database at the same place in both photos, beyond chance; none without them.
  std::optional<int> num_common_keypoints;
  std::string found_by;       // "name order", "time order" or "search"
  bool by_keypoints = false;  // too few edges: the keypoints measured the offset
  bool is_spare = false;      // another pair of the same place comes first
};

// The same place, but the camera moved between the two.
struct MovedPair {
  std::string first_image, second_image;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // x_in_second - x_in_first, pixels
  double offset_px = 0, offset_error_px = 0;
};

struct SinglePhoto {
  std::string image;
  std::string reason;  // a phrase
};

struct Associations {
  int num_photos = 0;                 // that could be read
  std::vector<AssociatedPair> pairs;  // ordered by the patterned image
  std::vector<MovedPair> moved;
  std::vector<SinglePhoto> singles;   // photos in no pair, ordered
  std::vector<std::string> warnings;  // sentences
};

// All photos of the folder and below: those that show the same from the same place, told apart by
// what the patterned one has in addition, detail and light. Neighbours in the order of names and of
// EXIF times first, then the most alike ones of those left. Photos are read one by one, smaller
// than they are. Throws InputError: no folder, fewer than two photos, a database that is none.
Associations FindAssociations(const AssociateOptions& options, Progress* progress);

// CSV patterned_image,plain_image,offset_px,brightness_ratio.
void WriteAssociations(const std::string& path, const std::vector<AssociatedPair>& pairs);

}  // namespace roomtex
