#pragma once
// Photos, depth maps and masks for programs that train on them or fuse them, one photo after the
// other.

#include <optional>
#include <string>
#include <vector>

#include "core/photo_fit.h"
#include "core/progress.h"
#include "core/undistortion.h"
#include "texture/export/export_scene.h"
#include "texture/sampling/photo_view.h"
#include "texture/sampling/visibility.h"

namespace roomtex {

class OptionFields;

struct ExportOptions {
  // Evenly spread over what at least two photos see. Splatting trainers start from some 100 000.
  int max_points = 200000;
  PinholeOptions pinhole;
  bool masks = true;
  OcclusionOptions occlusion;

  void Declare(OptionFields* fields);  // its own, not those of the structs in it
  std::vector<std::string> Problems() const;
};

// What was written of a photo.
struct ExportedPhoto {
  std::string name;
  Camera camera;  // PINHOLE
  Rigid cam_from_scan;
  struct Sight {
    int point;                 // of ExportScene::points
    Eigen::Vector2f x_in_img;  // undistorted
  };
  std::vector<Sight> sights;   // points that it clearly sees
  double share_moving = 0;     // of its pixels, masked as something that moved
  double share_unscanned = 0;  // of its pixels, where the scan has no surface
};

enum class ExportFormat { kColmap, kNerfstudio };

// Files below `folder`, each named as its photo: images/NAME; masks/NAME.png (0 = moved, blank or
// transparent) and scan_masks/NAME.png (0 = the scan has nothing there); stereo/depth_maps and
// normal_maps of kColmap, depths/NAME.png of kNerfstudio. Photos that cannot be undistorted
// (panoramas) or read go to left_out. Several photos at a time; the result does not depend on
// num_threads.
std::vector<ExportedPhoto> ExportPhotos(const ExportScene& scene,
                                        const std::vector<PhotoView>& photos, ExportFormat format,
                                        const ExportOptions& options, const std::string& folder,
                                        int num_threads, Progress* progress,
                                        std::vector<PhotoLeftOut>* left_out);

// cameras, images and points3D in sparse/0, and once more in sparse, where COLMAP's dense steps
// look for them; stereo/*.cfg. Tracks and points2D answer each other; points that fewer than two
// photos see clearly are left out. Gives the number of points.
size_t WriteColmapModel(const ExportScene& scene, const std::vector<ExportedPhoto>& photos,
                        const std::string& folder);

// transforms.json and points3D.ply: camera to world with OpenGL's axes (x right, y up, z back), z
// up, so that a scan whose up axis is another is turned (`scan_from_world` turns it back).
void WriteNerfstudioModel(const ExportScene& scene, const std::vector<ExportedPhoto>& photos,
                          const Eigen::Vector3d& up_in_scan, bool masks, const std::string& folder);

}  // namespace roomtex
