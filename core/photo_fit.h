#pragma once
// Does the file of a photo go with its camera? Pixels are those of the file as stored: COLMAP does
// not turn photos by their EXIF orientation, and neither do we. What happens to files afterwards:
// they are resized, turned by a viewer, cropped, lost.

#include <string>
#include <vector>

#include "core/command_line.h"
#include "core/photo.h"

namespace roomtex {

struct PhotoFit {
  int width = 0, height = 0;  // of the photo as ReadPhoto(path, pixels) gives it
  // As stored; by EXIF where only that gives the camera's shape: then the model was made by a
  // program that turns photos.
  PhotoPixels pixels = PhotoPixels::kAsStored;
  // Another size than the camera's, by one factor in both directions (to a pixel).
  bool scaled = false;
  std::string note;     // what there is to say about scaled and turned photos, a sentence; or ""
  std::string problem;  // why the photo cannot be used and what to do, sentences; "" = it can

  bool usable() const { return problem.empty(); }
};

// name: of the photo below --image_path, for the sentences and for StaysInside(). camera_width,
// camera_height: of the model's camera.
PhotoFit FitPhotoToCamera(const std::string& path, const std::string& name, int camera_width,
                          int camera_height);

// The first few notes of many photos, and how many more there are.
std::vector<std::string> FirstNotes(std::vector<std::string> notes);

// The photo in its camera's pixels: turned as fit says, resized if it is scaled. Throws InputError.
cv::Mat ReadFittedPhoto(const std::string& path, const PhotoFit& fit, int camera_width,
                        int camera_height);
// The same in cells of cell_px x cell_px of these pixels, whole ones only, to a quarter of a cell:
// a JPEG is made smaller while it is decoded.
cv::Mat ReadFittedCells(const std::string& path, const PhotoFit& fit, int camera_width,
                        int camera_height, int cell_px);

// A photo that is left out, and why, in sentences.
struct PhotoLeftOut {
  std::string name, reason;
};
// Warns of them by name, the first few one by one, and lists all as the report's
// `photos_left_out`.
void ReportPhotosLeftOut(const std::vector<PhotoLeftOut>& photos, const Command::Context& context);
// The sentence about one of them without its full stop, as part of a longer one.
std::string AsClause(std::string reason);
// --strict: throws InputError for the first of them.
void ThrowIfAnyLeftOut(const std::vector<PhotoLeftOut>& photos, const std::string& image_path);
inline constexpr char kStrictHelp[] =
    "Stop at a photo that is missing, unreadable or of another shape than its camera; 0 = leave it "
    "out and name it.";
inline constexpr char kUseDoubtfulHelp[] =
    "Use photos that roomtex-align doubts (the alignment's `images` say why), too; 0 = leave them "
    "out and name them.";

}  // namespace roomtex
