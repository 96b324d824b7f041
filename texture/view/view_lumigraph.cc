#include "texture/view/view_lumigraph.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <mutex>

#include <opencv2/core.hpp>

#include "core/json_text.h"
#include "core/parallel.h"
#include "texture/sampling/rasterizer.h"

namespace roomtex {
namespace {

std::string TextOf(const Json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key].is_string()
             ? object[key].get<std::string>()
             : "";
}

std::optional<ResponseCurve> ReadResponse(const Json& report, const std::string& folder) {
  const std::string source = TextOf(report, "response");
  std::string path;
  if (source == "bracket" || source == "estimate") {
    path = (std::filesystem::path(folder) / "response.txt").string();
  } else if (source == "file" && report.contains("options")) {
    path = TextOf(report["options"], "Exposure.response");
  }
  std::error_code error;
  if (path.empty() || !std::filesystem::exists(path, error)) return std::nullopt;
  return ResponseCurve::Read(path);
}

// Of a plane 1/depth is linear over the picture; where it is not, one thing ends before another.
constexpr float kJump = 0.02f;  // of 1/depth: 6 cm at 3 m

// 1/depth of what lies before everything else: a photo does not show what is there.
constexpr float kRightBefore = 1000;

// Draws a triangle, in `cam` of the pinhole camera, as far as it lies before it.
void DrawInCamera(const Camera& pinhole, const std::array<Eigen::Vector3f, 3>& corners,
                  cv::Mat1f* inverse) {
  constexpr float kNear = 1e-3f;  // metres
  std::array<RasterVertex, 4> seen;
  size_t count = 0;
  const auto add = [&](const Eigen::Vector3f& p) {
    seen[count++] = {static_cast<float>(pinhole.params[0] * p.x() / p.z() + pinhole.params[2]),
                     static_cast<float>(pinhole.params[1] * p.y() / p.z() + pinhole.params[3]),
                     1 / p.z()};
  };
  for (size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3f &p = corners[k], &next = corners[(k + 1) % 3];
    if (p.z() >= kNear) add(p);
    // Where the side crosses the plane just before the camera.
    if ((p.z() >= kNear) != (next.z() >= kNear)) {
      add(p + (kNear - p.z()) / (next.z() - p.z()) * (next - p));
    }
  }
  for (size_t k = 2; k < count; ++k) DrawTriangle(seen[0], seen[k - 1], seen[k], inverse);
}

// Whether the box, between two corners, lies beside or behind what the camera sees.
bool IsOutOfView(const Camera& pinhole, const Rigid& cam_from_scan, const Eigen::Vector3d& low,
                 const Eigen::Vector3d& high) {
  std::array<int, 5> beyond{};
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d p =
        cam_from_scan * Eigen::Vector3d(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                                        i & 4 ? high.z() : low.z());
    const double x = pinhole.params[0] * p.x() + pinhole.params[2] * p.z();
    const double y = pinhole.params[1] * p.y() + pinhole.params[3] * p.z();
    beyond[0] += p.z() <= 0;
    beyond[1] += x < 0;
    beyond[2] += x > pinhole.width * p.z();
    beyond[3] += y < 0;
    beyond[4] += y > pinhole.height * p.z();
  }
  return std::any_of(beyond.begin(), beyond.end(), [](int corners) { return corners == 8; });
}

cv::Mat1f WidenNearer(const cv::Mat1f& inverse) {
  cv::Mat1f widened = inverse.clone();
  for (int y = 0; y < inverse.rows; ++y) {
    for (int x = 0; x < inverse.cols; ++x) {
      const auto at = [&](int dx, int dy) {
        return inverse(std::clamp(y + dy, 0, inverse.rows - 1),
                       std::clamp(x + dx, 0, inverse.cols - 1));
      };
      const float here = inverse(y, x);
      float largest = here;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) largest = std::max(largest, at(dx, dy));
      }
      const bool inside = x > 0 && y > 0 && x + 1 < inverse.cols && y + 1 < inverse.rows;
      const float bend = std::max(
          {std::abs(at(-1, 0) + at(1, 0) - 2 * here), std::abs(at(0, -1) + at(0, 1) - 2 * here),
           std::abs(at(-1, -1) + at(1, 1) - 2 * here), std::abs(at(1, -1) + at(-1, 1) - 2 * here)});
      if (inside && bend > kJump * largest) widened(y, x) = largest;
    }
  }
  return widened;
}

}  // namespace

ViewTones ReadViewTones(const std::string& folder) {
  const Json report = ReadJsonIfAny((std::filesystem::path(folder) / "report.json").string());
  ViewTones tones;
  if (!report.is_object()) return tones;
  const bool by_channel = report.contains("channel_gain");
  const char* key = by_channel ? "channel_gain" : "exposure_gain";
  if (!report.contains(key) || !report[key].is_object()) return tones;
  tones.gains.emplace();
  for (const auto& [name, value] : report[key].items()) {
    Eigen::Vector3f gain;
    for (int k = 0; k < 3; ++k) {
      const Json number = value.is_array() && value.size() == 3 ? Json(value[k]) : Json(value);
      gain[k] = number.is_number() ? number.get<float>() : NAN;
    }
    if (gain.allFinite() && gain.minCoeff() > 0) (*tones.gains)[name] = gain;
  }
  tones.response = ReadResponse(report, folder);
  return tones;
}

ViewLumigraph::ViewLumigraph(const ViewCameras& cameras, ViewTones tones)
    : cameras_(cameras), tones_(std::move(tones)) {}

bool ViewLumigraph::Has(int id) const {
  return cameras_.Pinhole(id, kDepthSize).has_value() &&
         (!tones_.gains || tones_.gains->count(cameras_.Image(id).name) > 0);
}

Json ViewLumigraph::ToJson() const {
  Json photos = Json::array();
  bool any_pinhole = false;
  for (int id = 0; id < static_cast<int>(cameras_.size()); ++id) {
    any_pinhole |= cameras_.Pinhole(id, kDepthSize).has_value();
    if (!Has(id)) continue;
    const Camera pinhole = *cameras_.Pinhole(id, kDepthSize);
    const double w = pinhole.width, h = pinhole.height;
    Eigen::Vector3f gain = Eigen::Vector3f::Ones();
    if (tones_.gains) gain = tones_.gains->at(cameras_.Image(id).name);
    photos.push_back({{"id", id},
                      {"focal", {pinhole.params[0] / w, pinhole.params[1] / h}},
                      {"centre", {pinhole.params[2] / w, pinhole.params[3] / h}},
                      {"gain", {gain[0], gain[1], gain[2]}}});
  }
  const char* reason =
      !photos.empty()              ? ""
      : cameras_.num_photos() == 0 ? "View-dependent colour needs the photos: give "
                                     "--aligned and --image_path."
      : !any_pinhole ? "View-dependent colour is drawn from photos, not from panoramas."
                     : "None of these photos has coloured the model.";
  return {{"reason", reason}, {"photos", photos}};
}

std::shared_ptr<const std::string> ViewLumigraph::Photo(int id, int max_size) const {
  if (!Has(id)) return nullptr;
  return cameras_.PinholePhoto(id, max_size, tones_.response ? &*tones_.response : nullptr);
}

std::string ViewLumigraph::Depths(int id, const ViewChunks& chunks, const Eigen::Vector3d& origin,
                                  int num_threads) const {
  if (!Has(id)) return "";
  const Camera pinhole = *cameras_.Pinhole(id, kDepthSize);
  const Rigid& cam_from_scan = cameras_.Image(id).cam_from_model;
  const Eigen::Matrix3f rotation = cam_from_scan.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f origin_in_cam = (cam_from_scan * origin).cast<float>();
  cv::Mat1f inverse(pinhole.height, pinhole.width, 0.0f);
  std::mutex mutex;
  ParallelFor(num_threads, 0, static_cast<int>(chunks.chunks().size()), [&](int c) {
    const ViewChunk& chunk = chunks.chunks()[c];
    if (IsOutOfView(pinhole, cam_from_scan, origin + chunk.low.cast<double>(),
                    origin + chunk.high.cast<double>())) {
      return;
    }
    ViewChunks::Mesh mesh = chunks.Read(c);
    for (Eigen::Vector3f& point : mesh.points) point = rotation * point + origin_in_cam;
    cv::Mat1f drawn(inverse.size(), 0.0f);
    for (size_t i = 0; i < mesh.corners.size(); i += 3) {
      const uint16_t* corner = &mesh.corners[i];
      DrawInCamera(pinhole,
                   {mesh.points[corner[0]], mesh.points[corner[1]], mesh.points[corner[2]]},
                   &drawn);
    }
    const std::lock_guard<std::mutex> lock(mutex);
    std::transform(drawn.begin(), drawn.end(), inverse.begin(), inverse.begin(),
                   [](float a, float b) { return std::max(a, b); });
  });
  cv::Mat1f widened = WidenNearer(inverse);
  const cv::Mat1b transparent = cameras_.PinholeTransparency(id, kDepthSize);
  if (!transparent.empty()) widened.setTo(kRightBefore, transparent);
  cv::Mat half;
  widened.convertTo(half, CV_16F);
  const uint32_t header[4] = {0x31445452, static_cast<uint32_t>(half.cols),
                              static_cast<uint32_t>(half.rows), 0};
  std::string bytes(reinterpret_cast<const char*>(header), sizeof header);
  bytes.append(reinterpret_cast<const char*>(half.data), half.total() * half.elemSize());
  return bytes;
}

}  // namespace roomtex
