#include "importers/file_reader.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "core/input_guard.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr int64_t kBlockSize = 1 << 20;

}  // namespace

FileReader::FileReader(const std::string& path) : path_(path) {
  RequireFile(path, "Give the path of a scan file");
  NoteInput(path);
  fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (fd_ < 0 || ::fstat(fd_, &status) != 0) {
    const std::string reason = std::strerror(errno);
    if (fd_ >= 0) ::close(fd_);
    throw InputError(path, "", "cannot be opened (" + reason + ")",
                     "Check the path and its rights");
  }
  size_ = status.st_size;
}

FileReader::~FileReader() { ::close(fd_); }

void FileReader::Read(int64_t offset, void* target, int64_t num_bytes) const {
  char* bytes = static_cast<char*>(target);
  while (num_bytes > 0) {
    const ssize_t got = ::pread(fd_, bytes, static_cast<size_t>(num_bytes), offset);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw InputError(path_, BytePosition(offset),
                       std::string("cannot be read (") + std::strerror(errno) + ")",
                       "Check the disk");
    }
    if (got == 0) {
      throw InputError(path_, BytePosition(offset),
                       "the file ends, expected " + std::to_string(num_bytes) + " more bytes",
                       "The file is cut off: copy it again");
    }
    bytes += got;
    offset += got;
    num_bytes -= got;
  }
}

std::string FileReader::ReadSome(int64_t offset, int64_t max_bytes) const {
  const int64_t num_bytes = std::clamp<int64_t>(size_ - offset, 0, max_bytes);
  std::string bytes(static_cast<size_t>(num_bytes), '\0');
  Read(offset, bytes.data(), num_bytes);
  return bytes;
}

LineReader::LineReader(const FileReader& file, int64_t offset)
    : file_(file),
      block_(static_cast<size_t>(std::clamp<int64_t>(file.size() - offset, 1, kBlockSize))),
      block_offset_(offset) {
  if (offset == 0) block_offset_ = static_cast<int64_t>(SizeOfByteOrderMark(file.ReadSome(0, 3)));
}

bool LineReader::Refill() {
  std::memmove(block_.data(), block_.data() + begin_, end_ - begin_);
  block_offset_ += static_cast<int64_t>(begin_);
  end_ -= begin_;
  begin_ = 0;
  const int64_t next = block_offset_ + static_cast<int64_t>(end_);
  const int64_t space = static_cast<int64_t>(block_.size() - end_);
  const int64_t num_bytes = std::min(space, file_.size() - next);
  if (num_bytes <= 0) return false;
  file_.Read(next, block_.data() + end_, num_bytes);
  end_ += static_cast<size_t>(num_bytes);
  return true;
}

bool LineReader::Next(std::string_view* line) {
  if (line_end_ == 0) {
    Refill();
    line_end_ = LineEndOf({block_.data(), end_});
  }
  size_t searched = begin_;
  const char* newline = nullptr;
  while (true) {
    newline =
        static_cast<const char*>(std::memchr(block_.data() + searched, line_end_, end_ - searched));
    if (newline != nullptr) break;
    const size_t pending = end_ - begin_;
    if (pending == static_cast<size_t>(kBlockSize)) {
      throw InputError(file_.path(), LinePosition(line_number_ + 1),
                       "is longer than a megabyte, expected a line of text",
                       "The file is damaged or of another kind");
    }
    const bool more = Refill();
    if (!more) break;
    searched = begin_ + pending;
  }
  if (newline == nullptr && begin_ == end_) return false;
  const char* first = block_.data() + begin_;
  const char* last = newline != nullptr ? newline : block_.data() + end_;
  begin_ = static_cast<size_t>(last - block_.data()) + (newline != nullptr ? 1 : 0);
  while (last > first && last[-1] == '\r') --last;
  *line = std::string_view(first, static_cast<size_t>(last - first));
  ++line_number_;
  return true;
}

char LineEndOf(std::string_view start) {
  const size_t newline = start.find('\n');
  std::string_view first = start.substr(0, newline);
  while (!first.empty() && first.back() == '\r') first.remove_suffix(1);
  const auto count = std::count(first.begin(), first.end(), '\r');
  // Binary data behind a header hold any byte, and one '\r' may have got into a line.
  return count >= (newline == std::string_view::npos ? 1 : 2) ? '\r' : '\n';
}

size_t SizeOfByteOrderMark(std::string_view start) {
  return start.substr(0, 3) == "\xEF\xBB\xBF" ? 3 : 0;
}

std::vector<std::string> WordsOf(std::string_view line) {
  std::vector<std::string> words;
  size_t at = 0;
  while ((at = line.find_first_not_of(" \t", at)) != std::string_view::npos) {
    const size_t end = std::min(line.find_first_of(" \t", at), line.size());
    words.emplace_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

bool ParseReal(std::string_view word, double* number) {
  if (word.substr(0, 1) == "+" && word.substr(1, 1) != "-") word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), *number);
  if (error == std::errc::result_out_of_range) {
    *number = std::strtod(std::string(word).c_str(), nullptr);
  } else if (error != std::errc()) {
    return false;
  }
  return end == word.data() + word.size();
}

bool HasDecimalCommas(std::string_view line) {
  if (line.find(',') == std::string_view::npos || line.find('.') != std::string_view::npos) {
    return false;
  }
  int num_numbers = 0;
  for (std::string& word : WordsOf(line)) {
    if (std::isalpha(static_cast<unsigned char>(word[0]))) continue;
    const size_t comma = word.find(',');
    if (comma == 0 || comma + 1 == word.size()) return false;
    if (comma != std::string::npos) word[comma] = '.';
    double number = 0;
    if (!ParseReal(word, &number)) return false;
    ++num_numbers;
  }
  return num_numbers >= 2;
}

std::string RemedyForLine(std::string_view line, const char* otherwise) {
  return HasDecimalCommas(line) ? "Its numbers have decimal commas: write them with points"
                                : otherwise;
}

}  // namespace roomtex
