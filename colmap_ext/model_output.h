#pragma once
// Folders of models appear in the output whole or not at all.

#include <string>

#include "core/partial_path.h"

namespace roomtex {

// A folder of its own inside `parent` (so that renaming out of it is atomic), removed at the end
// whatever happens.
class ScratchFolder {
 public:
  // Throws InputError if it cannot be made.
  explicit ScratchFolder(const std::string& parent);

  const std::string& path() const { return folder_.path(); }
  std::string operator/(const std::string& name) const { return folder_ / name; }

 private:
  PartialFolder folder_;
};

// Throws InputError if `folder` exists and is something else than a COLMAP model (or empty):
// replacing it would destroy what is not ours.
void RequireReplaceableModel(const std::string& folder);

// Throws InputError if `folder` holds rigs.bin or frames.bin of a 4.x model, which another model
// put there would contradict.
void RequireNoRigs(const std::string& folder);

}  // namespace roomtex
