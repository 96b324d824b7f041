#pragma once
// Whether a correction of the photos is kept: judged where nothing was fitted to it.

#include <string>
#include <vector>

namespace roomtex {

// How alike what a photo shows is to what it should show, at places that were kept aside, in the
// same order each time: normalised cross-correlations, NaN = nothing to compare.
struct KeptAsideLikeness {
  std::vector<float> among_photos;  // with what the other photos show
  std::vector<float> with_scan;     // with the scanner's intensity
};

// Over the places that could be compared both times, and were this much alike at least once.
struct LikenessChange {
  double before = 0, after = 0;  // means
  double sigma = 0;              // standard error of the difference, as if all were independent
  int num_places = 0;
};

LikenessChange FindLikenessChange(const std::vector<float>& before, const std::vector<float>& after,
                                  float least);

// A correction and what became of it.
struct RegistrationTrial {
  // "pose": by what photos say of each other; "pose_by_scan": and by the scanner's intensity, from
  // there or, if that was not kept, from where they came; "warp".
  std::string mode;
  LikenessChange among_photos, with_scan;
  bool kept = false;
  // Whatever the likeness: the photos went farther than what each of them was off can have left in
  // common. Not judged by JudgeTrial().
  bool moved_too_far = false;
};

// Against what was kept last. earlier: the trials before.
RegistrationTrial JudgeTrial(const std::string& mode, const std::vector<RegistrationTrial>& earlier,
                             const KeptAsideLikeness& before, const KeptAsideLikeness& after);

}  // namespace roomtex
