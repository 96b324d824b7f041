#pragma once
// Bytes and lines of a file, in large blocks and with checked positions: what the readers stand on.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/text.h"

namespace roomtex {

// The remedy for a file that contradicts itself.
inline constexpr char kDamaged[] = "The file is damaged: write it again";

// A file opened for reading at any position. All errors are InputErrors that name the file.
class FileReader {
 public:
  // Throws when the file is missing, a folder, not a regular file or may not be read.
  explicit FileReader(const std::string& path);
  ~FileReader();
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;

  const std::string& path() const { return path_; }
  int64_t size() const { return size_; }

  // Reads exactly num_bytes at `offset`; throws when they are not there.
  void Read(int64_t offset, void* target, int64_t num_bytes) const;
  // At most max_bytes from `offset`, fewer at the end of the file.
  std::string ReadSome(int64_t offset, int64_t max_bytes) const;

 private:
  std::string path_;
  int fd_ = -1;
  int64_t size_ = 0;
};

// Bytes of the mark that some programs put before UTF-8; 0 without one.
size_t SizeOfByteOrderMark(std::string_view start);

// What ends the lines of a text that begins so: '\n', or '\r' where several stand before the first
// '\n' or there is none, as in files of old Macs.
char LineEndOf(std::string_view start);

// The lines of a text file one after the other, without their line ends (LF, CR LF, CR CR LF, or CR
// alone in all of it).
class LineReader {
 public:
  // The file must outlive this. `offset` is where line 1 starts;
  // a byte order mark at the start of the file is passed over.
  explicit LineReader(const FileReader& file, int64_t offset = 0);

  // Gives the next line, valid until the next call; false at the end of the file.
  // Throws when a line is longer than a megabyte: that is no text file.
  bool Next(std::string_view* line);
  // Of the line given last, from 1.
  long line_number() const { return line_number_; }
  // Where the next line starts.
  int64_t offset() const { return block_offset_ + static_cast<int64_t>(begin_); }
  int64_t BytesLeft() const { return file_.size() - offset(); }

 private:
  bool Refill();

  const FileReader& file_;
  std::vector<char> block_;
  int64_t block_offset_;  // of block_[0] in the file
  size_t begin_ = 0, end_ = 0;
  char line_end_ = 0;  // not known yet
  long line_number_ = 0;
};

// What stands between blanks and tabs.
std::vector<std::string> WordsOf(std::string_view line);

// A word that is a number, with a sign or without. What no double holds is 0 or infinite, as it is
// too small or too large.
bool ParseReal(std::string_view word, double* number);

// Commas stand in place of the decimal point, as in "1,5 2,5": of two words or more, besides those
// that begin with a letter, all are numbers then, and none has a point.
bool HasDecimalCommas(std::string_view line);
// The remedy for a line of text that cannot be read: what is to be done about such commas, else
// `otherwise`.
std::string RemedyForLine(std::string_view line, const char* otherwise = kDamaged);

// As core/text.h has it.
inline std::string Quoted(std::string_view text) { return Quoted(std::string(text)); }

}  // namespace roomtex
