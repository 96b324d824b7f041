#pragma once
// Which faces were cut out of which panoramas, and how they are turned in them: panoramas.json.

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "core/camera_model.h"

namespace roomtex {

struct CutPanorama {
  struct Face {
    std::string name;  // relative to the folder of the faces, as COLMAP names it
    Eigen::Quaterniond face_from_panorama = Eigen::Quaterniond::Identity();
  };
  std::string name;           // relative to the folder of the panoramas
  int width = 0, height = 0;  // pixels
  Camera face_camera;
  std::vector<Face> faces;

  // EQUIRECTANGULAR.
  Camera PanoramaCamera() const;
};

// Throws InputError for what is no such file.
std::vector<CutPanorama> ReadPanoramaSet(const std::string& path);
// Written aside and renamed.
void WritePanoramaSet(const std::vector<CutPanorama>& panoramas, const std::string& path);

}  // namespace roomtex
