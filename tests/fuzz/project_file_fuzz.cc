// Any bytes as an ini file of options: a UsageError or an InputError, or values of their kinds;
// never a crash.

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/option_list.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const roomtex::MemoryFile file(data, size);
  double number = 0;
  std::vector<std::string> words, passed;
  roomtex::OptionList list("roomtex-fuzz");
  const auto add = [&list](const char* name, auto set) {
    roomtex::Option option;
    option.name = name;
    option.repeatable = option.name == "scan_path";
    option.set = set;
    list.Add(option);
  };
  using Values = std::vector<std::string>;
  add("project_path", [](const Values&) {});
  add("quiet", [](const Values& values) { roomtex::ParseBool("quiet", values[0]); });
  add("num_threads", [](const Values& values) { roomtex::ParseInt("num_threads", values[0]); });
  add("Plane.weight",
      [&](const Values& values) { number = roomtex::ParseDouble("Plane.weight", values[0]); });
  add("scan_path", [&](const Values& values) { words = values; });
  list.Add(roomtex::PassedThrough{"--Mapper.", "", &passed});
  try {
    list.Parse({"--project_path", file.path()});
    if (std::isnan(number) || passed.size() % 2 != 0) std::abort();
    for (const std::string& word : words) {
      if (word.empty() || word.find('\n') != std::string::npos) std::abort();
    }
  } catch (const roomtex::InputError&) {
  } catch (const roomtex::UsageError&) {
  }
  return 0;
}
