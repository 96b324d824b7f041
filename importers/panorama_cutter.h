#pragma once
// Panoramas in, perspective faces and panoramas.json out: for COLMAP before 4.1.

#include <string>
#include <vector>

#include "core/panorama_faces.h"
#include "core/panorama_set.h"
#include "core/progress.h"

namespace roomtex {

// An image file, or a folder (with an image in it).
bool IsPanoramaInput(const std::string& input_path);

// What CutPanoramas() would cut of the same input: it throws for the same pictures.
std::vector<CutPanorama> DescribePanoramas(const std::string& input_path,
                                           const FaceOptions& options);

// Writes output_folder/NAME/face_1.jpg ..., panoramas.json, and camera_options.txt: how COLMAP's
// feature_extractor is told the camera of the faces (if all panoramas have one size). Throws
// InputError for a picture that is not twice as wide as high, or two of one name.
std::vector<CutPanorama> CutPanoramas(const std::string& input_path,
                                      const std::string& output_folder, const FaceOptions& options,
                                      int num_threads, Progress* progress);

}  // namespace roomtex
