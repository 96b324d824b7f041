#include "texture/registration/shift_solver.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "core/robust_kernel.h"

namespace roomtex {
namespace {

constexpr int kOfPose = PhotoMotion::RowsAtCompileTime;
using PoseBlock = Eigen::Matrix<double, kOfPose, kOfPose>;

// The least-squares problem A x = b with a prior, its unknowns photo by photo: pose, then warp.
class ShiftProblem {
 public:
  ShiftProblem(const std::vector<MeasuredShift>& shifts, const std::vector<PhotoPrior>& priors)
      : shifts_(shifts), priors_(priors), weights_(shifts.size(), 1.0) {
    int size = 0;
    for (const PhotoPrior& prior : priors) {
      first_.push_back(size);
      if (!prior.is_free) continue;
      size += kOfPose + (prior.warp != nullptr ? 2 * prior.warp->num_nodes() : 0);
    }
    first_.push_back(size);
  }

  int size() const { return first_.back(); }

  // How far the measured place of a shift moves against the others.
  Eigen::Vector2d Motion(const MeasuredShift& shift, const Eigen::VectorXd& x) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const MeasuredShift::Term& term : shift.terms) {
      if (!priors_[term.place.photo].is_free) continue;
      sum += term.share.cast<double>() * MotionInPhoto(term.place, x);
    }
    return sum;
  }

  void Reweight(const Eigen::VectorXd& x, double outlier_px) {
    for (size_t i = 0; i < shifts_.size(); ++i) {
      const Eigen::Vector2d left = shifts_[i].shift.cast<double>() - Motion(shifts_[i], x);
      weights_[i] = GemanMcClureWeight(left.squaredNorm() / (outlier_px * outlier_px));
    }
  }

  // A^T W b with the pull of the prior towards where the photo came from.
  Eigen::VectorXd Right() const {
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size());
    for (size_t i = 0; i < shifts_.size(); ++i) AddPull(i, shifts_[i].shift.cast<double>(), &right);
    Eigen::VectorXd stand = Eigen::VectorXd::Zero(size());
    for (size_t p = 0; p < priors_.size(); ++p) {
      if (!priors_[p].is_free) continue;
      stand.segment<kOfPose>(first_[p]) = priors_[p].pose;
      for (int n = 0; HasWarp(p) && n < priors_[p].warp->num_nodes(); ++n) {
        stand.segment<2>(Node(p, n)) = priors_[p].warp->Shift(n).cast<double>();
      }
    }
    AddPrior(-stand, &right);
    return right;
  }

  // (A^T W A + prior) x
  Eigen::VectorXd Apply(const Eigen::VectorXd& x) const {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(size());
    for (size_t i = 0; i < shifts_.size(); ++i) AddPull(i, Motion(shifts_[i], x), &result);
    AddPrior(x, &result);
    return result;
  }

  // Inverse blocks of the diagonal: poses whole, nodes by 2 x 2 numbers.
  void MakePreconditioner() {
    pose_blocks_.assign(priors_.size(), PoseBlock::Zero());
    diagonal_ = Eigen::VectorXd::Zero(size());
    for (size_t p = 0; p < priors_.size(); ++p) {
      if (priors_[p].is_free) {
        pose_blocks_[p].diagonal() = priors_[p].pose_sigma.array().square().inverse().matrix();
      }
    }
    for (size_t i = 0; i < shifts_.size(); ++i) {
      const Eigen::Matrix2d information = weights_[i] * shifts_[i].information.cast<double>();
      for (const MeasuredShift::Term& term : shifts_[i].terms) {
        const PlaceInPhoto& place = term.place;
        if (!priors_[place.photo].is_free) continue;
        const Eigen::Matrix2d share = term.share.cast<double>();
        const Eigen::Matrix2d in_photo = share.transpose() * information * share;
        const Eigen::Matrix<double, 2, kOfPose> by_pose = place.by_pose.cast<double>();
        pose_blocks_[place.photo] += by_pose.transpose() * in_photo * by_pose;
        for (int k = 0; HasWarp(place.photo) && k < 4; ++k) {
          const double w = place.node_weights[k];
          diagonal_.segment<2>(Node(place.photo, place.nodes[k])) += w * w * in_photo.diagonal();
        }
      }
    }
    for (size_t p = 0; p < priors_.size(); ++p) {
      if (!priors_[p].is_free) continue;
      pose_blocks_[p] = pose_blocks_[p].ldlt().solve(PoseBlock::Identity()).eval();
      if (!HasWarp(p)) continue;
      const double hold = 1 / Square(priors_[p].warp_sigma) + 4 / Square(priors_[p].step_sigma);
      for (int n = 0; n < priors_[p].warp->num_nodes(); ++n) {
        diagonal_.segment<2>(Node(p, n)).array() += hold;
      }
    }
  }

  Eigen::VectorXd Precondition(const Eigen::VectorXd& x) const {
    Eigen::VectorXd result = x;
    for (size_t p = 0; p < priors_.size(); ++p) {
      if (!priors_[p].is_free) continue;
      result.segment<kOfPose>(first_[p]) = pose_blocks_[p] * x.segment<kOfPose>(first_[p]);
      const int begin = first_[p] + kOfPose, count = first_[p + 1] - begin;
      result.segment(begin, count).array() /= diagonal_.segment(begin, count).array();
    }
    return result;
  }

  PhotoStep StepOf(size_t p, const Eigen::VectorXd& x) const {
    PhotoStep step;
    if (!priors_[p].is_free) return step;
    step.pose = x.segment<kOfPose>(first_[p]);
    for (int n = 0; HasWarp(p) && n < priors_[p].warp->num_nodes(); ++n) {
      step.warp.push_back(x.segment<2>(Node(p, n)).cast<float>());
    }
    return step;
  }

 private:
  static double Square(double x) { return x * x; }
  bool HasWarp(size_t p) const { return priors_[p].is_free && priors_[p].warp != nullptr; }
  int Node(size_t p, int node) const { return first_[p] + kOfPose + 2 * node; }

  Eigen::Vector2d MotionInPhoto(const PlaceInPhoto& place, const Eigen::VectorXd& x) const {
    Eigen::Vector2d motion = place.by_pose.cast<double>() * x.segment<kOfPose>(first_[place.photo]);
    for (int k = 0; HasWarp(place.photo) && k < 4; ++k) {
      motion += place.node_weights[k] * x.segment<2>(Node(place.photo, place.nodes[k]));
    }
    return motion;
  }

  // Row i of A, transposed and weighted, times a motion.
  void AddPull(size_t i, const Eigen::Vector2d& motion, Eigen::VectorXd* sum) const {
    const Eigen::Vector2d pull = weights_[i] * (shifts_[i].information.cast<double>() * motion);
    for (const MeasuredShift::Term& term : shifts_[i].terms) {
      const PlaceInPhoto& place = term.place;
      if (!priors_[place.photo].is_free) continue;
      const Eigen::Vector2d in_photo = term.share.cast<double>().transpose() * pull;
      sum->segment<kOfPose>(first_[place.photo]) +=
          place.by_pose.cast<double>().transpose() * in_photo;
      for (int k = 0; HasWarp(place.photo) && k < 4; ++k) {
        sum->segment<2>(Node(place.photo, place.nodes[k])) += place.node_weights[k] * in_photo;
      }
    }
  }

  // Poses and nodes near zero, neighbouring nodes near each other.
  void AddPrior(const Eigen::VectorXd& x, Eigen::VectorXd* sum) const {
    for (size_t p = 0; p < priors_.size(); ++p) {
      const PhotoPrior& prior = priors_[p];
      if (!prior.is_free) continue;
      sum->segment<kOfPose>(first_[p]) +=
          x.segment<kOfPose>(first_[p]).cwiseQuotient(prior.pose_sigma.cwiseAbs2());
      if (!HasWarp(p)) continue;
      const double hold = 1 / Square(prior.warp_sigma), smooth = 1 / Square(prior.step_sigma);
      const int columns = prior.warp->columns(), rows = prior.warp->rows();
      const auto tie = [&](int a, int b) {
        const Eigen::Vector2d pull = smooth * (x.segment<2>(Node(p, a)) - x.segment<2>(Node(p, b)));
        sum->segment<2>(Node(p, a)) += pull;
        sum->segment<2>(Node(p, b)) -= pull;
      };
      for (int n = 0; n < prior.warp->num_nodes(); ++n) {
        sum->segment<2>(Node(p, n)) += hold * x.segment<2>(Node(p, n));
        if (n % columns + 1 < columns) tie(n, n + 1);
        if (n / columns + 1 < rows) tie(n, n + columns);
      }
    }
  }

  const std::vector<MeasuredShift>& shifts_;
  const std::vector<PhotoPrior>& priors_;
  std::vector<double> weights_;  // robust
  std::vector<int> first_;       // unknown of each photo
  std::vector<PoseBlock> pose_blocks_;
  Eigen::VectorXd diagonal_;
};

// Conjugate gradients (Hestenes and Stiefel 1952) from x on.
void Descend(const ShiftProblem& problem, Eigen::VectorXd* x) {
  constexpr int kMostSteps = 200;
  constexpr double kEnough = 1e-6;
  Eigen::VectorXd left = problem.Right() - problem.Apply(*x);
  Eigen::VectorXd scaled = problem.Precondition(left), direction = scaled;
  double size = left.dot(scaled);
  const double first = problem.Right().dot(problem.Precondition(problem.Right()));
  for (int i = 0; i < kMostSteps && size > kEnough * first; ++i) {
    const Eigen::VectorXd image = problem.Apply(direction);
    const double length = size / direction.dot(image);
    *x += length * direction;
    left -= length * image;
    scaled = problem.Precondition(left);
    const double next = left.dot(scaled);
    direction = scaled + next / size * direction;
    size = next;
  }
}

}  // namespace

std::vector<PhotoStep> SolveShifts(const std::vector<MeasuredShift>& shifts,
                                   const std::vector<PhotoPrior>& priors, double outlier_px) {
  ShiftProblem problem(shifts, priors);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(problem.size());
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds && problem.size() > 0; ++round) {
    // The first time nothing is known: what lies far off is weighed by that.
    if (round > 0) problem.Reweight(x, outlier_px);
    problem.MakePreconditioner();
    Descend(problem, &x);
  }
  std::vector<PhotoStep> steps;
  for (size_t p = 0; p < priors.size(); ++p) steps.push_back(problem.StepOf(p, x));
  return steps;
}

}  // namespace roomtex
