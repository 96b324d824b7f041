#include "align/pick/photo_sights.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "align/trust/overlay.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr size_t kMaxSeen = 4;
constexpr double kLineTolerance = 0.5;  // pixels
constexpr int kShareSamples = 4000;     // of all scans

const char* KindName(ScanEdge::Kind kind) {
  switch (kind) {
    case ScanEdge::Kind::kDepth:
      return "depth";
    case ScanEdge::Kind::kCrease:
      return "crease";
    case ScanEdge::Kind::kIntensity:
      return "intensity";
  }
  return "";
}

Json EdgesToJson(const std::vector<ImgEdge>& edges) {
  const auto tenth = [](float value) { return std::round(10.0 * value) / 10; };
  Json json = Json::array();
  for (const ImgEdge& edge : edges) {
    std::vector<cv::Point2f> line, simple;
    for (const Eigen::Vector2d& x : edge.points) {
      line.emplace_back(static_cast<float>(x.x()), static_cast<float>(x.y()));
    }
    cv::approxPolyDP(line, simple, kLineTolerance, false);
    Json points = Json::array();
    for (const cv::Point2f& x : simple) points.push_back({tenth(x.x), tenth(x.y)});
    json.push_back({{"kind", KindName(edge.kind)}, {"points", std::move(points)}});
  }
  return json;
}

}  // namespace

std::shared_ptr<const Json> PhotoSights::Edges(const PickPhoto& photo, const PhotoState& state,
                                               int solution_number,
                                               const std::function<bool()>& give_up) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const Seen& seen : seen_) {
      if (seen.photo == photo.id && seen.solution_number == solution_number) return seen.edges;
    }
  }
  const PickScene::Edges* edges = scene_.WaitForEdges(give_up);
  if (edges == nullptr) return nullptr;
  auto json = std::make_shared<const Json>(EdgesToJson(
      SeeEdges(edges->edges, edges->free_space, state.projection(photo), state.cam_from_scan)));
  const std::lock_guard<std::mutex> lock(mutex_);
  seen_.push_front({photo.id, solution_number, json});
  if (seen_.size() > kMaxSeen) seen_.pop_back();
  return json;
}

std::vector<double> PhotoSights::ScanShares(const PickSolution& solution, int solution_number) {
  const ScanRays* rays = scene_.rays();
  const auto is_placed = [&solution](const PickPhoto& photo) {
    return solution.models[photo.model].scan_from_sparse ||
           solution.photos.at(photo.name()).by == PhotoState::By::kSearch;
  };
  const bool any_placed = std::any_of(scene_.photos().begin(), scene_.photos().end(), is_placed);
  if (!any_placed || rays == nullptr) return {};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (shares_number_ == solution_number) return shares_;
  }
  std::vector<Eigen::Vector3d> samples;
  for (int scan = 0; scan < scene_.num_scans(); ++scan) {
    const std::vector<Eigen::Vector3d>& points = scene_.places(scan).scan().points;
    const size_t stride = points.size() * scene_.num_scans() / kShareSamples + 1;
    for (size_t i = stride / 2; i < points.size(); i += stride) {
      if (points[i].x() == points[i].x()) samples.push_back(points[i]);
    }
  }
  const std::vector<PickPhoto>& photos = scene_.photos();
  std::vector<double> shares(photos.size(), kNoNumber);
  ParallelFor(scene_.input().num_threads, 0, static_cast<int>(photos.size()), [&](int i) {
    if (!is_placed(photos[i])) return;
    const Rigid& cam_from_scan = solution.photos.at(photos[i].name()).cam_from_scan;
    const Eigen::Vector3d centre = cam_from_scan.TargetOriginInSource();
    int num_seen = 0;
    for (const Eigen::Vector3d& sample : samples) {
      const auto x_in_img = photos[i].projection->ImgFromCam(cam_from_scan * sample);
      if (!x_in_img || !photos[i].projection->InImage(*x_in_img)) continue;
      num_seen += !rays->IsHidden(centre, sample);
    }
    shares[i] = 1.0 * num_seen / std::max<size_t>(samples.size(), 1);
  });
  const std::lock_guard<std::mutex> lock(mutex_);
  shares_number_ = solution_number;
  shares_ = shares;
  return shares;
}

}  // namespace roomtex
