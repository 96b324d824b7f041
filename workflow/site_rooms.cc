#include "workflow/site_rooms.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "core/csv.h"
#include "core/error.h"
#include "core/text.h"
#include "workflow/room_coverage.h"
#include "workflow/run_state.h"
#include "workflow/step.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

// What the room's own reports say, where they say it.
class RoomMaker {
 public:
  RoomMaker(const std::string& folder, const SiteRoom& room)
      : folder_(folder + "/" + room.name),
        state_(folder_ + "/steps.json"),
        report_(ReadJsonFile(folder_ + "/report.json")) {
    json_["name"] = room.name;
    json_["notes"] = room.notes;
  }

  Json Make() {
    Verdict();
    json_["folder"] = json_["name"];
    json_["has_report"] = IsThere(folder_ + "/report.html");
    Photos();
    Coverage();
    Plan();
    Errors();
    Cost();
    return json_;
  }

 private:
  using Texts = std::vector<std::string>;

  void Set(const std::string& state, const std::string& headline, const Texts& sentences,
           const Texts& remedies = {}) {
    json_["state"] = state;
    json_["headline"] = headline;
    json_["sentences"] = sentences;
    json_["remedies"] = remedies;
  }

  // A run that is refused before its first step leaves the report of the one before: what the steps
  // say comes first.
  void Verdict() {
    for (const std::string& step : StepNames()) {
      const StepRecord* const record = state_.Find(step);
      if (record == nullptr) continue;
      if (record->state == StepState::kFailed) {
        return Set(
            "failed", "The step " + step + " failed", {record->reason},
            {"What it printed: " + json_["name"].get<std::string>() + "/log/" + step + ".log"});
      }
      if (record->state == StepState::kStarted) {
        // roomtex-auto itself ended there, or was refused since: run_step.sh has kept what it said.
        if (IsNewer(kRefused, "/steps.json")) {
          const std::string said = LastWords(kRefused);
          return Set("failed", "The step " + step + " did not end",
                     said.empty() ? Texts() : Texts{said},
                     {"What it printed last: " + json_["name"].get<std::string>() + kRefused});
        }
        return Set("unfinished", "The step " + step + " runs still, or was killed", {});
      }
    }
    if (WasRefused()) return SayRefusal();
    try {
      const Json& verdict = report_.at("verdict");
      Set(verdict.at("state"), verdict.at("headline"), verdict.at("sentences").get<Texts>(),
          report_.at("remedies").get<Texts>());
    } catch (const Json::exception&) {
      SayRefusal();
    }
  }

  // The last start ended before it could write anything: the report is of an earlier one.
  bool WasRefused() const { return IsNewer(kRefused, "/report.json"); }
  // The first file is there, and the second was not written after it.
  bool IsNewer(const std::string& first, const std::string& second) const {
    std::error_code none, no_other;
    const auto time = fs::last_write_time(folder_ + first, none);
    const auto other = fs::last_write_time(folder_ + second, no_other);
    return !none && (no_other || time >= other);
  }
  void SayRefusal() {
    const std::string said =
        LastWords(IsThere(folder_ + kRefused) ? kRefused : "/log/features.run.log");
    const bool refused = !said.empty() || WasRefused();
    Set(refused ? "failed" : "unfinished", refused ? "It could not be started" : "Not begun",
        said.empty() ? Texts() : Texts{said});
  }

  // What roomtex-auto said last before it could write anything.
  std::string LastWords(const std::string& log) const {
    std::ifstream stream(folder_ + log);
    std::string line, last;
    while (std::getline(stream, line)) {
      if (BeginsWith(line, "roomtex-auto: ")) last = line.substr(14);
    }
    return last;
  }

  static constexpr char kRefused[] = "/log/refused";  // of run_step.sh

  void Photos() {
    if (!report_.is_object() || !report_.contains("photos") || !report_["photos"].is_array() ||
        report_["photos"].empty()) {
      return;
    }
    int num_registered = 0;
    for (const Json& photo : report_["photos"]) {
      if (!photo.is_object()) continue;
      const Json by = photo.value("registered_by", Json());
      num_registered += by.is_string() && by != "none";
    }
    json_["num_photos"] = report_["photos"].size();
    json_["num_registered"] = num_registered;
  }

  void Coverage() {
    json_["places_to_photograph"] = Json::array();
    try {
      const Json& coverage = report_.at("coverage");
      for (const auto& [ours, theirs] : {std::pair{"coverage", "all"},
                                         {"surface_m2", "surface_m2"},
                                         {"unseen_m2", "unseen_m2"}}) {
        json_[ours] = coverage.at(theirs).get<double>();
      }
      for (const Json& place : report_.at("places_to_photograph")) {
        json_["places_to_photograph"].push_back(PlaceToJson(PlaceFromJson(place)));
      }
    } catch (const Json::exception&) {
      json_["places_to_photograph"] = Json::array();
    }
  }

  void Plan() {
    if (!report_.is_object() || !report_.contains("plan")) return;
    const Json& plan = report_["plan"];
    const Json picture = plan.is_object() ? plan.value("picture", Json()) : Json();
    if (picture.is_string() && IsThere(folder_ + "/" + picture.get<std::string>())) {
      json_["plan"] = plan;
    }
  }

  void Errors() {
    const StepRecord* const align = state_.Find("align");
    if (align == nullptr || align->state != StepState::kDone) return;
    try {
      const Json report = ReadJsonFile(folder_ + "/log/align.json");
      const Json& expected = report.at("expected_error");
      json_["expected_error_mm"] = expected.at("at_cameras_mm").get<double>();
      json_["far_corner_mm"] = expected.at("at_far_corner_mm").get<double>();
    } catch (const Json::exception&) {
    }
  }

  void Cost() {
    double seconds = 0, cpu_seconds = 0;
    long long memory = 0;
    json_["steps"] = Json::object();
    for (const std::string& step : StepNames()) {
      const StepRecord* const record = state_.Find(step);
      if (record == nullptr) continue;
      seconds += record->seconds;
      cpu_seconds += record->cpu_seconds;
      memory = std::max(memory, record->peak_memory_bytes);
      json_["steps"][step] = {{"seconds", record->seconds},
                              {"cpu_seconds", record->cpu_seconds},
                              {"peak_memory_bytes", record->peak_memory_bytes}};
    }
    json_["seconds"] = seconds;
    json_["cpu_seconds"] = cpu_seconds;
    json_["peak_memory_bytes"] = memory;
  }

  std::string folder_;
  RunState state_;
  Json report_, json_;
};

// Of every step over all rooms: sums, and the room that needs most memory.
Json SiteSteps(const Json& rooms) {
  Json steps = Json::array();
  for (const std::string& name : StepNames()) {
    double seconds = 0, cpu_seconds = 0;
    long long memory = -1;
    std::string largest;
    for (const Json& room : rooms) {
      if (!room["steps"].contains(name)) continue;
      const Json& step = room["steps"][name];
      seconds += step["seconds"].get<double>();
      cpu_seconds += step["cpu_seconds"].get<double>();
      if (step["peak_memory_bytes"].get<long long>() > memory) {
        memory = step["peak_memory_bytes"];
        largest = room["name"];
      }
    }
    if (memory < 0) continue;
    steps.push_back({{"name", name},
                     {"seconds", seconds},
                     {"cpu_seconds", cpu_seconds},
                     {"peak_memory_bytes", memory},
                     {"largest_room", largest}});
  }
  return steps;
}

// Null if it did not run.
Json JoinedKeys(const std::string& folder) {
  const Json report = ReadJsonFile(folder + "/joined/joined.json");
  Json joined;
  try {
    joined["trusted"] = report.at("trusted").get<bool>();
    joined["reason"] = report.at("reason").get<std::string>();
    joined["reference"] = report.at("reference").get<std::string>();
    for (const char* list : {"rooms", "links", "loops"}) {
      if (!report.at(list).is_array()) return nullptr;
      joined[list] = report[list];
    }
    joined["scene"] = report.at("scene");
  } catch (const Json::exception&) {
    return nullptr;
  }
  return joined;
}

Json SiteVerdict(const Json& counts, const Json& joined) {
  const auto count = [&](const char* state) { return counts[state].get<int>(); };
  const int num_rooms = count("rooms");
  Json verdict;
  verdict["state"] = count("failed") > 0       ? "failed"
                     : count("untrusted") > 0  ? "untrusted"
                     : count("unfinished") > 0 ? "unfinished"
                                               : "trusted";
  const bool is_joined_ill = !joined.is_null() && !joined["trusted"].get<bool>();
  if (is_joined_ill && verdict["state"] == "trusted") verdict["state"] = "untrusted";
  const std::string number =
      count("trusted") == num_rooms
          ? (num_rooms == 1 ? "The room is" : "All " + std::to_string(num_rooms) + " rooms are")
          : std::to_string(count("trusted")) + " of " + std::to_string(num_rooms) + " rooms " +
                (count("trusted") == 1 ? "is" : "are");
  verdict["headline"] = number + " coloured and can be trusted";
  verdict["sentences"] = Json::array();
  for (const auto& [state, words] : {std::pair{"untrusted", "not to be trusted"},
                                     {"failed", "failed"},
                                     {"unfinished", "not finished"}}) {
    if (count(state) > 0) {
      verdict["sentences"].push_back(std::to_string(count(state)) + " " + words + ".");
    }
  }
  if (is_joined_ill) {
    verdict["sentences"].push_back("How the rooms stand to each other is not to be trusted: " +
                                   joined["reason"].get<std::string>());
  }
  return verdict;
}

}  // namespace

std::vector<SiteRoom> ReadSiteRooms(const std::string& path) {
  CsvReader reader(path, "Give site.csv, or leave --rooms_path out",
                   "Expected a table with the columns room and notes");
  std::vector<SiteRoom> rooms;
  std::set<std::string> names;
  int room_column = -1, notes_column = -1;
  while (reader.Next()) {
    const std::optional<std::vector<std::string>> fields = reader.Fields();
    if (!fields) throw reader.Error("has a quote that is not closed", "Close it");
    if (room_column < 0) {
      for (size_t i = 0; i < fields->size(); ++i) {
        if ((*fields)[i] == "room") room_column = static_cast<int>(i);
        if ((*fields)[i] == "notes") notes_column = static_cast<int>(i);
      }
      if (room_column < 0) {
        throw reader.Error("names no column room", "The first line has to name the columns");
      }
      continue;
    }
    const auto field = [&](int column) {
      const bool has = column >= 0 && static_cast<size_t>(column) < fields->size();
      return has ? (*fields)[static_cast<size_t>(column)] : std::string();
    };
    const SiteRoom room = {field(room_column), field(notes_column)};
    const bool is_folder =
        !room.name.empty() && room.name[0] != '.' && room.name.find('/') == std::string::npos;
    if (!is_folder) {
      throw reader.Error("room " + Quoted(room.name) + " cannot be the name of a folder",
                         "Name every room");
    }
    if (!names.insert(room.name).second) {
      throw reader.Error("room " + Quoted(room.name) + " is there already",
                         "Give every room a name of its own");
    }
    rooms.push_back(room);
  }
  if (rooms.empty()) throw InputError(path, "", "names no room", "Add a line for every room");
  return rooms;
}

std::vector<SiteRoom> FindSiteRooms(const std::string& folder) {
  std::vector<SiteRoom> rooms;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (IsThere(entry.path().string() + "/steps.json")) {
      rooms.push_back({entry.path().filename().string(), ""});
    }
  }
  if (rooms.empty()) {
    throw InputError(folder, "", "has no folder in which roomtex-auto has run",
                     "Give the folder that holds the rooms' output folders");
  }
  std::sort(rooms.begin(), rooms.end(),
            [](const SiteRoom& a, const SiteRoom& b) { return a.name < b.name; });
  return rooms;
}

Json MakeSiteKeys(const std::string& folder, const std::vector<SiteRoom>& rooms) {
  Json keys, counts;
  counts["rooms"] = rooms.size();
  for (const char* state : {"trusted", "untrusted", "failed", "unfinished"}) counts[state] = 0;
  Json list = Json::array();
  double seconds = 0, cpu_seconds = 0;
  long long memory = 0;
  for (const SiteRoom& room : rooms) {
    Json one = RoomMaker(folder, room).Make();
    const std::string state = one["state"];
    const std::string known = counts.contains(state) && state != "rooms" ? state : "unfinished";
    one["state"] = known;
    counts[known] = counts[known].get<int>() + 1;
    seconds += one["seconds"].get<double>();
    cpu_seconds += one["cpu_seconds"].get<double>();
    memory = std::max(memory, one["peak_memory_bytes"].get<long long>());
    list.push_back(one);
  }
  const Json joined = JoinedKeys(folder);
  keys["verdict"] = SiteVerdict(counts, joined);
  keys["counts"] = counts;
  keys["rooms"] = list;
  keys["joined"] = joined;
  keys["steps"] = SiteSteps(list);
  keys["total"] = {
      {"seconds", seconds}, {"cpu_seconds", cpu_seconds}, {"peak_memory_bytes", memory}};
  return keys;
}

}  // namespace roomtex
