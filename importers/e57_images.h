#pragma once
// The photos of an E57 file (images2D) as files, and those with a pose as a COLMAP model.

#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/panorama_faces.h"
#include "core/progress.h"
#include "core/similarity.h"

namespace roomtex {

struct E57ImageOptions {
  double meters_per_unit = 1;
  bool check = true;  // all checksums of the file first
  // Panoramas as faces of perspective cameras beside the whole picture, which is not in the model
  // then: for programs that know no EQUIRECTANGULAR.
  bool cut_panoramas = false;
  FaceOptions faces;
};

// A photo whose camera and place are known.
struct PosedPhoto {
  std::string name;  // relative to the folder of the photos
  Camera camera;
  Rigid cam_from_scan;
};

struct E57Photos {
  struct Photo {
    std::string file;        // relative to the folder
    std::string name, kind;  // as in the E57; kind: "pinhole", "spherical", "cylindrical", "visual"
    bool posed = false;      // in the model
  };
  std::vector<Photo> photos;
  std::vector<PosedPhoto> posed;
  std::vector<std::string> notes;  // why photos are not in the model
};

// Writes every photo into the folder under its own name (made fit for a file), byte by byte, but
// one with a mask as a PNG that is transparent where the mask says that it shows nothing; and, if
// some have pose and camera, the model folder/sparse: pinhole pictures as PINHOLE, panoramas all
// around as EQUIRECTANGULAR. Throws InputError with the byte, and for a file without photos.
E57Photos ExtractE57Images(const std::string& path, const std::string& folder,
                           const E57ImageOptions& options, Progress* progress);

// cameras.bin, images.bin and a points3D.bin without points, as COLMAP 3.7 to 4.x reads them;
// photos with equal cameras share one.
void WritePhotoModel(const std::vector<PosedPhoto>& photos, const std::string& folder);

}  // namespace roomtex
