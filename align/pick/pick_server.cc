#include "align/pick/pick_server.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "align/pick/found_places.h"
#include "align/pick/mirror_picks.h"
#include "align/pick/photo_corner.h"
#include "align/pick/pick_json.h"
#include "align/pick/reduced_photo.h"
#include "align/pick/scan_picture.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/photo.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kThumbnailWidth = 240;  // pixels
constexpr int kThumbnailQuality = 82;
constexpr int kNumOverlays = 4;

bool HasPairs(const PickSession::Snapshot& snapshot) {
  return std::any_of(snapshot.picks.begin(), snapshot.picks.end(),
                     [](const SessionPick& pick) { return pick.complete(); });
}

// Fewer than place a model.
bool IsHint(const PickSession::Snapshot& snapshot) {
  return std::count_if(snapshot.picks.begin(), snapshot.picks.end(), [](const SessionPick& pick) {
           return pick.complete() && pick.weight > 0;
         }) < kMinPicksPerPhoto;
}

void AddScans(const PickSceneInput& input, std::vector<std::string>* arguments) {
  const auto add = [&](const std::string& name, const std::string& value) {
    arguments->insert(arguments->end(), {name, value});
  };
  for (const std::string& path : input.scan_paths) add("--scan_path", path);
  if (!input.scan_poses.empty()) add("--scan_poses", input.scan_poses);
  const ScanReaderOptions &reader = input.scan_reader, defaults;
  if (reader.azimuth != defaults.azimuth) add("--azimuth", reader.azimuth);
  if (reader.units != defaults.units) add("--units", reader.units);
  if (reader.up_axis != defaults.up_axis) add("--up_axis", reader.up_axis);
  if (reader.max_range != defaults.max_range) {
    add("--max_range", Exact(reader.max_range));
  }
  if (!reader.e57_check) add("--E57.check", "0");
}

// What roomtex-align is given: what this command was given. Without picks it searches.
std::vector<std::string> AlignArguments(const PickScene& scene, const PickSession& session,
                                        const PickServer::Setup& setup) {
  const PickSceneInput& input = scene.input();
  std::vector<std::string> arguments;
  const auto add = [&](const std::string& name, const std::string& value) {
    arguments.push_back(name);
    arguments.push_back(value);
  };
  for (const std::string& path : input.input_paths) add("--input_path", path);
  // Given once more they would be read as if nobody knew where they stand.
  if (!input.remembers_scans) AddScans(input, &arguments);
  if (HasPairs(*session.Now())) add("--picks_path", session.picks_path());
  add("--output_path", setup.aligned_path);
  add("--image_path", input.image_path);
  const PhotoCameraOptions no_camera;
  if (input.camera.camera_model != no_camera.camera_model) {
    add("--camera_model", input.camera.camera_model);
  }
  if (!input.camera.camera_params.empty()) add("--camera_params", input.camera.camera_params);
  if (!input.panoramas_path.empty()) add("--panoramas_path", input.panoramas_path);
  if (input.num_threads > 0) add("--num_threads", std::to_string(input.num_threads));
  add("--overlays", std::to_string(kNumOverlays));
  return arguments;
}

std::string PhotoPicture(int id) { return "photo/" + std::to_string(id); }
std::string ScanPicture(int id, const std::string& name) {
  return "scan/" + std::to_string(id) + "/" + name;
}

// The whole number of a query; none if it is missing or no number.
std::optional<int> WholeOf(const LocalServer::Query& query, const std::string& name) {
  const auto at = query.find(name);
  if (at == query.end()) return std::nullopt;
  int value = 0;
  const char* const end = at->second.data() + at->second.size();
  const auto [stop, error] = std::from_chars(at->second.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

double NumberOf(const LocalServer::Query& query, const std::string& name) {
  const auto at = query.find(name);
  double value = 0;
  bool is_number = at != query.end();
  if (is_number) {
    const char* const end = at->second.data() + at->second.size();
    const auto [stop, error] = std::from_chars(at->second.data(), end, value);
    is_number = error == std::errc() && stop == end && std::isfinite(value);
  }
  if (!is_number) throw UsageError(name + " must be a number.");
  return value;
}

}  // namespace

PickServer::PickServer(const PickScene& scene, PickSession* session, const Page& page,
                       const Setup& setup)
    : scene_(scene),
      session_(session),
      setup_(setup),
      tiles_(ImageTilesOptions()),
      back_projections_(ImageTilesOptions().tile_size),
      sights_(scene),
      align_(setup.align_program, setup.aligned_path,
             [this](const std::string& folder, const Json& report) {
               return TakeReport(folder, report);
             }),
      server_(setup.server) {
  AddPictures();
  AddPage(page, &server_);
  server_.AddJson("/state", [this](const Query&) { return State(); });
  server_.AddContent("/tile", [this](const Query& query) { return Tile(query); });
  server_.AddContent("/thumbnail", [this](const Query& query) { return Thumbnail(query); });
  server_.AddJson("/scan_point", [this](const Query& query) { return ScanPoint(query); });
  server_.AddJson("/corner", [this](const Query& query) { return Corner(query); });
  server_.AddPut("/picks", [this](const Json& json) {
    PutPicks put = ParsePutPicks(json, scene_);
    return SessionToJson(*session_->Put(put.revision, std::move(put.picks)), scene_);
  });
  server_.AddPost("/mirror", [this](const Json&) {
    const std::string problem = MirrorProblem(scene_);
    if (!problem.empty()) throw UsageError(problem);
    if (!session_->SaveAgain(true)) throw UsageError(session_->Now()->save_error);
    mirror_asked_ = true;
    server_.RequestStop();
    return Json{{"path", "/" + setup_.next_token + "/"}};
  });
  server_.AddJson("/edges", [this](const Query& query) { return Edges(query); });
  AddAlign();
}

void PickServer::AddAlign() {
  server_.AddPost("/align", [this](const Json&) {
    if (!session_->SaveAgain(true)) throw UsageError(session_->Now()->save_error);
    const auto now = session_->Now();
    if (!scene_.has_model() && !HasPairs(*now)) {
      throw UsageError("There are no pairs yet: set six of them first.");
    }
    align_.Start(AlignArguments(scene_, *session_, setup_), scene_.has_model() && IsHint(*now));
    return align_.State();
  });
  server_.AddJson("/align", [this](const Query&) { return align_.State(); });
  server_.AddDelete("/align", [this](const Json&) {
    align_.Cancel();
    return align_.State();
  });
  server_.AddContent("/overlay", [this](const Query& query) { return Overlay(query); });
}

std::string PickServer::TakeReport(const std::string& folder, const Json& report) {
  std::shared_ptr<const FoundPlaces> found;
  std::string problem;
  try {
    found = ReadFoundPlaces(folder, report, scene_);
  } catch (const InputError& error) {
    problem = error.what();
  }
  session_->TakeFound(std::move(found));
  if (!problem.empty()) return problem;
  if (!IsMirroredReading(report, scene_)) return "";
  return "This page still shows the mirror image: press Mirror above the scan and align again, to "
         "look at the photos there.";
}

void PickServer::Wait() {
  server_.Wait();
  align_.Cancel();
}

PickServer::~PickServer() = default;

void PickServer::AddPictures() {
  for (const PickPhoto& photo : scene_.photos()) {
    if (photo.missing) continue;
    const Camera& camera = photo.projection->camera();
    tiles_.Add(PhotoPicture(photo.id), camera.width, camera.height, ImageTiles::Format::kJpeg,
               [&photo, &camera] {
                 return ReadFittedPhoto(photo.path, photo.fit, camera.width, camera.height);
               });
  }
  for (int scan = 0; scan < scene_.num_scans(); ++scan) {
    const ScanPlaces& places = scene_.places(scan);
    pictures_.push_back(ScanPicturesOf(places.scan()));
    content_.push_back(places.Content());
    for (const std::string& name : pictures_.back()) {
      tiles_.Add(ScanPicture(scan, name), places.width(), places.height(),
                 ImageTiles::Format::kJpeg,
                 [&places, name] { return DrawScanPicture(places, name); });
    }
  }
}

// --image_name, else the one with the most picks, else the first of the ranking.
int PickServer::SelectedPhoto() const {
  if (const PickPhoto* photo = scene_.FindPhoto(setup_.image_name)) return photo->id;
  const auto now = session_->Now();
  int selected = scene_.Ranked({})[0]->id, most = 0;
  for (const PickPhoto& photo : scene_.photos()) {
    const int count = static_cast<int>(
        std::count_if(now->picks.begin(), now->picks.end(),
                      [&](const SessionPick& pick) { return pick.image_name == photo.name(); }));
    if (count <= most) continue;
    selected = photo.id;
    most = count;
  }
  return selected;
}

// In the order of the strip: the best to pick in first.
Json PickServer::Photos(const PickSession::Snapshot& snapshot) {
  const std::vector<double> shares =
      sights_.ScanShares(snapshot.solution, snapshot.solution_number);
  Json json = Json::array();
  std::set<int> suggested;  // the models whose best photo was passed
  for (const PickPhoto* photo : scene_.Ranked(shares)) {
    const TilePyramid pyramid = tiles_.Pyramid(PhotoPicture(photo->id));
    const Camera& camera = photo->projection->camera();
    Json one;
    one["id"] = photo->id;
    one["name"] = photo->name();
    one["width"] = camera.width;
    one["height"] = camera.height;
    one["tile_size"] = pyramid.tile_size;
    one["num_levels"] = pyramid.num_levels;
    one["missing"] = photo->missing;
    one["problem"] = photo->problem;
    one["num_points"] = photo->num_points;
    one["scan_share"] = shares.empty() ? Json() : NumberOrNull(shares[photo->id]);
    one["rank"] = json.size() + 1;
    one["model"] = photo->model;
    one["suggested"] = suggested.insert(photo->model).second;
    json.push_back(one);
  }
  return json;
}

Json PickServer::State() {
  session_->SaveAgain(false);  // a disk that was full may have space again
  const auto snapshot = session_->Refresh();
  Json json;
  json["version"] = Version();
  json["min_picks"] = kMinPicksPerPhoto;
  json["models"] = scene_.input().input_paths;
  json["can_mirror"] = MirrorProblem(scene_).empty();
  json["picks_path"] = session_->picks_path();
  json["aligned_path"] = setup_.aligned_path;
  json["ready"] = snapshot->solution.with_rays;
  json["scans"] = Json::array();
  for (int scan = 0; scan < scene_.num_scans(); ++scan) {
    const ScanPlaces& places = scene_.places(scan);
    const TilePyramid pyramid = tiles_.Pyramid(ScanPicture(scan, "shaded"));
    Json one;
    one["id"] = scan;
    one["name"] = std::filesystem::path(places.scan().path).filename().string();
    one["path"] = places.scan().path;
    one["width"] = pyramid.width;
    one["height"] = pyramid.height;
    one["tile_size"] = pyramid.tile_size;
    one["num_levels"] = pyramid.num_levels;
    one["aspect"] = places.aspect();
    one["content"] = content_[scan];
    one["pictures"] = pictures_[scan];
    json["scans"].push_back(one);
  }
  json["photos"] = Photos(*snapshot);
  json["selected_photo"] = SelectedPhoto();
  json["session"] = SessionToJson(*snapshot, scene_);
  return json;
}

std::shared_ptr<const PickSession::Snapshot> PickServer::Solved(const PickPhoto& photo,
                                                                int solution) {
  auto snapshot = session_->Refresh();
  if (snapshot->solution_number != solution) return nullptr;
  return snapshot->solution.photos.at(photo.name()).solved() ? snapshot : nullptr;
}

std::optional<LocalServer::Content> PickServer::BackTile(const Query& query, int photo_id) {
  const auto scan = WholeOf(query, "scan"), solution = WholeOf(query, "solution");
  const auto level = WholeOf(query, "level"), x = WholeOf(query, "x"), y = WholeOf(query, "y");
  const bool exists = photo_id >= 0 && photo_id < static_cast<int>(scene_.photos().size()) &&
                      scan && *scan >= 0 && *scan < scene_.num_scans();
  if (!exists || !solution || !level || !x || !y) return std::nullopt;
  const PickPhoto& photo = scene_.photos()[photo_id];
  const auto give_up = [this, solution] {
    return server_.stopping() || session_->Now()->solution_number != *solution;
  };
  const ScanRays* rays = scene_.WaitForRays(give_up);
  const auto snapshot = Solved(photo, *solution);
  if (photo.missing || rays == nullptr || !snapshot) return std::nullopt;
  auto bytes =
      back_projections_.Tile({photo_id, *scan, *solution}, *level, *x, *y, [&]() -> cv::Mat {
        const PhotoState& state = snapshot->solution.photos.at(photo.name());
        return DrawBackProjection(scene_, *rays, photo, state.projection(photo),
                                  state.cam_from_scan, *scan, give_up);
      });
  if (!bytes) return std::nullopt;
  return Content{std::move(bytes), "image/png", "", true};
}

Json PickServer::Edges(const Query& query) {
  const auto id = WholeOf(query, "photo"), solution = WholeOf(query, "solution");
  if (!id || *id < 0 || *id >= static_cast<int>(scene_.photos().size()) || !solution) {
    throw UsageError("There is no such photo.");
  }
  const PickPhoto& photo = scene_.photos()[*id];
  const auto snapshot = Solved(photo, *solution);
  if (!snapshot) throw UsageError("The picks have changed, or this photo is not placed.");
  const auto edges = sights_.Edges(
      photo, snapshot->solution.photos.at(photo.name()), *solution,
      [&] { return server_.stopping() || session_->Now()->solution_number != *solution; });
  if (!edges) throw UsageError("The picks have changed.");
  return *edges;
}

std::optional<LocalServer::Content> PickServer::Overlay(const Query& query) {
  const auto name = query.find("name");
  if (name == query.end()) return std::nullopt;
  const std::string path = align_.OverlayPath(name->second);
  std::ifstream stream(path, std::ios::binary);
  if (path.empty() || !stream) return std::nullopt;
  auto bytes = std::make_shared<const std::string>(std::istreambuf_iterator<char>(stream),
                                                   std::istreambuf_iterator<char>());
  return Content{std::move(bytes), "image/jpeg", "", false};
}

std::optional<LocalServer::Content> PickServer::Tile(const Query& query) {
  if (const auto back = WholeOf(query, "back")) return BackTile(query, *back);
  std::string id;
  if (const auto photo = WholeOf(query, "photo")) {
    id = PhotoPicture(*photo);
  } else if (const auto scan = WholeOf(query, "scan"); scan && query.count("picture")) {
    id = ScanPicture(*scan, query.at("picture"));
  }
  const auto level = WholeOf(query, "level"), x = WholeOf(query, "x"), y = WholeOf(query, "y");
  if (tiles_.Pyramid(id).num_levels == 0 || !level || !x || !y) return std::nullopt;
  auto bytes = tiles_.Tile(id, *level, *x, *y);
  if (!bytes) return std::nullopt;
  return Content{std::move(bytes), ImageTiles::ContentType(tiles_.FormatOf(id)), "", true};
}

std::optional<LocalServer::Content> PickServer::Thumbnail(const Query& query) {
  const auto id = WholeOf(query, "photo");
  if (!id || *id < 0 || *id >= static_cast<int>(scene_.photos().size())) return std::nullopt;
  const PickPhoto& photo = scene_.photos()[*id];
  if (photo.missing) return std::nullopt;
  const std::lock_guard<std::mutex> lock(thumbnails_mutex_);
  std::shared_ptr<const std::string>& kept = thumbnails_[*id];
  if (!kept && !server_.stopping()) {
    cv::Mat picture = ReadReducedPhoto(photo.path, photo.fit, kThumbnailWidth);
    if (picture.cols > kThumbnailWidth) {
      const int height = std::max(
          1, static_cast<int>(std::lround(1.0 * kThumbnailWidth * picture.rows / picture.cols)));
      cv::resize(picture, picture, {kThumbnailWidth, height}, 0, 0, cv::INTER_AREA);
    }
    std::vector<uchar> bytes;
    cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kThumbnailQuality});
    kept = std::make_shared<const std::string>(bytes.begin(), bytes.end());
  }
  if (!kept) return std::nullopt;
  return Content{kept, "image/jpeg", "", true};
}

Json PickServer::Corner(const Query& query) {
  const auto id = WholeOf(query, "photo");
  const bool exists = id && *id >= 0 && *id < static_cast<int>(scene_.photos().size());
  if (!exists || scene_.photos()[*id].missing) throw UsageError("There is no such photo.");
  const PickPhoto& photo = scene_.photos()[*id];
  const Eigen::Vector2d place(NumberOf(query, "x"), NumberOf(query, "y"));
  const std::lock_guard<std::mutex> lock(corner_mutex_);
  if (corner_photo_id_ != *id) {
    const Camera& camera = photo.projection->camera();
    cv::cvtColor(ReadFittedPhoto(photo.path, photo.fit, camera.width, camera.height), corner_photo_,
                 cv::COLOR_BGR2GRAY);
    corner_photo_id_ = *id;
  }
  Json json;
  json["img"] = nullptr;
  if (const auto corner = FindCorner(corner_photo_, place, NumberOf(query, "reach"))) {
    json["img"] = {corner->x(), corner->y()};
  }
  return json;
}

Json PickServer::ScanPoint(const Query& query) const {
  const auto scan = WholeOf(query, "scan");
  if (!scan || *scan < 0 || *scan >= scene_.num_scans()) throw UsageError("There is no such scan.");
  return ScanPointToJson(
      scene_.places(*scan).PointAt({NumberOf(query, "x"), NumberOf(query, "y")}));
}

}  // namespace roomtex
