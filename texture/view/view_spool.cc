#include "texture/view/view_spool.h"

#include <cerrno>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <unistd.h>

#include "core/error.h"

namespace roomtex {

ViewSpool::ViewSpool() {
  std::error_code error;
  folder_ = std::filesystem::temp_directory_path(error).string();
  std::string path = folder_ + "/roomtex-view-XXXXXX";
  if (!error) fd_ = ::mkostemp(path.data(), O_CLOEXEC);
  if (error || fd_ < 0) Fail("no file can be made there", error ? error.value() : errno);
  ::unlink(path.c_str());
}

ViewSpool::~ViewSpool() { ::close(fd_); }

void ViewSpool::Fail(const std::string& finding, int error) const {
  throw InputError(folder_.empty() ? "the folder for temporary files" : folder_, "",
                   finding + " (" + std::strerror(error) + ")",
                   "Set TMPDIR to a folder with space for the room");
}

ViewSpool::Piece ViewSpool::Add(const std::string& bytes) {
  Piece piece{0, static_cast<int64_t>(bytes.size())};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    piece.offset = size_;
    size_ += piece.size;
  }
  for (int64_t done = 0; done < piece.size;) {
    const ssize_t written = ::pwrite(fd_, bytes.data() + done,
                                     static_cast<size_t>(piece.size - done), piece.offset + done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) Fail("the room cannot be put aside there", errno);
    done += written;
  }
  return piece;
}

std::string ViewSpool::Read(const Piece& piece) const {
  std::string bytes(static_cast<size_t>(piece.size), '\0');
  for (int64_t done = 0; done < piece.size;) {
    const ssize_t got = ::pread(fd_, bytes.data() + done, static_cast<size_t>(piece.size - done),
                                piece.offset + done);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) Fail("what was put aside there cannot be read", got < 0 ? errno : EIO);
    done += got;
  }
  return bytes;
}

}  // namespace roomtex
