#pragma once
// Bytes put aside on disk, so that a large room need not lie in memory while it is looked at.

#include <cstdint>
#include <mutex>
#include <string>

namespace roomtex {

// A file without a name in the folder for temporary files: gone with the process, however it ends.
// Safe to use from several threads.
class ViewSpool {
 public:
  struct Piece {
    int64_t offset = 0, size = 0;
  };

  // Throws InputError if no file can be made there.
  ViewSpool();
  ~ViewSpool();
  ViewSpool(const ViewSpool&) = delete;
  ViewSpool& operator=(const ViewSpool&) = delete;

  // Throws InputError when the disk is full.
  Piece Add(const std::string& bytes);
  std::string Read(const Piece& piece) const;

 private:
  [[noreturn]] void Fail(const std::string& finding, int error) const;

  std::string folder_;
  int fd_ = -1;
  std::mutex mutex_;
  int64_t size_ = 0;
};

}  // namespace roomtex
