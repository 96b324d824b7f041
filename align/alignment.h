#pragma once
// From picks to one similarity for the whole sparse model (thesis 7.1), refined on the scan's
// surface, and judged.

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "align/clicks/pick_review.h"
#include "align/clicks/picks.h"
#include "align/clicks/scale.h"
#include "align/fit/plane_bundle.h"
#include "align/fit/pose_covariance.h"
#include "align/fit/scan_bend.h"
#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "align/surface/scan_planes.h"
#include "align/trust/expected_error.h"
#include "align/trust/open_directions.h"
#include "align/trust/trust.h"
#include "colmap_ext/sparse_model.h"
#include "core/error.h"
#include "core/progress.h"
#include "core/scan.h"
#include "core/scan_mesh.h"

namespace roomtex {

struct AlignmentOptions {
  // Refine the similarity on the surface of the scan, and adjust poses and points to it.
  bool plane_constrained = true;
  PickReviewOptions picks;
  ScaleOptions scale;
  ScanPatchOptions surface;
  SimilarityFitOptions fit;
  PlaneBundleOptions bundle;
  TrustOptions trust;
  ScanMeshOptions mesh;
  int num_threads = -1;

  std::vector<std::string> Problems() const;
};

// What became of one pick. Residuals are distances in pixels.
struct PickOutcome {
  Pick pick;
  bool used = true;
  double residual_px = 0;  // under the solution from the picks alone
  // Where the sparse points lie on the surface (in the adjusted model, if there is one); NaN if
  // they could not be brought there.
  double refined_residual_px = std::numeric_limits<double>::quiet_NaN();
  double leave_one_out_px = std::numeric_limits<double>::quiet_NaN();  // NaN where it was not tried
};

struct Alignment {
  // The answer: from the input model to the aligned one, and of an adjusted model the best
  // similarity there is. Of a bent scan: to where the room really is.
  Similarity scan_from_sparse;
  Similarity scan_from_sparse_from_picks;  // before the refinement on the surface
  std::string clicked_image;               // the photo whose picks gave the pose
  double position_sigma = 0;               // metres, of its camera by the picks alone
  std::vector<PickOutcome> picks;
  double pick_rms_px = 0;  // of the used picks, by the picks alone
  double pick_max_px = 0;  // of all picks, by the picks alone
  double refined_pick_rms_px = std::numeric_limits<double>::quiet_NaN();  // of the used picks
  ScaleEstimate scale;
  // The refinement on the surface. It is made in any case, as a check of the picks; `refined` says
  // whether it is the answer.
  SimilarityFit surface_fit;
  bool refined = false;
  // The adjustment to the surface, tried where the similarity is refined and trusted. `adjusted`
  // says whether bundle.model is the answer.
  PlaneBundle bundle;
  bool adjusted = false;
  std::optional<BendFit> bend;  // of a bent scan
  // Of the similarity: by the surface where it was refined, else by the picks. Of an adjusted model
  // at_cameras and rotation are those of photo_sigmas.
  ExpectedError expected_error;
  std::map<uint32_t, PhotoSigma> photo_sigmas;  // of an adjusted model
  OpenDirections open;                          // what the surface leaves to the picks
  Placement placement;
  std::vector<std::string> warnings;
  // Why the answer is not to be trusted, in sentences; empty = trusted.
  std::vector<std::string> reasons;
};

// What was read from where, for the messages.
struct AlignmentInput {
  const SparseModel& model;
  const std::vector<Scan>& scans;
  const std::vector<Pick>& picks;
  std::string picks_path;
  std::string azimuth;                 // as the scans were read: "clockwise" or "counterclockwise"
  std::vector<ScanPlane> planes = {};  // of the scans, for the adjustment to the surface
};

// The files are fine, but what they say contradicts each other so plainly that there is no
// alignment: exit 4.
class Contradiction : public InputError {
 public:
  using InputError::InputError;
};

// Throws InputError for picks that cannot fix a pose, Contradiction for picks that are exchanged,
// not on the scan, of another photo, or show that the scan is mirrored. model.points carry the
// errors of UpdateReprojectionErrors(); sigma_px is their rms / sqrt(2).
Alignment AlignToScan(const AlignmentInput& input, double sigma_px, const FreeSpace& free_space,
                      const AlignmentOptions& options, Progress* progress);

}  // namespace roomtex
