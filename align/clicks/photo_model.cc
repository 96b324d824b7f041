#include "align/clicks/photo_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>

#include <fmt/core.h>

#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/stays_inside.h"
#include "core/text.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

// COLMAP's guess where nobody says: only a place to begin with, the picks decide.
constexpr double kGuessedFocal = 1.2;
constexpr double kMaxPrincipalShare = 0.2;  // of width and height; of crops and shifted lenses less

// A name must not lead out of the folder of the photos.
// Parameters that were found for another photo size have their principal point elsewhere.
bool IsOfThisSize(const Camera& camera, Eigen::Vector2d* principal) {
  const auto x = CameraProjection(camera).ImgFromCam({0, 0, 1});
  if (!x) return true;
  *principal = *x;
  const Eigen::Vector2d off = *x - 0.5 * Eigen::Vector2d(camera.width, camera.height);
  return std::abs(off.x()) < kMaxPrincipalShare * camera.width &&
         std::abs(off.y()) < kMaxPrincipalShare * camera.height;
}

Camera FoundCamera(const std::string& path, const Camera& given, FocalSource* source) {
  Camera camera = given;
  const bool has_radial = given.model != CameraModel::kSimplePinhole;
  camera.model = has_radial ? CameraModel::kSimpleRadial : CameraModel::kSimplePinhole;
  const std::optional<double> exif = ReadFocalLength(path);
  *source = exif ? FocalSource::kExif : FocalSource::kPicks;
  camera.params = {exif.value_or(kGuessedFocal * std::max(camera.width, camera.height)),
                   0.5 * camera.width, 0.5 * camera.height};
  if (has_radial) camera.params.push_back(0);
  return camera;
}

Camera CameraOf(const std::string& path, const PhotoCameraOptions& options, UnfitPhotos unfit,
                FocalSource* source) {
  const auto [width, height] = ReadPhotoSize(path);
  if (width == 0) {
    if (unfit == UnfitPhotos::kTaken) return {0, CameraModel::kSimplePinhole, 1, 1, {1, 0.5, 0.5}};
    throw InputError(path, "", "is no photo that can be read", "Check the file");
  }
  Camera camera;
  camera.model = *CameraModelFromName(options.camera_model);
  camera.width = width;
  camera.height = height;
  camera.params = options.Params();
  if (camera.params.empty()) return FoundCamera(path, camera, source);
  Eigen::Vector2d principal = Eigen::Vector2d::Zero();
  if (IsOfThisSize(camera, &principal)) {
    *source = FocalSource::kGiven;
    return camera;
  }
  if (unfit == UnfitPhotos::kTaken) return FoundCamera(path, camera, source);
  throw InputError(path, "",
                   fmt::format("has {} x {} pixels, and the principal point of --camera_params, "
                               "({:.6g}, {:.6g}), is far from its middle",
                               width, height, principal.x(), principal.y()),
                   "Give the parameters for this photo size, or leave them out");
}

}  // namespace

std::vector<double> PhotoCameraOptions::Params() const {
  std::vector<double> params;
  for (size_t at = 0; at < camera_params.size();) {
    const size_t end = std::min(camera_params.find(',', at), camera_params.size());
    params.push_back(ParseNumber(Trimmed(camera_params.substr(at, end - at)))
                         .value_or(std::numeric_limits<double>::quiet_NaN()));
    at = end + 1;
  }
  return params;
}

void PhotoCameraOptions::Declare(OptionFields* fields) {
  fields->Text("camera_model", &camera_model,
               "Without --input_path: COLMAP's model of the photos' camera, as "
               "ImageReader.camera_model has it. Without --camera_params SIMPLE_RADIAL or "
               "SIMPLE_PINHOLE.");
  fields->Text("camera_params", &camera_params,
               "Without --input_path: parameters of the photos' camera with commas between them, "
               "as COLMAP's ImageReader.camera_params; empty = the focal length of the EXIF data, "
               "or found by eight picks that do not lie on one plane.");
  const auto model = CameraModelFromName(camera_model);
  fields->Require(model.has_value(), "--camera_model " + camera_model +
                                         " is no camera model of COLMAP, such as SIMPLE_RADIAL");
  if (!model) return;
  const std::vector<double> params = Params();
  fields->Require(!params.empty() || *model == CameraModel::kSimpleRadial ||
                      *model == CameraModel::kSimplePinhole,
                  "--camera_model " + camera_model +
                      " needs --camera_params: what is found with the pose is a focal length and "
                      "one radial term (SIMPLE_RADIAL, SIMPLE_PINHOLE)");
  if (params.empty()) return;
  std::string problems;
  // The photos and their size come later: one that any focal length may have.
  const int side = params[0] > 1 ? static_cast<int>(std::min(params[0], 1e6)) : 1;
  for (const std::string& problem : Camera{1, *model, side, side, params}.Problems()) {
    problems += (problems.empty() ? "" : "; ") + problem;
  }
  fields->Require(problems.empty(), "--camera_params " + camera_params + " with --camera_model " +
                                        camera_model + ": " + problems);
}

std::vector<std::string> PhotoCameraOptions::Problems() const { return ProblemsOf(*this); }

PhotoModel MakePhotoModel(const std::string& image_path, const std::vector<std::string>& names,
                          const PhotoCameraOptions& options, UnfitPhotos unfit) {
  PhotoModel photos;
  uint32_t id = 0;
  for (const std::string& name : names) {
    ++id;
    Camera camera = CameraOf((fs::path(image_path) / name).string(), options, unfit,
                             &photos.focal_sources[name]);
    camera.camera_id = id;
    SparseImage image;
    image.image_id = image.camera_id = id;
    image.name = name;
    photos.model.cameras[id] = camera;
    photos.model.images[id] = image;
  }
  return photos;
}

PhotoModel MakePhotoModel(const std::string& image_path, const std::string& picks_path,
                          const std::vector<Pick>& picks, const PhotoCameraOptions& options) {
  std::set<std::string> names;
  for (const Pick& pick : picks) {
    std::error_code ignored;
    if (!StaysInside(pick.image_name) ||
        !fs::is_regular_file(fs::path(image_path) / pick.image_name, ignored)) {
      throw InputError(picks_path, LinePosition(pick.line),
                       "the photo " + pick.image_name + " is not in " + image_path,
                       "Correct the name, or --image_path");
    }
    names.insert(pick.image_name);
  }
  return MakePhotoModel(image_path, std::vector<std::string>(names.begin(), names.end()), options);
}

std::string FocalProblemOf(FocalSource source, const PointPairs& pairs) {
  return source == FocalSource::kPicks ? FindFocalProblem(pairs) : "";
}

PickReview ReviewPhotoPicks(const CameraProjection& projection, FocalSource source,
                            const PointPairs& pairs, const PickReviewOptions& options) {
  if (!FocalProblemOf(source, pairs).empty()) {
    PickReview none;
    none.used.assign(pairs.size(), true);
    none.residual_px = none.leave_one_out_px = none.without_px2 =
        Eigen::VectorXd::Constant(pairs.size(), std::numeric_limits<double>::quiet_NaN());
    return none;
  }
  if (source != FocalSource::kGiven) {
    return ReviewPicks(LensPoseSolver(projection.camera(), source), pairs, options);
  }
  PickReview review = ReviewPicks(projection, pairs, options);
  // No surface will make the pose exacter: its clicks must not count as better than clicks are
  // because a few of them happen to fit.
  const int num_used = static_cast<int>(std::count(review.used.begin(), review.used.end(), true));
  for (ViewPose& pose : review.poses) {
    const double sigma_px = ClickSigma(pose.sum_px2, 2 * num_used - 6);
    if (pose.sigma_px > 0) pose.covariance *= std::pow(sigma_px / pose.sigma_px, 2);
  }
  return review;
}

std::vector<PickView> ReviewPhotoViews(const PhotoModel& photos, const std::vector<Pick>& picks,
                                       const PickReviewOptions& options) {
  std::vector<PickView> views = ReviewViews(
      photos.model, picks, kMinPicksPerPhoto, options,
      [&](const std::string& name, const CameraProjection& projection, const PointPairs& pairs) {
        return ReviewPhotoPicks(projection, photos.focal_sources.at(name), pairs, options);
      });
  for (PickView& view : views) {
    if (view.layout_problem.empty()) {
      view.layout_problem = FocalProblemOf(photos.focal_sources.at(view.image_name), view.pairs);
    }
  }
  return views;
}

}  // namespace roomtex
