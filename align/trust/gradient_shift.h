#pragma once
// How far the scan's intensity has to be shifted, patch by patch, to lie on the photo: the check of
// an alignment that needs no picks and no sparse points.
//
// Intensity (infrared, reflected) and brightness differ, also in sign, but both change at the same
// places. So patches of gradient magnitude are compared by normalised cross correlation, and only
// at corners (Shi and Tomasi 1994, "Good Features to Track"), where a shift shows in every
// direction. What the shifts are worth is told by two controls that are measured beside them: the
// same patches at poses that are surely wrong, and the same patches at other places of the photo
// (chance).

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "align/trust/scan_view.h"
#include "core/camera_model.h"

namespace roomtex {

struct GradientShiftOptions {
  int max_patches = 120;  // per photo, the strongest corners first
  int patch_radius = 8;   // cells of the view; a patch is 2 * this + 1 wide
  // A patch fits where it should if the best shift is within this, or within so many steps between
  // the scan's samples if that is more. Larger = more tolerant, of chance hits as well.
  double min_tolerance_deg = 0.2;
  double tolerance_samples = 2;
  // The search reaches this many times the tolerance to all sides. Larger = fewer chance hits.
  double search_reach = 6;
  // A corner counts when the smaller eigenvalue of its gradients is this many times the lower
  // quintile over the view, which is noise. Larger = fewer patches.
  double min_corner_ratio = 10;
  // Degrees by which the cameras are turned, metres by which they are moved, for comparison.
  std::vector<double> turns_deg = {0.5, 1, 3};
  std::vector<double> moves = {0.01, 0.02, 0.05};
};

// Hits among trials.
struct Tally {
  long num = 0, hits = 0;
  double Share() const { return num > 0 ? static_cast<double>(hits) / num : 0; }
  void Add(bool hit) {
    ++num;
    hits += hit;
  }
  void Add(const Tally& other) {
    num += other.num;
    hits += other.hits;
  }
  // Ends of the interval that holds the true share with `sigmas` standard deviations (Wilson 1927).
  double Low(double sigmas) const;
  double High(double sigmas) const;
};

// A corner of the scan's intensity, where a photo shows it.
struct FittingCorner {
  uint32_t image_id = 0;  // set by MeasureAgreement()
  Eigen::Vector2d x_in_img = Eigen::Vector2d::Zero();
  Eigen::Vector3d x_in_cam = Eigen::Vector3d::Zero();  // metres, of the pose that was looked from
};

// The shifts of the patches of one or more photos.
struct GradientShifts {
  int num_photos = 0;                // with at least one patch
  int num_unclear_photos = 0;        // of them: brightness changes nearly everywhere, or nowhere
  std::vector<double> shifts_px;     // one per patch, pixels of the photo
  std::vector<double> shifts_deg;    // the same as angles
  Tally at_pose;                     // patches, and those within the tolerance
  Tally ring;                        // the same patches, and those within one to two tolerances
  Tally clear;                       // as at_pose, of the photos that are clear
  std::vector<Tally> turned, moved;  // as GradientShiftOptions::turns_deg, moves
  // Of turned and moved together, the patches that come to lie farther than twice the tolerance
  // from where the pose has them: what a wrong pose gives.
  Tally far;
  Tally elsewhere;  // patches compared with another place of the photo: chance
  double tolerance_deg = 0;
  std::vector<FittingCorner> corners;  // of clear photos, those within the tolerance
  // Of these photos, the others, where the scan has them; `img`.
  std::vector<Eigen::Vector2d> corners_amiss;
  // Where a photo shows many more patches shifted alike than by chance: these patches, where
  // the photo shows them (MeasureAgreement() keeps those of clear photos). A pose that is a few
  // degrees off, by drift or by a bent model, shifts all of what one photo shows.
  std::vector<FittingCorner> shifted_alike;
  // The patches, and those that are shifted alike in their photo (as above, however few); and how
  // many are so by chance.
  struct Alike {
    Tally patches;
    double num_by_chance = 0;
    void Add(const Alike& other) {
      patches.Add(other.patches);
      num_by_chance += other.num_by_chance;
    }
  };
  // Of photos that are not bare: clear ones; plain ones are not as busy as under a pattern.
  Alike alike_of_clear, alike_of_plain;

  // Share of the patches that are where the scan has them, but for what their photo is off as a
  // whole: beyond chance, 0 (none) to 1 (all). Of clear photos; of all plain ones where those
  // have fewer patches than tell anything; none where these have, too.
  std::optional<double> ShownShare() const;

  void Add(const GradientShifts& other);
};

// photo: 8-bit BGR of the size of the camera. sample_angle: radians, see ScanViewer.
GradientShifts MeasureGradientShifts(const ScanView& view, const cv::Mat& photo,
                                     const CameraProjection& projection, double sample_angle,
                                     const GradientShiftOptions& options);

struct GradientAgreement {
  GradientShifts shifts;
  double median_shift_px = 0, median_shift_deg = 0;
  // More patches fit than by chance, than at wrong poses, and than just beside the tolerance, each
  // clearly: the alignment is right to about the tolerance.
  bool supports = false;
  // Enough patches that should fit, and no more do than by chance: the alignment is wrong. Unclear
  // photos do not count: a pattern projected onto the walls (thesis 5.1.2) is not seen by the
  // scanner and buries what is.
  bool contradicts = false;
  std::string reason;  // a sentence, when it contradicts
};
GradientAgreement JudgeGradientShifts(const GradientShifts& shifts);

}  // namespace roomtex
