#include "core/output_file.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/commit_together.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/partial_path.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr int kReaderPatienceMs = 3000;  // for a pipe to be read by somebody
constexpr int kReaderPollMs = 20;

InputError NotWritable(const std::string& path, int error) {
  return {path, "", std::string("cannot be written (") + std::strerror(error) + ")",
          "Check that the folder exists and that you may write in it"};
}

// A link that stands for something that is already open, such as /dev/stdout, or a file that is no
// regular one: never replaced. Not /dev/shm, which is a disk.
bool IsDevice(const std::string& path) {
  struct stat there {};
  if (stat(path.c_str(), &there) == 0 && !S_ISREG(there.st_mode) && !S_ISDIR(there.st_mode)) {
    return true;
  }
  std::error_code error;
  const fs::path parent = fs::path(path).parent_path();
  const std::string folder = fs::weakly_canonical(parent.empty() ? "." : parent, error).string();
  return folder == "/dev" || folder == "/proc" || BeginsWith(folder, "/proc/");
}

// The new file is as readable as the old one was.
void TakeOverRights(const std::string& old_path, int descriptor) {
  struct stat old {};
  if (lstat(old_path.c_str(), &old) != 0 || !S_ISREG(old.st_mode)) return;
  (void)!fchown(descriptor, old.st_uid, old.st_gid);  // root writes for others
  (void)!fchmod(descriptor, old.st_mode & 07777);
}

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

// A pipe without a reader would be waited for without end.
int OpenDevice(const std::string& path) {
  for (int waited = 0;; waited += kReaderPollMs) {
    const int device = open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (device >= 0) {
      fcntl(device, F_SETFL, fcntl(device, F_GETFL) & ~O_NONBLOCK);
      return device;
    }
    if (errno != ENXIO) throw NotWritable(path, errno);
    if (waited >= kReaderPatienceMs) {
      throw InputError(path, "", "is a pipe or socket that nobody reads from",
                       "Start the reader first, or give the path of a file");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(kReaderPollMs));
  }
}

void CopyToDevice(const std::string& from, const std::string& path) {
  const Descriptor device(OpenDevice(path));
  std::ifstream stream(from, std::ios::binary);
  char block[1 << 16];
  while (stream.read(block, sizeof(block)), stream.gcount() > 0) {
    for (std::streamsize done = 0; done < stream.gcount();) {
      const ssize_t count =
          write(device.number(), block + done, static_cast<size_t>(stream.gcount() - done));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) {
        throw InputError(
            path, "", std::string("could not be written to its end (") + std::strerror(errno) + ")",
            "Check the space on the disk, or the program that reads it");
      }
      done += count;
    }
  }
}

}  // namespace

OutputFile::OutputFile(const std::string& path) : path_(path) {
  RequireReplaceable(path);
  direct_ = IsDevice(path);
  std::error_code error;
  target_ = fs::absolute(path, error).string();
  const fs::path parent = direct_ ? fs::temp_directory_path(error) : fs::path(path).parent_path();
  try {
    partial_path_ =
        MakePartial(parent.string(), PartialKind::kFile, fs::path(path).extension().string());
  } catch (const std::system_error& failure) {
    throw NotWritable(path, failure.code().value());
  }
  stream_.open(partial_path_, std::ios::binary | std::ios::trunc);
  if (!stream_) throw NotWritable(path, errno);
}

OutputFile::~OutputFile() {
  stream_.close();
  RemovePartial(partial_path_);
}

std::ostream& OutputFile::stream() { return stream_; }

void OutputFile::Commit() {
  stream_.flush();
  bool whole = stream_.good();
  stream_.close();
  // Writers that go by the path may have made the file anew.
  const Descriptor written(open(partial_path_.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (written.number() >= 0 && !direct_) {
    whole &= fdatasync(written.number()) == 0 || errno == EINVAL || errno == EROFS;
    TakeOverRights(target_, written.number());
  }
  if (!whole || written.number() < 0) {
    throw InputError(path_, "", "could not be written to its end", "Check the space on the disk");
  }
  if (direct_) return CopyToDevice(partial_path_, path_);
  RefuseToReplaceInput(path_);
  const WholeFile file = {path_, target_, partial_path_};
  if (!CommitTogether::Take(file)) MoveToPlace(file);
  partial_path_.clear();
}

void MakeFolder(const std::string& path) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_directory(path, error)) {
    throw InputError(path, "", "is a file, expected a folder to write into",
                     "Give another --output_path");
  }
  fs::create_directories(path, error);
  if (error) {
    throw InputError(path, "", "cannot be made a folder (" + error.message() + ")",
                     "Check the path and that you may write there");
  }
  if (::access(path.c_str(), W_OK | X_OK) != 0) {
    throw InputError(path, "", "cannot be written into", "Check the rights of this folder");
  }
}

std::string PathInside(const std::string& folder, const std::string& name) {
  const fs::path inside = fs::path(name).lexically_normal();
  if (name.empty() || inside.is_absolute() || *inside.begin() == "..") {
    throw InputError(folder + "/" + name, "", "leads out of the folder to write into",
                     "Rename the image in the model");
  }
  const fs::path path = fs::path(folder) / inside;
  MakeFolder(path.parent_path().string());
  return path.string();
}

void RequireFile(const std::string& path, const std::string& remedy) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    throw InputError(path, "", "is a folder, expected a file", remedy);
  }
  if (!fs::exists(path, error)) throw InputError(path, "", "does not exist", remedy);
  if (!fs::is_regular_file(path, error)) {
    throw InputError(path, "", "is not a regular file", remedy);
  }
  if (::access(path.c_str(), R_OK) != 0) {
    throw InputError(path, "", "may not be read", "Check the rights of this file");
  }
}

void RequireFolder(const std::string& path, const std::string& remedy) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError(path, "", "does not exist", remedy);
  if (!fs::is_directory(path, error)) {
    throw InputError(path, "", "is a file, expected a folder", remedy);
  }
}

}  // namespace roomtex
