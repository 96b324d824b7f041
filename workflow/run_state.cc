#include "workflow/run_state.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <set>

#include "core/json_text.h"
#include "core/output_file.h"
#include "core/photo_files.h"
#include "core/result_names.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr uintmax_t kLargeBytes = 1 << 20;
constexpr const char* kStateNames[] = {"started", "done", "untrusted", "failed"};

// FNV-1a, 64 bit: tells versions of one file apart, not files that somebody forged.
class Hash {
 public:
  void Add(const char* bytes, size_t count) {
    for (size_t i = 0; i < count; ++i) {
      value_ = (value_ ^ static_cast<unsigned char>(bytes[i])) * 0x100000001b3u;
    }
  }
  void Add(const std::string& text) { Add(text.c_str(), text.size() + 1); }
  std::string Text() const {
    static const char* const kDigits = "0123456789abcdef";
    std::string text;
    for (int shift = 60; shift >= 0; shift -= 4) text += kDigits[(value_ >> shift) & 15];
    return text;
  }

 private:
  uint64_t value_ = 0xcbf29ce484222325u;
};

void AddFile(const fs::path& path, Hash* hash) {
  std::error_code error;
  const uintmax_t size = fs::file_size(path, error);
  hash->Add(std::to_string(error ? 0 : size));
  if (size > kLargeBytes) {
    const auto time = fs::last_write_time(path, error).time_since_epoch().count();
    hash->Add(std::to_string(time));
    return;
  }
  std::ifstream stream(path, std::ios::binary);
  char buffer[65536];
  while (stream.read(buffer, sizeof buffer) || stream.gcount() > 0) {
    hash->Add(buffer, static_cast<size_t>(stream.gcount()));
  }
}

StepState StateOf(const std::string& name) {
  for (int i = 0; i < 4; ++i) {
    if (name == kStateNames[i]) return static_cast<StepState>(i);
  }
  return StepState::kFailed;
}

StepRecord RecordFromJson(const Json& json) {
  StepRecord record;
  record.state = StateOf(json.at("state"));
  record.made_from = json.at("made_from").get<MadeFrom>();
  record.outputs = json.at("outputs").get<std::map<std::string, std::string>>();
  record.commands = json.at("commands").get<std::vector<std::string>>();
  record.notes = json.at("notes").get<std::vector<std::string>>();
  record.reason = json.at("reason");
  record.seconds = json.at("seconds");
  record.cpu_seconds = json.at("cpu_seconds");
  record.peak_memory_bytes = json.at("peak_memory_bytes");
  return record;
}

}  // namespace

std::string HashText(const std::string& text) {
  Hash hash;
  hash.Add(text);
  return hash.Text();
}

namespace {

// What programs that show a folder leave in it (.DS_Store, Thumbs.db): nobody reads it, and to look
// at photos must not make everything anew.
bool IsLeftByLooking(const fs::path& below_folder) {
  const auto is_hidden = [](const fs::path& part) {
    const std::string name = part.string();
    return name.size() > 1 && name[0] == '.' && name != "..";
  };
  const std::string name = LowerCase(below_folder.filename().string());
  return name == "thumbs.db" || name == "desktop.ini" ||
         std::any_of(below_folder.begin(), below_folder.end(), is_hidden);
}

template <typename Counts>
std::string SignatureOf(const std::string& path, const Counts& counts) {
  std::error_code error;
  Hash hash;
  if (fs::is_regular_file(path, error)) {
    AddFile(path, &hash);
    return hash.Text();
  }
  if (!fs::is_directory(path, error)) return "";
  std::vector<fs::path> files;
  fs::recursive_directory_iterator entry(path, fs::directory_options::skip_permission_denied,
                                         error);
  for (; !error && entry != fs::end(entry); entry.increment(error)) {
    std::error_code unknown;
    const fs::path name = entry->path().lexically_relative(path);
    if (counts(name) && entry->is_regular_file(unknown)) files.push_back(entry->path());
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    hash.Add(file.lexically_relative(path).generic_string());
    AddFile(file, &hash);
  }
  return hash.Text();
}

}  // namespace

std::string Signature(const std::string& path) {
  return SignatureOf(path, [](const fs::path& name) { return !IsLeftByLooking(name); });
}

std::string SignatureOfPhotos(const std::string& folder) {
  return SignatureOf(folder, [](const fs::path& name) {
    const bool is_read = IsPhotoName(name.string()) || name == kPanoramaSetName;
    return is_read && !IsLeftByLooking(name);
  });
}

std::vector<std::string> Differences(const MadeFrom& before, const MadeFrom& now) {
  std::set<std::string> names;
  for (const auto& [name, value] : before) {
    const auto found = now.find(name);
    if (found == now.end() || found->second != value) names.insert(name);
  }
  for (const auto& [name, value] : now) {
    if (before.count(name) == 0) names.insert(name);
  }
  return {names.begin(), names.end()};
}

bool OutputsAreAsLeft(const StepRecord& record) {
  return std::all_of(record.outputs.begin(), record.outputs.end(),
                     [](const auto& output) { return Signature(output.first) == output.second; });
}

RunState::RunState(const std::string& path) : path_(path) {
  const Json json = ReadJsonIfAny(path);
  if (!json.is_object()) {
    std::error_code error;
    is_lost_ = fs::exists(path, error);
    return;
  }
  try {
    for (const auto& [name, record] : json.at("steps").items()) {
      records_[name] = RecordFromJson(record);
    }
  } catch (const Json::exception&) {
    records_.clear();
    is_lost_ = true;
  }
}

const StepRecord* RunState::Find(const std::string& step) const {
  const auto found = records_.find(step);
  return found == records_.end() ? nullptr : &found->second;
}

void RunState::Set(const std::string& step, const StepRecord& record) {
  records_[step] = record;
  Json steps = Json::object();
  for (const auto& [name, one] : records_) {
    steps[name] = RecordToJson(one);
    steps[name]["made_from"] = one.made_from;
    steps[name]["outputs"] = one.outputs;
  }
  WriteJson(path_, {{"steps", steps}});
}

Json RecordToJson(const StepRecord& record) {
  Json json;
  json["state"] = kStateNames[static_cast<int>(record.state)];
  json["reason"] = record.reason;
  json["commands"] = record.commands;
  json["notes"] = record.notes;
  json["seconds"] = record.seconds;
  json["cpu_seconds"] = record.cpu_seconds;
  json["peak_memory_bytes"] = record.peak_memory_bytes;
  return json;
}

}  // namespace roomtex
