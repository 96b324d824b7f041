#pragma once
// Files and folders that are being made, beside where they will be. Each is locked while its
// process lives: what a killed one left can be told by that, and goes when the next command writes
// into the same folder.

#include <string>
#include <vector>

namespace roomtex {

// Every name of such a file or folder begins with this.
inline constexpr char kPartialPrefix[] = ".roomtex-partial-";
// Such a name, which nobody can foresee. Throws std::system_error.
std::string PartialName();

// Makes an empty file or folder of a name that nobody can foresee, and gives its path; `extension`
// with its dot. Removes what killed processes left in `parent`. Throws std::system_error (the
// reason alone; the caller knows what it was for).
enum class PartialKind { kFile, kFolder };
std::string MakePartial(const std::string& parent, PartialKind kind,
                        const std::string& extension = "");
// Removes it with all that it holds.
void RemovePartial(const std::string& path);
// It has been renamed: the path is no longer ours.
void ReleasePartial(const std::string& path);

// A file or folder that is removed at the end, whatever happens.
class Partial {
 public:
  Partial(const std::string& parent, PartialKind kind) : path_(MakePartial(parent, kind)) {}
  ~Partial() { RemovePartial(path_); }
  Partial(const Partial&) = delete;
  Partial& operator=(const Partial&) = delete;

  const std::string& path() const { return path_; }
  // It stays, as if this process had been killed: the next command goes on with it.
  void Keep() {
    ReleasePartial(path_);
    path_.clear();
  }

 protected:
  std::string path_;
};

class PartialFolder : public Partial {
 public:
  explicit PartialFolder(const std::string& parent) : Partial(parent, PartialKind::kFolder) {}
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  // Moves it, to be continued there. Throws std::system_error.
  void MoveInto(const std::string& parent);
};

// Whether the path lies in such a folder or is such a file.
bool IsPartial(const std::string& path);

// Removes from the folder what killed processes left there; where one was killed while it moved
// finished files into this folder (OutputSet, CommitTogether), all are moved to their places, also
// those in other folders that belong to them. What cannot be moved stays, and a sentence about each
// is given. Never throws but for want of memory.
std::vector<std::string> RemoveLeftovers(const std::string& folder);

// For a process that a signal ends: removes all that it is making. From any thread; nothing can be
// made afterwards.
void RemoveAllPartials();

// Held while finished outputs are moved to their places, so that no signal falls between them.
class CommitLock {
 public:
  CommitLock();
  ~CommitLock();
  CommitLock(const CommitLock&) = delete;
  CommitLock& operator=(const CommitLock&) = delete;
};

}  // namespace roomtex
