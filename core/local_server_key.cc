#include "core/local_server_key.h"

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr size_t kTokenBytes = 20;

// Tells folders apart; the file itself holds the path, too, so that two of one number do not share.
uint64_t HashOf(const std::string& text) {
  uint64_t hash = 14695981039346656037u;  // FNV-1a
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return hash;
}

std::string KeyFolder() {
  const char* const state = std::getenv("XDG_STATE_HOME");
  const char* const home = std::getenv("HOME");
  if (state != nullptr && state[0] == '/') return std::string(state) + "/roomtex/keys";
  if (home != nullptr && home[0] == '/') return std::string(home) + "/.local/state/roomtex/keys";
  return "";
}

bool IsToken(const std::string& text) {
  return text.size() == 2 * kTokenBytes &&
         text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// The token in a key file; "" unless it is ours alone and for this place.
std::string ReadKey(const std::string& file, const std::string& place) {
  struct stat status {};
  if (lstat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return "";
  if (status.st_uid != geteuid() || (status.st_mode & 077) != 0) return "";
  std::ifstream stream(file);
  std::string token, written_place;
  std::getline(stream, token);
  std::getline(stream, written_place, '\0');
  return IsToken(token) && written_place == place ? token : "";
}

}  // namespace

std::string MakeToken() {
  std::array<unsigned char, kTokenBytes> bytes;
  size_t size = 0;
  while (size < bytes.size()) {
    const ssize_t got = getrandom(bytes.data() + size, bytes.size() - size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw std::runtime_error("the operating system gives no random numbers");
    size += static_cast<size_t>(got);
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    token += "0123456789abcdef"[byte >> 4];
    token += "0123456789abcdef"[byte & 15];
  }
  return token;
}

std::string KeptToken(const std::string& path) {
  std::error_code error;
  const std::string place = fs::weakly_canonical(path, error).string(), folder = KeyFolder();
  if (error || folder.empty()) return "";
  const std::string file = folder + "/" + fmt::format("{:016x}", HashOf(place));
  const std::string kept = ReadKey(file, place);
  if (!kept.empty()) return kept;
  fs::create_directories(folder, error);
  fs::permissions(folder, fs::perms::owner_all, error);
  fs::remove(file, error);
  const std::string token = MakeToken(), text = token + "\n" + place;
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor < 0) return ReadKey(file, place);  // somebody else was quicker, or no rights
  const bool written =
      write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  close(descriptor);
  return written ? token : "";
}

}  // namespace roomtex
