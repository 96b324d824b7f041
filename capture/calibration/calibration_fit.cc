#include "capture/calibration/calibration_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <ceres/jet.h>
#include <opencv2/calib3d.hpp>

#include "core/camera_formulas.h"
#include "core/decompositions.h"
#include "core/projection_jacobian.h"
#include "core/robust_kernel.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
constexpr int kMaxIterations = 100;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What all views share, in this order: the bend of the board, the parameters of the camera.
constexpr int kBends = 3;
template <int kParams>
constexpr int kShared = kParams > 0 ? kBends + kParams : 0;

// Projection of one corner and its derivatives: by what views share (with the first kParams
// parameters of the camera), and by a turn (about the board's origin, in `cam`) and a shift of the
// board.
template <int kParams>
struct Projected {
  Eigen::Vector2d x_in_img;
  Eigen::Matrix<double, 2, kShared<kParams>> by_shared;
  Eigen::Matrix<double, 2, 6> by_pose;
};

// kParams: 0 or kMaxCameraParams (parameters that the model lacks have zero derivatives).
template <int kParams>
std::optional<Projected<kParams>> ProjectCorner(const Camera& camera, const Rigid& cam_from_board,
                                                const BoardView& view, int corner) {
  const Eigen::Vector3d turned = cam_from_board.rotation * view.CornerOnBoard(corner);
  const Eigen::Vector3d x = turned + cam_from_board.translation;
  if (!(x.z() > 1e-9)) return std::nullopt;
  const double u = x.x() / x.z(), v = x.y() / x.z();
  const auto seen = ProjectRay<kParams>(camera.model, camera.params.data(),
                                        static_cast<int>(camera.params.size()), u, v);
  if (!seen.x_in_img.allFinite()) return std::nullopt;
  Projected<kParams> result;
  result.x_in_img = seen.x_in_img;
  // As in align's ReprojectionCost, which divides by z in another order and has a pose of another
  // form: to unite them would change both results in the last bits.
  Eigen::Matrix<double, 2, 3> uv_by_x;
  uv_by_x << 1 / x.z(), 0, -u / x.z(), 0, 1 / x.z(), -v / x.z();
  const Eigen::Matrix<double, 2, 3> by_x = seen.by_ray * uv_by_x;
  if constexpr (kParams > 0) {
    const Eigen::Vector3d up = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
    result.by_shared << by_x * up * view.shapes.col(corner).transpose(), seen.by_params;
  }
  result.by_pose << -by_x * CrossMatrix(turned), by_x;
  return result;
}

// The normal equations of one photo: what is shared (A), both (B), pose (C); right-hand sides a and
// b.
template <int kParams>
struct Equations {
  template <int kColumns>
  using Rows = Eigen::Matrix<double, kShared<kParams>, kColumns>;
  Rows<kShared<kParams>> A = Rows<kShared<kParams>>::Zero();
  Rows<6> B = Rows<6>::Zero();
  Rows<1> a = Rows<1>::Zero();
  Matrix6 C = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  double cost = 0;  // infinite when a corner has no projection
};
using Block = Equations<kMaxCameraParams>;
using PoseBlock = Equations<0>;

template <int kParams>
Equations<kParams> MakeEquations(const BoardView& view, const Camera& camera,
                                 const Rigid& cam_from_board, double huber_px) {
  Equations<kParams> block;
  const double limit = huber_px > 0 ? huber_px / std::sqrt(view.weight) : kInfinity;
  for (int i = 0; i < view.x_on_board.cols(); ++i) {
    if (!view.used[i]) continue;
    const auto projected = ProjectCorner<kParams>(camera, cam_from_board, view, i);
    if (!projected) {
      block.cost = kInfinity;
      return block;
    }
    const Eigen::Vector2d residual = view.x_in_img.col(i) - projected->x_in_img;
    const double length = residual.norm();
    const double weight = view.weight * HuberWeight(length, limit);
    block.cost += view.weight * HuberCost(length, limit);
    if constexpr (kParams > 0) {
      block.A.noalias() += weight * projected->by_shared.transpose() * projected->by_shared;
      block.B.noalias() += weight * projected->by_shared.transpose() * projected->by_pose;
      block.a.noalias() += weight * projected->by_shared.transpose() * residual;
    }
    block.C.noalias() += weight * projected->by_pose.transpose() * projected->by_pose;
    block.b.noalias() += weight * projected->by_pose.transpose() * residual;
  }
  return block;
}

// A + damping times its diagonal.
template <typename Matrix>
Matrix Damped(Matrix matrix, double damping) {
  matrix.diagonal() *= 1 + damping;
  matrix.diagonal().array() += 1e-12;
  return matrix;
}

// Which of the shared unknowns are free.
struct Unknowns {
  int first = 0, count = 0;
};
Unknowns UnknownsOf(const LensModel& lens, bool with_bend) {
  return with_bend ? Unknowns{0, kBends + lens.num_free} : Unknowns{kBends, lens.num_free};
}
bool HasBend(const std::vector<BoardView>& views) { return !views.front().bend.isZero(0); }

// The normal equations of what is shared, with the poses eliminated (Schur complement).
struct ReducedBlock {
  Eigen::MatrixXd S;
  Eigen::VectorXd g;
};

ReducedBlock Reduce(const Block& block, const Unknowns& free, double damping) {
  const Eigen::LDLT<Matrix6> C(Damped(block.C, damping));
  const Eigen::MatrixXd A = block.A.block(free.first, free.first, free.count, free.count);
  const Eigen::MatrixXd B = block.B.middleRows(free.first, free.count);
  return {Damped(A, damping) - B * C.solve(B.transpose()),
          block.a.segment(free.first, free.count) - B * C.solve(block.b)};
}

ReducedBlock SumReduced(const std::vector<Block>& blocks, const Unknowns& free, double damping) {
  ReducedBlock sum{Eigen::MatrixXd::Zero(free.count, free.count),
                   Eigen::VectorXd::Zero(free.count)};
  for (const Block& block : blocks) {
    const ReducedBlock reduced = Reduce(block, free, damping);
    sum.S += reduced.S;
    sum.g += reduced.g;
  }
  return sum;
}

// Inverse of a positive definite matrix whose rows differ by many orders of magnitude; none if it
// is singular.
std::optional<Eigen::MatrixXd> ScaledInverse(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd scale = matrix.diagonal().cwiseMax(0).cwiseSqrt();
  if (!(scale.minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd down = scale.cwiseInverse();
  const Eigen::MatrixXd scaled = down.asDiagonal() * matrix * down.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(scaled);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 1e-13)) return std::nullopt;
  const Eigen::MatrixXd inverse =
      ldlt.solve(Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols()));
  return Eigen::MatrixXd(down.asDiagonal() * inverse * down.asDiagonal());
}

bool IsPossible(const Camera& camera) {
  if (!camera.Problems().empty()) return false;
  const double size = std::max(camera.width, camera.height);
  const double f = camera.MeanFocalLength();
  return f > 0.05 * size && f < 200 * size;
}

Camera WithStep(const Camera& camera, const Eigen::VectorXd& step) {
  Camera moved = camera;
  for (int i = 0; i < step.size(); ++i) moved.params[i] += step[i];
  return moved;
}

std::vector<Block> MakeBlocks(const std::vector<BoardView>& views, const CameraFit& fit,
                              double huber_px) {
  std::vector<Block> blocks;
  for (size_t i = 0; i < views.size(); ++i) {
    blocks.push_back(
        MakeEquations<kMaxCameraParams>(views[i], fit.camera, fit.cam_from_board[i], huber_px));
  }
  return blocks;
}

double SumOfCosts(const std::vector<Block>& blocks) {
  double cost = 0;
  for (const Block& block : blocks) cost += block.cost;
  return cost;
}

// One damped step of all unknowns; unchanged if the equations cannot be solved.
CameraFit Stepped(const CameraFit& fit, const std::vector<Block>& blocks, double damping) {
  const Unknowns free = UnknownsOf(fit.lens, false);
  const ReducedBlock sum = SumReduced(blocks, free, damping);
  const Eigen::VectorXd scale = sum.S.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * sum.S * scale.asDiagonal();
  const Eigen::VectorXd step =
      scale.asDiagonal() * SolveSymmetric(scaled, scale.asDiagonal() * sum.g);
  CameraFit stepped = fit;
  if (!step.allFinite()) return stepped;
  stepped.camera = WithStep(fit.camera, step);
  for (size_t i = 0; i < blocks.size(); ++i) {
    const Vector6 pose_step = SolveSymmetric(
        Damped(blocks[i].C, damping),
        blocks[i].b - blocks[i].B.middleRows(free.first, free.count).transpose() * step);
    if (pose_step.allFinite()) stepped.cam_from_board[i] = Moved(fit.cam_from_board[i], pose_step);
  }
  return stepped;
}

// Both poses that a plane may have for a camera without distortion (Collins & Bartoli 2014),
// refined; the better one.
Rigid RoughPose(const BoardView& view, const Camera& camera) {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> image;
  for (int i = 0; i < view.x_on_board.cols(); ++i) {
    board.emplace_back(view.x_on_board(0, i), view.x_on_board(1, i), 0);
    image.emplace_back(view.x_in_img(0, i), view.x_in_img(1, i));
  }
  const cv::Matx33d K(camera.params[0], 0, camera.params[1], 0, camera.params[0], camera.params[2],
                      0, 0, 1);
  std::vector<cv::Mat> turns, shifts;
  try {
    cv::solvePnPGeneric(board, image, K, cv::noArray(), turns, shifts, false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
  }
  Rigid best;
  best.translation = {0, 0, 1e6};
  double least = kInfinity;
  for (size_t i = 0; i < turns.size(); ++i) {
    const Eigen::Vector3d turn(turns[i].at<double>(0), turns[i].at<double>(1),
                               turns[i].at<double>(2));
    if (!turn.allFinite()) continue;
    Rigid pose;
    pose.rotation = RotationFromVector(turn);
    pose.translation = {shifts[i].at<double>(0), shifts[i].at<double>(1), shifts[i].at<double>(2)};
    pose = FitPose(view, camera, pose, 0);
    const double rms = RmsLength(view, Residuals(view, camera, pose));
    if (!(rms < least)) continue;
    least = rms;
    best = pose;
  }
  return best;
}

void HoldOut(const std::vector<BoardView>& views, const std::vector<Block>& blocks,
             CameraFit* fit) {
  const int n = fit->lens.num_free;
  const Unknowns free = UnknownsOf(fit->lens, HasBend(views));
  const ReducedBlock sum = SumReduced(blocks, free, 0);
  fit->held_out_rms_px.assign(views.size(), kInfinity);
  fit->without_view.assign(views.size(), fit->camera);
  for (size_t i = 0; i < views.size(); ++i) {
    const ReducedBlock own = Reduce(blocks[i], free, 0);
    const auto inverse = ScaledInverse(sum.S - own.S);
    if (!inverse) continue;
    const Eigen::VectorXd step = *inverse * (sum.g - own.g);
    const Camera camera = WithStep(fit->camera, step.tail(n));
    if (!IsPossible(camera)) continue;
    BoardView view = views[i];
    if (free.count > n) view.bend += step.head<kBends>();
    const Rigid pose = FitPose(view, camera, fit->cam_from_board[i], 0);
    const double rms = RmsLength(view, Residuals(view, camera, pose));
    fit->without_view[i] = camera;
    if (std::isfinite(rms)) fit->held_out_rms_px[i] = rms;
  }
}

}  // namespace

std::string LensModel::Name() const {
  const std::string name = CameraModelName(model);
  return num_free == NumCameraParams(static_cast<int>(model)) ? name : name + " (k4 to k6 zero)";
}

const std::vector<LensModel>& LensModels() {
  static const std::vector<LensModel> models = {{CameraModel::kSimpleRadial, 4},
                                                {CameraModel::kRadial, 5},
                                                {CameraModel::kOpenCv, 8},
                                                {CameraModel::kFullOpenCv, 9},
                                                {CameraModel::kFullOpenCv, 12}};
  return models;
}

Camera InRicherModel(const Camera& camera, CameraModel model) {
  Camera richer = camera;
  richer.model = model;
  if (camera_formulas::HasOneFocalLength(camera.model) &&
      !camera_formulas::HasOneFocalLength(model)) {
    richer.params.insert(richer.params.begin(), richer.params[0]);
  }
  richer.params.resize(NumCameraParams(static_cast<int>(model)), 0.0);
  return richer;
}

Eigen::Matrix3Xd BendShapes(const Board& board, const Eigen::Matrix2Xd& x_on_board) {
  const Eigen::Vector2d middle = board.CornerOnBoard(board.NumCorners() - 1) / 2;
  const double half = middle.norm();
  Eigen::Matrix3Xd shapes(3, x_on_board.cols());
  for (int i = 0; i < shapes.cols(); ++i) {
    const Eigen::Vector2d at = (x_on_board.col(i) - middle) / half;
    shapes.col(i) = half * Eigen::Vector3d(at.x() * at.x(), at.x() * at.y(), at.y() * at.y());
  }
  return shapes;
}

BoardView MakeBoardView(const BoardPhoto& photo, const Board& board) {
  BoardView view;
  view.x_in_img = photo.x_in_img;
  view.x_on_board.resize(2, photo.NumCorners());
  for (int i = 0; i < photo.NumCorners(); ++i) {
    view.x_on_board.col(i) = board.CornerOnBoard(photo.corner_ids[i]);
  }
  view.shapes = BendShapes(board, view.x_on_board);
  view.used.assign(photo.NumCorners(), true);
  return view;
}

Eigen::Matrix2Xd Residuals(const BoardView& view, const Camera& camera,
                           const Rigid& cam_from_board) {
  Eigen::Matrix2Xd residuals(2, view.x_on_board.cols());
  for (int i = 0; i < residuals.cols(); ++i) {
    const auto projected = ProjectCorner<0>(camera, cam_from_board, view, i);
    residuals.col(i) =
        projected ? Eigen::Vector2d(view.x_in_img.col(i) - projected->x_in_img)
                  : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()).eval();
  }
  return residuals;
}

double RmsLength(const BoardView& view, const Eigen::Matrix2Xd& residuals) {
  double sum = 0;
  int count = 0;
  for (int i = 0; i < residuals.cols(); ++i) {
    if (!view.used[i]) continue;
    sum += residuals.col(i).squaredNorm();
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

Rigid FitPose(const BoardView& view, const Camera& camera, const Rigid& start, double huber_px) {
  Rigid pose = start;
  PoseBlock block = MakeEquations<0>(view, camera, pose, huber_px);
  double damping = 1e-4;
  for (int iteration = 0; iteration < 50 && std::isfinite(block.cost); ++iteration) {
    const Vector6 step = SolveSymmetric(Damped(block.C, damping), block.b);
    if (!step.allFinite()) break;
    const Rigid moved = Moved(pose, step);
    const PoseBlock next = MakeEquations<0>(view, camera, moved, huber_px);
    if (next.cost < block.cost) {
      const bool done = block.cost - next.cost < 1e-10 * block.cost;
      pose = moved;
      block = next;
      damping = std::max(damping / 10, 1e-12);
      if (done) break;
    } else {
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  return pose;
}

CameraFit RoughFit(const std::vector<BoardView>& views, int width, int height) {
  CameraFit best;
  double least = kInfinity;
  const double size = std::max(width, height);
  for (double f = 0.4 * size; f < 8 * size; f *= 1.25) {
    CameraFit fit;
    fit.lens = LensModels().front();
    fit.camera.camera_id = 1;
    fit.camera.model = fit.lens.model;
    fit.camera.width = width;
    fit.camera.height = height;
    fit.camera.params = {f, width / 2.0, height / 2.0, 0};
    double score = 0;
    for (const BoardView& view : views) {
      fit.cam_from_board.push_back(RoughPose(view, fit.camera));
      const double rms = RmsLength(view, Residuals(view, fit.camera, fit.cam_from_board.back()));
      // Logarithms: a photo that no camera explains shifts all scores alike.
      score += std::isfinite(rms) ? std::log(rms + 1e-4 * size) : std::log(size);
    }
    if (!(score < least)) continue;
    least = score;
    best = fit;
  }
  return best;
}

CameraFit FitCamera(const std::vector<BoardView>& views, const LensModel& lens,
                    const CameraFit& start, double huber_px) {
  CameraFit fit;
  fit.lens = lens;
  fit.camera = InRicherModel(start.camera, lens.model);
  for (size_t i = lens.num_free; i < fit.camera.params.size(); ++i) fit.camera.params[i] = 0;
  fit.cam_from_board = start.cam_from_board;
  std::vector<Block> blocks = MakeBlocks(views, fit, huber_px);
  fit.cost = SumOfCosts(blocks);
  double damping = 1e-4;
  int num_small = 0;
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(fit.cost); ++iteration) {
    CameraFit next = Stepped(fit, blocks, damping);
    next.cost = kInfinity;
    std::vector<Block> next_blocks;
    if (IsPossible(next.camera)) {
      next_blocks = MakeBlocks(views, next, huber_px);
      next.cost = SumOfCosts(next_blocks);
    }
    if (next.cost < fit.cost) {
      num_small = fit.cost - next.cost < 1e-9 * fit.cost ? num_small + 1 : 0;
      fit = next;
      blocks = std::move(next_blocks);
      damping = std::max(damping / 10, 1e-12);
      if (num_small >= 2) break;
    } else {
      damping *= 10;
      if (damping > 1e8) break;  // no direction leads down: the optimum, to rounding
    }
  }
  fit.converged = std::isfinite(fit.cost) && (num_small >= 2 || damping > 1e8);
  return fit;
}

void Finish(const std::vector<BoardView>& views, CameraFit* fit) {
  const int n = fit->lens.num_free;
  const auto num_params = static_cast<Eigen::Index>(fit->camera.params.size());
  const std::vector<Block> blocks = MakeBlocks(views, *fit, 0);
  const Unknowns free = UnknownsOf(fit->lens, HasBend(views));
  int num_coordinates = 0;
  fit->residuals.clear();
  fit->view_rms_px.clear();
  for (size_t i = 0; i < views.size(); ++i) {
    fit->residuals.push_back(Residuals(views[i], fit->camera, fit->cam_from_board[i]));
    fit->view_rms_px.push_back(RmsLength(views[i], fit->residuals[i]));
    num_coordinates +=
        2 * static_cast<int>(std::count(views[i].used.begin(), views[i].used.end(), true));
  }
  const double sum = SumOfCosts(blocks);
  fit->redundancy = num_coordinates - free.count - 6 * static_cast<int>(views.size());
  fit->sigma_px = fit->redundancy > 0 ? std::sqrt(sum / fit->redundancy) : kInfinity;
  fit->covariance = Eigen::MatrixXd::Zero(num_params, num_params);
  const auto inverse = ScaledInverse(SumReduced(blocks, free, 0).S);
  if (inverse && fit->redundancy > 0) {
    fit->covariance.topLeftCorner(n, n) =
        fit->sigma_px * fit->sigma_px * inverse->bottomRightCorner(n, n);
  } else {
    fit->covariance.topLeftCorner(n, n).diagonal().setConstant(kInfinity);
  }
  HoldOut(views, blocks, fit);
}

// Gauss-Newton on all unknowns, the bend aside from the descent of the others: what it moves them
// by is found anew.
BentFit FitBend(std::vector<BoardView> views, const CameraFit& start, double huber_px) {
  constexpr int kRounds = 8;
  constexpr double kLargestBend = 0.3;  // half a diagonal is raised by as much: no board
  BentFit bent;
  bent.fit = start;
  const Unknowns free = UnknownsOf(start.lens, true);
  for (int round = 0; round < kRounds; ++round) {
    const ReducedBlock sum = SumReduced(MakeBlocks(views, bent.fit, huber_px), free, 0);
    const auto inverse = ScaledInverse(sum.S);
    if (!inverse) return bent;
    const Eigen::Vector3d step = (*inverse * sum.g).head<kBends>();
    bent.bend += step;
    if (!(bent.bend.norm() < kLargestBend)) return bent;
    for (BoardView& view : views) view.bend = bent.bend;
    bent.fit = FitCamera(views, start.lens, bent.fit, huber_px);
    bent.bend_covariance = inverse->topLeftCorner<kBends, kBends>();
    if (step.norm() < 1e-7) break;
  }
  Finish(views, &bent.fit);
  bent.bend_covariance *= bent.fit.sigma_px * bent.fit.sigma_px;
  bent.found = std::isfinite(bent.fit.sigma_px);
  return bent;
}

}  // namespace roomtex
