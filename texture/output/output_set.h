#pragma once
// Files that belong together appear together.

#include <string>
#include <vector>

namespace roomtex {

// Files being written into a folder. They are made in a folder of their own inside it and moved out
// by Commit(), so that a run that is killed or fails while it writes leaves the earlier files as
// they were. What a killed run left is removed by the next one.
class OutputSet {
 public:
  // The folder must exist. Throws InputError if nothing can be written there.
  explicit OutputSet(const std::string& folder);
  ~OutputSet();  // removes what was not committed
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  // Where to write the file that will be folder/name.
  std::string Path(const std::string& name);
  const std::vector<std::string>& names() const { return names_; }

  // Moves the files; a link stays a link, the file it leads to is replaced. Throws InputError,
  // before anything is moved, if a folder stands in the way.
  void Commit();

 private:
  std::string folder_, aside_;
  std::vector<std::string> names_;
};

}  // namespace roomtex
