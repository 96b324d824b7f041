#pragma once
// The camera from photos of a board (thesis 5.2): which photos, which corners, which lens model,
// how exact, and whether the photos determine it at all.

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "capture/calibration/board.h"
#include "capture/calibration/board_detection.h"
#include "capture/calibration/calibration_fit.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

class OptionFields;

struct CalibrationOptions {
  // SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV; auto: the simplest that foretells photos left out
  // as well as any richer one.
  std::string camera_model = "auto";
  // auto takes a richer model when the log-likelihood of photos held out grows by more than this;
  // larger = simpler models.
  double min_gain = 6;
  // A photo is left out when its corners scatter by more than this many times the median photo's,
  // and by more than bad_photo_px; larger = more tolerant.
  double bad_photo_ratio = 3;
  double bad_photo_px = 0.15;  // pixels, standard deviation of a coordinate
  // A corner is left out beyond this many standard deviations of its photo's corners.
  double bad_corner_sigmas = 5;

  // Below or beyond these the camera is not to be trusted.
  int min_photos = 6;                  // photos that took part
  double min_tilt_deg = 15;            // largest angle between two boards
  double min_radius = 0.5;             // of the way from the middle to the corner of the picture
  double max_focal_sigma_percent = 1;  // standard deviation of the focal length
  double max_sigma_px = 1;  // and what all of them make of the picture (root mean square)
  // Largest Calibration::photo_scatter; larger = more tolerant. Right captures stay below 2 (1.6 at
  // most of those of tests and audit, boards bowed by up to 3 mm among them); 4.7 where the focal
  // length is 0.3 % longer in half of the photos.
  double max_photo_scatter = 3;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
  static std::vector<std::string> CameraModels();
};

// One photo in the calibration.
struct CalibratedPhoto {
  std::string name;
  bool used = false;
  std::string reason;       // why not
  int num_corners = 0;      // found
  int num_bad_corners = 0;  // of these left out
  // Root mean square length of the residuals, pixels; of a photo left out: with the board's pose
  // fitted to the camera. NaN without a board.
  double rms_px = 0;
  double held_out_rms_px = 0;  // with the camera of the other photos; NaN for photos not used
  double tilt_deg = 0;         // between the board's normal and the line of sight
  double distance = 0;         // metres, from the camera to the middle of the board
  Rigid cam_from_board;
  Eigen::Matrix2Xd x_in_img, residuals;  // all corners found; seen less computed
  std::vector<bool> corner_used;
};

// Where in the picture the corners lie.
struct Coverage {
  int columns = 0, rows = 0;                // of a grid of even cells
  std::vector<int> num_corners;             // per cell, row by row
  double share = 0;                         // of the cells with a corner
  std::array<bool, 4> corner_reached = {};  // of the picture, clockwise from the upper left
  double radius = 0;  // of the farthest corner from the middle; 1 = the picture's corner
};

struct ModelComparison {
  LensModel lens;
  double rms_px = 0, held_out_rms_px = 0;  // over all corners of the photos used
  double bic = 0;                          // Bayesian information criterion; smaller = better
  // How much it betters the model chosen so far: growth of the held-out log-likelihood.
  double gain = 0;
  bool chosen = false;
};

// A board that is not flat, by the heights of its corners (of second order).
struct BoardBow {
  double height = std::numeric_limits<double>::quiet_NaN();  // metres, highest less lowest corner
  double sigma = std::numeric_limits<double>::quiet_NaN();
  double focal_percent = 0;  // by which a flat board would make the focal length too long
  bool used = false;         // the calibration is that of the bent board
};

struct Calibration {
  Camera camera;  // camera_id 1
  LensModel lens;
  std::vector<double> params_sigma;  // standard deviations
  double rms_px = 0, held_out_rms_px = 0, sigma_px = 0;
  // Jackknife over the photos against the covariance. About 1 when corners err independently; more
  // when photos err as a whole (blur, a touched focus). What all have alike it does not see. The
  // standard deviations are enlarged by it when it is more than 1.
  double photo_scatter = 1;
  double focal_sigma_percent = 0, corner_sigma_px = 0, mean_sigma_px = 0;
  double max_angle_between_boards_deg = 0;
  BoardBow bow;
  std::vector<CalibratedPhoto> photos;  // in the order given
  Coverage coverage;
  std::vector<ModelComparison> models;
  std::string why_model;                       // a sentence
  std::vector<std::string> warnings, reasons;  // reasons: not to be trusted

  int NumUsed() const;
};

// path: for messages, the folder of the photos. Throws InputError when fewer than three photos show
// the board.
Calibration Calibrate(const std::vector<BoardPhoto>& photos, const Board& board,
                      const CalibrationOptions& options, const std::string& path);

}  // namespace roomtex
