// A site of two rooms on Snakemake, as docs/site.md has it: one that can be trusted, with its
// matches made in parts, and one whose photos show nothing in common; and of two rooms that share
// photos. Label `slow`.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/text.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class SiteWorkflow : public testing::Test {
 protected:
  void SetUp() override {
    if (RunProgram("snakemake --version").exit_code != 0) {
      GTEST_SKIP() << "Snakemake is not installed (scripts/setup.sh --site)";
    }
  }
  CommandResult RunSite(const std::string& more = "", const std::string& bin = BinFolder()) {
    const std::string site = ROOMTEX_SITE_FOLDER;
    CommandResult result = RunProgram(
        "snakemake -s " + site + "/Snakefile --profile " + site + "/local --directory " +
        folder_.path() +
        " --cores 2 --config photos_per_part=6 'options=--quality low' bin=" + bin + " " + more);
    result.err += result.out;
    return result;
  }
  void Simulate(const std::string& room, const std::string& options) {
    const CommandResult result = RunCommandLine("roomtex-simulate --quiet --output_path " +
                                                (folder_ / room) + " " + options);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  std::string At(const std::string& name) { return folder_ / ("result/" + name); }

  TempFolder folder_;
};

// A PTX file whose station stands in the identity, moved: its lines 3 to 10 are the station and its
// axes, and the same as a matrix of rows.
std::string TurnedPtx(const std::string& ptx, const Eigen::Isometry3d& moved) {
  std::istringstream in(ptx);
  std::ostringstream out;
  out.precision(12);
  std::string line;
  for (int i = 0; i < 2; ++i) out << (std::getline(in, line), line) << "\n";
  for (int i = 0; i < 8; ++i) std::getline(in, line);
  const Eigen::Matrix4d rows = moved.matrix().transpose();
  for (const int row : {3, 0, 1, 2}) out << rows.row(row).head<3>() << "\n";
  out << rows << "\n" << in.rdbuf();
  return out.str();
}

// The picks with their places in the scan moved; `picked`: the photo of the last one.
std::string TurnedPicks(const std::string& picks, const Eigen::Isometry3d& moved,
                        std::string* picked) {
  std::istringstream in(picks);
  std::ostringstream out;
  for (std::string line; std::getline(in, line);) {
    double x, y;
    Eigen::Vector3d p;
    char name[64];
    if (std::sscanf(line.c_str(), "%63[^,],%lf,%lf,%lf,%lf,%lf", name, &x, &y, &p.x(), &p.y(),
                    &p.z()) != 6) {
      out << line << "\n";
      continue;
    }
    *picked = name;
    p = moved * p;
    out << name << "," << x << "," << y << "," << p.x() << "," << p.y() << "," << p.z() << "\n";
  }
  return out.str();
}

TEST_F(SiteWorkflow, GoesOnWithTheOtherRoomsAndDoesNothingTwice) {
  Simulate(
      "a",
      "--random_seed 1 --num_photos 12 --photo_width 640 --photo_height 427 --scan_columns 500 "
      "--scan_rows 200");
  Simulate("b",
           "--random_seed 9 --num_photos 3 --photo_width 240 --photo_height 160 --scan_columns 200 "
           "--scan_rows 80");
  WriteBytes(folder_ / "site.csv",
             "room,photos,scans,notes,picks,cameras,options\n"
             "hall,a/photos,a/scan.rtpi,\"north, first\",a/picks.csv,a/cameras.txt,--pairs 1\n"
             "closet,b/photos,b/scan.rtpi,,,,\n");
  const CommandResult first = RunSite();
  EXPECT_NE(first.exit_code, 0);
  EXPECT_THAT(first.err, HasSubstr("Error in rule mapper"));
  const json site = json::parse(ReadBytes(At("site.json")));
  EXPECT_EQ(site["counts"]["trusted"], 1);
  EXPECT_EQ(site["counts"]["failed"], 1);
  EXPECT_EQ(site["rooms"][0]["notes"], "north, first");
  EXPECT_THAT(site["rooms"][1]["sentences"][0].get<std::string>(), HasSubstr("matches"));
  EXPECT_EQ(ReadBytes(At("hall/log/pictures.state")), "done\n");
  // The step matches found all its pairs matched by the two parts, which are gone.
  EXPECT_THAT(ReadBytes(At("hall/log/parts.run.log")), HasSubstr("from 2 copies"));
  EXPECT_THAT(ReadBytes(At("hall/log/matches.log")), HasSubstr("Matching block [1/1] in 0.00"));
  EXPECT_FALSE(fs::exists(At("hall/parts/1.db")));

  // The failed room is not to be trusted now: its state says so, nobody tries it again.
  const auto model = fs::last_write_time(At("hall/textured/model.glb"));
  for (const char* step : {"mapper", "align", "texture", "pictures"}) {
    WriteBytes(At(std::string("closet/log/") + step + ".state"), "untrusted\n");
  }
  const CommandResult second = RunSite();
  EXPECT_EQ(second.exit_code, 0) << second.err;
  EXPECT_THAT(second.err, HasSubstr("Nothing to be done"));
  EXPECT_EQ(fs::last_write_time(At("hall/textured/model.glb")), model);

  // Picks that were made for it let it go on from align, where its state is passed on.
  fs::copy_file(folder_ / "b/picks.csv", At("closet/picks.csv"));
  const CommandResult third = RunSite("-n");
  EXPECT_THAT(third.err, HasSubstr("rule align"));
  EXPECT_THAT(third.err, Not(HasSubstr("rule mapper")));
  EXPECT_THAT(third.err, Not(HasSubstr("room=hall")));
}

// An E57 that brings its own photos needs none beside it: neither in a table nor in a folder.
TEST_F(SiteWorkflow, ARoomMayHaveNoPhotosButTheScanners) {
  Simulate("made",
           "--num_photos 4 --photo_width 240 --photo_height 160 --scan_columns 200 --scan_rows 80");
  const CommandResult written = RunCommandLine(
      "roomtex-texture --quiet --Texture.scale 1 --output_e57 1 --E57.images 1 --input_path " +
      (folder_ / "made/truth") + " --image_path " + (folder_ / "made/photos") + " --scan_path " +
      (folder_ / "made/scan.rtpi") + " --output_path " + (folder_ / "made/coloured"));
  ASSERT_EQ(written.exit_code, 0) << written.err;
  const std::string e57 = ReadBytes(folder_ / "made/coloured/model.e57");
  fs::remove_all(folder_ / "made");
  fs::create_directories(folder_ / "hall");
  WriteBytes(folder_ / "hall/site.e57", e57);

  const CommandResult run = RunSite();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(ReadBytes(At("hall/log/pictures.state")), "done\n");
  EXPECT_FALSE(fs::exists(At("hall/log/features.state")));
  EXPECT_TRUE(fs::exists(At("hall/textured/model.glb")));
  const json site = json::parse(ReadBytes(At("site.json")));
  ASSERT_EQ(site["rooms"].size(), 1u);
  EXPECT_EQ(site["rooms"][0]["name"], "hall");
  EXPECT_EQ(site["rooms"][0]["state"], "trusted");

  WriteBytes(folder_ / "site.csv", "room,photos,scans\nhall,,hall/site.e57\n");
  EXPECT_THAT(RunSite("-n").err, HasSubstr("Nothing to be done"));
}

// What one scanner saw, taken for two rooms: the second has its scan in a frame of its own, which
// is known, and every third photo in common with the first.
TEST_F(SiteWorkflow, JoinsTwoRoomsByThePhotosThatTheyShare) {
  Simulate(
      "a",
      "--random_seed 1 --num_photos 18 --photo_width 640 --photo_height 427 --scan_columns 500 "
      "--scan_rows 200");
  const Eigen::Isometry3d b_from_a =
      Eigen::Translation3d(3, -2, 0.5) * Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitY());
  ASSERT_EQ(RunCommandLine("roomtex-import --quiet --input_path " + (folder_ / "a/scan.rtpi") +
                           " --output_path " + (folder_ / "a.ptx"))
                .exit_code,
            0);
  fs::create_directories(folder_ / "b/photos");
  WriteBytes(folder_ / "b/scan.ptx", TurnedPtx(ReadBytes(folder_ / "a.ptx"), b_from_a));
  std::string picked;
  WriteBytes(folder_ / "b/picks.csv",
             TurnedPicks(ReadBytes(folder_ / "a/picks.csv"), b_from_a, &picked));
  const int shared = std::stoi(picked.substr(6, 3)) % 3;  // photo_007.jpg
  for (int i = 0; i < 18; ++i) {
    char name[32];
    std::snprintf(name, sizeof(name), "photo_%03d.jpg", i);
    const fs::path photo = folder_ / ("a/photos/" + std::string(name));
    if (i % 3 != (shared + 1) % 3)
      fs::copy_file(photo, folder_ / ("b/photos/" + std::string(name)));
    if (i % 3 == (shared + 2) % 3) fs::remove(photo);
  }
  WriteBytes(folder_ / "site.csv",
             "room,photos,scans,picks,cameras\n"
             "hall,a/photos,a/scan.rtpi,a/picks.csv,a/cameras.txt\n"
             "library,b/photos,b/scan.ptx,b/picks.csv,a/cameras.txt\n");
  const CommandResult run = RunSite();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json joined = json::parse(ReadBytes(At("joined/joined.json")));
  EXPECT_EQ(joined["trusted"], true) << joined["reason"];
  ASSERT_EQ(joined["links"].size(), 1u);
  EXPECT_GE(joined["links"][0]["num_agreeing"], 4);
  EXPECT_EQ(joined["rooms"][1]["name"], "library");
  const json& rows = joined["rooms"][1]["site_from_room"];
  Eigen::Isometry3d a_from_b = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      a_from_b(row, column) = rows[row][column].get<double>();
    }
  }
  // Where the second room's photos are: within a few metres of its station.
  const Eigen::Isometry3d off = a_from_b * b_from_a;
  EXPECT_LT((off * Eigen::Vector3d(1, 1, 1) - Eigen::Vector3d(1, 1, 1)).norm(), 0.015);
  EXPECT_LT(Eigen::AngleAxisd(off.rotation()).angle(), 0.003);
  const json site = json::parse(ReadBytes(At("site.json")));
  EXPECT_EQ(site["counts"]["trusted"], 2);
}

// What every job of a dry run asks for, by its rule.
std::map<std::string, int> AskedOf(const std::string& dry_run, const std::string& resource) {
  std::map<std::string, int> asked;
  std::istringstream lines(dry_run);
  std::string rule;
  for (std::string line; std::getline(lines, line);) {
    if (BeginsWith(line, "rule ")) rule = line.substr(5, line.find(':') - 5);
    const size_t at = line.find(" " + resource + "=");
    if (line.find("resources:") == std::string::npos || at == std::string::npos) continue;
    asked[rule] = std::stoi(line.substr(at + resource.size() + 2));
  }
  return asked;
}

// Programs in place of those that take time: the room `attic` is not to be trusted, and what is to
// be joined is written down.
TEST_F(SiteWorkflow, DoesNotJoinRoomsIntoAFrameThatIsNotThere) {
  const auto add_program = [this](const std::string& name, const std::string& script) {
    fs::create_directories(folder_ / "bin");
    WriteBytes(folder_ / ("bin/" + name), "#!/bin/sh\n" + script);
    fs::permissions(folder_ / ("bin/" + name), fs::perms::owner_all);
  };
  add_program("roomtex-auto", "case \"$*\" in *result/attic*align*) exit 4;; esac\n");
  const std::string joined_rooms =
      R"({"trusted": true, "reason": "", "rooms": [], "links": [], "loops": [], "scene": null})";
  add_program("roomtex-join", "echo \"$*\" >>" + (folder_ / "joins") + "\necho '" + joined_rooms +
                                  "' >" + At("joined/joined.json") + "\n");
  fs::create_symlink(BinFolder() + "/roomtex-site", folder_ / "bin/roomtex-site");
  std::string table = "room,photos,scans\n";
  for (const char* room : {"hall", "attic", "cellar"}) {
    fs::create_directories(folder_ / ("photos/" + std::string(room)));
    table += std::string(room) + ",photos/" + room + ",s.rtpi\n";
  }
  WriteBytes(folder_ / "site.csv", table);
  WriteBytes(folder_ / "s.rtpi", "a scan");
  // Of an earlier run, when the attic was trusted.
  fs::create_directories(At("joined"));
  WriteBytes(At("joined/joined.json"), R"({"reference": "attic", "rooms": [{"name": "hall"}]})");
  WriteBytes(At("joined/hall.txt"), "a matrix");
  const CommandResult result = RunSite("reference=attic", folder_ / "bin");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_FALSE(fs::exists(folder_ / "joins"));
  EXPECT_FALSE(fs::exists(At("joined/hall.txt")));
  const json joined = json::parse(ReadBytes(At("joined/joined.json")));
  EXPECT_EQ(joined["trusted"], false);
  EXPECT_THAT(ReadBytes(At("site.html")),
              HasSubstr("The reference attic is not aligned so that it can be trusted"));
  // Without it the first of those that are.
  EXPECT_EQ(RunSite("", folder_ / "bin").exit_code, 0);
  EXPECT_THAT(ReadBytes(folder_ / "joins"),
              HasSubstr("--input_path=result/hall/aligned --input_path=result/cellar/aligned"));
  const CommandResult stranger = RunSite("reference=tower", folder_ / "bin");
  EXPECT_NE(stranger.exit_code, 0);
  EXPECT_THAT(stranger.err, HasSubstr("reference=tower is no room of the site"));
}

TEST_F(SiteWorkflow, AsksForTwiceTheMemoryAndTimeWithEveryTry) {
  Simulate("a",
           "--num_photos 8 --photo_width 240 --photo_height 160 --scan_columns 200 --scan_rows 80");
  // Its matches in two parts, so that every rule is there.
  WriteBytes(folder_ / "site.csv",
             "room,photos,scans,options\nhall,a/photos,a/scan.rtpi,--pairs 1\n");
  std::vector<std::map<std::string, int>> megabytes, minutes;
  for (const char* attempt : {"1", "2", "3"}) {
    const CommandResult run = RunSite(std::string("max_mem_mb=1700 -n --attempt ") + attempt);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    megabytes.push_back(AskedOf(run.err, "mem_mb"));
    minutes.push_back(AskedOf(run.err, "runtime"));
  }
  for (const char* rule : {"features", "pairs", "part", "parts", "matches", "mapper", "align",
                           "texture", "pictures"}) {
    ASSERT_EQ(megabytes[0].count(rule), 1u) << rule;
    const int first = megabytes[0][rule];
    EXPECT_GT(first, 100) << rule;
    EXPECT_LT(first, 1700) << rule;
    EXPECT_EQ(megabytes[1][rule], std::min(2 * first, 1700)) << rule;
    EXPECT_EQ(megabytes[2][rule], std::min(4 * first, 1700)) << rule;
    EXPECT_EQ(minutes[1][rule], 2 * minutes[0][rule]) << rule;
    EXPECT_EQ(minutes[2][rule], 4 * minutes[0][rule]) << rule;
  }
}

// What is named in the options is an input, too; what lies beside photos is none.
TEST_F(SiteWorkflow, SeesWhatHasChangedAmongTheOptions) {
  for (const char* folder : {"p", "pano"}) fs::create_directories(folder_ / folder);
  for (const char* file : {"p/a.jpg", "pano/b.jpg", "s.ptx", "poses.csv"}) {
    WriteBytes(folder_ / file, "1\n");
  }
  WriteBytes(folder_ / "site.csv",
             "room,photos,scans,options\na,p,s.ptx,--scan_poses=poses.csv\n"
             "b,,s.ptx,--panoramas_path pano\n");
  // As if all had been done.
  const std::vector<const char*> steps = {"features", "matches", "mapper",
                                          "align",    "texture", "pictures"};
  for (const char* room : {"a", "b"}) {
    for (const char* step : steps) {
      const std::string log = std::string(room) + "/log/";
      fs::create_directories(At(log));
      WriteBytes(At(log + step + ".state"), "done\n");
    }
  }
  const auto reasons = [this] { return RunSite("-n --rerun-triggers mtime").err; };
  EXPECT_THAT(reasons(), HasSubstr("Nothing to be done"));
  const auto touch = [this](const char* file) {
    WriteBytes(folder_ / file, "2\n");
    fs::last_write_time(folder_ / file, fs::file_time_type::clock::now() + std::chrono::hours(1));
  };
  touch("p/.DS_Store");
  touch("pano/notes.txt");
  EXPECT_THAT(reasons(), HasSubstr("Nothing to be done"));
  touch("poses.csv");
  EXPECT_THAT(reasons(), HasSubstr("Updated input files: poses.csv"));
  touch("pano/b.jpg");
  EXPECT_THAT(reasons(), HasSubstr("Updated input files: pano/b.jpg"));
}

TEST_F(SiteWorkflow, SaysWhatIsWrongWithTheTable) {
  EXPECT_THAT(RunSite("-n").err, HasSubstr("is no site"));
  fs::create_directories(folder_ / "p");
  WriteBytes(folder_ / "s.ptx", "1\n");
  for (const auto& [table, finding] : {
           std::pair{"room,photos\n", "no column \"scans\""},
           {"room,photos,scans,colour\n", "column \"colour\" is not known"},
           {"room,photos,scans\na,p,s.ptx\na,p,s.ptx\n", "line 3: room \"a\" is there already"},
           {"room,photos,scans\n../a,p,s.ptx\n", "becomes the name of a folder"},
           {"room,photos,scans\njoined,p,s.ptx\n", "is the name of the folder of the joined rooms"},
           {"room,photos,scans\nsite.html,p,s.ptx\n", "is the name of the site's page"},
           {"room,photos,scans,options\na,p,s.ptx,--scan_path=t.ptx\n",
            "--scan_path cannot be one"},
           {"room,photos,scans,options\na,p,s.ptx,--scan_poses t.csv\n",
            "--scan_poses \"t.csv\" does not exist"},
           {"room,photos,scans\na,q,s.ptx\n", "folder of photos \"q\" does not exist"},
           {"room,photos,scans\na,p,t.ptx;s.ptx\n", "scan \"t.ptx\" does not exist"},
           {"room,photos,scans\na,p,\n", "no scan is named"},
           {"room,photos,scans\na,,s.ptx\n", "no photos are named, and no scan is an E57"},
           {"room,photos,scans,options\na,p,s.ptx,--only align\n", "--only cannot be one"},
           {"room,photos,scans,options\na,p,s.ptx,'\n", "No closing quotation"},
       }) {
    WriteBytes(folder_ / "site.csv", table);
    const CommandResult result = RunSite("-n");
    EXPECT_NE(result.exit_code, 0) << table;
    EXPECT_THAT(result.err, HasSubstr(finding)) << table;
  }
}

}  // namespace
}  // namespace roomtex
