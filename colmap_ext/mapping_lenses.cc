#include "colmap_ext/mapping_lenses.h"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "core/camera_formulas.h"
#include "core/error.h"

namespace roomtex {
namespace {

// As a share; larger is no determination.
constexpr double kMaxFocalSigma = 0.03;

// A calibrated lens stays unless the photos know theirs so well, or are so sure that it is wrong:
// of one plane, or of a walk along a wall, they take a bent room for another lens.
constexpr double kMaxFocalSigmaOfCalibrated = 0.004;
constexpr double kSureDeviations = 15, kClearFocalDeviations = 5;  // LensFinding's
// Nor for a focal length that it has already and a little more distortion: a camera that turns on
// the spot leaves that open by more than it seems.
constexpr double kSameFocalDeviations = 2, kOtherLensDeviations = 40;

// From which version on COLMAP knows a camera model (major * 100 + minor).
int FirstVersionWith(CameraModel model) {
  if (model <= CameraModel::kThinPrismFisheye) return 0;
  return model == CameraModel::kRadTanThinPrismFisheye ? 311 : 400;
}

// COLMAP aborts where it meets the number of a camera model that it does not know.
void RequireKnownCameraModels(const ColmapProgram& colmap, const LensPlan& plan,
                              const std::string& database_path) {
  const int version = colmap.VersionNumber();
  for (const auto& [id, image] : plan.images()) {
    const CameraModel model = plan.cameras().at(image.camera_id).model;
    const int first = FirstVersionWith(model);
    if (version == 0 || version >= first) continue;
    throw InputError(
        database_path, "camera " + std::to_string(image.camera_id),
        fmt::format("is {}, which COLMAP {}.{} does not know", CameraModelName(model),
                    version / 100, version % 100),
        fmt::format("Name COLMAP {}.{} or newer by --colmap, or extract the features with another "
                    "--ImageReader.camera_model",
                    first / 100, first % 100));
  }
}

LensLabels LabelsOf(const MatchedImages& images, const std::string& image_path) {
  std::map<uint32_t, std::string> names;
  for (const auto& [id, image] : images.images()) names[id] = image.name;
  return ReadLensLabels(names, image_path);
}

// What COLMAP makes of a focal length in EXIF. It calls it known, but that one is rounded to whole
// millimetres on film, which COLMAP takes to be 35 mm wide instead of 36, and nothing is known of
// the rest. Nobody who calibrated a lens that may be distorted finds it without any distortion and
// with its axis in the very middle.
bool IsByExif(const Camera& camera) {
  const std::vector<double>& p = camera.params;
  const auto num_linear = static_cast<size_t>(camera_formulas::NumLinearParams(camera.model));
  if (!camera.has_prior_focal_length || p.size() <= num_linear) return false;
  return p[0] == p[num_linear - 3] && p[num_linear - 2] == 0.5 * camera.width &&
         p[num_linear - 1] == 0.5 * camera.height &&
         std::all_of(p.begin() + static_cast<std::ptrdiff_t>(num_linear), p.end(),
                     [](double value) { return value == 0; });
}

// With the focal lengths that only EXIF tells as what they are, a start.
std::map<uint32_t, Camera> CamerasOf(const MatchedImages& images, RefineIntrinsics refine) {
  std::map<uint32_t, Camera> cameras = images.cameras();
  if (refine != RefineIntrinsics::kAuto) return cameras;
  for (auto& [id, camera] : cameras) {
    if (IsByExif(camera)) camera.has_prior_focal_length = false;
  }
  return cameras;
}

LensPlan PlanLenses(const MatchedImages& images, const LensLabels& labels, const KnownPhotos& known,
                    RefineIntrinsics refine) {
  const std::map<uint32_t, Camera> cameras = CamerasOf(images, refine);
  LensPlan plan = refine == RefineIntrinsics::kNever ? LensPlan(cameras, images.images())
                                                     : LensPlan(cameras, images.images(), labels);
  TellCameras(known, &plan);
  return plan;
}

void KeepCamerasOfRigs(const Command::Context& context, LensCheck* check) {
  bool any = false;
  for (LensFinding& lens : check->lenses) {
    any = any || lens.used;
    lens.used = false;
  }
  context.Warn(
      std::string("The database holds rigs of several cameras: photos are mapped with its cameras, "
                  "not with the lenses that they were told or share by EXIF") +
      (any ? ", though the photos contradict them." : "."));
}

}  // namespace

bool AreDetermined(const LensCheck& check) {
  return std::all_of(check.lenses.begin(), check.lenses.end(), [](const LensFinding& lens) {
    return lens.focal_sigma < kMaxFocalSigma * lens.found.MeanFocalLength();
  });
}

MappingLenses::MappingLenses(const MappingOptions& options, const Command::Context& context,
                             const ColmapProgram& colmap, const MatchedImages& images,
                             const KnownPhotos& known)
    : context_(context),
      images_(images),
      refine_(RefineIntrinsicsFromWord(options.refine_intrinsics)),
      labels_(LabelsOf(images, options.image_path)),
      told_(PlanLenses(images, labels_, known, refine_)),
      plan_(told_) {
  for (const std::string& note : plan_.notes()) context_.Warn(note);
  RequireKnownCameraModels(colmap, plan_, options.database_path);
}

LensPlan MappingLenses::AsInDatabase() const {
  return LensPlan(images_.cameras(), images_.images());
}

bool MappingLenses::AreCalibrated(const std::set<uint32_t>& photos) const {
  return std::all_of(photos.begin(), photos.end(), [&](uint32_t id) {
    return plan_.cameras().at(plan_.images().at(id).camera_id).has_prior_focal_length;
  });
}

std::map<uint32_t, Camera> MappingLenses::Held(const LensPlan& plan) const {
  std::map<uint32_t, Camera> calibrated;
  if (refine_ != RefineIntrinsics::kAuto) return calibrated;
  for (const auto& [id, camera] : plan.cameras()) {
    const auto told = plan_.cameras().find(id);
    const bool is_as_told = told != plan_.cameras().end() && told->second.model == camera.model &&
                            told->second.params == camera.params;
    if (camera.has_prior_focal_length && is_as_told) calibrated.emplace(id, camera);
  }
  return calibrated;
}

LensCheck MappingLenses::Check(const MappingPass& pass) const {
  LensCheck check = CheckLenses(pass.model(), labels_, RefineIntrinsics::kAuto);
  if (!pass.can_set_lenses) KeepCamerasOfRigs(context_, &check);
  return check;
}

void MappingLenses::KeepCalibrated(MappingPass* pass) const {
  for (LensFinding& lens : pass->lenses.lenses) {
    const Camera& told = pass->plan.cameras().at(lens.camera_ids[0]);
    if (refine_ != RefineIntrinsics::kAuto || !lens.used || lens.apart) continue;
    if (!told.has_prior_focal_length) continue;
    const double sigma = lens.focal_sigma / told.MeanFocalLength();
    const bool vague = sigma >= kMaxFocalSigmaOfCalibrated && lens.deviations <= kSureDeviations &&
                       lens.FocalDeviations() < kClearFocalDeviations;
    const bool same =
        lens.FocalDeviations() < kSameFocalDeviations && lens.deviations < kOtherLensDeviations;
    if (!vague && !same) continue;
    lens.used = false;
    context_.Warn(fmt::format(
        "The photos would have a focal length of {:.1f} pixels instead of {:.1f}, but know it to "
        "{:.1f} % only: the calibrated lens stays.",
        lens.found.MeanFocalLength(), told.MeanFocalLength(), 100 * sigma));
  }
}

bool MappingLenses::AreContradicted(const MappingPass& pass) const {
  bool contradicted = false;
  const bool determined = AreDetermined(pass.lenses);
  for (LensFinding lens : pass.lenses.lenses) {
    if (pass.lenses.only_looked_at && lens.Contradicts()) {
      context_.Warn(lens.Sentence() + " It is for roomtex-align, which has the scan, to mend it.");
    }
    if (!lens.used) continue;
    contradicted = true;
    if (determined) continue;
    lens.used = false;
    context_.Warn(lens.Sentence() +
                  fmt::format(" The photos leave focal lengths open by more than {:.0f} %.",
                              100 * kMaxFocalSigma));
  }
  return contradicted && determined;
}

void MappingLenses::Learn(const MappingPass& pass) {
  plan_ = pass.plan;
  const bool knows = pass.can_set_lenses && pass.refine && !pass.lenses.lenses.empty() &&
                     AreDetermined(pass.lenses);
  if (knows) plan_.Calibrate(pass.model());
}

void MappingLenses::Tell(MappingPass* pass) const {
  const LensPlan told = pass->can_set_lenses ? told_ : AsInDatabase();
  const SparseModel& model = pass->model();
  for (LensFinding& lens : pass->lenses.lenses) {
    // By whether they are calibrated: what COLMAP guessed counts where nothing else was told.
    std::map<bool, std::map<uint32_t, Camera>> told_cameras;
    std::map<bool, bool> is_another;
    for (const std::string& name : lens.photos) {
      const SparseImage& image = *model.FindImage(name);
      const Camera& camera = told.cameras().at(told.images().at(image.image_id).camera_id);
      const Camera& now = model.cameras.at(image.camera_id);
      const bool is_calibrated = camera.has_prior_focal_length;
      is_another[is_calibrated] |= now.model != camera.model || now.params != camera.params;
      told_cameras[is_calibrated].emplace(camera.camera_id, camera);
    }
    const bool any_calibrated = told_cameras.count(true) > 0;
    std::vector<Camera> cameras;
    for (const auto& [id, camera] : told_cameras[any_calibrated]) cameras.push_back(camera);
    lens.used = is_another[any_calibrated];
    lens.Tell(cameras);
  }
}

void MappingLenses::SayWhatWasNotHeld(const MappingPass& pass) const {
  const std::vector<const MapperResult*> models = pass.best[0].Models();
  if (std::none_of(models.begin(), models.end(),
                   [](const auto* one) { return one->could_not_hold; })) {
    return;
  }
  std::string list;
  for (const auto& [id, camera] : Held(pass.plan)) {
    if (pass.model().cameras.count(id) == 0) continue;
    list += (list.empty() ? "" : ", ") + std::to_string(id);
  }
  context_.Warn("Calibrated cameras (" + list +
                ") could not be held beside those that are refined: the model has them as COLMAP "
                "refined them. Map the photos of calibrated cameras by themselves, or give "
                "--refine_intrinsics 0, which keeps all as told.");
}

}  // namespace roomtex
