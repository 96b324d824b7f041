#pragma once
// A wall that a projector throws a pattern onto, seen by a camera.

#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/photo.h"
#include "core/random_stream.h"

namespace roomtex {

struct WallView {
  double wall_width = 2.0;  // metres: width of the projected picture
  double distance = 3;      // metres, camera to the middle of the picture
  double turn_deg = 0;      // the camera looks at the wall from the side
  double roll_deg = 0;
  int width = 1936, height = 1288;  // pixels of the photo
  double field_of_view_deg = 65;    // horizontal
  double blur_px = 0.7;             // Gaussian sigma, in the photo
  double noise = 2;                 // grey levels
  double room_light = 0.25;         // of the light of a white pattern
  double gain = 0.85;               // exposure: linear value of a white place
};

// A camera of 1 MP.
inline WallView SmallView() {
  WallView view;
  view.width = 1290;
  view.height = 860;
  return view;
}

// pixel of the photo = H * pixel of the pattern (OpenCV's pixel centres).
inline cv::Matx33d PhotoFromPattern(const WallView& view, cv::Size pattern) {
  const double f = view.width / 2.0 / std::tan(RadFromDeg(view.field_of_view_deg / 2));
  const double s = view.wall_width / pattern.width;
  const double c = std::cos(RadFromDeg(view.turn_deg)), n = std::sin(RadFromDeg(view.turn_deg));
  const double cr = std::cos(RadFromDeg(view.roll_deg)), sr = std::sin(RadFromDeg(view.roll_deg));
  const cv::Matx33d wall(s, 0, -s * (pattern.width - 1) / 2, 0, s, -s * (pattern.height - 1) / 2, 0,
                         0, 1);
  const cv::Matx33d place(c, 0, 0, 0, 1, 0, n, 0, view.distance);
  const cv::Matx33d roll(cr, -sr, 0, sr, cr, 0, 0, 0, 1);
  const cv::Matx33d camera(f, 0, (view.width - 1) / 2.0, 0, f, (view.height - 1) / 2.0, 0, 0, 1);
  return camera * roll * place * wall;
}

inline cv::Mat1b TakePhoto(const cv::Mat1b& pattern, const WallView& view, uint64_t seed) {
  constexpr int kFine = 2;  // rendered this much finer, then averaged
  cv::Mat1f light(pattern.rows, pattern.cols);
  for (int i = 0; i < static_cast<int>(pattern.total()); ++i) {
    light(i) = LinearFromSrgbByte()[pattern(i)];
  }
  const cv::Matx33d finer(kFine, 0, (kFine - 1) / 2.0, 0, kFine, (kFine - 1) / 2.0, 0, 0, 1);
  cv::Mat1f fine, photo;
  cv::warpPerspective(light, fine, finer * PhotoFromPattern(view, pattern.size()),
                      {view.width * kFine, view.height * kFine}, cv::INTER_LINEAR);
  cv::resize(fine, photo, {view.width, view.height}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(photo, photo, {}, view.blur_px);
  cv::Mat1b bytes(photo.rows, photo.cols);
  RandomStream random(seed);
  for (int i = 0; i < static_cast<int>(photo.total()); ++i) {
    const double linear = view.gain * (photo(i) + view.room_light) / (1 + view.room_light);
    bytes(i) =
        cv::saturate_cast<uchar>(255 * SrgbFromLinear(linear) + view.noise * random.Gaussian());
  }
  return bytes;
}

}  // namespace roomtex
