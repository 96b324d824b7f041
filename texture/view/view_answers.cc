#include "texture/view/view_answers.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>

#include <Eigen/Geometry>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/command_line.h"
#include "core/error.h"
#include "core/option_list.h"
#include "core/parallel.h"
#include "core/resource_limits.h"
#include "texture/view/view_chunks.h"

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
  // problem: why there is no value.
  void Set(std::shared_ptr<const T> value, std::exception_ptr problem) {
    const std::lock_guard<std::mutex> lock(mutex_);
    value_ = std::move(value);
    problem_ = std::move(problem);
    is_set_ = true;
    changed_.notify_all();
  }
  // Waits; null when `give_up` says so. Throws why it could not be made.
  std::shared_ptr<const T> Get(const std::function<bool()>& give_up) {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!is_set_ && !give_up()) changed_.wait_for(lock, std::chrono::milliseconds(100));
    if (problem_) std::rethrow_exception(problem_);
    return value_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::shared_ptr<const T> value_;
  std::exception_ptr problem_;
  bool is_set_ = false;
};

}  // namespace

struct ViewAnswers::Impl {
  Impl(ViewContent given, int threads, std::function<bool()> stop)
      : content(std::move(given)),
        lumigraph(content.cameras, content.tones),
        num_threads(threads),
        stop_asked(std::move(stop)) {}

  void Add();
  void Prepare();
  bool IsStopping() const { return stopping || stop_asked(); }
  Json Scene();
  std::optional<LocalServer::Content> Texture(const Query& query);
  // Waits for it.
  const ViewChunks& Chunks();
  std::shared_ptr<const ViewEvidence> Evidence();
  int ChunkId(const Query& query);

  // Without the arrays of its model once the pieces are made.
  ViewContent content;
  const ViewLumigraph lumigraph;
  const int num_threads;
  const std::function<bool()> stop_asked;
  std::map<std::string, std::function<Json(const Query&)>> json;
  std::map<std::string, std::function<std::optional<LocalServer::Content>(const Query&)>> pieces;
  std::atomic<bool> stopping{false};
  Promised<ViewChunks> chunks;
  Promised<ViewEvidence> evidence;
  std::mutex texture_mutex;
  std::map<std::pair<int, int>, std::shared_ptr<const std::string>> scaled;  // page, size
  size_t num_points = 0, num_triangles = 0;
  std::thread worker;
};

const ViewChunks& ViewAnswers::Impl::Chunks() {
  const auto made = chunks.Get([this] { return IsStopping(); });
  // Kept by the promise.
  if (made) return *made;
  throw UsageError("The viewer is ending.");
}

std::shared_ptr<const ViewEvidence> ViewAnswers::Impl::Evidence() {
  auto found = evidence.Get([this] { return IsStopping(); });
  if (!found) throw UsageError("The viewer is ending.");
  return found;
}

Json ViewAnswers::Impl::Scene() {
  const std::vector<ViewChunk>& made = Chunks().chunks();
  const ViewModel& model = content.model;
  Json pages = Json::array(), list = Json::array();
  for (size_t i = 0; i < model.images.size(); ++i) {
    const ViewImage& image = model.images[i];
    pages.push_back(
        {{"id", i}, {"width", image.width}, {"height", image.height}, {"wrap", image.wrap}});
  }
  Eigen::AlignedBox3f box;
  for (size_t i = 0; i < made.size(); ++i) {
    const ViewChunk& chunk = made[i];
    box.extend(chunk.low);
    box.extend(chunk.high);
    list.push_back({{"id", i},
                    {"page", chunk.page},
                    {"supplement", chunk.is_supplement},
                    {"min", ToArray(chunk.low)},
                    {"max", ToArray(chunk.high)},
                    {"num_triangles", chunk.num_triangles},
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
          {"num_vertices", model.is_cloud ? num_triangles : num_points},
          {"num_triangles", model.is_cloud ? 0 : num_triangles},
          {"pages", pages},
          {"uv",
           {{"low", {model.uv_low.x(), model.uv_low.y()}},
            {"high", {model.uv_high.x(), model.uv_high.y()}}}},
          {"chunks", list},
          {"num_cameras", content.cameras.size()},
          {"num_photos", content.cameras.num_photos()},
          {"num_points", content.cameras.model().points.size()},
          {"warnings", content.warnings}};
}

int ViewAnswers::Impl::ChunkId(const Query& query) {
  const int id = IntOf(query, "id");
  if (id < 0 || id >= static_cast<int>(Chunks().chunks().size())) {
    throw UsageError("There is no such chunk.");
  }
  return id;
}

std::optional<LocalServer::Content> ViewAnswers::Impl::Texture(const Query& query) {
  const int page = IntOf(query, "page");
  Chunks();  // by then the model is not changed any more
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

void ViewAnswers::Impl::Prepare() {
  // Returns what went wrong, memory that ran out, too: whoever asks is told.
  const auto attempt = [this](const std::function<void()>& make) -> std::exception_ptr {
    if (IsStopping()) return nullptr;
    try {
      make();
      return nullptr;
    } catch (...) {
      return std::current_exception();
    }
  };
  std::shared_ptr<const ViewChunks> cut;
  std::exception_ptr problem = attempt([this, &cut] {
    ViewModel whole = std::move(content.model);
    content.model = {};
    content.model.path = whole.path;
    content.model.origin = whole.origin;
    content.model.up = whole.up;
    content.model.images = whole.images;
    content.model.uv_low = whole.uv_low;
    content.model.uv_high = whole.uv_high;
    content.model.is_cloud = whole.is_cloud;
    num_points = whole.points.size();
    num_triangles = whole.triangles.size();
    cut = std::make_shared<const ViewChunks>(std::move(whole), ViewChunkOptions(), num_threads,
                                             [this] { return IsStopping(); });
  });
  if (IsStopping()) cut = nullptr;
  chunks.Set(cut, problem);
  if (!cut) return evidence.Set(nullptr, problem);
  // Only ahead of time: what is not made now is made when it is asked for.
  attempt([this, &cut] {
    ParallelFor(num_threads, 0, static_cast<int>(cut->chunks().size()), [&](int chunk) {
      if (!IsStopping()) cut->Make(chunk, ViewChunks::kCoarse);
    });
  });
  std::shared_ptr<const ViewEvidence> found;
  problem = attempt([this, &found, &cut] {
    if (content.evidence_path.empty()) {
      found = std::make_shared<const ViewEvidence>(content.no_evidence_reason);
      return;
    }
    try {
      found = std::make_shared<const ViewEvidence>(
          *cut, content.model.origin, ReadEvidence(content.evidence_path), num_threads);
    } catch (const InputError& error) {
      found = std::make_shared<const ViewEvidence>(error.what());
    }
  });
  evidence.Set(found, problem);
}

void ViewAnswers::Impl::Add() {
  using Content = std::optional<LocalServer::Content>;
  const auto jpeg = [](std::shared_ptr<const std::string> picture) -> Content {
    if (!picture) return std::nullopt;
    return LocalServer::Content{std::move(picture), "image/jpeg", "", true};
  };
  json["scene"] = [this](const Query&) { return Scene(); };
  json["evidence"] = [this](const Query&) { return Evidence()->ToJson(); };
  json["cameras"] = [this](const Query&) {
    Json cameras = content.cameras.ToJson();
    for (Json& camera : cameras) {
      const auto found = content.shifts.find(camera["name"].get<std::string>());
      camera["shift"] = found == content.shifts.end() ? Json() : found->second;
    }
    return cameras;
  };
  json["lattice"] = [this](const Query& query) {
    return content.cameras.Lattice(IntOf(query, "id"));
  };
  json["lumigraph"] = [this](const Query&) { return lumigraph.ToJson(); };
  pieces["chunk"] = [this](const Query& query) -> Content {
    return Bytes(Chunks().Encode(ChunkId(query), LevelOf(query)));
  };
  pieces["evidence_chunk"] = [this](const Query& query) -> Content {
    const int id = ChunkId(query);
    const ViewChunks::Level level = LevelOf(query);
    return Bytes(Evidence()->Encode(id, Chunks().Make(id, level)->points));
  };
  pieces["texture"] = [this](const Query& query) { return Texture(query); };
  pieces["points"] = [this](const Query&) -> Content {
    Chunks();  // by then the origin stands
    return Bytes(content.cameras.EncodePoints(content.model.origin));
  };
  pieces["pinhole_photo"] = [this, jpeg](const Query& query) {
    return jpeg(lumigraph.Photo(IntOf(query, "id"), IntOf(query, "max")));
  };
  pieces["depths"] = [this](const Query& query) -> Content {
    std::string depths =
        lumigraph.Depths(IntOf(query, "id"), Chunks(), content.model.origin, num_threads);
    if (depths.empty()) return std::nullopt;
    return Bytes(std::move(depths));
  };
  pieces["photo"] = [this, jpeg](const Query& query) {
    return jpeg(content.cameras.Photo(IntOf(query, "id"), IntOf(query, "max")));
  };
}

ViewAnswers::ViewAnswers(ViewContent content, int num_threads, std::function<bool()> stop)
    : impl_(std::make_unique<Impl>(std::move(content), num_threads, std::move(stop))) {
  impl_->Add();
  try {
    impl_->worker = StartThread([impl = impl_.get()] { impl->Prepare(); });
  } catch (const std::system_error&) {
    impl_->Prepare();
  }
}

ViewAnswers::~ViewAnswers() {
  impl_->stopping = true;
  if (impl_->worker.joinable()) impl_->worker.join();
}

const std::map<std::string, std::function<Json(const ViewAnswers::Query&)>>& ViewAnswers::json()
    const {
  return impl_->json;
}
const std::map<std::string,
               std::function<std::optional<LocalServer::Content>(const ViewAnswers::Query&)>>&
ViewAnswers::content() const {
  return impl_->pieces;
}

}  // namespace roomtex
