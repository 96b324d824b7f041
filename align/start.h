#pragma once
// Where an alignment starts: a similarity for the sparse model, and what is known of it. By picks
// it is the pose of one photo (thesis 7.1.1) with the scale by its features (7.1.2), or one answer
// for the picks of several photos, even if none of them has enough for a pose.

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "align/alignment_input.h"
#include "align/clicks/pick_view.h"
#include "align/clicks/view_pose.h"
#include "align/fit/joint_picks.h"
#include "align/fit/spread_picks.h"

namespace roomtex {

// What a start makes of one pick. Residuals are distances in pixels.
struct PickOutcome {
  Pick pick;
  bool used = true;
  double residual_px = 0;                                              // under the start
  double leave_one_out_px = std::numeric_limits<double>::quiet_NaN();  // NaN where it was not tried
};

struct AlignmentStart {
  enum class Source {
    kPicks,       // StartFromPicks()
    kSimilarity,  // StartFromSimilarity()
  };
  Source source = Source::kSimilarity;
  Similarity scan_from_sparse;
  // Metres, of the cameras: how far off the surface is looked for.
  double position_sigma = 0;
  std::vector<PickOutcome> picks;  // those that there are, also of a start that is not from them
  // So many of `picks`, the last ones, are no clicks but places of the scan's intensity that the
  // photos show where they should (automatic_alignment.cc).
  int num_corners = 0;
  double pick_sigma_px = kUsualClickSigma;  // click noise, per coordinate
  // NaN without picks.
  double pick_rms_px = std::numeric_limits<double>::quiet_NaN();  // of those used
  double pick_max_px = std::numeric_limits<double>::quiet_NaN();  // of all that count
  // Of a start from picks.
  std::string image_name;  // the photo whose picks gave the pose; "" where picks of several did
  ScaleEstimate scale;
  std::string scale_image_name;  // the photo whose features these are
  // Of spread picks, which know the scale themselves: how far that of the features is from theirs,
  // as a share, and one standard deviation of theirs; NaN else.
  double scale_off = std::numeric_limits<double>::quiet_NaN();
  double scale_sigma = std::numeric_limits<double>::quiet_NaN();

  std::vector<bool> UsedPicks() const;
};

// Root mean square over the used picks, each residual times its weight; NaN without picks.
double PickRms(const std::vector<PickOutcome>& picks, const std::vector<double>& residuals_px);
// Distances of the picks from where a similarity puts them.
std::vector<double> PickDistances(const SparseModel& model, const std::vector<Pick>& picks,
                                  const Similarity& scan_from_sparse);

struct PickStart {
  int view = -1;  // of the views: the photo whose pose counts; -1 if none has a pose
  PoseChoice choice;
  // Where no photo has kMinPicksPerPhoto picks with a pose, but all of them together are enough.
  std::optional<SpreadPickFit> spread;
  // Where picks of other photos count as well.
  std::optional<JointPickFit> joint;
  // None without a view or a spread fit, and where no feature of the photo fixes the scale.
  std::optional<AlignmentStart> start;
};

// From views (of these picks) to the start; the same for the window and the command. The photo is
// the one whose picks fix its camera best; one with kMinPicksPerPhoto picks goes before all others.
// If there is none such, picks of several photos count together (AreSpreadPicks); else, of the
// photos that have fewer, the one with more. choices: the poses of views where they are known
// already (ChoosePoseOf); a view whose choice rests on no feature is passed over. Empty = none is.
PickStart StartFromPicks(const SparseModel& model, const std::vector<Pick>& picks,
                         const std::vector<PickView>& views,
                         const std::vector<std::optional<PoseChoice>>& choices,
                         const AlignmentOptions& options, const ScaleOfPhoto& scale_of_photo);

// A similarity found otherwise, its cameras within position_sigma metres (one standard deviation).
// picks may be empty; those that count are used.
AlignmentStart StartFromSimilarity(const SparseModel& model, const std::vector<Pick>& picks,
                                   const Similarity& scan_from_sparse, double position_sigma);

}  // namespace roomtex
