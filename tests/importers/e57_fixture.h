#pragma once
// Tests of the E57 reader: files of a few bytes, written, read, and refused.

#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/e57.h"
#include "tests/importers/e57_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

class E57 : public testing::Test {
 protected:
  std::vector<Scan> Read(const std::string& bytes, const std::string& part = "",
                         const E57Options& options = {}) {
    WriteBytes(folder_ / "site.e57", bytes);
    notes_.clear();
    return ReadE57(folder_ / "site.e57", part, options, &notes_);
  }
  // One scan of single floats.
  static std::string Cloud(const std::vector<Eigen::Vector3f>& points, const std::string& more,
                           size_t piece = 5000) {
    std::vector<std::string> streams(3);
    for (const Eigen::Vector3f& point : points) {
      for (int i = 0; i < 3; ++i) streams[i] += Bytes(point[i]);
    }
    E57Bytes file;
    const uint64_t offset = file.AddPoints(streams, piece);
    return file.Finish(E57Xml(ScanXml(offset, points.size(), SinglesXml(), more)));
  }
  void ExpectError(const std::string& bytes, const std::string& message) {
    EXPECT_INPUT_ERROR(Read(bytes), message);
    EXPECT_INPUT_ERROR(Read(bytes), folder_ / "site.e57");
  }
  TempFolder folder_;
  std::vector<std::string> notes_;
};

}  // namespace roomtex
