#include "capture/calibration/calibration_output.h"

#include <cmath>
#include <cstdlib>

#include "core/camera_text.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

Json Numbers(const std::vector<double>& values) {
  Json json = Json::array();
  for (const double value : values) json.push_back(NumberOrNull(value));
  return json;
}

Json PhotoToJson(const CalibratedPhoto& photo) {
  Json json;
  json["name"] = photo.name;
  json["used"] = photo.used;
  json["rms_px"] = NumberOrNull(photo.rms_px);
  json["num_corners"] = photo.num_corners;
  json["reason"] = photo.reason;
  json["held_out_rms_px"] = NumberOrNull(photo.held_out_rms_px);
  json["num_bad_corners"] = photo.num_bad_corners;
  json["tilt_deg"] = NumberOrNull(photo.tilt_deg);
  json["distance_m"] = NumberOrNull(photo.distance);
  return json;
}

Json CoverageToJson(const Coverage& coverage) {
  Json json;
  json["share"] = coverage.share;
  json["radius"] = coverage.radius;
  json["corners_reached"] = coverage.corner_reached;
  json["columns"] = coverage.columns;
  json["rows"] = coverage.rows;
  json["num_corners"] = coverage.num_corners;
  return json;
}

Json ModelToJson(const ModelComparison& model) {
  Json json;
  json["camera_model"] = CameraModelName(model.lens.model);
  json["num_free_params"] = model.lens.num_free;
  json["rms_px"] = model.rms_px;
  json["held_out_rms_px"] = NumberOrNull(model.held_out_rms_px);
  json["gain"] = NumberOrNull(model.gain);
  json["bic"] = model.bic;
  json["chosen"] = model.chosen;
  return json;
}

}  // namespace

Camera RoundedCamera(const Camera& camera) {
  Camera rounded = camera;
  for (double& param : rounded.params) {
    param = std::strtod(Significant(param, kLensDigits).c_str(), nullptr);
  }
  return rounded;
}

void WriteCamerasText(const std::string& path, const Camera& camera) {
  OutputFile file(path);
  file.stream() << "# Camera list with one line of data per camera:\n"
                << "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
                << "# Number of cameras: 1\n"
                << CamerasTextLine(camera, kLensDigits);
  file.Commit();
}

std::string FocalLengthLine(const Calibration& calibration) {
  const double focal = calibration.camera.MeanFocalLength();
  return "focal length " + Number(focal, 1) + " +- " +
         Number(calibration.focal_sigma_percent / 100 * focal, 1) + " px (" +
         Number(calibration.focal_sigma_percent, 2) + " %), reprojection " +
         Number(calibration.rms_px, 2) + " px rms over " + std::to_string(calibration.NumUsed()) +
         " photos";
}

void FillReport(const Calibration& calibration, const Board& board, Report* report) {
  Report& r = *report;
  r["camera_model"] = CameraModelName(calibration.camera.model);
  r["width"] = calibration.camera.width;
  r["height"] = calibration.camera.height;
  r["params"] = calibration.camera.params;
  r["params_sigma"] = Numbers(calibration.params_sigma);
  r["focal_sigma_percent"] = NumberOrNull(calibration.focal_sigma_percent);
  r["corner_sigma_px"] = NumberOrNull(calibration.corner_sigma_px);
  r["mean_sigma_px"] = NumberOrNull(calibration.mean_sigma_px);
  r["rms_px"] = calibration.rms_px;
  r["held_out_rms_px"] = NumberOrNull(calibration.held_out_rms_px);
  r["corner_noise_px"] = NumberOrNull(calibration.sigma_px);
  r["photo_scatter"] = NumberOrNull(calibration.photo_scatter);
  r["board_bow_mm"] = NumberOrNull(1000 * calibration.bow.height);
  r["board_bow_sigma_mm"] = NumberOrNull(1000 * calibration.bow.sigma);
  r["board_bow_focal_percent"] = calibration.bow.focal_percent;
  r["board_bow_used"] = calibration.bow.used;
  r["board"] = board.Name();
  r["num_photos"] = calibration.photos.size();
  r["num_used"] = calibration.NumUsed();
  r["max_angle_between_boards_deg"] = calibration.max_angle_between_boards_deg;
  r["coverage"] = CoverageToJson(calibration.coverage);
  r["models"] = Json::array();
  for (const ModelComparison& model : calibration.models) r["models"].push_back(ModelToJson(model));
  r["why_model"] = calibration.why_model;
  r["images"] = Json::array();
  for (const CalibratedPhoto& photo : calibration.photos) {
    r["images"].push_back(PhotoToJson(photo));
  }
}

}  // namespace roomtex
