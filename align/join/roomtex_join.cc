// roomtex-join: aligned rooms in one frame, by the photos and scans that they share.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "align/join/joined_scene.h"
#include "align/join/room_graph.h"
#include "align/join/room_links.h"
#include "align/join/room_record.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/json_text.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/standard_files.h"
#include "core/stays_inside.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

struct JoinOptions {
  std::vector<std::string> input_paths, image_paths;
  std::string output_path;
  bool registered = false, accept_untrusted = false;
};

constexpr char kSceneName[] = "site.gltf", kReportName[] = "joined.json";

std::vector<RoomRecord> ReadRooms(const JoinOptions& options, const Command::Context& context) {
  std::vector<std::string> problems;
  if (!options.image_paths.empty() && options.image_paths.size() != options.input_paths.size()) {
    problems.push_back("--image_path is given " + std::to_string(options.image_paths.size()) +
                       " times for " + std::to_string(options.input_paths.size()) +
                       " --input_path: give one for each, in the same order, or none");
  }
  std::map<std::string, std::string> names;
  for (const std::string& path : options.input_paths) {
    const auto [at, is_new] = names.emplace(RoomName(path), path);
    if (!is_new) {
      problems.push_back(at->second + " and " + path + " are both called " + at->first +
                         ": give every room a folder of another name");
    }
  }
  ThrowIfProblems(problems);
  std::vector<RoomRecord> rooms;
  for (size_t i = 0; i < options.input_paths.size(); ++i) {
    RequireFolder(options.input_paths[i], "Give the folder that roomtex-align wrote");
    rooms.push_back(ReadRoom(options.input_paths[i],
                             options.image_paths.empty() ? "" : options.image_paths[i], context));
    AlignmentRecord& alignment = rooms.back().alignment;
    TakeOverTrust(alignment, options.accept_untrusted, context);
    alignment.trusted |= options.accept_untrusted;
    context.progress.Tick();
  }
  return rooms;
}

// Of the scan frames, from `room` to that of its place.
Rigid FrameFromScan(const RoomRecord& frame, const RoomRecord& room, const RoomPlace& place) {
  return frame.RoomFromScan().Inverse() * place.frame_from_room * room.RoomFromScan();
}

Json MillimetresOrNull(double metres) {
  return std::isfinite(metres) ? Json(1000 * metres) : Json(nullptr);
}

void AddMisfit(const Misfit& misfit, Json* json) {
  (*json)["offset_mm"] = MillimetresOrNull(misfit.offset);
  (*json)["offset_sigma_mm"] = MillimetresOrNull(misfit.offset_sigma);
  (*json)["turn_deg"] = DegFromRad(misfit.turn);
  (*json)["turn_sigma_deg"] = DegFromRad(misfit.turn_sigma);
}

Json MatrixToJson(const Rigid& rigid) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back(ToJson(rigid.Matrix().row(row).transpose()));
  return rows;
}

// Whether anything says where a room stands to the first one; of scans that are registered, whether
// anything was compared with that.
bool IsPlaced(size_t room, const std::vector<RoomLink>& links, const RoomPlace& place,
              bool registered) {
  if (!registered) return room == 0 || place.frame != static_cast<int>(room);
  return std::any_of(links.begin(), links.end(), [&](const RoomLink& link) {
    return link.first == static_cast<int>(room) || link.second == static_cast<int>(room);
  });
}

Json RoomToJson(const std::vector<RoomRecord>& rooms, size_t room, const RoomPlace& place,
                bool is_placed) {
  const RoomRecord& frame = rooms[place.frame];
  const Rigid site_from_room = FrameFromScan(frame, rooms[room], place);
  Json json;
  json["name"] = rooms[room].name;
  json["input_path"] = rooms[room].alignment.folder;
  json["frame"] = frame.name;
  json["trusted"] = place.trusted;
  json["site_from_room"] = MatrixToJson(site_from_room);
  json["rotation_wxyz"] = ToJson(WxyzFromQuaternion(site_from_room.rotation));
  json["translation"] = ToJson(site_from_room.translation);
  json["centre"] = ToJson(site_from_room * rooms[room].origin);
  json["position_sigma_mm"] = is_placed ? MillimetresOrNull(place.position_sigma) : Json(nullptr);
  json["rotation_sigma_deg"] = is_placed ? Json(DegFromRad(place.rotation_sigma)) : Json(nullptr);
  return json;
}

Json LinkToJson(const std::vector<RoomRecord>& rooms, const RoomLink& link,
                const LinkVerdict& verdict, const RoomPlace& first) {
  Json json, views = Json::array();
  int num_photos = 0;
  for (const SharedView& view : link.views) {
    const bool is_photo = view.kind == SharedView::Kind::kPhoto;
    num_photos += is_photo;
    Json one = {{"name", view.name}, {"kind", is_photo ? "photo" : "scan"}};
    AddMisfit(MisfitOf(view, link.first_from_second), &one);
    one["agrees"] = view.agrees;
    views.push_back(one);
  }
  json["first"] = rooms[link.first].name;
  json["second"] = rooms[link.second].name;
  json["trusted"] = verdict.trusted;
  json["reason"] = verdict.reason;
  json["num_photos"] = num_photos;
  json["num_scans"] = static_cast<int>(link.views.size()) - num_photos;
  json["num_agreeing"] = link.NumAgreeing();
  const RoomRecord& frame = rooms[first.frame];
  json["place"] =
      ToJson(frame.RoomFromScan().Inverse() * (first.frame_from_room * link.x_in_first));
  json["residual"] = nullptr;
  if (verdict.misfit) AddMisfit(*verdict.misfit, &json["residual"]);
  json["tilt_deg"] = verdict.tilt ? Json(DegFromRad(*verdict.tilt)) : Json(nullptr);
  json["views"] = views;
  return json;
}

Json LoopToJson(const std::vector<RoomRecord>& rooms, const RoomLoop& loop) {
  Json json = {{"rooms", Json::array()}};
  for (const int room : loop.rooms) json["rooms"].push_back(rooms[room].name);
  AddMisfit(loop.misfit, &json);
  json["closes"] = !loop.misfit.Contradicts();
  return json;
}

void FillReport(const std::vector<RoomRecord>& rooms, const std::vector<RoomLink>& links,
                const RoomGraph& graph, bool registered, const Command::Context& context) {
  Report& report = context.report;
  report["reference"] = rooms[0].name;
  report["rooms"] = report["links"] = report["loops"] = Json::array();
  std::string alone, not_compared;
  for (size_t i = 0; i < rooms.size(); ++i) {
    const RoomPlace& place = graph.places[i];
    const bool is_placed = IsPlaced(i, links, place, registered);
    report["rooms"].push_back(RoomToJson(rooms, i, place, is_placed));
    if (place.frame != 0) alone += (alone.empty() ? "" : ", ") + rooms[i].name;
    if (!is_placed && registered) {
      not_compared += (not_compared.empty() ? "" : ", ") + rooms[i].name;
    }
  }
  for (size_t i = 0; i < links.size(); ++i) {
    const LinkVerdict& verdict = graph.verdicts[i];
    report["links"].push_back(LinkToJson(rooms, links[i], verdict, graph.places[links[i].first]));
    for (const std::string& note : verdict.notes) context.Warn(note);
    if (!verdict.trusted) report.SetUntrusted(verdict.reason);
  }
  for (const RoomLoop& loop : graph.loops) report["loops"].push_back(LoopToJson(rooms, loop));
  if (!alone.empty()) {
    context.Warn("No photo and no scan links these rooms to " + rooms[0].name +
                 ", so that they are not in its frame: " + alone +
                 ". Let two or three photos of each doorway be in the folders of both rooms.");
  }
  if (!not_compared.empty() && rooms.size() > 1) {
    context.Warn(
        "With these rooms no other shares a photo or a scan, so that nothing was compared "
        "with the frame that --registered 1 takes them to lie in: " +
        not_compared);
  }
}

// The rooms of the report that lies in the folder.
std::vector<std::string> RoomsOfEarlierRun(const std::string& folder) {
  const Json report = ReadJsonIfAny((fs::path(folder) / kReportName).string());
  std::vector<std::string> names;
  if (!report.is_object() || report.value("command", Json()) != "roomtex-join") return names;
  for (const Json& room : report.value("rooms", Json::array())) {
    const Json name = room.is_object() ? room.value("name", Json()) : Json();
    if (name.is_string() && StaysInside(name.get<std::string>())) names.push_back(name);
  }
  return names;
}

// ROOM.txt of the rooms in the first one's frame. One of a room that is in none, or no longer
// there, would be taken for its place.
void WriteMatrices(const std::vector<RoomRecord>& rooms, const RoomGraph& graph,
                   const std::string& folder, OutputSet* outputs) {
  const auto file_of = [](const std::string& room) { return room + ".txt"; };
  std::set<std::string> written;
  for (size_t i = 0; i < rooms.size(); ++i) {
    const RoomPlace& place = graph.places[i];
    if (place.frame != 0) {
      outputs->Remove(file_of(rooms[i].name));
      continue;
    }
    const Rigid moved = FrameFromScan(rooms[0], rooms[i], place);
    WriteSimilarityMatrix(outputs->Path(file_of(rooms[i].name)),
                          {1, moved.rotation, moved.translation});
    written.insert(rooms[i].name);
  }
  for (const std::string& name : RoomsOfEarlierRun(folder)) {
    if (written.count(name) == 0) outputs->Remove(file_of(name));
  }
}

// The rooms' coloured models, as roomtex-auto lays them out, of the rooms in the first one's frame;
// of one room alone its own model is all there is. The report's `scene`.
void WriteScene(const std::vector<RoomRecord>& rooms, const RoomGraph& graph,
                const std::string& folder, OutputSet* outputs, const Command::Context& context) {
  std::vector<SceneRoom> models;
  for (size_t i = 0; i < rooms.size(); ++i) {
    const fs::path glb = fs::absolute(rooms[i].alignment.folder) / ".." / "textured" / "model.glb";
    std::error_code error;
    if (graph.places[i].frame != 0 || !fs::is_regular_file(glb, error)) continue;
    models.push_back({rooms[i].name, glb.lexically_normal().string(),
                      FrameFromScan(rooms[0], rooms[i], graph.places[i])});
  }
  context.report["scene"] = nullptr;
  if (models.size() < 2) {
    outputs->Remove(kSceneName);
    return;
  }
  WriteJson(outputs->Path(kSceneName), MakeJoinedScene(models, folder));
  context.report["scene"] = kSceneName;
}

void Join(const JoinOptions& options, const Command::Context& context) {
  context.progress.Stage("read rooms", static_cast<int>(options.input_paths.size()));
  const std::vector<RoomRecord> rooms = ReadRooms(options, context);
  context.progress.Stage("compare photos");
  std::vector<std::string> problems;
  const std::vector<RoomLink> links = FindRoomLinks(rooms, &problems);
  for (const std::string& problem : problems) context.report.SetUntrusted(problem);
  context.progress.Stage("place rooms");
  const RoomGraph graph = PlaceRooms(rooms, links, options.registered);
  FillReport(rooms, links, graph, options.registered, context);

  context.progress.Stage("write");
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  const auto num_joined = std::count_if(graph.places.begin(), graph.places.end(),
                                        [](const RoomPlace& place) { return place.frame == 0; });
  WriteMatrices(rooms, graph, options.output_path, outputs.get());
  WriteScene(rooms, graph, options.output_path, outputs.get(), context);
  CommitWithReport(kReportName, outputs);
  AnswerAtEnd(std::to_string(num_joined) + " of " + std::to_string(rooms.size()) +
              " rooms in the frame of " + rooms[0].name + ", " + std::to_string(links.size()) +
              " links\n" + options.output_path + "\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  JoinOptions options;
  Command command("roomtex-join",
                  "Brings aligned rooms into one frame, by the photos and scans that they share.",
                  "roomtex-join --input_path result/hall/aligned --input_path "
                  "result/library/aligned --output_path result/joined");
  command.AddInputPaths("input_path", &options.input_paths,
                        "A room: the folder that roomtex-align wrote. Given for each room; the "
                        "scan frame of the first becomes that of all. A room is called as its "
                        "folder, or, where that is \"aligned\", as the one around it.",
                        Command::Kind::kRequired);
  command.AddInputPaths("image_path", &options.image_paths,
                        "The folders of the photos, one for each --input_path, in the same order; "
                        "not given = those that roomtex-align was given. Photos are the same when "
                        "their files are, whatever their names.",
                        Command::Kind::kOptional);
  command.AddOutputPath("output_path", &options.output_path,
                        "Folder for joined.json (the report), ROOM.txt (4x4 matrix from the room's "
                        "scan frame to the common one, e.g. for CloudCompare; none of a room that "
                        "is not in it), and site.gltf, the "
                        "rooms of that frame coloured, where two or more of them have "
                        "../textured/model.glb beside their models, whose files it refers to.");
  command.AddBool("registered", &options.registered,
                  "The scans of all rooms lie in one frame already: nothing is moved, and what "
                  "rooms share is compared with that.");
  command.AddBool("accept_untrusted", &options.accept_untrusted, kAcceptUntrustedHelp);
  return command.Run(argc, argv, [&](const Command::Context& context) { Join(options, context); });
}
