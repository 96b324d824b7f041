#pragma once
// How roomtex-auto tells whether a step would be made from the same as before. A path counts by
// what it names, however it is spelt and wherever the command is started, and the output folder may
// be moved.

#include <string>
#include <vector>

#include "workflow/chain.h"
#include "workflow/run_state.h"

namespace roomtex {

// What paths name, seen from one output folder.
class PathNames {
 public:
  explicit PathNames(const std::string& output_path);

  // "{result}/sparse/0" in the output folder, elsewhere absolute, without links and "..". What is
  // named so already stays as it is.
  std::string Of(const std::string& path) const;
  // Where that lies now.
  std::string PlaceOf(const std::string& name) const;

  // A command line, without what its result does not depend on, and its paths by what they name.
  std::string Essential(const CommandLine& line) const;
  // What differs. Of options also which ones: "options (--image_path)". `before` may be of a run
  // that kept paths as they were typed: they count as if they had been typed here.
  std::vector<std::string> Changes(const MadeFrom& before, const MadeFrom& now) const;

 private:
  MadeFrom Named(const MadeFrom& from) const;

  std::string output_path_, output_place_;
};

// The last name of a path, of "photos/." and "photos/" as well.
std::string FileName(const std::string& path);

// The words of what CommandText() wrote.
CommandLine CommandWords(const std::string& text);

}  // namespace roomtex
