#include "building/window/outline_session.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "building/building_output.h"
#include "building/building_solid.h"
#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

Json BuildingJson(const OutlineBuilding& building) {
  Outline outline;
  outline.buildings = {building};
  return OutlineToJson(outline)["buildings"][0];
}

Json SolidJson(const BuildingSolid& solid) {
  static const char* const kKinds[] = {"ground", "roof", "wall"};
  Json faces = Json::array();
  for (const SolidFace& face : solid.faces) {
    Json corners = Json::array();
    for (const Eigen::Vector3d& x : solid.CornersOf(face)) corners.push_back({x.x(), x.y(), x.z()});
    faces.push_back({{"kind", kKinds[static_cast<int>(face.kind)]}, {"corners", corners}});
  }
  return faces;
}

}  // namespace

OutlineSession::OutlineSession(const OutlineWindowInput& input, OutlineCloud cloud,
                               std::vector<PlaneSegment> segments)
    : input_(input),
      file_(input.output_path),
      cloud_(std::move(cloud)),
      segments_(std::move(segments)) {
  const bool goes_on = std::filesystem::exists(input_.output_path);
  if (goes_on || !input_.outline_path.empty()) {
    const std::string& path = goes_on ? input_.output_path : input_.outline_path;
    outline_ = ReadOutline(path, &left_out_);
    if (input_.geo_origin) PlaceOnEarth(*input_.geo_origin, path, &outline_);
    // The model that is there now says how far it may be believed.
    if (cloud_.frame.alignment) outline_.alignment = cloud_.frame.alignment;
    AdoptFrame(outline_, &cloud_, &segments_);
  } else {
    outline_ = ProposeOutline(cloud_, segments_, input_.proposal).outline;
  }
  if (!goes_on) Save(input_.outline_path.empty());
  if (!save_error_.empty()) throw InputError(input_.output_path, "", save_error_, "");
}

Json OutlineSession::Buildings() {
  Json json;
  json["revision"] = revision_;
  json["points_revision"] = points_revision_;
  json["save_error"] = save_error_;
  json["buildings"] = Json::array();
  const OutlineProposal judged = JudgeOutline(cloud_, segments_, outline_);
  for (size_t i = 0; i < outline_.buildings.size(); ++i) {
    const OutlineBuilding& building = outline_.buildings[i];
    const BuildingEvidence& evidence = judged.evidence[i];
    Json one = BuildingJson(building);
    one["shape"] = building.RoofShape();
    const BuildingSolid solid = ExtrudeBuilding(building);
    one["faces"] = SolidJson(solid);
    one["doubts"] = evidence.doubts;
    one["explained"] = evidence.explained;
    one["corner_sigma"] = evidence.corner_sigma;
    one["volume"] = solid.Volume();
    json["buildings"].push_back(one);
  }
  return json;
}

Json OutlineSession::State() {
  const std::lock_guard<std::mutex> lock(mutex_);
  Json json = Buildings();
  json["version"] = Version();
  json["output_path"] = input_.output_path;
  json["model_paths"] = input_.model_paths;
  json["left_out"] = left_out_;
  json["unit"] = outline_.metric ? "m" : "units";
  json["on_earth"] = outline_.geo.has_value();
  const GroundPlane ground = FindGround(cloud_, segments_);
  json["ground"] = {{"height", ground.height},
                    {"gradient", {ground.gradient.x(), ground.gradient.y()}}};
  json["step"] = cloud_.step;
  Eigen::AlignedBox3d box;
  for (const PlaneSegment& segment : segments_) {
    for (size_t k = 0; k < segment.points.size(); k += 5) {
      box.extend(cloud_.points[static_cast<size_t>(segment.points[k])]);
    }
  }
  if (box.isEmpty()) {
    for (const Eigen::Vector3d& point : cloud_.points) box.extend(point);
  }
  origin_ = box.center();
  json["origin"] = {origin_.x(), origin_.y(), origin_.z()};
  json["bounds"] = {{box.min().x(), box.min().y(), box.min().z()},
                    {box.max().x(), box.max().y(), box.max().z()}};
  json["num_points"] = cloud_.points.size();
  json["lines"] = Json::array();
  for (const auto& [a, b] : WallStretches(cloud_, segments_)) {
    json["lines"].push_back({a.x(), a.y(), b.x(), b.y()});
  }
  return json;
}

std::string OutlineSession::Points() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const size_t n = cloud_.points.size();
  std::string bytes(n * (3 * sizeof(float) + 3), '\0');
  for (size_t i = 0; i < n; ++i) {
    const Eigen::Vector3f x = (cloud_.points[i] - origin_).cast<float>();
    std::memcpy(bytes.data() + i * 3 * sizeof(float), x.data(), 3 * sizeof(float));
    for (size_t c = 0; c < 3; ++c) {
      bytes[n * 3 * sizeof(float) + 3 * i + c] =
          static_cast<char>(cloud_.colors.empty() ? 128 : cloud_.colors[i][c]);
    }
  }
  return bytes;
}

void OutlineSession::CheckRevision(const Json& request) const {
  const bool is_ours = request.is_object() && request.contains("revision") &&
                       request["revision"].is_number_integer() &&
                       request["revision"].get<int>() == revision_;
  if (!is_ours) {
    throw UsageError(
        "The buildings were changed elsewhere, perhaps in another tab: load the page again.");
  }
}

Json OutlineSession::Put(const Json& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  CheckRevision(request);
  Json file = OutlineToJson(outline_);
  file["buildings"] = request.contains("buildings") ? request["buildings"] : Json();
  outline_.buildings = ParseOutline("drawing", file).buildings;
  ++revision_;
  Save(false);
  return Buildings();
}

Json OutlineSession::Propose(const Json& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ProposalOptions options = input_.proposal;
  if (request.is_object() && request.contains("area")) {
    const Json& area = request["area"];
    options.area.clear();
    for (size_t i = 0; area.is_array() && i < area.size(); ++i) {
      options.area += (i == 0 ? "" : ",") + area[i].dump();
    }
    if (!options.Area()) throw UsageError("The area must be a rectangle.");
  }
  const OutlineProposal proposal = ProposeOutline(cloud_, segments_, options);
  Json json;
  json["buildings"] = Json::array();
  for (const OutlineBuilding& building : proposal.outline.buildings) {
    json["buildings"].push_back(BuildingJson(building));
  }
  return json;
}

OutlineBuilding OutlineSession::BuildingOf(const Json& json) const {
  Json file = OutlineToJson(outline_);
  file["buildings"] = Json::array({json});
  return ParseOutline("drawing", file).buildings[0];
}

Json OutlineSession::Heights(const Json& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const OutlineBuilding building = BuildingOf(
      request.is_object() && request.contains("building") ? request["building"] : Json());
  const auto measured = HeightsFromPoints(cloud_, segments_, building);
  if (!measured || !measured->Problems().empty()) {
    throw UsageError("The points tell no height here: type it in.");
  }
  return {{"building", BuildingJson(*measured)}};
}

Json OutlineSession::SetUp(const Json& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  CheckRevision(request);
  if (outline_.geo) throw UsageError("The model lies on the Earth, which says what is up.");
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  const Json& given = request.contains("up") ? request["up"] : Json();
  for (size_t i = 0; given.is_array() && given.size() == 3 && i < 3; ++i) {
    if (given[i].is_number()) up[static_cast<int>(i)] = given[i].get<double>();
  }
  if (!(up.norm() > 1e-6) || !up.allFinite()) throw UsageError("Up must be a direction.");
  cloud_.up = up.normalized();
  cloud_.up_source = OutlineCloud::UpSource::kGiven;
  const Similarity before = outline_.outline_from_input;
  Level(&cloud_, &segments_);
  outline_.outline_from_input = cloud_.frame.outline_from_input;
  MoveBuildings(outline_.outline_from_input * before.Inverse(), &outline_.buildings);
  ++revision_;
  ++points_revision_;
  Save(false);
  return Buildings();
}

Json OutlineSession::WriteModels() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (input_.model_paths.empty()) {
    throw UsageError("No --model_path was given: roomtex-outline --outline_path " +
                     input_.output_path + " --model_path building.glb writes one.");
  }
  for (const std::string& path : input_.model_paths) WriteBuildings(path, outline_);
  return {{"written", input_.model_paths}};
}

OutlineProposal OutlineSession::Judged() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!save_error_.empty()) Save(false);  // a disk that was full may have space again
  if (!save_error_.empty()) throw InputError(input_.output_path, "", save_error_, "");
  return JudgeOutline(cloud_, segments_, outline_);
}

void OutlineSession::Save(bool proposed) {
  try {
    file_.Save([&] { WriteOutline(input_.output_path, outline_, proposed); });
    save_error_.clear();
  } catch (const std::exception& error) {
    save_error_ = std::string("the buildings could not be saved: ") + error.what();
  }
}

}  // namespace roomtex
