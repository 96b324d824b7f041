#include "align/pick/pick_server.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "align/pick/pick_json.h"
#include "align/pick/reduced_photo.h"
#include "align/pick/scan_picture.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/photo.h"

namespace roomtex {
namespace {

constexpr int kThumbnailWidth = 240;  // pixels
constexpr int kThumbnailQuality = 82;

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
      server_(setup.server) {
  AddPictures();
  AddPage(page, &server_);
  server_.AddJson("/state", [this](const Query&) { return State(); });
  server_.AddContent("/tile", [this](const Query& query) { return Tile(query); });
  server_.AddContent("/thumbnail", [this](const Query& query) { return Thumbnail(query); });
  server_.AddJson("/scan_point", [this](const Query& query) { return ScanPoint(query); });
  server_.AddPut("/picks", [this](const Json& json) {
    PutPicks put = ParsePutPicks(json, scene_);
    return SessionToJson(*session_->Put(put.revision, std::move(put.picks)), scene_);
  });
}

PickServer::~PickServer() = default;

void PickServer::AddPictures() {
  for (const PickPhoto& photo : scene_.photos()) {
    if (photo.missing) continue;
    const Camera& camera = photo.projection->camera();
    tiles_.Add(PhotoPicture(photo.id), camera.width, camera.height, ImageTiles::Format::kJpeg,
               [path = photo.path] { return ReadPhoto(path); });
  }
  for (int scan = 0; scan < scene_.num_scans(); ++scan) {
    const ScanPlaces& places = scene_.places(scan);
    for (const std::string& name : ScanPictureNames()) {
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
  int selected = 0, most = 0;
  for (const PickPhoto& photo : scene_.photos()) {
    const int count = static_cast<int>(
        std::count_if(now->picks.begin(), now->picks.end(),
                      [&](const SessionPick& pick) { return pick.image_name == photo.name(); }));
    if (count > most || (most == 0 && photo.rank == 1)) selected = photo.id;
    most = std::max(most, count);
  }
  return selected;
}

Json PickServer::State() {
  const auto snapshot = session_->Refresh();
  Json json;
  json["version"] = Version();
  json["min_picks"] = kMinPicksPerPhoto;
  json["picks_path"] = session_->picks_path();
  json["aligned_path"] = setup_.aligned_path;
  json["ready"] = snapshot->solution.with_rays;
  json["scans"] = Json::array();
  for (int scan = 0; scan < scene_.num_scans(); ++scan) {
    const ScanPlaces& places = scene_.places(scan);
    const TilePyramid pyramid = tiles_.Pyramid(ScanPicture(scan, ScanPictureNames()[0]));
    Json one;
    one["id"] = scan;
    one["name"] = std::filesystem::path(places.scan().path).filename().string();
    one["path"] = places.scan().path;
    one["width"] = pyramid.width;
    one["height"] = pyramid.height;
    one["tile_size"] = pyramid.tile_size;
    one["num_levels"] = pyramid.num_levels;
    one["aspect"] = places.aspect();
    one["pictures"] = ScanPictureNames();
    json["scans"].push_back(one);
  }
  std::vector<const PickPhoto*> order;
  for (const PickPhoto& photo : scene_.photos()) order.push_back(&photo);
  std::sort(order.begin(), order.end(),
            [](const PickPhoto* a, const PickPhoto* b) { return a->rank < b->rank; });
  json["photos"] = Json::array();
  for (const PickPhoto* photo : order) {
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
    one["scan_share"] = nullptr;
    one["rank"] = photo->rank;
    json["photos"].push_back(one);
  }
  json["selected_photo"] = SelectedPhoto();
  json["session"] = SessionToJson(*snapshot, scene_);
  return json;
}

std::optional<LocalServer::Content> PickServer::Tile(const Query& query) {
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
    const Camera& camera = photo.projection->camera();
    cv::Mat picture = ReadReducedPhoto(photo.path, camera.width, kThumbnailWidth);
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

Json PickServer::ScanPoint(const Query& query) const {
  const auto scan = WholeOf(query, "scan");
  if (!scan || *scan < 0 || *scan >= scene_.num_scans()) throw UsageError("There is no such scan.");
  return ScanPointToJson(
      scene_.places(*scan).PointAt({NumberOf(query, "x"), NumberOf(query, "y")}));
}

}  // namespace roomtex
