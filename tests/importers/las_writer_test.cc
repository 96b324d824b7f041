#include "importers/las_writer.h"

#include <gmock/gmock.h>

#include "importers/las.h"
#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const char kSystem[] =
    "PROJCS[\"ETRS89 / UTM 33N\",GEOGCS[\"ETRS89\",DATUM[\"D\",SPHEROID[\"GRS 1980\",6378137,"
    "298.257]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],"
    "PROJECTION[\"Transverse_Mercator\"],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25833\"]]";

class LasWriter : public testing::Test {
 protected:
  LasWriter() {
    scan_.organised = false;
    scan_.points = {{412345.12341, 5654321.5, 99}, Scan::MissingPoint(), {412350, 5654300, -3.25}};
    scan_.intensity = {0.25f, 0, 1};
  }
  void AddColors() { scan_.colors = {{255, 0, 7}, {0, 0, 0}, {1, 2, 3}}; }

  // What the other reader prints of the file.
  std::string ByTheOther(const std::string& name) const {
    const CommandResult result =
        RunProgram(std::string("python3 ") + ROOMTEX_READ_LAS + " " + (folder_ / name));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out;
  }
  std::string Write(const std::string& version, const std::string& system = "") {
    WriteLas({&scan_, &scan_}, folder_ / "b.las", {version}, system);
    return ByTheOther("b.las");
  }

  Scan scan_;
  TempFolder folder_;
};

TEST_F(LasWriter, IntensitiesOfEveryRangeKeepTheirOrder) {
  const auto intensities = [this](std::vector<float> given) {
    scan_.points.assign(given.size(), {1, 2, 3});
    scan_.intensity = std::move(given);
    WriteLas({&scan_}, folder_ / "i.las", {"1.2"}, "");
    return ReadLas(folder_ / "i.las", {}).intensity;
  };
  EXPECT_THAT(intensities({0, 7, 65535}), ElementsAre(0, 7, 65535));
  EXPECT_THAT(intensities({0, 0.5f, 1}), ElementsAre(0, 32768, 65535));
  EXPECT_THAT(intensities({-2048, -1024, 2048}), ElementsAre(0, 16384, 65535));  // of a PTS
  EXPECT_THAT(intensities({-20, -5, 0}), ElementsAre(0, 49151, 65535));          // dB
  EXPECT_THAT(intensities({0.25f, 0.5f, 1.25f}), ElementsAre(13107, 26214, 65535));
  EXPECT_THAT(intensities({0, 131070}), ElementsAre(0, 65535));
}

TEST_F(LasWriter, EveryVersionIsReadAsItWasWrittenByUsAndByAnother) {
  for (const std::string version : {"1.2", "1.3", "1.4"}) {
    for (const bool colored : {false, true}) {
      scan_.colors.clear();
      if (colored) AddColors();
      const bool recent = version == "1.4";
      const std::string format = recent ? (colored ? "7" : "6") : colored ? "2" : "0";
      const std::string first = "412345.1234 5654321.5000 99.0000 16384" +
                                std::string(colored ? " 65535 0 1799\n" : "\n");
      const std::string second =
          "412350.0000 5654300.0000 -3.2500 65535" + std::string(colored ? " 257 514 771\n" : "\n");
      EXPECT_EQ(Write(version), version + " format " + format + " wkt " + (recent ? "1" : "0") +
                                    " points 4\n" + first + second + first + second);
      LasOptions options;
      options.colors = true;
      const Scan again = ReadLas(folder_ / "b.las", options);
      ASSERT_EQ(again.points.size(), 4u);
      EXPECT_LT((again.points[0] - scan_.points[0]).norm(), 6e-5);
      EXPECT_LT((again.points[3] - scan_.points[2]).norm(), 6e-5);
      EXPECT_EQ(again.intensity[0], 16384);
      EXPECT_EQ(again.intensity[1], 65535);
      ASSERT_EQ(again.colors.size(), colored ? 4u : 0u);
      if (colored) {
        EXPECT_EQ(again.colors[1], scan_.colors[2]);
      }
    }
  }
}

TEST_F(LasWriter, TheCoordinateSystemGoesIntoLas14) {
  EXPECT_THAT(Write("1.2", kSystem), Not(HasSubstr("PROJCS")));
  EXPECT_THAT(Write("1.3", kSystem), Not(HasSubstr("PROJCS")));
  EXPECT_THAT(Write("1.4", kSystem),
              HasSubstr(std::string("LASF_Projection 2112 ") + kSystem + "\n"));
  const ScanFile again = ReadScanFile(folder_ / "b.las", {});
  EXPECT_EQ(again.coordinate_system, kSystem);
  EXPECT_THAT(again.notes, IsEmpty());
}

TEST_F(LasWriter, ALongCoordinateSystemStandsBehindThePoints) {
  const std::string remarks(80000, 'r');  // longer than a record before the points can be
  const std::string system = "COMPD_CS[\"" + remarks + "\"," + kSystem + "]";
  EXPECT_THAT(Write("1.4", system),
              HasSubstr(std::string("LASF_Projection 2112 ") + system + "\n"));
  const ScanFile again = ReadScanFile(folder_ / "b.las", {});
  EXPECT_EQ(again.coordinate_system, system);
  EXPECT_EQ(again.scans[0].points.size(), 4u);
}

TEST_F(LasWriter, RoomtexImportKeepsTheCoordinateSystemWhereTheCoordinatesStay) {
  Write("1.4", kSystem);
  const auto convert = [this](const std::string& more) {
    const CommandResult result =
        RunCommandLine("roomtex-import --input_path " + (folder_ / "b.las") + " --output_path " +
                       (folder_ / "c.las") + " " + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  EXPECT_THAT(convert("--Las.version 1.4"), Not(HasSubstr("coordinate system")));
  EXPECT_EQ(ByTheOther("c.las"), ByTheOther("b.las"));
  EXPECT_THAT(convert(""), HasSubstr("c.las is without the coordinate system of the input"));
  EXPECT_THAT(ByTheOther("c.las"), HasSubstr("1.2 format 0 wkt 0 points 4\n4123"));
  // As something else than what the file says.
  convert("--Las.version 1.4 --units feet");
  EXPECT_THAT(ByTheOther("c.las"), Not(HasSubstr("PROJCS")));
  const CommandResult wrong =
      RunCommandLine("roomtex-import --input_path " + (folder_ / "b.las") + " --output_path " +
                     (folder_ / "c.las") + " --Las.version 1.5");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--Las.version"));
}

TEST_F(LasWriter, AScanWithoutColoursBesideOneWithThemIsBlack) {
  Scan plain = scan_;
  AddColors();
  WriteLas({&plain, &scan_}, folder_ / "b.las", {"1.4"});
  EXPECT_THAT(ByTheOther("b.las"), HasSubstr("99.0000 16384 0 0 0\n"));
  EXPECT_THAT(ByTheOther("b.las"), HasSubstr("99.0000 16384 65535 0 1799\n"));
}

}  // namespace
}  // namespace roomtex
