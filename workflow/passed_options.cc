#include "workflow/passed_options.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/child_program.h"
#include "core/error.h"
#include "core/text.h"
#include "workflow/own_commands.h"
#include "workflow/step_lines.h"

namespace roomtex {
namespace {

// Of one of our commands, by its help; with their dashes.
std::set<std::string> OptionsOfOurs(const std::string& command) {
  std::set<std::string> names;
  ChildSettings settings;
  settings.on_line = [&](const std::string& line) {
    const std::string start = "  --";
    if (!BeginsWith(line, start)) return;
    const auto end = std::find_if(line.begin() + 2, line.end(),
                                  [](unsigned char letter) { return std::isspace(letter); });
    names.insert(std::string(line.begin() + 2, end));
  };
  RunChild({FindOwnCommand(command), "--help"}, settings);
  return names;
}

std::set<std::string> OptionsOfColmap(Chain* chain, const std::vector<std::string>& commands) {
  std::set<std::string> names;
  for (const std::string& command : commands) {
    const std::set<std::string>& of_one = chain->Colmap().Options(command);
    names.insert(of_one.begin(), of_one.end());
  }
  return names;
}

// passed: name, value, name, value ...
void CheckNames(const std::vector<std::string>& passed, const std::set<std::string>& names,
                const std::string& command) {
  std::vector<std::string> problems;
  for (size_t i = 0; i + 1 < passed.size(); i += 2) {
    if (names.count(passed[i]) > 0) continue;
    problems.push_back(passed[i] + " is no option of " + command + " (see its --help)");
  }
  ThrowIfProblems(problems);
}

void CheckOurs(const std::vector<std::string>& passed, const std::string& command) {
  if (!passed.empty()) CheckNames(passed, OptionsOfOurs(command), command);
}

void CheckColmaps(const std::vector<std::string>& passed, Chain* chain,
                  const std::vector<std::string>& commands, const std::string& what) {
  if (!passed.empty()) CheckNames(passed, OptionsOfColmap(chain, commands), what);
}

}  // namespace

void CheckPassedOptions(Chain* chain) {
  const PassedOptions& passed = chain->options().passed;
  CheckOurs(passed.pairs, "roomtex-pairs");
  CheckOurs(passed.align, "roomtex-align");
  CheckOurs(passed.texture, "roomtex-texture");
  // roomtex-mapper hands these on in its turn.
  std::vector<std::string> of_mapper = passed.mapper, of_colmaps_mapper;
  for (size_t i = 0; i + 1 < of_mapper.size();) {
    if (!BeginsWith(of_mapper[i], "--Mapper.")) {
      i += 2;
      continue;
    }
    const auto at = of_mapper.begin() + static_cast<std::ptrdiff_t>(i);
    of_colmaps_mapper.insert(of_colmaps_mapper.end(), at, at + 2);
    of_mapper.erase(at, at + 2);
  }
  CheckOurs(of_mapper, "roomtex-mapper");
  if (!HasOwnPhotos(chain)) return;
  CheckColmaps(of_colmaps_mapper, chain, {"mapper"}, "colmap mapper");
  CheckColmaps(passed.features, chain, {"feature_extractor"}, "colmap feature_extractor");
  CheckColmaps(passed.matches, chain,
               {"exhaustive_matcher", "sequential_matcher", "matches_importer"},
               "COLMAP's matchers");
}

}  // namespace roomtex
