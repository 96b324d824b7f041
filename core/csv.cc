#include "core/csv.h"

#include <algorithm>

#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr size_t kMaxLineLength = 64 * 1024;  // bytes; a longer line is none of a table
constexpr int kMaxLinesOfField = 8;

std::string Field(const std::string& text) {
  if (text.find_first_of(",\"#\r\n") == std::string::npos && text == Trimmed(text)) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

// Where the `#` is, from `at` on, that blanks part from what stands before it; the line's end if
// there is none.
size_t CommentIn(const std::string& line, size_t at) {
  for (at = line.find('#', at); at != std::string::npos; at = line.find('#', at + 1)) {
    if (at > 0 && (line[at - 1] == ' ' || line[at - 1] == '\t')) return at;
  }
  return line.size();
}

}  // namespace

CsvReader::CsvReader(const std::string& path, const std::string& remedy,
                     const std::string& expected)
    : path_(path), expected_(expected) {
  RequireFile(path, remedy);
  stream_.open(path, std::ios::binary);
  if (!stream_) throw InputError(path, "", "cannot be opened", "Check that you may read it");
}

bool CsvReader::NextLine(std::string* line) {
  if (!ahead_.empty()) {
    *line = ahead_.front();
    ahead_.pop_front();
    return true;
  }
  if (!std::getline(stream_, *line)) return false;
  ++lines_read_;
  if (lines_read_ == 1) DropByteOrderMark(line);
  if (line->size() > kMaxLineLength || line->find('\0') != std::string::npos) {
    line_number_ = lines_read_;
    throw Error("is not a line of a text file", expected_);
  }
  return true;
}

bool CsvReader::Next() {
  while (NextLine(&line_)) {
    line_number_ = lines_read_ - static_cast<long>(ahead_.size());
    std::string record = line_;
    line_ = Trimmed(line_);
    if (line_.empty() || line_[0] == '#') continue;
    if (Fields()) return true;
    // A quote that is still open: the field may end some lines below, or it is a mistake here.
    const std::string first = line_;
    std::vector<std::string> more;
    for (std::string line; static_cast<int>(more.size()) < kMaxLinesOfField && NextLine(&line);) {
      more.push_back(line);
      record += "\n" + line;
      line_ = Trimmed(record);
      if (Fields()) return true;
    }
    ahead_.insert(ahead_.begin(), more.begin(), more.end());
    line_ = first;
    return true;
  }
  if (stream_.bad()) {
    throw InputError(path_, "", "could not be read to its end", "Check the disk");
  }
  return false;
}

std::optional<std::vector<std::string>> CsvReader::Fields() const {
  std::vector<std::string> fields;
  for (size_t at = 0;; ++at) {
    while (at < line_.size() && (line_[at] == ' ' || line_[at] == '\t')) ++at;
    std::string field;
    const bool quoted = at < line_.size() && line_[at] == '"';
    if (quoted) {
      for (++at;; ++at) {
        if (at >= line_.size()) return std::nullopt;
        if (line_[at] == '"') {
          if (at + 1 >= line_.size() || line_[at + 1] != '"') break;
          ++at;
        }
        field += line_[at];
      }
      ++at;
    }
    const size_t comment = fields.size() >= comments_from_ ? CommentIn(line_, at) : line_.size();
    const size_t comma = std::min(line_.find(',', at), comment);
    const std::string rest = Trimmed(line_.substr(at, comma - at));
    if (quoted && !rest.empty()) return std::nullopt;
    fields.push_back(quoted ? field : rest);
    if (comma == comment) return fields;
    at = comma;
  }
}

InputError CsvReader::Error(const std::string& finding, const std::string& remedy) const {
  return InputError(path_, LinePosition(line_number_), finding, remedy);
}

std::string CsvLine(const std::vector<std::string>& fields) {
  std::string line;
  for (size_t i = 0; i < fields.size(); ++i) line += (i > 0 ? "," : "") + Field(fields[i]);
  return line + "\n";
}

}  // namespace roomtex
