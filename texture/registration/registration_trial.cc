#include "texture/registration/registration_trial.h"

#include <algorithm>
#include <cmath>

namespace roomtex {

LikenessChange FindLikenessChange(const std::vector<float>& before, const std::vector<float>& after,
                                  float least) {
  LikenessChange change;
  double sum = 0, squares = 0;
  for (size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    if (std::isnan(before[i]) || std::isnan(after[i])) continue;
    if (std::max(before[i], after[i]) < least) continue;
    ++change.num_places;
    change.before += before[i];
    change.after += after[i];
    const double step = after[i] - before[i];
    sum += step;
    squares += step * step;
  }
  if (change.num_places == 0) return change;
  const double count = change.num_places;
  change.before /= count;
  change.after /= count;
  change.sigma = std::sqrt(std::max(0.0, squares / count - sum * sum / (count * count)) / count);
  return change;
}

RegistrationTrial JudgeTrial(const std::string& mode, const std::vector<RegistrationTrial>& earlier,
                             const KeptAsideLikeness& before, const KeptAsideLikeness& after) {
  constexpr float kAlike = 0.6f;  // intensity is not brightness
  // Places overlap and are seen by several photos: a standard error is three of those that count
  // each for itself.
  constexpr double kSure = 3, kLikely = 1;
  constexpr int kFewestPlaces = 20;
  RegistrationTrial trial;
  trial.mode = mode;
  trial.among_photos = FindLikenessChange(before.among_photos, after.among_photos, -1);
  trial.with_scan = FindLikenessChange(before.with_scan, after.with_scan, kAlike);
  const LikenessChange& photos = trial.among_photos;
  const LikenessChange& scan = trial.with_scan;
  if (photos.num_places < kFewestPlaces) return trial;
  const bool knows_scan = scan.num_places >= kFewestPlaces;
  const double along_scan =
      knows_scan ? (scan.after - scan.before) / std::max(scan.sigma, 1e-9) : 0;
  const double among_photos = (photos.after - photos.before) / std::max(photos.sigma, 1e-9);
  const double left = (1 - photos.after) / (1 - photos.before);
  const bool any_kept = std::any_of(earlier.begin(), earlier.end(),
                                    [](const RegistrationTrial& one) { return one.kept; });
  // Shares of the disagreement that may be left. What the photos say by themselves is not given up
  // for a scan whose shape is not that of the room.
  constexpr double kPoses = 0.85, kWarps = 0.95, kByScan = 1.02;
  if (any_kept && mode == "pose_by_scan") {
    trial.kept = along_scan > kLikely && left < kByScan;
  } else {
    trial.kept =
        along_scan > -kSure && among_photos > kSure && left < (mode == "warp" ? kWarps : kPoses);
  }
  return trial;
}

}  // namespace roomtex
