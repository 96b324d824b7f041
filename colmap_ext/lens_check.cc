#include "colmap_ext/lens_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>
#include <utility>

#include "colmap_ext/calibration_check.h"
#include "core/camera_formulas.h"
#include "core/decompositions.h"
#include "core/similarity.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kLensPointsPerImage = 150;  // enough for a few parameters, and fast
// A lens told this many standard deviations from the one found is wrong. Correlated errors of
// keypoints make them a few.
constexpr double kMaxDeviations = 6;
// A photo has a lens of its own if its focal length differs by this share, and so many standard
// deviations.
constexpr double kOwnShare = 0.01, kOwnDeviations = 5;
constexpr size_t kMaxPhotosApart = 150;  // of more photos none is looked at on its own
// Photos are asked for their own lenses to some tenths of a standard deviation, five of which
// decide: twice as exact takes twice the steps.
constexpr double kMinGainApart = 1e-4;
constexpr size_t kMinObservationsApart = 40;
constexpr size_t kMinPhotosOfSpread = 5;
// By this much, in units of the noise's variance, principal point and tangential distortion must
// lower the cost to be freed; two to four parameters.
constexpr double kMinCentreGain = 20;
// By this much, in units of the noise's variance and per parameter, the cost may rise when cameras
// that were told differently share a lens.
constexpr double kMaxRisePerParam = 6;

int NumFocal(const Camera& camera) {
  return camera_formulas::HasOneFocalLength(camera.model) ? 1 : 2;
}

double MeanFocalSigma(const Camera& camera, const Eigen::MatrixXd& covariance) {
  if (covariance.size() == 0) return std::numeric_limits<double>::infinity();
  const int n = NumFocal(camera);
  return std::sqrt(covariance.topLeftCorner(n, n).sum()) / n;
}

// Parameter by parameter.
Camera MedianCamera(const std::vector<Camera>& cameras) {
  Camera median = cameras[0];
  for (size_t k = 0; k < median.params.size(); ++k) {
    std::vector<double> values;
    for (const Camera& camera : cameras) values.push_back(camera.params[k]);
    median.params[k] = MidpointMedian(values);
  }
  return median;
}

// One lens for all that look alike, freed, and able to be what its own camera model may not say.
LensSet SharedLenses(const SparseModel& model, const LensLabels& labels) {
  using Kind = std::tuple<CameraModel, int, int, std::string>;
  std::map<Kind, std::vector<uint32_t>> images;
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.cameras.at(image.camera_id);
    const auto label = labels.find(id);
    images[{camera.model, camera.width, camera.height,
            label == labels.end() ? "" : label->second.text}]
        .push_back(id);
  }
  LensSet lenses;
  for (const auto& [kind, ids] : images) {
    std::vector<Camera> cameras;
    for (const uint32_t id : ids) {
      cameras.push_back(model.cameras.at(model.images.at(id).camera_id));
      lenses.of_image[id] = static_cast<int>(lenses.lenses.size());
    }
    const Camera median = RicherCamera(MedianCamera(cameras));
    lenses.lenses.push_back({median, median, true});
  }
  return lenses;
}

// A lens for every photo, held near the shared one.
LensSet LensPerPhoto(const LensSet& shared) {
  LensSet own;
  for (const auto& [id, index] : shared.of_image) {
    own.of_image[id] = static_cast<int>(own.lenses.size());
    const Camera& camera = shared.lenses[index].camera;
    own.lenses.push_back({camera, camera, true});
  }
  return own;
}

size_t NumObservations(const SparseImage& image) {
  return static_cast<size_t>(std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(),
                                           [](uint64_t id) { return id != kInvalidPoint3dId; }));
}

// What the photos say of their focal lengths one by one.
struct OwnFocalLength {
  uint32_t image_id = 0;
  int lens = 0;             // that it shares with others
  double focal_length = 0;  // pixels
  double sigma = 0;         // as its keypoints' noise has it
  double usual = 0;         // median of the photos that share the lens
};

// Of photos with enough observations; empty where there are too many photos to ask.
std::vector<OwnFocalLength> OwnFocalLengths(const SparseModel& model, double sigma_px,
                                            const LensSet& lenses) {
  std::vector<OwnFocalLength> photos;
  if (model.images.size() > kMaxPhotosApart) return photos;
  const PhotoBundle own = AdjustPhotos(model, LensPerPhoto(lenses), sigma_px, {}, kMinGainApart);
  if (!own.usable) return photos;
  const double noise = std::sqrt(std::max(1.0, own.cost / std::max(1.0, own.redundancy)));
  std::map<int, std::vector<double>> focal_lengths;
  for (const auto& [id, index] : own.lenses.of_image) {
    if (NumObservations(model.images.at(id)) < kMinObservationsApart) continue;
    const Camera& camera = own.lenses.lenses[static_cast<size_t>(index)].camera;
    const double sigma =
        noise * MeanFocalSigma(camera, own.covariances[static_cast<size_t>(index)]);
    photos.push_back({id, lenses.of_image.at(id), camera.MeanFocalLength(), sigma});
    focal_lengths[photos.back().lens].push_back(camera.MeanFocalLength());
  }
  for (OwnFocalLength& photo : photos) photo.usual = Median(focal_lengths.at(photo.lens));
  return photos;
}

// How much more the photos' focal lengths differ than their keypoints' noise explains: rolling
// shutters, blur and what a camera model lacks go with the photo, so that thousands of keypoints do
// not average them out.
double Spread(const std::vector<OwnFocalLength>& photos) {
  std::vector<double> deviations;
  for (const OwnFocalLength& photo : photos) {
    if (std::isfinite(photo.sigma)) {
      deviations.push_back(std::abs(photo.focal_length - photo.usual) / photo.sigma);
    }
  }
  if (deviations.size() < kMinPhotosOfSpread) return 1;
  return std::max(1.0, kSigmaPerMad * Median(deviations));
}

// Photos that obey another focal length get lenses of their own, one for those of about the same.
// False if there are none.
bool SetApart(const std::vector<OwnFocalLength>& photos, double spread, LensSet* lenses) {
  std::map<int, std::vector<OwnFocalLength>> apart;
  std::map<int, size_t> num_photos;
  for (const OwnFocalLength& photo : photos) {
    ++num_photos[photo.lens];
    const double off = std::abs(photo.focal_length - photo.usual);
    if (off > kOwnShare * photo.usual && off > kOwnDeviations * spread * photo.sigma) {
      apart[photo.lens].push_back(photo);
    }
  }
  bool any = false;
  for (auto& [lens, others] : apart) {
    if (2 * others.size() >= num_photos.at(lens)) continue;  // nothing is usual
    any = true;
    std::sort(others.begin(), others.end(), [](const OwnFocalLength& a, const OwnFocalLength& b) {
      return a.focal_length < b.focal_length;
    });
    double last = 0;
    for (const OwnFocalLength& photo : others) {
      if (!(photo.focal_length < last * (1 + 2 * kOwnShare))) {
        Lens own_lens = lenses->lenses[static_cast<size_t>(lens)];
        const double ratio = photo.focal_length / own_lens.camera.MeanFocalLength();
        for (int k = 0; k < NumFocal(own_lens.camera); ++k) {
          own_lens.camera.params[static_cast<size_t>(k)] *= ratio;
        }
        own_lens.told.params = own_lens.camera.params;
        lenses->lenses.push_back(own_lens);
      }
      last = photo.focal_length;
      lenses->of_image[photo.image_id] = static_cast<int>(lenses->lenses.size()) - 1;
    }
  }
  return any;
}

Eigen::VectorXd Difference(const Camera& a, const Camera& b) {
  Eigen::VectorXd difference(static_cast<int>(a.params.size()));
  for (size_t k = 0; k < a.params.size(); ++k) {
    difference[static_cast<int>(k)] = a.params[k] - b.params[k];
  }
  return difference;
}

LensFinding FindingOf(const SparseModel& model, const PhotoBundle& bundle, int index, double noise,
                      bool apart) {
  const Lens& lens = bundle.lenses.lenses[static_cast<size_t>(index)];
  LensFinding finding;
  finding.apart = apart;
  std::set<uint32_t> camera_ids;
  std::vector<Camera> told;
  for (const auto& [id, lens_of_image] : bundle.lenses.of_image) {
    if (lens_of_image != index) continue;
    const SparseImage& image = model.images.at(id);
    finding.photos.push_back(image.name);
    if (camera_ids.insert(image.camera_id).second)
      told.push_back(model.cameras.at(image.camera_id));
  }
  finding.camera_ids.assign(camera_ids.begin(), camera_ids.end());
  finding.found = lens.camera;
  finding.covariance = noise * bundle.covariances[static_cast<size_t>(index)];
  finding.Tell(told);
  if (finding.sigmas.size() == 0) finding.found = finding.told;
  return finding;
}

}  // namespace

RefineIntrinsics RefineIntrinsicsFromWord(const std::string& word) {
  if (word == "auto") return RefineIntrinsics::kAuto;
  return word == "0" ? RefineIntrinsics::kNever : RefineIntrinsics::kAlways;
}

void LensFinding::Tell(const std::vector<Camera>& cameras) {
  std::vector<Camera> rich;
  for (const Camera& camera : cameras) rich.push_back(RicherCamera(camera));
  const bool is_one_kind = std::all_of(
      rich.begin(), rich.end(), [&](const Camera& camera) { return camera.model == found.model; });
  if (rich.empty() || !is_one_kind) return;
  told = MedianCamera(rich);
  told_alike = std::all_of(rich.begin(), rich.end(),
                           [&](const Camera& camera) { return camera.params == rich[0].params; });
  SetCovariance(covariance);
}

void LensFinding::SetCovariance(const Eigen::MatrixXd& of_found) {
  covariance = of_found;
  focal_sigma = MeanFocalSigma(found, covariance);
  if (covariance.size() == 0) return;
  sigmas = covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd off = Difference(found, told);
  deviations = std::sqrt(std::max(0.0, off.dot(SolveSymmetric(covariance, off))));
}

bool LensFinding::Contradicts() const { return deviations > kMaxDeviations; }

double LensFinding::FocalDeviations() const {
  return std::abs(found.MeanFocalLength() - told.MeanFocalLength()) / focal_sigma;
}

std::string LensFinding::Sentence() const {
  const double told_px = told.MeanFocalLength(), found_px = found.MeanFocalLength();
  std::string who = "Camera " + std::to_string(camera_ids[0]);
  if (apart) {
    const bool is_one = photos.size() == 1;
    who = photos[0] +
          (is_one ? " obeys" : " and " + std::to_string(photos.size() - 1) + " more photos obey");
    return who + " a focal length of " + Number(found_px, 1) + " pixels instead of " +
           Number(told_px, 1) + ": a zoom or another focus. " +
           (!used    ? "The lens as told is kept."
            : is_one ? "It got a camera of its own."
                     : "They got a camera of their own.");
  }
  if (camera_ids.size() > 1) {
    who = "Cameras " + std::to_string(camera_ids.front()) + " to " +
          std::to_string(camera_ids.back()) + " are one lens and";
  }
  return who + ": focal length " + Number(told_px, 1) + " pixels as told, " + Number(found_px, 1) +
         " +- " + Number(focal_sigma, 1) + " by the photos (" + Number(deviations, 0) +
         " standard deviations, distortion included). The lens " +
         (used ? "found is used." : "as told is kept.");
}

Json LensToJson(const LensFinding& finding) {
  const auto number = [](double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
  };
  Json json;
  json["camera_ids"] = finding.camera_ids;
  json["num_photos"] = finding.photos.size();
  json["photos"] = finding.apart ? Json(finding.photos) : Json(nullptr);
  json["model"] = CameraModelName(finding.told.model);
  json["told"] = finding.told.params;
  json["told_alike"] = finding.told_alike;
  json["found"] = finding.found.params;
  json["sigma"] = finding.sigmas.size() > 0 ? ToJson(finding.sigmas) : Json(nullptr);
  json["focal_px"]["told"] = finding.told.MeanFocalLength();
  json["focal_px"]["found"] = finding.found.MeanFocalLength();
  json["focal_px"]["sigma"] = number(finding.focal_sigma);
  json["deviations"] = number(finding.deviations);
  json["used"] = finding.used;
  return json;
}

std::map<uint32_t, Camera> LensCheck::ToldCameras(const SparseModel& model) const {
  std::map<uint32_t, Camera> told;
  for (const auto& [id, lens] : lens_of_camera) {
    const Camera& camera = model.cameras.at(id);
    const bool was_used = mended && lenses[static_cast<size_t>(lens)].used;
    told[id] = was_used ? lenses[static_cast<size_t>(lens)].told : camera;
  }
  return told;
}

namespace {

// Cameras that are told the same are one lens also where it stays as told.
std::map<uint32_t, int> LensesAsTold(const SparseModel& model,
                                     const std::vector<LensFinding>& lenses) {
  std::map<uint32_t, int> lens_of_camera;
  for (size_t i = 0; i < lenses.size(); ++i) {
    if (lenses[i].apart || !lenses[i].told_alike) continue;
    for (const uint32_t id : lenses[i].camera_ids) lens_of_camera[id] = static_cast<int>(i);
  }
  int next = static_cast<int>(lenses.size());
  for (const auto& [id, camera] : model.cameras) next += lens_of_camera.emplace(id, next).second;
  return lens_of_camera;
}

// Whether other photos than these have their cameras: else what was told is of them alone.
bool SharesCameras(const SparseModel& model, const LensFinding& finding) {
  return std::any_of(model.images.begin(), model.images.end(), [&](const auto& image) {
    const auto& ids = finding.camera_ids;
    return std::find(ids.begin(), ids.end(), image.second.camera_id) != ids.end() &&
           std::find(finding.photos.begin(), finding.photos.end(), image.second.name) ==
               finding.photos.end();
  });
}

// What the photos say: every lens freed, and without those parameters that they do not ask for.
struct FreedLenses {
  size_t num_shared = 0;  // lenses.lenses before those of photos set apart
  PhotoBundle full, sparing;
  double noise = 1;  // variance, in units of the assumed one
};

std::optional<FreedLenses> FreeLenses(const SparseModel& thinned, const LensLabels& labels,
                                      double sigma_px) {
  FreedLenses freed;
  LensSet lenses = SharedLenses(thinned, labels);
  freed.num_shared = lenses.lenses.size();
  for (Lens& lens : lenses.lenses) lens.hold_centre = true;
  freed.sparing = AdjustPhotos(thinned, lenses, sigma_px);
  if (!freed.sparing.usable) return std::nullopt;
  lenses = freed.sparing.lenses;
  const auto photos = OwnFocalLengths(freed.sparing.model, sigma_px, lenses);
  const double spread = Spread(photos);
  if (SetApart(photos, spread, &lenses)) {
    freed.sparing = AdjustPhotos(freed.sparing.model, lenses, sigma_px);
    if (!freed.sparing.usable) return std::nullopt;
    lenses = freed.sparing.lenses;
  }
  for (Lens& lens : lenses.lenses) lens.hold_centre = false;
  freed.full = AdjustPhotos(freed.sparing.model, lenses, sigma_px);
  if (!freed.full.usable) return std::nullopt;
  freed.noise =
      spread * spread * std::max(1.0, freed.full.cost / std::max(1.0, freed.full.redundancy));
  // A rolling shutter looks like a wrong principal point in one photo and like tangential
  // distortion in the next one: photos that differ by that know a lens less well than their
  // keypoints say.
  if (freed.full.model.images.size() >= kMinPhotosOfSpread) {
    freed.noise = std::max(freed.noise, freed.full.scatter_by_photo);
  }
  if (freed.sparing.cost - freed.full.cost > kMinCentreGain * freed.noise) {
    freed.sparing = freed.full;
  }
  return freed;
}

bool SharingIsTooDear(const SparseModel& thinned, const FreedLenses& freed, double sigma_px) {
  const size_t num_lenses = freed.full.lenses.lenses.size();
  if (thinned.cameras.size() <= num_lenses) return false;
  const PhotoBundle held = AdjustPhotos(thinned, LensesOf(thinned), sigma_px);
  const double num_removed = 6.0 * static_cast<double>(thinned.cameras.size() - num_lenses);
  return held.usable && freed.full.cost - held.cost > kMaxRisePerParam * freed.noise * num_removed;
}

}  // namespace

namespace {

// A bundle adjustment of single photos would take rigs apart, and has no place for panoramas.
bool HasPanoramasOrRigs(const SparseModel& model) {
  return std::any_of(model.cameras.begin(), model.cameras.end(),
                     [](const auto& camera) { return camera.second.IsPanorama(); }) ||
         std::any_of(model.images.begin(), model.images.end(),
                     [](const auto& image) { return image.second.frame_id != kNoFrame; });
}

// The photos that have a lens, each by itself.
SparseModel SinglePhotos(const SparseModel& model) {
  std::set<uint32_t> panoramas;
  for (const auto& [id, image] : model.images) {
    if (model.cameras.at(image.camera_id).IsPanorama()) panoramas.insert(id);
  }
  SparseModel photos = WithoutPhotos(model, panoramas);
  for (auto& [id, image] : photos.images) image.frame_id = kNoFrame;
  for (auto at = photos.cameras.begin(); at != photos.cameras.end();) {
    at = at->second.IsPanorama() ? photos.cameras.erase(at) : std::next(at);
  }
  return photos;
}

// Holds a lens as it was told: each of its cameras as its own, if they were told differently.
void HoldAsTold(const SparseModel& model, const LensFinding& finding, int index, LensSet* set) {
  std::map<uint32_t, int> lens_of_camera;
  for (const uint32_t id : finding.camera_ids) {
    int lens = index;
    if (!lens_of_camera.empty() && !finding.told_alike) {
      lens = static_cast<int>(set->lenses.size());
      const Lens copy = set->lenses[static_cast<size_t>(index)];
      set->lenses.push_back(copy);
    }
    lens_of_camera[id] = lens;
    set->lenses[static_cast<size_t>(lens)].free = false;
    set->lenses[static_cast<size_t>(lens)].camera = model.cameras.at(id);
  }
  for (auto& [image_id, lens] : set->of_image) {
    if (lens == index) lens = lens_of_camera.at(model.images.at(image_id).camera_id);
  }
}

}  // namespace

LensCheck CheckLenses(const SparseModel& model, const LensLabels& labels, RefineIntrinsics refine) {
  LensCheck check;
  check.lens_of_camera = LensesAsTold(model, {});
  if (model.images.size() < 2) return check;
  if (HasPanoramasOrRigs(model)) {
    check.lenses = CheckLenses(SinglePhotos(model), labels, RefineIntrinsics::kNever).lenses;
    check.only_looked_at = true;
    return check;
  }
  const double sigma_px = KeypointNoise(model);
  const SparseModel thinned = ThinnedModel(model, kLensPointsPerImage);
  const std::optional<FreedLenses> freed = FreeLenses(thinned, labels, sigma_px);
  if (!freed) return check;
  const bool too_dear = SharingIsTooDear(thinned, *freed, sigma_px);
  LensSet mended = freed->sparing.lenses;
  const size_t num_lenses = mended.lenses.size();
  for (size_t i = 0; i < num_lenses; ++i) {
    LensFinding finding =
        FindingOf(model, freed->full, static_cast<int>(i), freed->noise, i >= freed->num_shared);
    finding.used = refine == RefineIntrinsics::kAlways ||
                   (finding.apart && SharesCameras(model, finding)) || !finding.told_alike ||
                   finding.Contradicts();
    const bool never = refine == RefineIntrinsics::kNever;
    if (finding.sigmas.size() == 0 || too_dear || never) finding.used = false;
    mended.lenses[i].free = finding.used;
    if (!finding.used) HoldAsTold(model, finding, static_cast<int>(i), &mended);
    check.lenses.push_back(std::move(finding));
  }
  if (refine == RefineIntrinsics::kNever) return check;
  check.lens_of_camera = LensesAsTold(model, check.lenses);
  const auto is_used = [](const LensFinding& lens) { return lens.used; };
  if (std::none_of(check.lenses.begin(), check.lenses.end(), is_used)) return check;
  const PhotoBundle adjusted = AdjustPhotos(model, mended, sigma_px);
  if (!adjusted.usable) {
    for (LensFinding& finding : check.lenses) finding.used = false;
    return check;
  }
  for (size_t i = 0; i < num_lenses; ++i) {
    if (check.lenses[i].used) check.lenses[i].found = adjusted.lenses.lenses[i].camera;
  }
  check.mended = PutBack(WithLenses(adjusted.model, adjusted.lenses), model);
  check.lens_of_camera.clear();
  for (const auto& [id, image] : check.mended->images) {
    check.lens_of_camera[image.camera_id] = adjusted.lenses.of_image.at(id);
  }
  return check;
}

}  // namespace roomtex
