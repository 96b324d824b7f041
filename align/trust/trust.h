#pragma once
// Whether an alignment is to be believed: what contradicts it, in sentences.

#include <string>
#include <vector>

#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "align/trust/free_space.h"
#include "colmap_ext/sparse_model.h"
#include "core/similarity.h"

namespace roomtex {

class OptionFields;

struct TrustOptions {
  // Pixels; root mean square distance of the picks from the best pose above which the alignment is
  // not trusted. 0 = 10 pixels or 0.4 % of the photo's diagonal, whichever is more. Larger = more
  // tolerant.
  double max_pick_rms_px = 0;
  // Spread of the scale from feature to feature (relative median absolute deviation). Larger = more
  // tolerant.
  double max_scale_mad = 0.05;
  int min_scale_features = 10;
  // Metres; a sparse point this near to the scan's surface is on it.
  double surface_tolerance = 0.05;
  // Of the sparse points that the scanner could see, the share that must be on the surface, not
  // floating in what the scanner saw to be empty. Larger = stricter.
  double min_surface_share = 0.6;
  // Things that people move leave points floating where they are now, and points behind where they
  // were; the scan of another room does so everywhere. The smaller of the two shares (of the points
  // near what the scanner saw) must not be larger than this. Larger = more tolerant.
  double max_changed_share = 0.08;
  // Of the corners of the scan's intensity, the share that the photos must show where the scan has
  // them (GradientShifts::ShownShare()), where picks alone say that the two belong together. Larger
  // = stricter.
  double min_shown_share = 0.2;
  // Share of the photos that must not have been taken from inside a wall or outside the scan.
  double min_camera_share = 0.5;
  // Metres; a pose of the picks less certain than this (one standard deviation) fixes nothing.
  double max_position_sigma = 0.3;

  // max_pick_rms_px with its default resolved for one camera.
  double PickRmsLimit(const Camera& camera) const;
  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Where the sparse points and the cameras come to lie in the scan.
struct Placement {
  int num_points = 0;  // sparse points that were looked at
  int num_on_surface = 0;
  int num_floating = 0;  // in space that the scanner saw to be empty
  int num_hidden = 0;    // behind the surface that the scanner saw
  int num_cameras = 0;
  // In space that the scanner saw to be empty or did not see at all, or with the surface that they
  // show before them.
  int num_cameras_free = 0;

  // num_on_surface / (num_on_surface + num_floating); 0 without any.
  double SurfaceShare() const;
  double CameraShare() const;
  // min(num_floating, num_hidden) / (num_on_surface + num_floating + num_hidden); 0 without any.
  double ChangedShare() const;
};

Placement CheckPlacement(const SparseModel& model, const std::vector<SurfacePoint>& points,
                         const Similarity& scan_from_sparse, const ScanPatches& surface,
                         const FreeSpace& free_space, const TrustOptions& options);

}  // namespace roomtex
