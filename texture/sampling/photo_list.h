#pragma once
// Which photos give colour, from where, with which camera.

#include <map>
#include <string>
#include <vector>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/photo_fit.h"
#include "importers/scan_record.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

struct PhotoSources {
  std::string image_path;     // folder of the photos
  std::string database_path;  // "" = intrinsics from the model
  // The model's poses go with its own intrinsics (roomtex-align may have adjusted both): those of
  // the database that differ are not used, which is warned of.
  bool aligned_model = false;
  // Of the aligned model: photos that are left out, and why, by name.
  std::map<std::string, std::string> doubtful_photos;
  bool use_doubtful = false;      // they are not
  std::string associations_path;  // "" = every registered photo gives colour
};

struct PhotoList {
  std::vector<PhotoView> photos;      // ordered by name
  std::vector<std::string> warnings;  // plain sentences
  // Doubtful, missing, no image, or of another shape than the camera's; ordered by name.
  std::vector<PhotoLeftOut> left_out;
};

// The registered photos of a model in the scan frame. With associations the plain twin of every
// registered patterned photo takes its place; registered photos that the table knows only as plain
// ones stay, those that it does not know are left out, because the pattern may be on them, and so
// are those whose plain twin is not in the folder. Every file is looked at (FitPhotoToCamera): one
// that cannot be used is left out, a photo of the same shape but another size gets a scaled camera.
// Throws InputError if none is left.
PhotoList ListPhotos(const SparseModel& model_in_scan, const PhotoSources& sources);

// The same for a command, of a model that `alignment` says what is known of: warnings are said,
// `strict` stops at a photo that is left out. InputError also for more photos than kMaxPhotos.
PhotoList ListPhotosOf(const SparseModel& model, const AlignmentRecord& alignment,
                       PhotoSources sources, bool strict, const Command::Context& context);

// CSV with a header that names patterned_image and plain_image among its columns. Pairs in file
// order. Throws InputError with the line.
struct AssociatedPhotos {
  std::string patterned_image, plain_image;
};
std::vector<AssociatedPhotos> ReadAssociations(const std::string& path);

// The camera for photos of another size: focal lengths and principal point scale, distortion stays.
Camera ScaleCamera(const Camera& camera, int width, int height);

}  // namespace roomtex
