#pragma once
// Photos of a simulated board with known truth: camera, poses, positions of all corners.

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "capture/calibration/board.h"
#include "capture/calibration/board_detection.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

// A lens that calls for the given model: 72 degrees wide, principal point off the middle.
Camera LensThatCallsFor(CameraModel model, int width, int height);

struct BoardSetOptions {
  int num_photos = 15;
  double max_tilt_deg = 40;
  double reach = 1;    // how far from the middle the boards lie; 0 = all in the middle
  double size = 0.55;  // of the board in the picture, on average
  bool whole = true;   // the whole board is in the picture
  uint64_t seed = 1;
};
// Poses with varied tilts, turns, distances and places.
std::vector<Rigid> MakeBoardPoses(const Camera& camera, const Board& board,
                                  const BoardSetOptions& options);

// Height of a place of a board that is bowed about its middle column, metres towards the camera:
// as a sheet (power 2), or by edges that curl up (4).
double BowedHeight(const Board& board, const Eigen::Vector2d& x_on_board, double bow,
                   int power = 2);

// The corners as a perfect detection with Gaussian noise would give them.
std::vector<BoardPhoto> ObserveBoards(const Camera& camera, const Board& board,
                                      const std::vector<Rigid>& cam_from_board, double noise_px,
                                      uint64_t seed, double bow = 0, int power = 2);

struct BoardPhotoOptions {
  double blur_px = 0.8;  // Gaussian sigma
  double noise = 2;      // grey levels
  double stretch = 1;    // the board's columns are this much too wide: another board
  double bow = 0;  // metres: its middle column lies so much nearer than its first and last one
  uint64_t seed = 1;
  bool upper_left_is_black = true;
};

// Averages over pixels with an edge in them, in linear light.
class BoardRenderer {
 public:
  explicit BoardRenderer(const Camera& camera);
  // 8-bit grey.
  cv::Mat Render(const Board& board, const Rigid& cam_from_board,
                 const BoardPhotoOptions& options) const;

 private:
  Eigen::Vector2d RayAt(double x, double y) const;
  Camera camera_;
  int columns_, rows_;
  std::vector<Eigen::Vector2d> rays_;  // every second pixel
};

// Writes board_000.png ... into the folder (made if needed); names in order.
std::vector<std::string> WriteBoardPhotos(const std::string& folder, const Camera& camera,
                                          const Board& board, const std::vector<Rigid>& poses,
                                          const BoardPhotoOptions& options);

Board Checkerboard(int columns, int rows);

}  // namespace roomtex
