#pragma once
// Least squares of one camera model on the corners of a board in several photos (Zhang 2000): the
// intrinsics, and a pose of the board per photo.
//
// Not by a general solver: the normal equations are kept per photo. Their sum, with the poses
// eliminated (Schur complement), gives the covariance of the intrinsics; leaving one out gives the
// camera that the other photos would have led to. With them the descent itself is forty lines.
// Ceres 2.1 comes to the same parameters (to 1e-6 of each wherever the photos determine them:
// OpenCV's sample boards, simulated ones) in 2 to 7 times our time, 10 to 43 ms for our 2 to 7.
// Only in the flat valley of FULL_OPENCV for a lens that does not call for it does it get farther
// down, by 1e-5 to 1e-3 of the cost, where we say after 100 iterations that it does not converge.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "capture/calibration/board.h"
#include "capture/calibration/board_detection.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

// A COLMAP model of which the first num_free parameters are estimated; the others are 0.
struct LensModel {
  CameraModel model = CameraModel::kOpenCv;
  int num_free = 8;
  // "OPENCV"; "FULL_OPENCV (k4 to k6 zero)" for the thesis' lens: k1, k2, k3, p1, p2.
  std::string Name() const;
};
// From the simplest to the richest; each holds those before it.
const std::vector<LensModel>& LensModels();

// The same lens in a model that holds the camera's own.
Camera InRicherModel(const Camera& camera, CameraModel model);

// What a fit looks at.
struct BoardView {
  Eigen::Matrix2Xd x_on_board;  // `board`
  Eigen::Matrix2Xd x_in_img;    // seen there
  std::vector<bool> used;       // corners that take part
  double weight = 1;            // of its squared residuals; less than 1 for a photo with more noise
  // A board that is not flat: height of corner i = shapes.col(i).dot(bend), towards +z of `board`.
  // shapes: metres, u^2, u v, v^2 from the middle, times half the board's diagonal; u and v in
  // halves of the diagonal. The same bend in all views; zero = flat.
  Eigen::Matrix3Xd shapes;
  Eigen::Vector3d bend = Eigen::Vector3d::Zero();
  Eigen::Vector3d CornerOnBoard(int i) const {
    return {x_on_board(0, i), x_on_board(1, i), shapes.col(i).dot(bend)};
  }
};
Eigen::Matrix3Xd BendShapes(const Board& board, const Eigen::Matrix2Xd& x_on_board);
BoardView MakeBoardView(const BoardPhoto& photo, const Board& board);

struct CameraFit {
  LensModel lens;
  Camera camera;
  std::vector<Rigid> cam_from_board;  // one per view
  bool converged = false;
  double cost = 0;  // sum of weighted squared residuals, Huber's where a limit is given

  // Filled by Finish().
  std::vector<Eigen::Matrix2Xd> residuals;  // seen less computed, pixels, per view
  double sigma_px = 0;  // noise of one coordinate of a corner in a photo of weight 1
  int redundancy = 0;   // coordinates less unknowns
  // Of all parameters (zero for those not free), times sigma_px^2; infinite when not determined.
  Eigen::MatrixXd covariance;
  // Root mean square length of the residuals of each view, pixels: in the fit, and held out: with
  // the camera of the other views, the board's pose fitted to that camera.
  std::vector<double> view_rms_px, held_out_rms_px;
  // Intrinsics that the other views lead to, per view (first-order; exact enough for statistics).
  std::vector<Camera> without_view;
};

// Rough camera (SIMPLE_RADIAL, principal point in the middle) and poses: the focal length that puts
// the boards straight in most photos. A few wrong photos do no harm.
CameraFit RoughFit(const std::vector<BoardView>& views, int width, int height);

// Levenberg-Marquardt from `start`, whose camera the lens must hold. Residuals longer than huber_px
// / sqrt(weight) pull no more than that; 0 = no limit.
CameraFit FitCamera(const std::vector<BoardView>& views, const LensModel& lens,
                    const CameraFit& start, double huber_px);

// Residuals, noise, covariance and held-out errors at the optimum. Where the views have a bend,
// what is not known of it is in the covariance.
void Finish(const std::vector<BoardView>& views, CameraFit* fit);

// Camera, poses and bend together, from a fit of the views, whose lens it keeps.
struct BentFit {
  bool found = false;  // the views determine it
  Eigen::Vector3d bend = Eigen::Vector3d::Zero();
  Eigen::Matrix3d bend_covariance = Eigen::Matrix3d::Zero();
  CameraFit fit;  // finished
};
BentFit FitBend(std::vector<BoardView> views, const CameraFit& start, double huber_px);

// The pose of the board for a given camera; start: near it.
Rigid FitPose(const BoardView& view, const Camera& camera, const Rigid& start, double huber_px);
// Residuals of all corners, seen less computed; NaN where there is no projection.
Eigen::Matrix2Xd Residuals(const BoardView& view, const Camera& camera,
                           const Rigid& cam_from_board);
// Of the corners used, pixels.
double RmsLength(const BoardView& view, const Eigen::Matrix2Xd& residuals);

}  // namespace roomtex
