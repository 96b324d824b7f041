#include "align/trust/open_directions.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/core.h>

#include "core/frames.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr double kMaxSlide = 0.02;    // metres
constexpr double kMaxTurn_deg = 0.5;  // degrees
constexpr double kMaxGrowth = 0.01;
// What is known without any surface: keeps the inverse finite, and is far beyond all limits.
constexpr double kPriorSlide = 1.0, kPriorTurn = 0.5, kPriorGrowth = 0.5;  // metres, radians, share
// The surface faces a way when at least this share of it does (an eigenvalue of the mean n n^T).
constexpr double kMinFacing = 0.03;

// Eigenvectors of a covariance whose standard deviations exceed the limit, worst first.
std::vector<Eigen::Vector3d> Open(const Eigen::Matrix3d& covariance, double limit) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  std::vector<Eigen::Vector3d> open;
  for (int k = 2; k >= 0; --k) {
    if (solver.eigenvalues()[k] > limit * limit) open.push_back(solver.eigenvectors().col(k));
  }
  return open;
}

// Derivatives of a point's position by the seven numbers of the fit.
Eigen::Matrix<double, 3, 7> PointJacobian(const Eigen::Vector3d& arm) {
  Eigen::Matrix<double, 3, 7> jacobian;
  jacobian.leftCols<3>().setIdentity();
  jacobian.middleCols<3>(3) << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
  jacobian.col(6) = arm;
  return jacobian;
}

std::string Listed(const std::vector<Eigen::Vector3d>& directions) {
  std::string text;
  for (const Eigen::Vector3d& direction : directions) {
    // No "-0.00": adding zero makes it positive.
    const Eigen::Vector3d d = (100 * direction).array().round() / 100 + 0.0;
    text +=
        fmt::format("{}({:.2f}, {:.2f}, {:.2f})", text.empty() ? "" : ", ", d.x(), d.y(), d.z());
  }
  return text;
}

}  // namespace

OpenDirections FindOpenDirections(const SimilarityFit& fit, const Eigen::Vector3d& x_in_scan) {
  OpenDirections open;
  if (!fit.converged || !fit.covariance.allFinite()) return open;
  Matrix7d information = fit.surface_information;
  for (int k = 0; k < 7; ++k) {
    const double prior = k < 3 ? kPriorSlide : k < 6 ? kPriorTurn : kPriorGrowth;
    information(k, k) += 1 / (prior * prior);
  }
  const Matrix7d covariance = information.ldlt().solve(Matrix7d::Identity());
  const Eigen::Matrix<double, 3, 7> jacobian = PointJacobian(x_in_scan - fit.pivot);
  open.slides = Open(jacobian * covariance * jacobian.transpose(), kMaxSlide);
  open.turns = Open(covariance.block<3, 3>(3, 3), RadFromDeg(kMaxTurn_deg));
  open.scale = covariance(6, 6) > kMaxGrowth * kMaxGrowth;
  const Eigen::Matrix3d together = jacobian * fit.covariance * jacobian.transpose();
  for (const Eigen::Vector3d& slide : open.slides) {
    open.slide_sigma = std::max(open.slide_sigma, std::sqrt(slide.dot(together * slide)));
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> facing(fit.facing);
  open.num_facings = static_cast<int>((facing.eigenvalues().array() > kMinFacing).count());
  return open;
}

std::string OpenDirections::Sentence(HeldBy held_by) const {
  if (None()) return "";
  std::string open;
  const auto add = [&](const std::string& what) { open += (open.empty() ? "" : ", ") + what; };
  if (!slides.empty()) add("where the model lies along " + Listed(slides));
  if (!turns.empty()) add("how it is turned about " + Listed(turns));
  if (scale) add("its scale");
  const std::string left_open =
      fmt::format("The surface of the scan that the sparse points lie on {} and leaves open {}: ",
                  num_facings == 1   ? "faces one way only (one wall, or walls opposite each other)"
                  : num_facings == 2 ? "faces two ways only"
                                     : "is too small or too round",
                  open);
  if (held_by == HeldBy::kNothing) {
    return left_open + "there nothing holds it. Six picks would, or a scan of more of the room.";
  }
  return left_open +
         fmt::format(
             "there {} alone hold it{}. More picks, or a scan of more of the room, would make it "
             "safer.",
             held_by == HeldBy::kPhotos ? "the photos, by what they show of the scan's intensity,"
                                        : "the picks",
             slides.empty() ? ""
                            : ", to " + Number(1000 * slide_sigma, 1) +
                                  " mm at the photos (one standard deviation)");
}

}  // namespace roomtex
