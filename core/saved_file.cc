#include "core/saved_file.h"

#include <fstream>
#include <tuple>

#include <sys/stat.h>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {

bool SavedFile::Identity::operator==(const Identity& other) const {
  const auto all = [](const Identity& one) {
    return std::tie(one.is_there, one.device, one.inode, one.size, one.seconds, one.nanoseconds);
  };
  return all(*this) == all(other);
}

SavedFile::SavedFile(const std::string& path) : path_(path), ours_(Now()) {}

SavedFile::Identity SavedFile::Now() const {
  struct stat there {};
  if (stat(path_.c_str(), &there) != 0) return {};
  return {true,          there.st_dev,         there.st_ino,
          there.st_size, there.st_mtim.tv_sec, there.st_mtim.tv_nsec};
}

void SavedFile::KeepAs(const std::string& other_path) const {
  std::ifstream in(path_, std::ios::binary);
  if (!in) throw InputError(path_, "", "cannot be read", "Check that you may read it");
  OutputFile out(other_path);
  if (in.peek() != std::ifstream::traits_type::eof()) out.stream() << in.rdbuf();
  out.Commit();
}

void SavedFile::Save(const std::function<void()>& write) {
  const Identity now = Now();
  if (now.is_there && !(now == ours_)) {
    KeepAs(path_ + ".other");
    ours_ = now;
    is_first_ = false;
    throw ChangedElsewhere(path_, "", "was changed by somebody else, perhaps another window",
                           "That is kept as " + path_ + ".other; the next change here replaces it");
  }
  if (is_first_ && now.is_there) KeepAs(path_ + ".bak");
  is_first_ = false;
  write();
  ours_ = Now();
}

}  // namespace roomtex
