#pragma once
// A scan that is itself slightly and smoothly bent (thesis 7.2): by how much, seen against the
// sparse model, whose shape the photos fix far better. The field's words: non-rigid distortion of a
// scan (Brown and Rusinkiewicz 2007, "Global Non-Rigid Alignment of 3-D Scans"), and for what
// causes it, the scanner's systematic errors (Lichti 2007, "Error Modelling, Calibration and
// Analysis of an AM-CW Terrestrial Laser Scanner System").
//
// Beyond the thesis. Distances of points from surfaces say nothing about sliding along them. Fitted
// to a bent scan, a similarity (or a bundle adjustment) follows the walls and shifts every colour
// along the walls by as much. So the bend is estimated as what a scanner does wrong:
// ranges too long or short and azimuths off, smoothly changing with the direction.

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/clicks/picks.h"
#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "colmap_ext/sparse_model.h"
#include "core/scan.h"

namespace roomtex {

// Where the scan has a point of the room. Frame: `scan`.
class ScanBend {
 public:
  // No bend.
  ScanBend() = default;
  // The scanner's place, up, and where its first column lies. scan: organised.
  explicit ScanBend(const Scan& scan);

  // Number of coefficients: ranges (a share, spherical harmonics of degree 1 to 4), then azimuths
  // (radians: steadily growing over the turn, once and twice around).
  static constexpr int kNumRange = 24, kNumAzimuth = 5, kNumCoefficients = kNumRange + kNumAzimuth;
  using Coefficients = Eigen::Matrix<double, kNumCoefficients, 1>;
  Coefficients coefficients = Coefficients::Zero();

  bool IsNone() const { return coefficients.isZero(0); }
  // From where a point is to where the scan has it.
  Eigen::Vector3d Bend(const Eigen::Vector3d& x_in_scan) const;
  // The inverse of Bend.
  Eigen::Vector3d Straighten(const Eigen::Vector3d& x_in_scan) const;
  // Derivatives of Bend(x) by the coefficients, at none; metres.
  Eigen::Matrix<double, 3, kNumCoefficients> Basis(const Eigen::Vector3d& x_in_scan) const;

  // Range share and azimuth (radians) in the direction of a point.
  Eigen::Vector2d At(const Eigen::Vector3d& x_in_scan) const;

 private:
  Coefficients Functions(const Eigen::Vector3d& offset) const;

  Eigen::Vector3d station_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes_ = Eigen::Matrix3d::Identity();  // rows: first column, sideways, up
  double turn_ = 1;                                     // +1: columns run counter-clockwise
};

// Metres, rms; a scanner that measures 1 % wrong (the worst that the thesis speaks of) at 2 to 3 m.
// What is bent by more was not bent by a scanner.
inline constexpr double kMaxScannerBend = 0.025;

struct BendFit {
  Similarity scan_from_sparse;  // of the room as it is
  ScanBend bend;
  double bend_rms = 0;  // metres; of the bend at the points that lie on the surface
  double rms_straight = 0, rms_bent = 0;  // distances from the surface without and with it, metres
  int num_points = 0;
  double followed = 1;  // `bend` is this share of what was found

  // What the bend takes away of the squared distances, as a share of its own square. A scan that is
  // bent lies beside the points by as much as it is bent across its surfaces; what is fitted to
  // drifting parts bends far and explains little.
  double Explained() const {
    return (rms_straight * rms_straight - rms_bent * rms_bent) / (bend_rms * bend_rms);
  }
};

// Similarity and bend together, from the distances of the points from the surface and from the
// picks. How large coefficients may be follows from the data: their variance is the one that makes
// the data most likely (evidence, MacKay 1992), found by expectation maximisation (Dempster et al.
// 1977), so that a straight scan stays straight. None if the scan is not bent by more than min_bend
// (rms, metres) or by more than any scanner does (5 % of the ranges), or has no grid, or there are
// several scans.
std::optional<BendFit> FitScanBend(const SparseModel& model,
                                   const std::vector<SurfacePoint>& points,
                                   const std::vector<Scan>& scans, const ScanPatches& surface,
                                   const std::vector<Pick>& picks, const std::vector<bool>& used,
                                   double pick_sigma_px, const Similarity& start, double min_bend);

}  // namespace roomtex
