#pragma once
// One photo among those to be associated, small enough to keep hundreds, and how two compare.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "capture/association/associated_views_shift.h"

namespace roomtex {

struct PhotoSummary {
  std::string name, path;
  std::array<int, 2> size = {0, 0};  // width, height as in the file
  cv::Mat1b small;                   // 384 pixels or so
  std::optional<double> exposure;    // relative, of EXIF
  std::string date_time;             // of EXIF, or ""
  std::vector<float> sketch;         // unit vector of its edges, coarse: for the search
  std::string unreadable;            // why, or ""
};
// Never throws for what is wrong with the photo.
PhotoSummary SummarizePhoto(const std::string& name, const std::string& path);

// 0..1: how alike the edges of two photos lie.
double SketchLikeness(const PhotoSummary& a, const PhotoSummary& b);

// The place of both is the same, as far as the small pictures tell.
struct PlaceComparison {
  bool same_place = false;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // x_in_second - x_in_first, pixels of the photo
  double agreement = 0;                             // of the edges, 0..1
};
PlaceComparison ComparePlaces(const PhotoSummary& first, const PhotoSummary& second);

// The light of two photos of one place.
struct LightComparison {
  // Share of the picture where one has detail that the other lacks.
  double changed_share = 0;
  bool same_light = false;  // both patterned, or both plain
  // Where it changed, the part of the change that is detail of the photo that has less of its own:
  // 0 = a pattern over a plain photo, whose detail the other has as well; 0.5 = two patterns.
  double two_sided = 0;
  double detail_ratio = 1;      // detail of the second over that of the first, where it changed
  double brightness_ratio = 1;  // linear light, second over first; EXIF exposures taken out
  bool exif_brightness = false;
};
LightComparison CompareLight(const PhotoSummary& first, const PhotoSummary& second,
                             const Eigen::Vector2d& shift);

// Shift of the keypoints that two photos have in common, x_in_second - x_in_first, within 4 pixels
// of `start`. None if no more fall together than chance brings.
struct KeypointShift {
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  double error_px = 0;
  int num_common = 0;  // beyond chance
};
std::optional<KeypointShift> FindKeypointShift(const std::vector<Eigen::Vector2d>& first,
                                               const std::vector<Eigen::Vector2d>& second,
                                               const Eigen::Vector2d& start);

}  // namespace roomtex
