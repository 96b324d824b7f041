#include "texture/registration/register_photos.h"

#include <cmath>
#include <utility>

namespace roomtex {
namespace {

// Whether photos agree better than before, by more than those of a bare room or of moved things do
// by chance: all of them, or one by much and the others no worse for it.
bool AgreeBetter(const std::vector<double>& before, const std::vector<double>& after) {
  constexpr double kBetter = 0.95, kMuchBetter = 0.8;
  if (after.back() < kBetter * before.back()) return true;
  if (!(after.back() < before.back())) return false;
  for (size_t i = 0; i + 1 < before.size(); ++i) {
    if (after[i] < kMuchBetter * before[i]) return true;
  }
  return false;
}

// Pixels of the level: the first search finds what is off by much, the others what it left.
constexpr int kCoarseRadius = 3, kFineRadius = 2, kLastRadius = 1;
constexpr int kFineRounds = 3;
int RadiusAt(int level, int round) {
  return level == PhotoRegistrar::kNumLevels - 1 ? kCoarseRadius
         : round == 0                            ? kFineRadius
                                                 : kLastRadius;
}
int RoundsAt(int level) { return level > 0 ? 1 : kFineRounds; }

// Coarse to fine, until the photos agree. False if they agree no better than before.
bool BringTogether(bool with_warps, PhotoRegistrar* registrar) {
  const std::vector<double> before = registrar->Disagreement();
  for (int level = PhotoRegistrar::kNumLevels - 1; level >= 0; --level) {
    for (int i = 0; i < RoundsAt(level); ++i) {
      registrar->Measure(level, RadiusAt(level, i));
      if (!registrar->FreeIfOff()) break;
      registrar->Correct(true, with_warps && level == 0);
    }
  }
  if (!registrar->is_free()) return true;
  registrar->Measure(0, kLastRadius);
  return AgreeBetter(before, registrar->Disagreement());
}

// Tries one correction after the other, and takes back those for which nothing speaks but what they
// were fitted to.
class TrialRun {
 public:
  explicit TrialRun(PhotoRegistrar* registrar) : registrar_(*registrar) {}

  std::vector<RegistrationTrial> Run() {
    int level = PhotoRegistrar::kNumLevels - 1;
    for (; level >= 0; --level) {
      registrar_.Measure(level, RadiusAt(level, 0));
      if (registrar_.FreeIfOff()) break;
    }
    if (!registrar_.is_free()) return {};
    registrar_.KeepAside();
    stand_ = registrar_.Here();
    likeness_ = registrar_.Judge();
    // What photos say of each other first: the scan, which nothing was fitted to then, is a
    // witness. If it says that they slid along it, it has to hold them.
    const PhotoRegistrar::Stand first = stand_;
    MovePoses(level, false);
    const bool by_photos = Keep("pose");
    bool by_scan = false;
    if (by_photos) {
      // They were off each by itself: what they still have in common is the mean of that.
      const double most_px =
          kCommon * registrar_.MotionFrom(first) / std::sqrt(registrar_.num_photos()) + kCommonPx;
      for (int i = 0; i < kScanRounds; ++i) {
        registrar_.Measure(0, kLastRadius);
        registrar_.Correct(true, false);
      }
      by_scan = Keep("pose_by_scan", registrar_.MotionFrom(stand_) >= most_px);
    } else {
      MovePoses(level, true);
      by_scan = Keep("pose_by_scan");
    }
    // Photos that agree with each other or with the scan, but not with both, see another shape.
    const bool is_bent = by_scan && !by_photos;
    if (by_photos || by_scan) registrar_.Measure(0, kLastRadius);
    if (is_bent || (by_photos && registrar_.AreOff())) {
      for (int i = 0; i < kWarpRounds; ++i) {
        if (i > 0) registrar_.Measure(0, kLastRadius);
        registrar_.Correct(by_scan, true);
      }
      Keep("warp");
    }
    registrar_.KeepNothingAside();
    registrar_.Measure(0, kLastRadius);
    return std::move(trials_);
  }

 private:
  static constexpr int kScanRounds = 2, kWarpRounds = 2;
  static constexpr double kCommon = 2, kCommonPx = 0.25;  // standard errors; pixels

  void MovePoses(int level, bool by_scan) {
    for (; level >= 0; --level) {
      for (int i = 0; i < RoundsAt(level); ++i) {
        registrar_.Measure(level, RadiusAt(level, i));
        registrar_.Correct(by_scan, false);
      }
    }
  }

  // Whether the photos stay where they are now; they go back otherwise.
  bool Keep(const char* mode, bool moved_too_far = false) {
    const KeptAsideLikeness now = registrar_.Judge();
    trials_.push_back(JudgeTrial(mode, trials_, likeness_, now));
    trials_.back().moved_too_far = moved_too_far;
    trials_.back().kept &= !moved_too_far;
    if (!trials_.back().kept) {
      registrar_.Return(stand_);
      return false;
    }
    stand_ = registrar_.Here();
    likeness_ = now;
    return true;
  }

  PhotoRegistrar& registrar_;
  PhotoRegistrar::Stand stand_;
  KeptAsideLikeness likeness_;
  std::vector<RegistrationTrial> trials_;
};

}  // namespace

Registration RegisterPhotos(const PhotoPassInput& input, const std::vector<GridOfSamples>& grids,
                            const std::vector<std::vector<uint8_t>>& intensities,
                            const ObservationStore& store,
                            const std::vector<Eigen::Vector3f>& gains,
                            const RegistrationOptions& options, int num_threads,
                            std::vector<PhotoView>* photos) {
  Registration result;
  if (options.mode == "none" || photos->empty()) return result;
  SharedSamples samples(input, grids, intensities, store, static_cast<int>(photos->size()));
  std::vector<PhotoView> moved = *photos;
  PhotoRegistrar registrar(&samples, gains, options, num_threads, &moved);
  if (options.mode == "auto") {
    result.trials = TrialRun(&registrar).Run();
  } else {
    const PhotoRegistrar::Stand first = registrar.Here();
    if (!BringTogether(options.mode == "warp", &registrar)) {
      registrar.Return(first);
      registrar.Measure(0, kLastRadius);
    }
  }
  result.photos = registrar.Report();
  if (options.mode == "measure") {
    for (PhotoRegistration& photo : result.photos) {
      photo.corrected = false;
      photo.shift_after_px = photo.shift_before_px;
    }
  } else {
    *photos = std::move(moved);
  }
  return result;
}

}  // namespace roomtex
