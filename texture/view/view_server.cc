#include "texture/view/view_server.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <sstream>
#include <thread>

#include <Eigen/Geometry>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/command_line.h"
#include "core/error.h"
#include "core/option_list.h"
#include "core/parallel.h"
#include "core/ray_caster.h"
#include "texture/view/view_chunks.h"
#include "view_page.h"

namespace roomtex {
namespace {

constexpr int kMaxTexture = 4096;  // what every browser's WebGL takes

Json ToArray(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Json ToArray(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

const std::string& Wanted(const LocalServer::Query& query, const std::string& name) {
  const auto found = query.find(name);
  if (found == query.end()) throw UsageError("The request lacks \"" + name + "\".");
  return found->second;
}
int IntOf(const LocalServer::Query& query, const std::string& name) {
  return ParseInt(name, Wanted(query, name));
}
double DoubleOf(const LocalServer::Query& query, const std::string& name) {
  const double value = ParseDouble(name, Wanted(query, name));
  if (!std::isfinite(value)) throw UsageError("\"" + name + "\" must be a finite number.");
  return value;
}

// What lies between low and high along an axis is shown.
struct Cut {
  Eigen::Vector3d axis;
  double low, high;
};
std::vector<Cut> CutsOf(const LocalServer::Query& query) {
  std::vector<Cut> cuts;
  for (const char* name : {"cut0", "cut1", "cut2"}) {
    if (query.count(name) == 0) continue;
    std::vector<double> values;
    std::stringstream list(query.at(name));
    for (std::string part; std::getline(list, part, ',');) {
      values.push_back(ParseDouble(name, part));
    }
    if (values.size() != 5) throw UsageError("\"" + std::string(name) + "\" must be five numbers.");
    cuts.push_back({{values[0], values[1], values[2]}, values[3], values[4]});
  }
  return cuts;
}

ViewChunks::Level LevelOf(const LocalServer::Query& query) {
  const int level = IntOf(query, "level");
  if (level < ViewChunks::kCoarse || level > ViewChunks::kFull) {
    throw UsageError("The levels are 0 (coarse), 1 and 2 (everything).");
  }
  return static_cast<ViewChunks::Level>(level);
}

LocalServer::Content Bytes(std::string bytes) {
  return {std::make_shared<const std::string>(std::move(bytes)), "application/octet-stream", "",
          true};
}

// A value that is made in the background.
template <typename T>
class Promised {
 public:
  void Set(std::shared_ptr<const T> value) {
    const std::lock_guard<std::mutex> lock(mutex_);
    value_ = std::move(value);
    is_set_ = true;
    changed_.notify_all();
  }
  // Waits; null when it could not be made or `give_up` says so.
  std::shared_ptr<const T> Get(const std::function<bool()>& give_up) {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!is_set_ && !give_up()) changed_.wait_for(lock, std::chrono::milliseconds(100));
    return value_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::shared_ptr<const T> value_;
  bool is_set_ = false;
};

}  // namespace

struct ViewServer::Impl {
  Impl(ViewContent given, const LocalServer* local_server, int threads)
      : content(std::move(given)),
        chunks(content.model),
        lumigraph(content.cameras, content.tones),
        server(local_server),
        num_threads(threads) {}

  void AddRoutes(LocalServer* target);
  void Prepare();
  bool IsStopping() const { return stopping || server->stopping(); }
  Json Scene() const;
  Json CastRay(const LocalServer::Query& query);
  std::optional<LocalServer::Content> Chunk(const LocalServer::Query& query) const;
  std::optional<LocalServer::Content> EvidenceChunk(const LocalServer::Query& query);
  std::optional<LocalServer::Content> Texture(const LocalServer::Query& query);
  int ChunkId(const LocalServer::Query& query) const;
  std::shared_ptr<const ViewEvidence> WaitForEvidence() {
    return evidence.Get([this] { return IsStopping(); });
  }

  const ViewContent content;
  const ViewChunks chunks;
  const ViewLumigraph lumigraph;
  const LocalServer* const server;
  const int num_threads;
  std::atomic<bool> stopping{false};
  Promised<RayCaster> caster;
  Promised<ViewEvidence> evidence;
  std::mutex texture_mutex;
  std::map<std::pair<int, int>, std::shared_ptr<const std::string>> scaled;  // page, size
  std::thread worker;
};

Json ViewServer::Impl::Scene() const {
  const ViewModel& model = content.model;
  Json pages = Json::array(), pieces = Json::array();
  for (size_t i = 0; i < model.images.size(); ++i) {
    pages.push_back(
        {{"id", i}, {"width", model.images[i].width}, {"height", model.images[i].height}});
  }
  Eigen::AlignedBox3f box;
  for (size_t i = 0; i < chunks.chunks().size(); ++i) {
    const ViewChunk& chunk = chunks.chunks()[i];
    box.extend(chunk.low);
    box.extend(chunk.high);
    pieces.push_back({{"id", i},
                      {"page", chunk.page},
                      {"supplement", chunk.is_supplement},
                      {"min", ToArray(chunk.low)},
                      {"max", ToArray(chunk.high)},
                      {"num_triangles", chunk.num_triangles()},
                      {"num_vertices", chunk.num_vertices},
                      {"spacing", chunk.spacing}});
  }
  std::filesystem::path name(model.path);
  if (name.stem() == "model" && name.has_parent_path()) name = name.parent_path();
  const Eigen::Vector3d low = model.origin + box.min().cast<double>();
  const Eigen::Vector3d high = model.origin + box.max().cast<double>();
  return {{"version", Version()},
          {"name", name.filename().string()},
          {"path", model.path},
          {"origin", ToArray(model.origin)},
          {"up", ToArray(model.up)},
          {"bounds", {{"min", ToArray(low)}, {"max", ToArray(high)}}},
          {"num_vertices", model.is_cloud ? model.triangles.size() : model.points.size()},
          {"num_triangles", model.is_cloud ? 0 : model.triangles.size()},
          {"pages", pages},
          {"chunks", pieces},
          {"num_cameras", content.cameras.size()},
          {"num_photos", content.cameras.num_photos()},
          {"num_points", content.cameras.model().points.size()},
          {"warnings", content.warnings}};
}

int ViewServer::Impl::ChunkId(const LocalServer::Query& query) const {
  const int id = IntOf(query, "id");
  if (id < 0 || id >= static_cast<int>(chunks.chunks().size())) {
    throw UsageError("There is no such chunk.");
  }
  return id;
}

std::optional<LocalServer::Content> ViewServer::Impl::Chunk(const LocalServer::Query& query) const {
  return Bytes(chunks.Encode(ChunkId(query), LevelOf(query)));
}

std::optional<LocalServer::Content> ViewServer::Impl::EvidenceChunk(
    const LocalServer::Query& query) {
  const ViewChunks::Level level = LevelOf(query);
  const int id = ChunkId(query);
  const auto found = WaitForEvidence();
  if (!found) return std::nullopt;
  return Bytes(found->Encode(chunks.Make(id, level)->points));
}

std::optional<LocalServer::Content> ViewServer::Impl::Texture(const LocalServer::Query& query) {
  const int page = IntOf(query, "page");
  if (page < 0 || page >= static_cast<int>(content.model.images.size())) return std::nullopt;
  const ViewImage& image = content.model.images[page];
  const int size = std::clamp(IntOf(query, "max"), 64, kMaxTexture);
  if (std::max(image.width, image.height) <= size) {
    return LocalServer::Content{image.bytes, image.type, "", true};
  }
  const std::lock_guard<std::mutex> lock(texture_mutex);  // one at a time: 200 MB while it lasts
  auto& result = scaled[{page, size}];
  if (!result) {
    const cv::Mat encoded(1, static_cast<int>(image.bytes->size()), CV_8U,
                          const_cast<char*>(image.bytes->data()));
    cv::Mat pixels = cv::imdecode(encoded, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
    if (pixels.empty()) {
      throw InputError(content.model.path, "",
                       "holds a texture image (" + std::to_string(page) + ") that cannot be read",
                       "Run roomtex-texture again");
    }
    const double scale = static_cast<double>(size) / std::max(pixels.cols, pixels.rows);
    const cv::Size to(std::max(1, static_cast<int>(std::lround(scale * pixels.cols))),
                      std::max(1, static_cast<int>(std::lround(scale * pixels.rows))));
    cv::resize(pixels, pixels, to, 0, 0, cv::INTER_AREA);
    // The small one is only seen until the next one comes.
    const bool preview = size <= 1024;
    std::vector<unsigned char> bytes;
    cv::imencode(preview ? ".jpg" : ".png", pixels, bytes,
                 preview ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, 92}
                         : std::vector<int>{cv::IMWRITE_PNG_COMPRESSION, 1});
    result = std::make_shared<const std::string>(bytes.begin(), bytes.end());
  }
  const std::string type = (*result)[0] == '\xff' ? "image/jpeg" : "image/png";
  return LocalServer::Content{result, type, "", true};
}

Json ViewServer::Impl::CastRay(const LocalServer::Query& query) {
  const auto rays = caster.Get([this] { return IsStopping(); });
  if (!rays) throw UsageError("The mesh could not be prepared for measuring.");
  const Eigen::Vector3d from(DoubleOf(query, "x"), DoubleOf(query, "y"), DoubleOf(query, "z"));
  Eigen::Vector3d direction(DoubleOf(query, "dx"), DoubleOf(query, "dy"), DoubleOf(query, "dz"));
  if (!(direction.norm() > 1e-12)) throw UsageError("The ray has no direction.");
  direction.normalize();
  const bool front_only = query.count("front") > 0 && IntOf(query, "front") != 0;
  const bool with_supplement = query.count("supplement") == 0 || IntOf(query, "supplement") != 0;
  const std::vector<Cut> cuts = CutsOf(query);
  const ViewModel& model = content.model;
  // Bounded: a ray along a surface may touch many triangles that do not count.
  double nearest = 0;
  for (int i = 0; i < 10000; ++i) {
    const auto hit = rays->Cast(from, direction, nearest);
    if (!hit) break;
    const Triangle& t = model.triangles[hit->triangle];
    const bool is_cut = std::any_of(cuts.begin(), cuts.end(), [&hit](const Cut& cut) {
      const double at = hit->point.dot(cut.axis);
      return at < cut.low || at > cut.high;
    });
    const bool counts = (with_supplement || !model.IsSupplement(hit->triangle)) &&
                        (!front_only || ShowsFront(model, hit->triangle, direction)) && !is_cut;
    if (counts) {
      return {{"hit", true},
              {"point", ToArray(hit->point)},
              {"normal", ToArray(Eigen::Vector3f(model.normals[t[0]]))},
              {"distance", hit->distance}};
    }
    nearest = hit->distance + 1e-5;
  }
  return {{"hit", false}};
}

void ViewServer::Impl::Prepare() {
  const auto attempt = [this](const std::function<void()>& make) {
    if (IsStopping()) return;
    try {
      make();
    } catch (const std::exception&) {
      // Out of memory: what asks for it is told that it is not there.
    }
  };
  attempt([this] {
    ParallelFor(num_threads, 0, static_cast<int>(chunks.chunks().size()), [this](int chunk) {
      if (!IsStopping()) chunks.Make(chunk, ViewChunks::kCoarse);
    });
  });
  std::shared_ptr<const RayCaster> rays;
  attempt([this, &rays] {
    std::vector<Eigen::Vector3d> points;
    points.reserve(content.model.points.size());
    for (size_t i = 0; i < content.model.points.size(); ++i) {
      points.push_back(content.model.InScan(i));
    }
    rays = std::make_shared<const RayCaster>(points, content.model.triangles);
  });
  caster.Set(rays);
  std::shared_ptr<const ViewEvidence> found;
  attempt([this, &found] {
    if (content.evidence_path.empty()) {
      found = std::make_shared<const ViewEvidence>(content.no_evidence_reason);
      return;
    }
    try {
      found =
          std::make_shared<const ViewEvidence>(content.model, ReadEvidence(content.evidence_path));
    } catch (const InputError& error) {
      found = std::make_shared<const ViewEvidence>(error.what());
    }
  });
  evidence.Set(found);
}

void ViewServer::Impl::AddRoutes(LocalServer* target) {
  using Query = LocalServer::Query;
  AddPage(kViewPage, target);
  target->AddJson("/scene", [this](const Query&) { return Scene(); });
  target->AddJson("/evidence", [this](const Query&) {
    const auto found = WaitForEvidence();
    if (!found) throw UsageError("The evidence could not be prepared.");
    return found->ToJson();
  });
  target->AddJson("/cameras", [this](const Query&) { return content.cameras.ToJson(); });
  target->AddJson("/lattice", [this](const Query& query) {
    return content.cameras.Lattice(IntOf(query, "id"));
  });
  target->AddJson("/cast", [this](const Query& query) { return CastRay(query); });
  target->AddContent("/chunk", [this](const Query& query) { return Chunk(query); });
  target->AddContent("/evidence_chunk",
                     [this](const Query& query) { return EvidenceChunk(query); });
  target->AddContent("/texture", [this](const Query& query) { return Texture(query); });
  target->AddContent("/points", [this](const Query&) -> std::optional<LocalServer::Content> {
    return Bytes(content.cameras.EncodePoints(content.model.origin));
  });
  target->AddJson("/lumigraph", [this](const Query&) { return lumigraph.ToJson(); });
  target->AddContent("/pinhole_photo",
                     [this](const Query& query) -> std::optional<LocalServer::Content> {
                       auto bytes = lumigraph.Photo(IntOf(query, "id"), IntOf(query, "max"));
                       if (!bytes) return std::nullopt;
                       return LocalServer::Content{bytes, "image/jpeg", "", true};
                     });
  target->AddContent("/depths", [this](const Query& query) -> std::optional<LocalServer::Content> {
    const auto rays = caster.Get([this] { return IsStopping(); });
    if (!rays) throw UsageError("The mesh could not be prepared for depth maps.");
    std::string bytes = lumigraph.Depths(IntOf(query, "id"), *rays, num_threads);
    if (bytes.empty()) return std::nullopt;
    return Bytes(std::move(bytes));
  });
  target->AddContent("/photo", [this](const Query& query) -> std::optional<LocalServer::Content> {
    auto bytes = content.cameras.Photo(IntOf(query, "id"), IntOf(query, "max"));
    if (!bytes) return std::nullopt;
    return LocalServer::Content{bytes, "image/jpeg", "", true};
  });
}

ViewServer::ViewServer(ViewContent content, LocalServer* server, int num_threads)
    : impl_(std::make_unique<Impl>(std::move(content), server, num_threads)) {
  impl_->AddRoutes(server);
  impl_->worker = std::thread([impl = impl_.get()] { impl->Prepare(); });
}

ViewServer::~ViewServer() {
  impl_->stopping = true;
  if (impl_->worker.joinable()) impl_->worker.join();
}

}  // namespace roomtex
