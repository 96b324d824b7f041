#pragma once
// Where one photo was taken, by features that it has in common with the scan
// (appearance_features.h): RANSAC (Fischler and Bolles 1981) with three matches a sample
// (three_point_pose.h), without a sparse model and without a click. Frames: `scan`, `cam`, `img`.

#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

struct PhotoMatch {
  Eigen::Vector2d x_in_img;   // pixels, as taken
  Eigen::Vector3d x_in_scan;  // metres
};

struct PhotoSearchOptions {
  int num_samples = 60000;     // of each focal length; most are dropped before they are looked at
  double tolerance_deg = 0.6;  // between the ray of a feature and its place
  double cell = 0.15;          // metres; matches in one cell of the scan are one
  double photo_cell_deg = 2;   // so are those in one cell of the photo
  // Metres and degrees between cameras that are different places. (Of a poster alone there are
  // often two.)
  double distinct = 0.3, distinct_deg = 10;
  // Times the camera's focal length, each tried.
  std::vector<double> focal_scales = {1};
  int num_kept = 6;
};

struct PhotoPlace {
  Rigid cam_from_scan;
  double focal_scale = 1;     // times the camera's
  int num_cells = 0;          // of the scan or of the photo, whichever are fewer, that agree
  std::vector<int> agreeing;  // matches, one of each cell of the scan
};

// Clearly different places, the best first; those behind the first say what comes by chance. The
// same for every number of threads.
std::vector<PhotoPlace> SearchPhotoPlaces(const std::vector<PhotoMatch>& matches,
                                          const Camera& camera, const PhotoSearchOptions& options,
                                          int num_threads);

// Cells of the scan with matches, whether they agree on anything or not.
int CountCells(const std::vector<PhotoMatch>& matches, double cell);

// Poses of cameras at clearly different places.
bool AreDistinct(const Rigid& a, const Rigid& b, const PhotoSearchOptions& options);

// The camera with its focal length times a number.
Camera WithFocalScale(Camera camera, double scale);

}  // namespace roomtex
