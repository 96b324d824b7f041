#pragma once
// Photos that nobody reconstructed, as a sparse model without points: a camera for each, from
// options, from EXIF or to be found by its picks, and a pose that is still to come.

#include <map>
#include <string>
#include <vector>

#include "align/clicks/lens_pose.h"
#include "align/clicks/pick_view.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

class OptionFields;

struct PhotoCameraOptions {
  // As COLMAP's --ImageReader.camera_model and .camera_params. Without parameters the lens is found
  // with the pose, which knows SIMPLE_RADIAL and SIMPLE_PINHOLE.
  std::string camera_model = "SIMPLE_RADIAL";
  std::string camera_params;

  // What is written in a text of numbers with commas between them; nothing of an empty one.
  std::vector<double> Params() const;
  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct PhotoModel {
  // No points, and poses that say nothing. Ids are places in the order of the names, from 1.
  SparseModel model;
  std::map<std::string, FocalSource> focal_sources;  // by name
};

// Of a photo that cannot be read, or of another size than that of the given parameters.
enum class UnfitPhotos {
  kRefused,  // InputError
  kTaken,    // one pixel for the one; for the other a lens that is found, as if none were given
};
PhotoModel MakePhotoModel(const std::string& image_path, const std::vector<std::string>& names,
                          const PhotoCameraOptions& options,
                          UnfitPhotos unfit = UnfitPhotos::kRefused);
// The photos that picks name. Throws InputError with the pick's line for one that is not there.
PhotoModel MakePhotoModel(const std::string& image_path, const std::string& picks_path,
                          const std::vector<Pick>& picks, const PhotoCameraOptions& options);

// The picks of one photo: ReviewPicks() with a lens that is known or found, by kMinPicksPerPhoto
// picks or more. Without a pose if they cannot fix one: why says FocalProblemOf().
PickReview ReviewPhotoPicks(const CameraProjection& projection, FocalSource source,
                            const PointPairs& pairs, const PickReviewOptions& options);
// Why picks do not tell a focal length that nobody knows; "" if they do, or need not.
std::string FocalProblemOf(FocalSource source, const PointPairs& pairs);
// ReviewViews() by these.
std::vector<PickView> ReviewPhotoViews(const PhotoModel& photos, const std::vector<Pick>& picks,
                                       const PickReviewOptions& options);

}  // namespace roomtex
