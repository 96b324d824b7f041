#pragma once
// A file that a window saves after every change, while others may change it, too.

#include <cstdint>
#include <functional>
#include <string>

#include "core/error.h"

namespace roomtex {

// Of a file that somebody else wrote since.
class ChangedElsewhere : public InputError {
 public:
  using InputError::InputError;
};

class SavedFile {
 public:
  // What stands there now is what the window goes on from: read the file after this.
  explicit SavedFile(const std::string& path);

  const std::string& path() const { return path_; }

  // write() replaces the file. Before the first time, the file that was there at the beginning is
  // kept as path.bak. One that somebody else wrote since is kept as path.other, and
  // ChangedElsewhere says so once, instead of write(): whoever works here then knows, and the next
  // save replaces it.
  void Save(const std::function<void()>& write);

 private:
  // Of the file that stands there; equal for none.
  struct Identity {
    bool is_there = false;
    uint64_t device = 0, inode = 0;
    int64_t size = 0, seconds = 0, nanoseconds = 0;
    bool operator==(const Identity& other) const;
  };
  Identity Now() const;
  void KeepAs(const std::string& other_path) const;

  const std::string path_;
  Identity ours_;  // as it was read or written here
  bool is_first_ = true;
};

}  // namespace roomtex
