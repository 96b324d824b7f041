#pragma once
// The records of a compressed vector of an E57 file, read in blocks.

#include <cstdint>
#include <string>
#include <vector>

#include "importers/e57_document.h"
#include "importers/e57_pages.h"

namespace roomtex {

// Each field is a stream of bits of its own, cut into packets; the streams of a packet need not
// hold the same number of records. What is kept of the file is what streams are ahead of each
// other.
class E57Records {
 public:
  static constexpr int64_t kBlock = 4096;  // most records that are given at once

  // fields: indices into points.fields of those that are wanted; no strings. Both arguments must
  // outlive this. Throws InputError when the section cannot hold the records that are declared.
  E57Records(const E57Pages& pages, const E57Points& points, const std::vector<int>& fields);

  // Decodes the next records, at most kBlock; 0 when all were given. Throws InputError with the
  // byte.
  int64_t Next();
  // Value of each record given last, of the k-th wanted field: scaled.
  const double* Values(size_t k) const { return streams_[k].values.data(); }
  // Records that there are to be read: one if all are the same, as they take no bytes.
  int64_t num_records() const { return num_records_; }

 private:
  struct Stream {
    const E57Field* field;
    size_t number;            // in a packet
    std::vector<char> bytes;  // not decoded yet, and room for reading beyond
    size_t begin = 0;         // of the next value, in bits
    size_t end = 0;           // bytes
    std::vector<double> values;

    int64_t NumAvailable(int64_t at_most) const;
    void Append(const char* from, size_t count);
    void Decode(int64_t count);
  };

  void ReadSectionHeader();
  void CheckRecordCount() const;
  void ReadPacket();
  void TakeStreams(const std::vector<char>& packet);
  InputError Error(int64_t offset, const std::string& finding) const;

  const E57Pages& pages_;
  const E57Points& points_;
  std::vector<Stream> streams_;
  std::vector<char> packet_;
  int64_t next_packet_ = 0, section_end_ = 0;  // logical
  int64_t num_records_ = 0, num_given_ = 0;
};

}  // namespace roomtex
