#pragma once
// What can be seen of photos and programs before anything runs: the ground for roomtex-auto's
// choices.

#include <optional>
#include <string>
#include <vector>

namespace roomtex {

struct PhotoFacts {
  std::string name;  // below the folder, as COLMAP names it
  int width = 0, height = 0;
  std::string camera;  // EXIF make and model, "" without
  std::optional<double> focal_length_mm;
  double Megapixels() const { return 1e-6 * width * height; }
};

// The photos of a folder and of those below it, by name. Throws InputError if there are none or the
// folder is missing.
std::vector<PhotoFacts> ReadPhotoFacts(const std::string& folder);

// Photos that one lens may have taken: same camera, focal length and size.
struct PhotoGroup {
  std::string camera;
  std::optional<double> focal_length_mm;
  int width = 0, height = 0;
  std::vector<std::string> names;
  std::string Text() const;  // "30 photos of 5472 x 3648, Canon EOS 6D, 24 mm"
};
// The largest first.
std::vector<PhotoGroup> GroupByCamera(const std::vector<PhotoFacts>& photos);

// A line of COLMAP's cameras.txt.
struct KnownCamera {
  std::string model;
  int width = 0, height = 0;
  std::string params;  // with commas, as --ImageReader.camera_params has them
};
std::vector<KnownCamera> ReadKnownCameras(const std::string& path);  // throws InputError

// Whether neighbouring photos come in pairs of the same view in different light, as they do where a
// pattern was projected: from small pictures.
bool LooksPatterned(const std::string& folder, const std::vector<PhotoFacts>& photos);

}  // namespace roomtex
