#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <opencv2/features2d.hpp>

#include "capture/association/associated_views.h"
#include "capture/association/associated_views_links.h"
#include "core/error.h"
#include "tests/capture/association/associate_scene.h"
#include "tests/colmap_ext/database_maker.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

Take Plain(double ev = 0.6) {
  Take take;
  take.ev = ev;
  return take;
}
Take Patterned(double shift_x = 0, double shift_y = 0, double ev = 0) {
  Take take;
  take.patterned = true;
  take.ev = ev;
  take.shift_x = shift_x;
  take.shift_y = shift_y;
  take.seed = 2;
  return take;
}

// As the command does it. Gives the number of pairs.
int WriteLinks(const std::string& folder, const std::string& image_path,
               const std::vector<AssociatedPair>& pairs) {
  MakeLinks(folder, image_path, pairs)->Commit();
  return NumLinks(pairs);
}

class Associate : public ::testing::Test {
 protected:
  Associate() { fs::create_directories(Images()); }

  std::string Images() const { return folder_ / "images"; }
  std::string Image(const std::string& name) const { return Images() + "/" + name; }
  void Save(const std::string& name, int place, const Take& take, const std::string& time = "") {
    fs::create_directories(fs::path(Image(name)).parent_path());
    FurnishedScene().Save(Image(name), place, take, time);
  }
  Associations Find() {
    options_.image_path = Images();
    Progress progress(true);
    return FindAssociations(options_, &progress);
  }
  static std::vector<std::pair<std::string, std::string>> Names(const Associations& found) {
    std::vector<std::pair<std::string, std::string>> names;
    for (const AssociatedPair& pair : found.pairs) {
      names.push_back({pair.patterned_image, pair.plain_image});
    }
    return names;
  }
  static std::string ReasonOf(const Associations& found, const std::string& image) {
    for (const SinglePhoto& single : found.singles) {
      if (single.image == image) return single.reason;
    }
    return "";
  }

  TempFolder folder_;
  AssociateOptions options_;
};

TEST_F(Associate, FindsThePairsOfARoom) {
  for (int place = 0; place < 5; ++place) {
    Save("img_" + std::to_string(2 * place) + ".jpg", place, Patterned());
    Save("img_" + std::to_string(2 * place + 1) + ".jpg", place, Plain());
  }
  const Associations found = Find();
  EXPECT_THAT(Names(found),
              ElementsAre(Pair("img_0.jpg", "img_1.jpg"), Pair("img_2.jpg", "img_3.jpg"),
                          Pair("img_4.jpg", "img_5.jpg"), Pair("img_6.jpg", "img_7.jpg"),
                          Pair("img_8.jpg", "img_9.jpg")));
  for (const AssociatedPair& pair : found.pairs) {
    EXPECT_LT(pair.offset_px, 0.06);
    EXPECT_GT(pair.brightness_ratio, 1.1);
    EXPECT_EQ(pair.found_by, "name order");
  }
  EXPECT_TRUE(found.singles.empty());
  EXPECT_TRUE(found.moved.empty());
}

TEST_F(Associate, FindsThemInAnyOrderAndInFolders) {
  for (int place = 0; place < 3; ++place) {
    Save("with/" + std::to_string(place) + ".jpg", place, Patterned());
    Save("without/" + std::to_string(2 - place) + ".png", place, Plain());
  }
  const Associations found = Find();
  ASSERT_EQ(found.pairs.size(), 3u);
  for (int place = 0; place < 3; ++place) {
    EXPECT_EQ(found.pairs[place].patterned_image, "with/" + std::to_string(place) + ".jpg");
    EXPECT_EQ(found.pairs[place].plain_image, "without/" + std::to_string(2 - place) + ".png");
  }
  // Whatever the number of threads.
  options_.num_threads = 1;
  const Associations again = Find();
  ASSERT_EQ(again.pairs.size(), found.pairs.size());
  for (size_t i = 0; i < found.pairs.size(); ++i) {
    EXPECT_EQ(again.pairs[i].offset_px, found.pairs[i].offset_px);
    EXPECT_EQ(again.pairs[i].brightness_ratio, found.pairs[i].brightness_ratio);
  }
}

TEST_F(Associate, FollowsTheOrderOfTime) {
  Save("a.jpg", 0, Patterned(), "2026:05:01 12:00:01");
  Save("b.jpg", 1, Plain(), "2026:05:01 12:10:07");
  Save("c.jpg", 2, Patterned(), "2026:05:01 12:20:01");
  Save("d.jpg", 0, Plain(), "2026:05:01 12:00:09");
  Save("e.jpg", 2, Plain(), "2026:05:01 12:20:08");
  Save("f.jpg", 1, Patterned(), "2026:05:01 12:10:01");
  const Associations found = Find();
  EXPECT_THAT(Names(found),
              ElementsAre(Pair("a.jpg", "d.jpg"), Pair("c.jpg", "e.jpg"), Pair("f.jpg", "b.jpg")));
  for (const AssociatedPair& pair : found.pairs) EXPECT_EQ(pair.found_by, "time order");
}

TEST_F(Associate, TakesTheExposureOutOfTheBrightness) {
  // Automatic exposure: the patterned photo is the darker picture of the brighter light.
  Save("a.jpg", 0, Patterned(0, 0, -1), "2026:05:01 12:00:01");
  Save("b.jpg", 0, Plain(1), "2026:05:01 12:00:09");
  const Associations with = Find();
  ASSERT_THAT(Names(with), ElementsAre(Pair("a.jpg", "b.jpg")));
  EXPECT_TRUE(with.pairs[0].exif_brightness);
  EXPECT_GT(with.pairs[0].brightness_ratio, 1.5);
  EXPECT_TRUE(with.warnings.empty());
  Save("a.jpg", 0, Patterned(0, 0, -1));
  const Associations without = Find();
  ASSERT_THAT(Names(without), ElementsAre(Pair("a.jpg", "b.jpg")));
  EXPECT_FALSE(without.pairs[0].exif_brightness);
  EXPECT_LT(without.pairs[0].brightness_ratio, 1);
  ASSERT_EQ(without.warnings.size(), 1u);
  EXPECT_THAT(without.warnings[0], HasSubstr("told by their detail"));
}

TEST_F(Associate, SaysWhenBothAreEquallyBright) {
  Save("b.jpg", 3, Patterned());
  Save("a.jpg", 3, Plain());
  const double ratio = Find().pairs.at(0).brightness_ratio;
  Save("a.jpg", 3, Plain(0.6 + std::log2(ratio)));
  const Associations found = Find();
  ASSERT_THAT(Names(found), ElementsAre(Pair("b.jpg", "a.jpg")));
  EXPECT_NEAR(found.pairs[0].brightness_ratio, 1, 0.05);
  if (found.pairs[0].brightness_ratio < 1.03) {
    ASSERT_EQ(found.warnings.size(), 1u);
    EXPECT_THAT(found.warnings[0], HasSubstr("not brighter"));
  }
}

TEST_F(Associate, AcceptsAThirdOfAPixelAndRefusesFourFifths) {
  Save("a0.jpg", 0, Patterned(0.3, 0));
  Save("a1.jpg", 0, Plain());
  Save("b0.jpg", 1, Patterned(0.8, 0));
  Save("b1.jpg", 1, Plain());
  Save("c0.jpg", 2, Plain());
  Save("c1.jpg", 2, Patterned(-5.2, 3.1));
  const Associations found = Find();
  ASSERT_THAT(Names(found), ElementsAre(Pair("a0.jpg", "a1.jpg")));
  EXPECT_NEAR(found.pairs[0].offset_px, 0.3, 0.1);
  EXPECT_NEAR(found.pairs[0].shift.x(), 0.3, 0.1);
  ASSERT_EQ(found.moved.size(), 2u);
  EXPECT_EQ(found.moved[0].first_image, "b0.jpg");
  EXPECT_NEAR(found.moved[0].offset_px, 0.8, 0.1);
  EXPECT_NEAR(found.moved[0].shift.x(), -0.8, 0.1);  // the plain photo is the second one
  EXPECT_NEAR(found.moved[1].offset_px, std::hypot(5.2, 3.1), 0.1);
  EXPECT_NEAR(found.moved[1].shift.y(), 3.1, 0.1);
  EXPECT_THAT(ReasonOf(found, "b1.jpg"), HasSubstr("moved by 0."));
  options_.max_offset = 1;
  EXPECT_EQ(Find().pairs.size(), 2u);
}

TEST_F(Associate, RefusesACameraThatRolled) {
  Take rolled = Patterned();
  rolled.roll_deg = 0.25;
  Save("a.jpg", 0, rolled);
  Save("b.jpg", 0, Plain());
  const Associations found = Find();
  EXPECT_TRUE(found.pairs.empty());
  ASSERT_EQ(found.moved.size(), 1u);
  EXPECT_NEAR(found.moved[0].offset_px, 1.09, 0.15);
}

TEST_F(Associate, GivesTwoPatternedPhotosTheSamePlainOne) {
  Save("a.jpg", 0, Patterned(0.2, 0));
  Take second = Patterned();
  second.seed = 31;
  Save("b.jpg", 0, second);
  Save("c.jpg", 0, Plain());
  Save("d.jpg", 1, Patterned());
  Save("e.jpg", 1, Plain());
  const Associations found = Find();
  EXPECT_THAT(Names(found),
              ElementsAre(Pair("a.jpg", "c.jpg"), Pair("b.jpg", "c.jpg"), Pair("d.jpg", "e.jpg")));
  EXPECT_TRUE(found.pairs[0].is_spare);
  EXPECT_FALSE(found.pairs[1].is_spare);
  // Links hold each place once.
  EXPECT_EQ(WriteLinks(folder_ / "links", Images(), found.pairs), 2);
  EXPECT_FALSE(fs::exists(folder_ / "links/plain/a.jpg"));
}

Take BothProjectors() {
  Take take = Patterned();
  take.second_projector = true;
  take.ev = -0.5;
  take.seed = 3;
  return take;
}

// Both projectors, one, none: what shares part of a pattern lies on each other best of all.
TEST_F(Associate, TakesNoPhotoWithAPatternForAPlainOne) {
  const std::string names[3][3] = {{"p0_a_both.jpg", "p0_b_one.jpg", "p0_c_plain.jpg"},
                                   {"p1_b_both.jpg", "p1_a_one.jpg", "p1_c_plain.jpg"},
                                   {"p2_b_both.jpg", "p2_c_one.jpg", "p2_a_plain.jpg"}};
  for (int place = 0; place < 3; ++place) {
    Save(names[place][0], place, BothProjectors());
    Save(names[place][1], place, Patterned());
    Take plain = Plain();
    plain.shift_x = 0.15;
    Save(names[place][2], place, plain);
  }
  const std::string line = "roomtex-associate --quiet --image_path " + Images() +
                           " --output_path " + (folder_ / "pairs.csv");
  const CommandResult result = RunCommandLine(line + " --links_path " + (folder_ / "links"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err.find("further plain"), std::string::npos) << result.err;
  for (const auto& [both, one, plain] : names) {
    const std::string table = ReadBytes(folder_ / "pairs.csv");
    EXPECT_THAT(table, HasSubstr(both + "," + plain + ","));
    EXPECT_THAT(table, HasSubstr(one + "," + plain + ","));
    EXPECT_THAT(table, ::testing::Not(HasSubstr(both + "," + one)));
  }
  for (const auto& entry : fs::directory_iterator(folder_ / "links/plain")) {
    EXPECT_THAT(fs::canonical(entry).filename().string(), HasSubstr("_plain"));
  }
}

// The plain one was taken after the camera had been touched.
TEST_F(Associate, LeavesAPhotoWithoutACleanPlainOneAlone) {
  Save("a.jpg", 0, BothProjectors());
  Save("b.jpg", 0, Patterned(0.45, 0));
  Take plain = Plain();
  plain.shift_x = 0.9;
  Save("c.jpg", 0, plain);
  const Associations found = Find();
  EXPECT_THAT(Names(found), ElementsAre(Pair("b.jpg", "c.jpg")));
  EXPECT_THAT(ReasonOf(found, "a.jpg"), HasSubstr("b.jpg of its place has a pattern itself"));
}

// Each of two projectors alone: neither photo is the other's plain one, whichever is brighter or
// has more detail.
TEST_F(Associate, PairsNoTwoPatterns) {
  Take other = Plain();
  other.second_projector = true;
  for (int place = 0; place < 4; ++place) {
    other.ev = 0.3 * place - 0.5;
    Save("p" + std::to_string(place) + "_one.jpg", place, Patterned());
    Save("p" + std::to_string(place) + "_other.jpg", place, other);
  }
  Save("p4_both.jpg", 4, BothProjectors());
  Save("p4_one.jpg", 4, Patterned());
  const Associations alone = Find();
  EXPECT_TRUE(alone.pairs.empty()) << alone.pairs[0].plain_image;
  EXPECT_THAT(ReasonOf(alone, "p4_one.jpg"), HasSubstr("p4_both.jpg of its place has a pattern"));
  // Both have the plain one where there is one.
  Save("p2_plain.jpg", 2, Plain());
  EXPECT_THAT(Names(Find()), ElementsAre(Pair("p2_one.jpg", "p2_plain.jpg"),
                                         Pair("p2_other.jpg", "p2_plain.jpg")));
}

TEST_F(Associate, NamesASecondPlainPhoto) {
  Save("a.jpg", 0, Plain());
  Save("b.jpg", 0, Patterned());
  Take second = Plain(0.3);
  second.seed = 44;
  second.shift_x = 0.2;
  Save("c.jpg", 0, second);
  const Associations found = Find();
  EXPECT_THAT(Names(found), ElementsAre(Pair("b.jpg", "a.jpg")));
  EXPECT_THAT(ReasonOf(found, "c.jpg"), HasSubstr("a further plain photo"));
}

TEST_F(Associate, NamesAPhotoWithoutATwin) {
  Save("a.jpg", 0, Patterned());
  Save("b.jpg", 0, Plain());
  Save("c.jpg", 1, Patterned());
  Save("d.jpg", 2, Plain());
  const Associations found = Find();
  EXPECT_THAT(Names(found), ElementsAre(Pair("a.jpg", "b.jpg")));
  EXPECT_THAT(ReasonOf(found, "c.jpg"), HasSubstr("no other photo"));
  EXPECT_THAT(ReasonOf(found, "d.jpg"), HasSubstr("no other photo"));
}

TEST_F(Associate, TellsPhotosInTheSameLightApart) {
  Save("a.jpg", 0, Plain(0.6));
  Take second = Plain(0.1);
  second.seed = 5;
  Save("b.jpg", 0, second);
  Save("c.jpg", 1, Patterned(0, 0, 0));
  Take other = Patterned(0, 0, -0.4);
  other.seed = 6;
  Save("d.jpg", 1, other);
  const Associations found = Find();
  EXPECT_TRUE(found.pairs.empty());
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "d.jpg"}) {
    EXPECT_THAT(ReasonOf(found, name), HasSubstr("in the same light")) << name;
  }
}

TEST_F(Associate, NamesPhotosOfAnotherSize) {
  Save("a.jpg", 0, Patterned());
  cv::Mat small;
  cv::resize(FurnishedScene().TakePhoto(0, Plain()), small, {480, 320}, 0, 0, cv::INTER_AREA);
  cv::imwrite(Image("b.jpg"), small);
  const Associations found = Find();
  EXPECT_TRUE(found.pairs.empty());
  EXPECT_THAT(ReasonOf(found, "b.jpg"), HasSubstr("has 480 x 320 pixels and the other 720 x 480"));
}

TEST_F(Associate, GoesOnWithoutABrokenPhoto) {
  Save("a.jpg", 0, Patterned());
  Save("b.jpg", 0, Plain());
  Save("c.jpg", 1, Patterned());
  const std::string whole = ReadBytes(Image("c.jpg"));
  WriteBytes(Image("c.jpg"), whole.substr(0, whole.size() / 2));
  WriteBytes(Image("d.jpg"), "no picture");
  WriteBytes(Image("notes.txt"), "no photo");
  const Associations found = Find();
  EXPECT_EQ(found.num_photos, 2);
  EXPECT_THAT(Names(found), ElementsAre(Pair("a.jpg", "b.jpg")));
  EXPECT_THAT(ReasonOf(found, "c.jpg"), HasSubstr("ends before the picture does"));
  EXPECT_THAT(ReasonOf(found, "d.jpg"), HasSubstr("cannot be read"));
  EXPECT_EQ(found.singles.size(), 2u);
}

TEST_F(Associate, WantsTwoPhotos) {
  EXPECT_INPUT_ERROR(Find(), "holds no photos");
  Save("a.jpg", 0, Patterned());
  EXPECT_INPUT_ERROR(Find(), "holds 1 photos");
}

// A database with SIFT keypoints of the photos, as COLMAP numbers them.
void WriteDatabase(const std::string& path, const std::string& images,
                   const std::vector<std::string>& names, bool with_keypoints,
                   const std::map<std::string, std::string>& files = {}) {
  DatabaseMaker database(path, DatabaseMaker::Schema::k38);
  Camera camera;
  camera.camera_id = 1;
  camera.width = AssociateScene::kWidth;
  camera.height = AssociateScene::kHeight;
  camera.params = {600, 600, 360, 240};
  database.AddCamera(camera);
  uint32_t id = 0;
  for (const std::string& name : names) {
    database.AddImage(++id, name, 1);
    if (!with_keypoints) continue;
    std::vector<cv::KeyPoint> keypoints;
    const std::string& file = files.count(name) > 0 ? files.at(name) : name;
    cv::SIFT::create(0, 3, 0.02)->detect(cv::imread(images + "/" + file, 0), keypoints);
    std::vector<Eigen::Vector2d> x_in_img;
    for (const cv::KeyPoint& keypoint : keypoints) {
      x_in_img.emplace_back(keypoint.pt.x + 0.5, keypoint.pt.y + 0.5);
    }
    database.AddKeypoints(id, x_in_img, 2);
  }
}

TEST_F(Associate, CountsTheKeypointsInCommon) {
  Save("a.jpg", 0, Patterned());
  Save("b.jpg", 0, Plain());
  Save("c.jpg", 1, Patterned());
  Save("d.jpg", 1, Plain());
  options_.database_path = folder_ / "database.db";
  WriteDatabase(options_.database_path, Images(), {"a.jpg", "b.jpg", "c.jpg"}, true);
  const std::string before = ReadBytes(options_.database_path);
  const Associations found = Find();
  ASSERT_EQ(found.pairs.size(), 2u);
  ASSERT_TRUE(found.pairs[0].num_common_keypoints.has_value());
  EXPECT_GT(*found.pairs[0].num_common_keypoints, 40);
  EXPECT_FALSE(found.pairs[1].num_common_keypoints.has_value());  // d.jpg is not in the database
  EXPECT_EQ(ReadBytes(options_.database_path), before);
  EXPECT_FALSE(fs::exists(options_.database_path + "-wal"));
}

TEST_F(Associate, SaysWhereKeypointsContradictTheEdges) {
  Save("a.jpg", 0, Patterned());
  Save("b.jpg", 0, Plain());
  Save("a_moved.jpg", 0, Patterned(2.5, 0));
  options_.database_path = folder_ / "database.db";
  // Of another photo under its name.
  WriteDatabase(options_.database_path, Images(), {"a.jpg", "b.jpg"}, true,
                {{"a.jpg", "a_moved.jpg"}});
  fs::remove(Image("a_moved.jpg"));
  const Associations found = Find();
  ASSERT_THAT(Names(found), ElementsAre(Pair("a.jpg", "b.jpg")));
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_THAT(found.warnings[0], HasSubstr("that both have say 2."));
}

TEST_F(Associate, WorksWithADatabaseOfNamesOnly) {
  Save("a.jpg", 0, Patterned());
  Save("b.jpg", 0, Plain());
  options_.database_path = folder_ / "database.db";
  WriteDatabase(options_.database_path, Images(), {"a.jpg", "gone.jpg"}, false);
  const Associations found = Find();
  EXPECT_EQ(found.pairs.size(), 1u);
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_THAT(found.warnings[0], HasSubstr("gone.jpg"));
  WriteBytes(options_.database_path, "no database");
  EXPECT_INPUT_ERROR(Find(), "database.db");
}

TEST_F(Associate, LinksPairsUnderCommonNames) {
  Save("p/a.jpg", 0, Patterned());
  Save("q/b.jpg", 0, Plain());
  const Associations found = Find();
  const std::string links = folder_ / "deep/links";
  ASSERT_EQ(WriteLinks(links, Images(), found.pairs), 1);
  EXPECT_EQ(ReadBytes(links + "/patterned/p/a.jpg"), ReadBytes(Image("p/a.jpg")));
  EXPECT_EQ(ReadBytes(links + "/plain/p/a.jpg"), ReadBytes(Image("q/b.jpg")));
  EXPECT_TRUE(fs::is_symlink(links + "/plain/p/a.jpg"));
  // A second run replaces the first one's links, and theirs only.
  AssociatedPair other = found.pairs[0];
  std::swap(other.patterned_image, other.plain_image);
  EXPECT_EQ(WriteLinks(links, Images(), {other}), 1);
  EXPECT_FALSE(fs::exists(links + "/plain/p/a.jpg"));
  EXPECT_TRUE(fs::exists(links + "/plain/q/b.jpg"));
  WriteBytes(links + "/plain/mine.jpg", "mine");
  EXPECT_INPUT_ERROR(WriteLinks(links, Images(), found.pairs), "mine.jpg");
  EXPECT_EQ(ReadBytes(links + "/plain/mine.jpg"), "mine");
  EXPECT_TRUE(fs::exists(links + "/patterned/q/b.jpg"));
  EXPECT_FALSE(fs::exists(links + "/patterned/p/a.jpg"));
  // Nothing lies about, and photos were never touched.
  int entries = 0;
  for (const auto& entry : fs::directory_iterator(links)) entries += entry.exists();
  EXPECT_EQ(entries, 3);
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(Image("p/a.jpg"))));
}

TEST_F(Associate, LinksAreWholeOrNotAtAll) {
  Save("a.jpg", 0, Patterned());
  AssociatedPair good, bad;
  good.patterned_image = good.plain_image = "a.jpg";
  bad.patterned_image = "a.jpg";
  bad.plain_image = "gone.jpg";
  const std::string links = folder_ / "links";
  EXPECT_INPUT_ERROR(WriteLinks(links, Images(), {bad}), "cannot be filled");
  EXPECT_FALSE(fs::exists(links + "/patterned"));
  EXPECT_EQ(WriteLinks(links, Images(), {good}), 1);
  EXPECT_INPUT_ERROR(WriteLinks(links, Images(), {bad}), "cannot be filled");
  EXPECT_TRUE(fs::exists(links + "/plain/a.jpg"));
}

TEST_F(Associate, CommandWritesTheTableAndTheLinks) {
  Save("a.jpg", 0, Patterned());
  Save("b, c.jpg", 0, Plain());
  const std::string line = "roomtex-associate --quiet --image_path " + Images() +
                           " --output_path " + (folder_ / "pairs.csv") + " --report_path " +
                           (folder_ / "report.json");
  CommandResult result = RunCommandLine(line + " --links_path " + (folder_ / "links"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.out, (folder_ / "pairs.csv") + "\n");
  const std::string table = ReadBytes(folder_ / "pairs.csv");
  EXPECT_EQ(table.rfind("patterned_image,plain_image,offset_px,brightness_ratio\n"
                        "a.jpg,\"b, c.jpg\",0.0",
                        0),
            0u)
      << table;
  EXPECT_TRUE(fs::exists(folder_ / "links/plain/a.jpg"));
  EXPECT_THAT(ReadBytes(folder_ / "report.json"), HasSubstr("\"num_pairs\": 1"));
  result = RunCommandLine(line + " --links_path " + Images() + "/links");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_EQ(RunCommandLine(line + " --max_offset 0").exit_code, 2);
  // Nothing usable: the camera moved.
  Save("a.jpg", 0, Patterned(1.2, 0));
  result = RunCommandLine(line);
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_EQ(ReadBytes(folder_ / "pairs.csv"),
            "patterned_image,plain_image,offset_px,brightness_ratio\n");
  EXPECT_THAT(ReadBytes(folder_ / "report.json"), HasSubstr("the camera moved by 1."));
}

}  // namespace
}  // namespace roomtex
