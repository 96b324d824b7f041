#pragma once
// Bundle adjustment (Triggs et al. 2000, "Bundle Adjustment - A Modern Synthesis") of the aligned
// model with its points held on the surface of the scan: plane-constrained bundle adjustment
// (thesis 7.2, Appendix C).

#include <map>
#include <set>
#include <string>
#include <vector>

#include "align/clicks/picks.h"
#include "align/clicks/view_pose.h"
#include "align/fit/plane_association.h"
#include "align/fit/scan_bend.h"
#include "align/surface/scan_patches.h"
#include "align/surface/scan_planes.h"
#include "colmap_ext/reprojection_cost.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

class OptionFields;

struct PlaneBundleOptions {
  // Pixels per metre; weight of a point's distance from its surface against its reprojection
  // errors, the thesis' beta. Larger = nearer to the scan. 0 = per point from the ratio of image
  // noise and scan noise.
  double beta = 0;
  // Which points are held on which surface: by flat patches, too (thesis, chapter 10). Each round
  // has a gate of its own.
  PlaneAssociationOptions association;
  int min_track = 2;  // observations that a point needs to be held on a surface
  // The photo of the picks keeps its pose, as in the thesis; else its picks hold it no more than
  // their noise allows.
  bool fix_clicked_view = false;
  // Lenses are adjusted, too (PlaneBundleInput::lens_of_camera), held near what was told by
  // LensPrior. No option of its own: see AlignmentOptions::refine_intrinsics.
  bool refine_intrinsics = false;
  bool hold_centre = false;  // LensPrior's
  // Rolling shutters: photos move while their rows are read (RowMotion). No option of its own.
  bool row_motion = false;
  // One may have bent the model, which may go farther then.
  bool rolled = false;
  // Whether a smooth bend of the scan is looked for (FitScanBend), and the least one that counts:
  // metres, rms over the points on the surface. Smaller ones are within the noise.
  bool bend = true;
  double min_bend = 0.001;
  bool rolling_shutter = true;  // whether photos are asked for one (FindRollingShutter)
  int num_rounds = 5;       // points are given to surfaces anew this often, less if nothing changes
  int max_iterations = 25;  // of each round

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct PlaneBundleInput {
  // In the scan frame, by a similarity; of a bent scan: where the room really is (BendFit).
  const SparseModel& model;
  const std::vector<ScanPlane>& planes;
  const ScanPatches& patches;
  const std::vector<Pick>& picks;           // of all photos
  std::vector<bool> used;                   // one per pick
  double pick_sigma_px = kUsualClickSigma;  // click noise, per coordinate
  std::string clicked_image;                // for fix_clicked_view
  ScanBend bend = ScanBend();               // where the scan has what the photos see
  // Cameras with the same number are one lens; one that lacks here is a lens of its own.
  std::map<uint32_t, int> lens_of_camera = {};
  std::map<uint32_t, Camera> told = {};  // as told, where the model's cameras are no longer that
  // Image noise per coordinate, pixels; 0 = from the residuals of `model`.
  double sigma_px = 0;
  // Pixels; how far picks are off, however well they are made, because model and scan disagree.
  double pick_bend_px = 0;
  // Photos whose keypoints were put where they would be had all rows been read with the middle one:
  // what such a motion leaves open is in the covariances.
  RowMotions row_motions = {};
};

struct PlaneBundle {
  // False: `model` is the input, and `reason` says in a sentence what went wrong.
  bool usable = false;
  std::string reason;
  SparseModel model;  // adjusted, on the surface of the scan as it is; errors updated
  // The similarity from the input model to the adjusted one (least squares over cameras and points
  // on the surface), and what it leaves of the cameras: how much the adjustment bent the model.
  // Metres. Both before the model is put onto a bent scan.
  Similarity adjusted_from_input;
  double max_bending = 0;

  // With row_motion: of the photos that took part. Their keypoints in `model` are then where they
  // would be had all rows been read with the middle one.
  RowMotions motions;

  // Photos that took no part, because too few points hold them or because they ran away; they
  // follow the similarity.
  std::set<uint32_t> idle_images;
  std::set<uint32_t> ran_away;  // of these: their points want them elsewhere

  std::vector<SurfaceConstraint> constraints;  // of the last round
  std::vector<int> num_points_of_plane;        // of these, one per plane
  // RMS distance of these points from their surfaces, metres; the same points before and after.
  double plane_rms_before = 0, plane_rms_after = 0;
  // RMS over all observations, pixels.
  double reprojection_rms_before = 0, reprojection_rms_after = 0;
  double sigma_px = 0;  // image noise per coordinate: the input's, or that of its residuals
  // By image_id: sum over the photo's observations of Huber's cost of the reprojection error in
  // units of sigma_px, of the adjusted model before it is put onto a bent scan: twice the negative
  // log likelihood. All of them together are the bundle's image cost.
  std::map<uint32_t, double> photo_costs;
  int num_rounds = 0;
};

// Of the image cost of `bundle` what is of photos that take part in it and in `other`: a photo that
// only one of them puts back must not decide between the two.
double SharedImageCost(const PlaneBundle& bundle, const PlaneBundle& other);

// Minimises reprojection errors (Huber) + distances of the points from their surfaces (Cauchy) +
// errors of the picks (Huber) over all poses and points. Points are given to surfaces anew from
// round to round. The surfaces hold the gauge; what they leave open (one wall only) the picks hold.
// Points within 1 cm of a camera that sees them are left out of the result.
// A bent scan is straightened for that. In the end the points are bent like the scan and each photo
// is fitted to them; a photo itself cannot be bent, so its reprojection errors grow.
// Does not depend on the number of threads: Ceres runs on one thread.
PlaneBundle AdjustToSurface(const PlaneBundleInput& input, const PlaneBundleOptions& options);

}  // namespace roomtex
