#pragma once
// Tables with commas between their fields (CSV, RFC 4180). A field that holds a comma or a line end
// stands in double quotes, a quote in it is written twice; blanks around fields mean nothing. Blank
// lines and those that start with `#` are comments. UTF-8, with or without a byte order mark; lines
// end with LF or CR LF.

#include <deque>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {

// What editors of Windows put before the first line of a text.
inline void DropByteOrderMark(std::string* first_line) {
  if (BeginsWith(*first_line, "\xef\xbb\xbf")) first_line->erase(0, 3);
}

class CsvReader {
 public:
  // Throws InputError if the file cannot be opened; remedy: what to do if there is none. expected:
  // the remedy for a file that is no text, "Expected a CSV file with ...".
  CsvReader(const std::string& path, const std::string& remedy, const std::string& expected);

  // Goes to the next record that is no comment: a line, or several where a quoted field goes over
  // their ends; false behind the last one. Throws InputError for what is not a line of text, and
  // when the file cannot be read on.
  bool Next();

  // Blanks and `#` behind a field begin a comment to the line's end, from this field on (0 = the
  // first): names of photos may have a # of their own. Not asked for, none does.
  void CommentsFrom(size_t field) { comments_from_ = field; }

  long line_number() const { return line_number_; }        // its first line, from 1
  const std::string& line() const { return line_; }        // without blanks at its ends
  std::optional<std::vector<std::string>> Fields() const;  // none if a quote is not closed

  // An error in this line.
  InputError Error(const std::string& finding, const std::string& remedy) const;

 private:
  std::string path_, expected_;
  std::ifstream stream_;
  bool NextLine(std::string* line);

  size_t comments_from_ = std::numeric_limits<size_t>::max();
  std::string line_;
  long line_number_ = 0, lines_read_ = 0;
  std::deque<std::string> ahead_;  // read already, but not part of this record
};

// A record of a table: fields between commas, in quotes where a reader needs them, and a line feed.
// Read back, the fields are the same.
std::string CsvLine(const std::vector<std::string>& fields);

}  // namespace roomtex
