#pragma once
// The aligned model and the photos, as the viewer shows them.

#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/photo_fit.h"
#include "core/report.h"
#include "texture/sampling/photo_tone.h"

namespace roomtex {

// Where the positions of a photo lie in the room: a lattice over the photo. Between its nodes
// straight lines are good to a tenth of a pixel, whatever the distortion.
struct PhotoLattice {
  int columns = 0, rows = 0;  // nodes
  // Row by row from the upper left corner of the photo: unit vectors in `cam`, of a panorama all
  // around; zero where no ray of the camera's valid field goes.
  std::vector<Eigen::Vector3f> directions;
};
PhotoLattice MakePhotoLattice(const Camera& camera);

class ViewCameras {
 public:
  // No cameras.
  ViewCameras() = default;
  // image_path: folder of the photos; "" = none. A photo that is not there is no error: the camera
  // lacks its picture.
  ViewCameras(SparseModel model_in_scan, const std::string& image_path);

  size_t size() const { return images_.size(); }
  size_t num_photos() const;  // whose file can be shown
  // Those whose file cannot be, if there is a folder of photos.
  const std::vector<PhotoLeftOut>& left_out() const { return left_out_; }
  const SparseModel& model() const { return model_; }

  // [{id, name, width, height, focal, center [3] (`scan`), rotation_wxyz (cam_from_scan), corners
  // [4][3] (unit, `cam`: upper left, upper right, lower right, lower left), photo (bool)}]; by
  // name.
  Json ToJson() const;
  // {columns, rows, directions [3 * columns * rows]}. Throws UsageError for a camera that is not
  // there.
  Json Lattice(int id) const;
  // JPEG with at most max_size pixels along its longer side, in the shape of the lattice; null if
  // there is no file. Throws InputError if it cannot be read.
  std::shared_ptr<const std::string> Photo(int id, int max_size) const;
  // The camera without distortion that shows most of its photo, with at most max_size pixels along
  // its longer side; none for a panorama or without a file.
  std::optional<Camera> Pinhole(int id, int max_size) const;
  // The photo as that camera sees it, JPEG; null without a file. response: of the photo's bytes,
  // null = sRGB. Throws InputError if it cannot be read.
  std::shared_ptr<const std::string> PinholePhoto(int id, int max_size,
                                                  const ResponseCurve* response) const;
  // Other than 0 where that camera sees what is transparent in the photo, in the size of
  // Pinhole(id, max_size); empty where nothing is. Throws likewise.
  cv::Mat1b PinholeTransparency(int id, int max_size) const;
  // Throws UsageError for a camera that is not there.
  const SparseImage& Image(int id) const;
  // Points of the sparse model: float x y z (relative to `origin`), bytes r g b 255; without far
  // strays: see the .cc file.
  std::string EncodePoints(const Eigen::Vector3d& origin) const;

 private:
  SparseModel model_;
  std::vector<const SparseImage*> images_;  // by name
  std::vector<std::string> paths_;          // "" = no such file
  std::vector<PhotoFit> fits_;
  std::vector<PhotoLeftOut> left_out_;
  // The pictures asked for last; behind a pointer, so that this can be moved.
  struct Cache;
  std::shared_ptr<Cache> cache_;
};

}  // namespace roomtex
