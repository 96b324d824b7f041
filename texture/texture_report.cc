#include "texture/texture_report.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace roomtex {
namespace {

// Correlation of a photo with the others below which a sentence warns of it.
constexpr double kDoubtfulAgreement = 0.7;

double RoundedShare(const std::shared_ptr<const PhotoMask>& mask) {
  return mask ? std::round(1e3 * mask->Share()) / 1e3 : 0;
}
double RoundedGain(float gain) { return std::round(1e6 * gain) / 1e6; }

// What was found of the camera: response curve, light in the corners, how true EXIF is.
void FillToneReport(const std::vector<PhotoView>& photos, const ExposureSolution& exposure,
                    Report* report) {
  (*report)["response"] = exposure.response;
  Json corners = Json::object();
  for (size_t i = 0; i < photos.size(); ++i) {
    const auto& tone = exposure.tones[i];
    const double corner = tone ? std::exp(-tone->vignetting.LogFactor(1)) : 1;
    corners[photos[i].name] = std::round(1e4 * corner) / 1e4;
  }
  (*report)["corner_light"] = corners;
  (*report)["exif_scatter_ev"] =
      exposure.exif_scatter ? Json(*exposure.exif_scatter / std::log(2.0)) : Json(nullptr);
}

// How far each photo was off, and what was done about it.
Json RegistrationReport(const std::vector<PhotoView>& photos,
                        const std::vector<PhotoRegistration>& registration) {
  const auto rounded = [](double value) { return std::round(1e3 * value) / 1e3; };
  Json images = Json::array();
  for (size_t i = 0; i < registration.size(); ++i) {
    const PhotoRegistration& photo = registration[i];
    Json map = Json::array();
    for (int row = 0; row < PhotoRegistration::kMapRows; ++row) {
      Json line = Json::array();
      for (int column = 0; column < PhotoRegistration::kMapColumns; ++column) {
        const double px = photo.map_px[row * PhotoRegistration::kMapColumns + column];
        line.push_back(std::isnan(px) ? Json(nullptr) : Json(rounded(px)));
      }
      map.push_back(line);
    }
    images.push_back(
        {{"name", photos[i].name},
         {"shift_px",
          {{"before", rounded(photo.shift_before_px)}, {"after", rounded(photo.shift_after_px)}}},
         {"shift_before_mm", rounded(1000 * photo.shift_before)},
         {"shift_map_px", map},
         {"share_measured", rounded(photo.share_measured)},
         {"corrected", photo.corrected},
         {"turned_deg", rounded(photo.turned_deg)},
         {"moved_mm", rounded(1000 * photo.moved)},
         {"row_turned_deg", rounded(photo.row_turned_deg)},
         {"warp_px", rounded(photo.warp_px)}});
  }
  return images;
}

// Which corrections were tried, what spoke for them, and which were kept.
Json TrialsReport(const std::vector<RegistrationTrial>& trials) {
  const auto rounded = [](double value) { return std::round(1e4 * value) / 1e4; };
  const auto change = [&](const LikenessChange& found) {
    return Json{{"before", rounded(found.before)},
                {"after", rounded(found.after)},
                {"sigma", rounded(found.sigma)},
                {"num_places", found.num_places}};
  };
  Json list = Json::array();
  std::string applied = "none";
  for (const RegistrationTrial& trial : trials) {
    if (trial.kept) applied = trial.mode;
    list.push_back({{"mode", trial.mode},
                    {"kept", trial.kept},
                    {"moved_too_far", trial.moved_too_far},
                    {"among_photos", change(trial.among_photos)},
                    {"with_scan", change(trial.with_scan)}});
  }
  return {{"applied", applied}, {"trials", list}};
}

std::string NameList(const std::vector<PhotoView>& photos, const std::vector<int>& numbers) {
  std::string list;
  for (size_t i = 0; i < numbers.size() && i < 5; ++i) {
    list += (i > 0 ? ", " : "") + photos[numbers[i]].name;
  }
  if (numbers.size() > 5) list += " and " + std::to_string(numbers.size() - 5) + " more";
  return list;
}

}  // namespace

void FillColorReport(const std::vector<PhotoView>& photos, const ColorizeOptions& options,
                     const ColorizeResult& result, const Command::Context& context) {
  Report& report = context.report;
  report["num_photos"] = photos.size();
  report["num_vertices"] = result.num_vertices;
  report["num_colored"] = result.num_colored;
  const double coverage = result.num_vertices > 0 ? static_cast<double>(result.num_colored) /
                                                        static_cast<double>(result.num_vertices)
                                                  : 0;
  report["coverage"] = coverage;
  report["views_mean"] = result.views_mean;
  report["pixels_per_sample"] = result.pixels_per_sample;
  report["texture_scale"] = result.texture_scale;
  Json atlases = Json::array();
  for (const ColoredScan& scan : result.scans) {
    const MeshAtlas& atlas = scan.atlas;
    if (atlas.empty()) continue;
    atlases.push_back({{"texel_mm", 1000 * atlas.texel_size},
                       {"num_charts", atlas.charts.size()},
                       {"num_pages", atlas.num_pages},
                       {"page_size", atlas.page_size},
                       {"coverage", atlas.num_seen / std::max(1.0, atlas.num_texels)}});
  }
  if (!atlases.empty()) report["atlas"] = atlases;
  Json gains = Json::object(), balance = Json::object(), seen = Json::object();
  for (size_t i = 0; i < photos.size(); ++i) {
    const Eigen::Vector3f& gain = result.exposure.gains[i];
    gains[photos[i].name] = RoundedGain(std::cbrt(gain.prod()));
    balance[photos[i].name] = {RoundedGain(gain[0]), RoundedGain(gain[1]), RoundedGain(gain[2])};
    seen[photos[i].name] = result.samples_seen[i];
  }
  report["exposure_gain"] = gains;
  if (options.exposure.white_balance) report["channel_gain"] = balance;
  if (result.exposure.reference_photo >= 0) {
    report["exposure_reference"] = photos[result.exposure.reference_photo].name;
  }
  report["samples_seen"] = seen;
  Json agreement = Json::object();
  for (size_t i = 0; i < photos.size(); ++i) {
    const PhotoAgreement& photo = result.agreement[i];
    agreement[photos[i].name] = {{"correlation", std::round(1e3 * photo.correlation) / 1e3},
                                 {"difference", std::round(1e3 * photo.difference) / 1e3},
                                 {"num_samples", photo.num_samples},
                                 {"moving", RoundedShare(result.photos[i].moving)}};
  }
  report["photo_agreement"] = agreement;
  report["divided_photos"] = ToJson(result.comparison);
  Json sharpness = Json::object();
  for (size_t i = 0; i < photos.size(); ++i) {
    const PhotoSharpness& photo = result.sharpness[i];
    sharpness[photos[i].name] = {{"sharpness", std::round(1e3 * photo.sharpness) / 1e3},
                                 {"weight", std::round(1e3 * result.photos[i].weight) / 1e3},
                                 {"num_samples", photo.num_samples}};
  }
  report["photo_sharpness"] = sharpness;
  FillToneReport(photos, result.exposure, &report);
  if (!result.registration.photos.empty()) {
    report["images"] = RegistrationReport(photos, result.registration.photos);
    if (options.registration.mode == "auto") {
      report["registration"] = TrialsReport(result.registration.trials);
    }
  }
  report["disagreement"] = {{"before", result.disagreement.before},
                            {"after", result.disagreement.after},
                            {"at_random", result.disagreement.at_random},
                            {"num_pairs", result.disagreement.num_pairs}};
}

void JudgeColors(const std::vector<PhotoView>& photos, const ColorizeResult& result,
                 const Command::Context& context) {
  const ExposureSolution& exposure = result.exposure;
  if (exposure.without_exif > 0) {
    context.Warn(std::to_string(exposure.without_exif) + " of " + std::to_string(photos.size()) +
                 " photos have no exposure in EXIF; they are matched to the others");
  }
  if (!exposure.by_exif.empty()) {
    context.Warn("these photos overlap none of the others, their exposure comes from EXIF alone: " +
                 NameList(photos, exposure.by_exif));
  }
  if (!exposure.unconnected.empty()) {
    context.Warn(
        "neither EXIF nor an overlap ties these photos to the others, they get the median "
        "exposure: " +
        NameList(photos, exposure.unconnected));
  }
  if (!exposure.response_problem.empty()) {
    context.Warn("the response curve cannot be estimated: " + exposure.response_problem +
                 ". The photos are taken for sRGB");
  }
  if (exposure.exif_ignored) {
    context.Warn("the exposures in EXIF contradict what the photos show and are not used");
  }
  if (!exposure.contradicted.empty()) {
    context.Warn("the overlaps contradict EXIF by more than half an EV: " +
                 NameList(photos, exposure.contradicted));
  }
  const std::vector<int> foreign = FindForeignPhotos(result.agreement, kDoubtfulAgreement);
  if (!foreign.empty()) {
    context.Warn("much of what these photos show is not what the others show at the same places: " +
                 NameList(photos, foreign));
  }
  std::vector<int> moving;
  for (size_t i = 0; i < result.photos.size(); ++i) {
    if (result.photos[i].moving) moving.push_back(static_cast<int>(i));
  }
  if (!moving.empty()) {
    context.Warn(
        "something stands in these photos that the others do not show, and is left out "
        "(photo_agreement, moving): " +
        NameList(photos, moving));
  }
  std::vector<int> blind;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (result.samples_seen[i] == 0) blind.push_back(static_cast<int>(i));
  }
  if (!blind.empty() && blind.size() < photos.size()) {
    context.Warn("these photos see no sample of the scan: " + NameList(photos, blind));
  }
  const double coverage = static_cast<double>(result.num_colored) /
                          static_cast<double>(std::max<size_t>(result.num_vertices, 1));
  if (result.num_colored == 0) {
    context.report.SetUntrusted(
        "no photo sees any sample of the scan. Is the model aligned? Run roomtex-align.");
  } else if (coverage < 0.002) {
    context.report.SetUntrusted(
        "the photos see less than 0.2 % of the scan. Is the model aligned? "
        "Run roomtex-align.");
  } else if (blind.size() > photos.size() / 2) {
    context.report.SetUntrusted(
        "most photos see no sample of the scan. Is the model aligned? Run "
        "roomtex-align.");
  }
  const Disagreement& d = result.disagreement;
  if (d.num_pairs > 1000 && d.at_random > 15 && d.after > 0.8 * d.at_random) {
    context.report.SetUntrusted(
        "photos that see the same sample differ in colour as much as at random. Is the model "
        "aligned? Run roomtex-align.");
  }
  if (result.comparison.Contradicts()) {
    context.report.SetUntrusted(
        "photos contradict each other where they see the same (divided_photos): they, or some of "
        "them, stand elsewhere than they were aligned. Did several projectors throw the same "
        "pattern, or do rooms look alike? Look "
        "at the sparse model in COLMAP's window.");
  }
}

void FillScansReport(const PlacedScans& placed, Report* report) {
  Json scans = Json::array();
  for (const PlacedScans::File& file : placed.files) {
    scans.push_back({{"path", file.path},
                     {"azimuth", file.azimuth.empty() ? Json(nullptr) : Json(file.azimuth)},
                     {"meters_per_unit", file.meters_per_unit}});
  }
  (*report)["scans"] = scans;
}

Json SupplementReport(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                      const std::string& path) {
  size_t first = 0;
  for (size_t s = 0; s + 1 < scans.size(); ++s) {
    first += scans[s].points.size() - scans[s].NumMissing();
  }
  const std::vector<uint8_t>& views = colored.back().samples.views;
  return {{"path", path},
          {"first_vertex", first},
          {"num_vertices", scans.back().points.size()},
          {"num_colored", views.size() - std::count(views.begin(), views.end(), 0)}};
}

}  // namespace roomtex
