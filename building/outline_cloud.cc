#include "building/outline_cloud.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <unordered_map>

#include <Eigen/Eigenvalues>

#include "building/neighbours.h"
#include "colmap_ext/sparse_model.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/json_text.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/result_names.h"
#include "core/statistics.h"
#include "core/text.h"
#include "importers/scan_record.h"

namespace roomtex {
namespace {

constexpr size_t kFewestPoints = 50;

// Numbers between commas; none unless they are `count`.
std::vector<double> NumbersOf(const std::string& text, size_t count) {
  std::vector<double> numbers;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) {
    const std::optional<double> number = ParseNumber(Trimmed(part));
    if (!number) return {};
    numbers.push_back(*number);
  }
  if (numbers.size() != count || text.back() == ',') return {};
  return numbers;
}

std::optional<Eigen::Vector3d> GivenUp(const std::string& text) {
  const std::vector<double> numbers = NumbersOf(text, 3);
  if (numbers.empty()) return std::nullopt;
  const Eigen::Vector3d up(numbers[0], numbers[1], numbers[2]);
  if (!(up.norm() > 1e-9) || !up.allFinite()) return std::nullopt;
  return up.normalized();
}

std::optional<GeoPosition> GivenOrigin(const std::string& text) {
  const std::vector<double> numbers = NumbersOf(text, 3);
  if (numbers.empty()) return std::nullopt;
  return GeoPosition{numbers[0], numbers[1], numbers[2]};
}

// Gravity by the cameras: people hold them level, wide or high, whatever they tilt, so that one
// axis of the picture is horizontal (Szeliski 2006, "Image alignment and stitching", 2.5).
std::optional<Eigen::Vector3d> UpOfCameras(const SparseModel& model) {
  struct Axes {
    Eigen::Vector3d x, y;  // right and down
  };
  std::vector<Axes> cameras;
  for (const auto& [id, image] : model.images) {
    const Eigen::Matrix3d model_from_cam =
        image.cam_from_model.rotation.conjugate().toRotationMatrix();
    cameras.push_back({model_from_cam.col(0), model_from_cam.col(1)});
  }
  if (cameras.size() < 2) return std::nullopt;
  constexpr size_t kMostCameras = 100;
  const size_t every = (cameras.size() + kMostCameras - 1) / kMostCameras;
  const auto score_of = [&](const Eigen::Vector3d& up) {
    // Most photos are wide, few are upside down.
    constexpr double kHigh = 0.9, kUpsideDown = 0.7, kLevel = 0.2;
    const auto level = [](double sine) { return std::exp(-sine * sine / (kLevel * kLevel)); };
    double score = 0;
    for (size_t i = 0; i < cameras.size(); i += every) {
      const double x = cameras[i].x.dot(up), y = cameras[i].y.dot(up);
      score += std::max((y < 0 ? 1 : kUpsideDown) * level(x), kHigh * level(y));
    }
    return score;
  };
  double best_score = -1;
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  for (size_t i = 0; i < cameras.size(); i += every) {
    std::vector<Eigen::Vector3d> guesses = {-cameras[i].y, cameras[i].x, -cameras[i].x};
    for (size_t j = i + every; j < cameras.size(); j += 7 * every) {
      // Square to the horizontal axes of two photos, and rather up than down in them.
      Eigen::Vector3d guess = cameras[i].x.cross(cameras[j].x);
      if (guess.norm() < 0.2) continue;
      guess.normalize();
      guesses.push_back(guess.dot(cameras[i].y + cameras[j].y) > 0 ? Eigen::Vector3d(-guess)
                                                                   : guess);
    }
    for (const Eigen::Vector3d& guess : guesses) {
      const double score = score_of(guess);
      if (score > best_score) best_score = score, up = guess;
    }
  }
  for (int round = 0; round < 10; ++round) {
    Eigen::Matrix3d sum = 1e-3 * static_cast<double>(cameras.size()) *
                          (Eigen::Matrix3d::Identity() - up * up.transpose());
    for (const Axes& axes : cameras) {
      const bool wide = std::abs(axes.x.dot(up)) <= std::abs(axes.y.dot(up));
      const Eigen::Vector3d level = wide ? axes.x : axes.y;
      const double sine = level.dot(up) / 0.1;
      const double weight = 1 / (1 + sine * sine);
      sum += weight * level * level.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
    const Eigen::Vector3d next = solver.eigenvectors().col(0);
    up = next.dot(up) < 0 ? Eigen::Vector3d(-next) : next;
  }
  return up;
}

// What roomtex-align wrote beside an aligned model, or into its geo folder.
struct ModelPlace {
  bool aligned = false;  // metres
  std::optional<GeoFrame> geo;
  Rigid enu_from_model;
  bool north_assumed = false;
};

ModelPlace PlaceOfModel(const std::string& folder) {
  ModelPlace place;
  for (const char* name : {kAlignReportName, "geo.json"}) {
    const std::string path = (std::filesystem::path(folder) / name).string();
    const Json json = ReadJsonIfAny(path);
    if (!json.is_object()) continue;
    const bool is_alignment = std::string(name) == kAlignReportName;
    place.aligned = true;
    const Json geo = is_alignment ? (json.contains("geo") ? json["geo"] : Json()) : json;
    if (!geo.is_object()) continue;
    try {
      place.north_assumed = geo.value("heading_assumed", false);
      const Json& origin = geo.at("origin");
      const GeoPosition position{origin.at("latitude").get<double>(),
                                 origin.at("longitude").get<double>(),
                                 origin.at("height").get<double>()};
      if (!position.Problems().empty()) {
        throw InputError(path, "origin", position.Problems()[0], "Run roomtex-align again");
      }
      if (is_alignment) {
        const Json& rigid = geo.at("enu_from_scan");
        Eigen::Vector4d wxyz;
        for (size_t i = 0; i < 4; ++i) {
          wxyz[static_cast<int>(i)] = rigid.at("rotation_wxyz").at(i).get<double>();
        }
        for (size_t i = 0; i < 3; ++i) {
          place.enu_from_model.translation[static_cast<int>(i)] =
              rigid.at("translation").at(i).get<double>();
        }
        if (!(std::abs(wxyz.norm() - 1) < 1e-3)) {
          throw InputError(path, "geo.enu_from_scan", "holds a rotation that is none",
                           "Run roomtex-align again");
        }
        place.enu_from_model.rotation = QuaternionFromWxyz(wxyz).normalized();
      }
      place.geo.emplace(position);
    } catch (const nlohmann::json::exception&) {
      throw InputError(path, "geo", "lacks the place on the Earth or holds something else there",
                       "Run roomtex-align again");
    }
    return place;
  }
  return place;
}

// The frame of COLMAP's model_aligner, ecef: everything as far from the origin as the ground is
// from the middle of the Earth. Northings of a map grid are, too, about 57 degrees north; their z
// is a height, which in ecef only a strip of 20 km along the equator has so small.
bool LooksEarthCentred(const std::vector<Eigen::Vector3d>& points) {
  constexpr double kHighest = 1e4;  // metres
  std::vector<double> norms, heights;
  const size_t every = std::max<size_t>(1, points.size() / 1000);
  for (size_t i = 0; i < points.size(); i += every) {
    norms.push_back(points[i].norm());
    heights.push_back(std::abs(points[i].z()));
  }
  const double low = Quantile(norms, 0.05), high = Quantile(norms, 0.95);
  return low > 6.34e6 && high < 6.40e6 && Median(&heights) > kHighest;
}

void AddModelPoints(const SparseModel& model, OutlineCloud* cloud) {
  for (const auto& [id, point] : model.points) {
    if (!point.x_in_model.allFinite()) continue;
    cloud->points.push_back(point.x_in_model);
    cloud->colors.push_back({point.color[0], point.color[1], point.color[2]});
    Eigen::Vector3d eye = Scan::MissingPoint();
    if (!point.track.empty()) {
      const auto image = model.images.find(point.track[0].image_id);
      if (image != model.images.end()) eye = image->second.cam_from_model.TargetOriginInSource();
    }
    cloud->eyes.push_back(eye);
  }
}

void AddScanPoints(const ScanFile& file, OutlineCloud* cloud) {
  for (const Scan& scan : file.scans) {
    const Eigen::Vector3d eye = scan.organised ? scan.Station() : Scan::MissingPoint();
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      cloud->points.push_back(scan.points[i]);
      cloud->eyes.push_back(eye);
    }
  }
}

// Averages in cubes of this side.
void ThinOut(double side, const Eigen::Vector3d& origin, OutlineCloud* cloud) {
  struct Cube {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double count = 0;
    size_t first = 0;
  };
  std::unordered_map<uint64_t, size_t> index;
  std::vector<Cube> cubes;
  index.reserve(2 * kMaxOutlinePoints);
  for (size_t i = 0; i < cloud->points.size(); ++i) {
    const Eigen::Vector3d at = (cloud->points[i] - origin) / side;
    const uint64_t key = MixBits(static_cast<uint64_t>(static_cast<int64_t>(std::floor(at.x()))),
                                 static_cast<uint64_t>(static_cast<int64_t>(std::floor(at.y()))),
                                 static_cast<uint64_t>(static_cast<int64_t>(std::floor(at.z()))));
    const auto [found, is_new] = index.emplace(key, cubes.size());
    if (is_new) cubes.push_back({Eigen::Vector3d::Zero(), 0, i});
    Cube& cube = cubes[found->second];
    cube.sum += cloud->points[i] - origin;
    cube.count += 1;
  }
  OutlineCloud thin = *cloud;
  thin.points.clear(), thin.eyes.clear(), thin.colors.clear();
  for (const Cube& cube : cubes) {
    thin.points.push_back(origin + cube.sum / cube.count);
    thin.eyes.push_back(cloud->eyes[cube.first]);
    if (!cloud->colors.empty()) thin.colors.push_back(cloud->colors[cube.first]);
  }
  *cloud = std::move(thin);
}

// Where nearly all points lie: outliers of a model may be kilometres away.
Eigen::AlignedBox3d BoxOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::AlignedBox3d box;
  Eigen::Vector3d low, high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    const size_t every = std::max<size_t>(1, points.size() / 100000);
    for (size_t i = 0; i < points.size(); i += every) values.push_back(points[i][axis]);
    low[axis] = Quantile(values, 0.02);
    high[axis] = Quantile(values, 0.98);
  }
  box.extend(low), box.extend(high);
  return box;
}

// Far outliers go, and what is more than the rest needs is averaged.
void LimitPoints(OutlineCloud* cloud) {
  const Eigen::AlignedBox3d core = BoxOf(cloud->points);
  const double reach = core.diagonal().norm();
  OutlineCloud near = *cloud;
  near.points.clear(), near.eyes.clear(), near.colors.clear();
  for (size_t i = 0; i < cloud->points.size(); ++i) {
    if (core.exteriorDistance(cloud->points[i]) > reach) continue;
    near.points.push_back(cloud->points[i]);
    near.eyes.push_back(cloud->eyes[i]);
    if (!cloud->colors.empty()) near.colors.push_back(cloud->colors[i]);
  }
  *cloud = std::move(near);
  double side = reach / 4000;
  while (cloud->points.size() > kMaxOutlinePoints && side > 0) {
    ThinOut(side, core.min(), cloud);
    side *= 1.3;
  }
}

// What --geo_origin must not stand beside, must not stand beside a place on the Earth that the
// input has by itself, either.
void RequireNoOtherFrame(const OutlineInputOptions& options, bool is_on_earth) {
  if (!is_on_earth) return;
  const char* const has_place = " has its place on the Earth by itself, ";
  if (!options.up.empty()) {
    throw UsageError(options.input_path + has_place + "and with it what is up: leave --up out");
  }
  if (options.scale != 0 && options.scale != 1) {
    throw UsageError(options.input_path + has_place + "in metres: leave --scale out");
  }
  if (!options.geo_origin.empty()) {
    throw UsageError(options.input_path + has_place +
                     "and how it is turned there: leave --geo_origin out");
  }
}

}  // namespace

void OutlineInputOptions::Declare(OptionFields* fields) {
  fields->InputPath("sparse_path", &sparse_path,
                    "For a scan file as --input_path: the COLMAP model in the same frame (a dense "
                    "cloud's own model). Its cameras tell what is up, roomtex-align's "
                    "alignment.json beside it scale and place on the Earth.");
  fields->Text("up", &up,
               "x,y,z: what points up in the frame of the input; empty = by the cameras or the "
               "file, refined by walls and ground.");
  fields->Require(up.empty() || GivenUp(up).has_value(),
                  "--up must be three numbers x,y,z that are not all 0");
  fields
      ->Number("scale", &scale,
               "Metres per unit of the input; 0 = 1 for scan files and models of roomtex-align, "
               "else not known: lengths are then in units of the input.")
      .NotNegative()
      .Finite();
  const bool fine = geo_origin.empty() || (GivenOrigin(geo_origin).has_value() &&
                                           GivenOrigin(geo_origin)->Problems().empty());
  fields->Text("geo_origin", &geo_origin,
               "LATITUDE,LONGITUDE,HEIGHT (degrees WGS84, metres above the ellipsoid): the input's "
               "frame is east-north-up about this place, in metres. Not needed for models that "
               "roomtex-align placed on the Earth, nor for Earth-centred ones (COLMAP's "
               "model_aligner, ecef).");
  fields->Require(
      fine,
      "--geo_origin must be LATITUDE,LONGITUDE,HEIGHT in degrees (-90 to 90, -180 to 360) and "
      "metres");
  reader.Declare(fields);
}
std::vector<std::string> OutlineInputOptions::Problems() const {
  std::vector<std::string> problems = ProblemsOf(*this);
  if (!geo_origin.empty() && !up.empty()) {
    problems.push_back("--up and --geo_origin both say what is up: leave one out");
  }
  if (!geo_origin.empty() && scale != 0 && scale != 1) {
    problems.push_back("--geo_origin is for an input in metres: leave --scale out");
  }
  return problems;
}

std::optional<GeoPosition> OutlineInputOptions::GeoOrigin() const {
  return GivenOrigin(geo_origin);
}

Eigen::Vector3d MiddleOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& point : points) values.push_back(point[axis]);
    middle[axis] = Median(&values);
  }
  return middle;
}

void OutlineCloud::MoveTo(const Similarity& target_from_here) {
  for (Eigen::Vector3d& point : points) point = target_from_here * point;
  for (Eigen::Vector3d& eye : eyes) eye = target_from_here * eye;
  for (Eigen::Vector3d& camera : cameras) camera = target_from_here * camera;
  up = target_from_here.rotation * up;
  spacing *= target_from_here.scale;
  noise *= target_from_here.scale;
  step *= target_from_here.scale;
  frame.outline_from_input = target_from_here * frame.outline_from_input;
}

void MeasureCloud(bool metric, int num_threads, OutlineCloud* cloud) {
  const Neighbours neighbours(cloud->points);
  constexpr int kProbes = 4000, kCount = 16, kSixth = 6;
  const size_t every = std::max<size_t>(1, cloud->points.size() / kProbes);
  const int probes = static_cast<int>((cloud->points.size() + every - 1) / every);
  std::vector<double> spacings(static_cast<size_t>(probes)), noises(spacings.size());
  ParallelFor(num_threads, 0, probes, [&](int i) {
    const Eigen::Vector3d& x = cloud->points[static_cast<size_t>(i) * every];
    const std::vector<int> near = neighbours.Nearest(x, kCount);
    spacings[static_cast<size_t>(i)] =
        (cloud->points[static_cast<size_t>(near[std::min<size_t>(kSixth, near.size() - 1)])] - x)
            .norm();
    noises[static_cast<size_t>(i)] = FitPlane(cloud->points, near).rms;
  });
  cloud->spacing = Median(&spacings);
  // Most neighbourhoods hold corners and clutter: the flat ones tell the noise.
  cloud->noise = Quantile(&noises, 0.3);
  const double extent = BoxOf(cloud->points).diagonal().norm();
  constexpr double kStep = 1.5;  // metres
  cloud->step = metric ? std::min(kStep, extent / 40) : extent / 40;
}

OutlineCloud ReadOutlineCloud(const OutlineInputOptions& options, int num_threads) {
  OutlineCloud cloud;
  if (!std::filesystem::exists(options.input_path)) {
    throw InputError(options.input_path, "", "does not exist",
                     "Give the folder of a COLMAP model, or a scan file");
  }
  const bool is_model = std::filesystem::is_directory(options.input_path);
  const std::string model_folder = is_model ? options.input_path : options.sparse_path;
  if (is_model && !options.sparse_path.empty()) {
    throw UsageError("--sparse_path is for a scan file as --input_path; " + options.input_path +
                     " is a model itself");
  }
  SparseModel model;
  ModelPlace place;
  if (!model_folder.empty()) {
    model = ReadSparseModel(model_folder);
    place = PlaceOfModel(model_folder);
    const AlignmentRecord record = ReadAlignmentRecord(model_folder);
    if (place.aligned) {
      cloud.frame.alignment = {record.trusted, record.reason, place.north_assumed};
    }
    for (const auto& [id, image] : model.images) {
      cloud.cameras.push_back(image.cam_from_model.TargetOriginInSource());
    }
  }
  if (is_model) {
    AddModelPoints(model, &cloud);
  } else {
    const ScanFile file = ReadScanFile(options.input_path, options.reader);
    AddScanPoints(file, &cloud);
    cloud.up = file.scans[0].up;
  }
  cloud.num_read = static_cast<double>(cloud.points.size());
  if (cloud.points.size() < kFewestPoints) {
    throw InputError(options.input_path, "",
                     "holds " + std::to_string(cloud.points.size()) +
                         " points, too few for a "
                         "building (at least " +
                         std::to_string(kFewestPoints) + ")",
                     "Give a model or cloud with more points");
  }
  RequireNoOtherFrame(options, place.geo || LooksEarthCentred(cloud.points));
  if (place.aligned && options.scale != 0 && options.scale != 1) {
    throw UsageError(model_folder + " is a model of roomtex-align, in metres: leave --scale out");
  }
  // A model beside a cloud is that of its points; alone, a cloud is in metres as all scans are.
  cloud.frame.metric = place.aligned || options.scale > 0 || !options.geo_origin.empty() ||
                       (!is_model && model_folder.empty());
  if (options.scale > 0) cloud.MoveTo({options.scale, Eigen::Quaterniond::Identity(), {0, 0, 0}});

  if (!options.geo_origin.empty()) {
    cloud.frame.geo.emplace(*GivenOrigin(options.geo_origin));
  } else if (place.geo) {
    cloud.frame.geo = place.geo;
    cloud.MoveTo({1, place.enu_from_model.rotation, place.enu_from_model.translation});
  } else if (LooksEarthCentred(cloud.points)) {
    const GeoFrame earth({0, 0, 0});
    const GeoPosition position =
        earth.GeoFromEnu(earth.EcefFromEnu().Inverse() * MiddleOf(cloud.points));
    cloud.frame.geo.emplace(position);
    const Rigid enu_from_ecef = cloud.frame.geo->EcefFromEnu().Inverse();
    cloud.MoveTo({1, enu_from_ecef.rotation, enu_from_ecef.translation});
    cloud.frame.metric = true;
  }

  if (const auto up = GivenUp(options.up)) {
    cloud.up = cloud.frame.outline_from_input.rotation * *up;
    cloud.up_source = OutlineCloud::UpSource::kGiven;
  } else if (cloud.frame.geo) {
    cloud.up = Eigen::Vector3d::UnitZ();
    cloud.up_source = OutlineCloud::UpSource::kEarth;
  } else if (const auto by_cameras = UpOfCameras(model)) {
    cloud.up = cloud.frame.outline_from_input.rotation * *by_cameras;
    cloud.up_source = OutlineCloud::UpSource::kCameras;
  }
  LimitPoints(&cloud);
  MeasureCloud(cloud.frame.metric, num_threads, &cloud);
  return cloud;
}

}  // namespace roomtex
