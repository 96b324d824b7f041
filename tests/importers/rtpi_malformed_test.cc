// RTPI files that cannot be used: each gives one InputError that names the file and the place.

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/rtpi.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

class MalformedRtpi : public testing::Test {
 protected:
  // The message; "" if the file was read.
  std::string MessageOf(const std::string& bytes) {
    WriteBytes(folder_ / "bad.rtpi", bytes);
    try {
      ScanFromRtpi(ReadRtpi(folder_ / "bad.rtpi"), {});
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find(folder_ / "bad.rtpi"), 0u) << error.what();
      return error.what();
    }
    return "";
  }
  void ExpectError(const std::string& bytes, const std::string& text) {
    const std::string message = MessageOf(bytes);
    EXPECT_THAT(message, testing::HasSubstr(text));
  }
  std::string Good(bool big = false) {
    return Rtpi3Header(6, 5) + RtpiBody(MakeColumns(6, 5), big);
  }
  TempFolder folder_;
};

TEST_F(MalformedRtpi, IsRefusedWhereverItIsCutOff) {
  for (const bool big : {false, true}) {
    const std::string good = Good(big);
    ASSERT_EQ(MessageOf(good), "");
    for (size_t size = 0; size < good.size(); ++size) {
      EXPECT_NE(MessageOf(good.substr(0, size)), "") << "cut after byte " << size;
    }
    const std::string version2 = "RTPIv2 6 5\n" + RtpiBody(MakeColumns(6, 5), big);
    for (size_t size = 0; size < version2.size(); ++size) {
      EXPECT_NE(MessageOf(version2.substr(0, size)), "") << "cut after byte " << size;
    }
  }
}

TEST_F(MalformedRtpi, SaysAtWhichByteTheFileIsCutOff) {
  const std::string good = Good();
  const size_t last_count = good.size() - 5 * 16 - 4;
  ExpectError(good.substr(0, good.size() - 1), "byte " + std::to_string(last_count));
  ExpectError(good.substr(0, last_count + 2), "column 5 of 6");
}

TEST_F(MalformedRtpi, RefusesTrailingBytes) {
  for (const bool big : {false, true}) {
    const std::string good = Good(big);
    ExpectError(good + "x", "byte " + std::to_string(good.size()) + ": 1 bytes follow");
  }
}

TEST_F(MalformedRtpi, RefusesImpossibleColumnCounts) {
  const size_t body = Rtpi3Header(6, 5).size();
  for (const bool big : {false, true}) {
    for (const uint32_t count : {6u, 0xFFFFFFFFu, 0x80000000u, 0x7FFFFFFFu, 70000u}) {
      for (const int column : {0, 3}) {
        std::string bytes = Good(big), word;
        AppendWord(count, big, &word);
        const size_t at = body + static_cast<size_t>(column) * (4 + 5 * 16);
        bytes.replace(at, 4, word);
        ExpectError(bytes, "byte " + std::to_string(at) + ": ");
        ExpectError(bytes, "column " + std::to_string(column) + " has " +
                               std::to_string(static_cast<int32_t>(count)) + " samples");
      }
    }
  }
}

TEST_F(MalformedRtpi, RefusesAbsurdHeaderNumbersBeforeAnyAllocation) {
  const std::string body = RtpiBody(MakeColumns(6, 5), false);
  const auto with = [&](const std::string& columns, const std::string& samples) {
    std::string header = Rtpi3Header(6, 5);
    header.replace(header.find("columns: 6"), 10, "columns: " + columns);
    header.replace(header.find("column: 5"), 9, "column: " + samples);
    return header + body;
  };
  ExpectError(with("1000000000", "5"), "line 6: says 1000000000 columns");
  ExpectError(with("9223372036854775807", "5"), "line 6: says");
  ExpectError(with("99999999999999999999999", "5"), "line 6: num_columns is");
  ExpectError(with("-1", "5"), "line 6: num_columns is \"-1\"");
  ExpectError(with("", "5"), "line 6: num_columns is");
  ExpectError(with("six", "5"), "line 6: num_columns is \"six\"");
  ExpectError(with("1e9", "5"), "line 6: num_columns is");
  ExpectError(with("7", "5"), "column 6 of 7");
  ExpectError(with("5", "5"), "bytes follow the last of 5 columns");
  ExpectError(with("0", "5"), "bytes follow");
  ExpectError(with("6", "4"), "5 samples");
  ExpectError(with("6", "-3"), "line 7: max_samples_per_column");
  ExpectError(with("6", "1e400"), "line 7");
  ExpectError("RTPIv2 1000000000 5\n" + body, "line 1: says 1000000000 columns");
  ExpectError("RTPIv2 -6 5\n" + body, "line 1");
  ExpectError("RTPIv2 6\n" + body, "line 1");
  ExpectError("RTPIv2\n" + body, "line 1");
}

TEST_F(MalformedRtpi, RefusesAnglesThatAreNone) {
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(), -1e30f, 90};
  for (const float angle : bad) {
    for (const bool theta : {false, true}) {
      RawColumns columns = MakeColumns(6, 5);
      (theta ? columns[2][3].theta : columns[2][3].phi) = angle;
      const size_t byte = Rtpi3Header(6, 5).size() + 2 * (4 + 5 * 16) + 4 + 3 * 16;
      ExpectError(Rtpi3Header(6, 5) + RtpiBody(columns, false),
                  "byte " + std::to_string(byte) + " (column 2, sample 3)");
    }
  }
}

TEST_F(MalformedRtpi, RefusesAGridOutOfProportion) {
  RawColumns columns(50000);
  columns[0] = MakeColumns(1, 9)[0];
  for (int k = 1; k < 8; ++k) columns[0][k].phi = columns[0][k - 1].phi + 2e-7f;
  columns[0][8].phi = 1;
  ExpectError(Rtpi3Header(50000, 9) + RtpiBody(columns, false), "50000 columns by");
}

TEST_F(MalformedRtpi, RefusesAScanWithoutMeasuredSamples) {
  ExpectError(Rtpi3Header(6, 5) + RtpiBody(RawColumns(6), false), "no measured sample");
  RawColumns columns = MakeColumns(2, 2);
  for (auto& column : columns) {
    for (RawSample& sample : column) sample.range = 0;
  }
  ExpectError(Rtpi3Header(2, 2) + RtpiBody(columns, true), "no measured sample");
}

TEST_F(MalformedRtpi, TellsVersion1AndOtherFiles) {
  ExpectError("P9 640 480\n" + std::string(100, 'x'), "version 1");
  ExpectError("# made by\nP9 640 480\n", "line 2: is RTPI version 1");
  ExpectError("RTPI_version_4.0\n# --end_header--\n", "expected \"RTPI_version_3.0\"");
  ExpectError("", "does not begin with");
  ExpectError("# only\n# comments\n", "does not begin with");
  ExpectError(std::string(3 << 20, 'R'), "longer than a megabyte");
  ExpectError("RTPI_version_3.0\n" + std::string(3 << 20, '\n'), "does not end");
  ExpectError(Rtpi3Header(6, 5).substr(0, 200), "does not end");
  ExpectError("RTPI_version_3.0\n# --end_header--\n", "without the line \"# num_columns: N\"");
  std::string color = Good();
  color.replace(color.find("color: no"), 9, "color: on");
  ExpectError(color, "line 8: has_color is \"on\"");
}

TEST_F(MalformedRtpi, TellsAMissingFileAndAFolder) {
  EXPECT_INPUT_ERROR(ReadRtpi(folder_ / "none.rtpi"), "none.rtpi: does not exist");
  EXPECT_INPUT_ERROR(ReadRtpi(folder_.path()), "is a folder");
}

}  // namespace
}  // namespace roomtex
