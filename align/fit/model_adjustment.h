#pragma once
// The aligned model adjusted to the surface of the scan, bent or not (thesis 7.2).

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "align/clicks/view_pose.h"
#include "align/fit/plane_bundle.h"
#include "align/fit/pose_covariance.h"
#include "align/fit/scan_bend.h"
#include "align/fit/similarity_fit.h"

namespace roomtex {

// What becomes of the lenses when a model is adjusted to the surface.
enum class LensChoice {
  kHeld,
  kFree,
  kFreeButCentre,  // principal point and tangential distortion only if the photos ask for it
  kByScan,         // freed if the model fits the surface better for it
};

struct ModelAdjustmentInput {
  const SparseModel& model;                 // in its own frame
  const std::vector<SurfacePoint>& points;  // of the model
  const std::vector<Scan>& scans;
  const std::vector<ScanPlane>& planes;
  const ScanPatches& patches;
  const std::vector<Pick>& picks;  // may be empty
  std::vector<bool> used;          // one per pick
  double pick_sigma_px = kUsualClickSigma;
  std::string clicked_image;  // for PlaneBundleOptions::fix_clicked_view; may be empty
  LensChoice lens = LensChoice::kHeld;
  // As in PlaneBundleInput.
  std::map<uint32_t, int> lens_of_camera = {};
  std::map<uint32_t, Camera> told = {};
  double pick_bend_px = 0;  // PlaneBundleInput
  RowMotions row_motions = {};
  bool freed_with_rows = false;  // lenses were, when these motions were found
};

struct ModelAdjustment {
  PlaneBundle bundle;           // its model is the answer if it is usable
  std::optional<BendFit> bend;  // of a bent scan
  // Of a bent scan, by AdjustModel(): adjusted to it as it is, which the bend was judged against.
  std::optional<PlaneBundle> straight;
  // From the input model to the adjusted one, the best there is (of a bent scan: to where the room
  // really is). If the bundle is not usable: the start's.
  Similarity scan_from_sparse;
  PoseCovariances covariances;
  bool freed = false;  // lenses were adjusted
  // Of their parameters, by camera_id.
  std::map<uint32_t, Eigen::MatrixXd> camera_covariances;
};

// Whether the photos ask for lenses of their own: freed, the adjustment costs clearly less.
bool IsLensBetter(const PlaneBundle& held, const PlaneBundle& freed);

// From a similarity that lies on the surface. With options.bend, and unless the clicked photo is
// fixed, a bent scan is told from a bent model by the photos: straightening it must lower the cost
// of their observations, below that of a straight scan with its lenses freed, too; on a bent scan
// lenses stay as they came.
ModelAdjustment AdjustModel(const ModelAdjustmentInput& input, const Similarity& start,
                            const PlaneBundleOptions& options, int num_threads);

// The same where it is known whether the scan is bent and how much of that is followed: as `like`
// has it. The bend itself is found anew.
ModelAdjustment AdjustModelLike(const ModelAdjustment& like, const ModelAdjustmentInput& input,
                                const Similarity& start, const PlaneBundleOptions& options);

}  // namespace roomtex
