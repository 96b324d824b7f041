#pragma once
// Folders of models appear in the output whole or not at all.

#include <string>

namespace roomtex {

// A folder of its own inside `parent` (so that renaming out of it is atomic), removed at the end
// whatever happens.
class ScratchFolder {
 public:
  // Throws InputError if it cannot be made.
  explicit ScratchFolder(const std::string& parent);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

// Throws InputError if `folder` exists and is something else than a COLMAP model (or empty):
// replacing it would destroy what is not ours.
void RequireReplaceableModel(const std::string& folder);

// Throws InputError unless `folder` does not exist, is empty, or holds what this command left
// there: its report.json names it.
void RequireReplaceableOutput(const std::string& folder, const std::string& command);

// The folder that holds `folder`, made if it is missing; a slash at the end means nothing.
std::string ParentFolder(const std::string& folder);

// Puts `finished` in the place of `target`; what stood there goes into `scratch` as a whole. Same
// file system. A slash at the end of target means nothing.
void ReplaceFolder(const std::string& finished, const std::string& target,
                   const std::string& scratch);

}  // namespace roomtex
