// Photos that nothing connects: sparse models of one room, each in a frame of its own, put into its
// scan by one run of roomtex-align.

#include <algorithm>
#include <filesystem>

#include <gmock/gmock.h>

#include "tests/align/case_folder.h"
#include "tests/align/model_part.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::SizeIs;

class SeveralModels : public testing::Test {
 protected:
  SeveralModels() {
    const auto in_first = [](uint32_t id) { return id % 2 == 0; };
    first_ = PartOf(case_.model, in_first);
    second_ = PartOf(case_.model, [&](uint32_t id) { return !in_first(id); });
    Similarity elsewhere;
    elsewhere.scale = 0.3;
    elsewhere.rotation = Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, -1).normalized());
    elsewhere.translation = {4, -1, 2};
    TransformModel(elsewhere, &second_);
    WriteSparseModel(first_, files_.folder / "0");
    WriteSparseModel(second_, files_.folder / "1");
    files_.input_path = files_.folder / "0" + (" --input_path " + (files_.folder / "1"));
  }
  // In the photo of each model that is best for it.
  std::vector<Pick> PicksOf(const SparseModel& model) const {
    for (int photo = 0; photo < case_.room->NumPhotos(); ++photo) {
      if (model.FindImage(case_.room->PhotoName(photo)) == nullptr) continue;
      std::vector<Pick> picks = PicksOfPhoto(*case_.room, photo, 8);
      if (picks.size() == 8) return picks;
    }
    return {};
  }
  CommandResult AlignWith(const std::vector<std::vector<Pick>>& picks) const {
    std::vector<Pick> all;
    for (const auto& some : picks) all.insert(all.end(), some.begin(), some.end());
    WritePicks(files_.picks_path, all);
    return files_.Align();
  }
  Json Report() const { return Json::parse(ReadBytes(files_.output_path + "/alignment.json")); }
  double WorstPosition(const SparseModel& model) const {
    double worst = 0;
    for (int photo = 0; photo < case_.room->NumPhotos(); ++photo) {
      const SparseImage* const image = model.FindImage(case_.room->PhotoName(photo));
      if (image == nullptr) continue;
      worst = std::max(worst, (image->cam_from_model.TargetOriginInSource() -
                               case_.room->CamFromScan(photo).TargetOriginInSource())
                                  .norm());
    }
    return worst;
  }

  const SimulatedCase& case_ = MakeCase();
  SparseModel first_, second_;
  CaseFolder files_{case_};
};

TEST_F(SeveralModels, AreWrittenAsOne) {
  const CommandResult result = AlignWith({PicksOf(first_), PicksOf(second_)});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel joined = ReadSparseModel(files_.output_path);
  EXPECT_EQ(joined.images.size(), case_.model.images.size());
  EXPECT_EQ(joined.cameras.size(), case_.model.cameras.size());
  EXPECT_NEAR(static_cast<double>(joined.points.size()),
              static_cast<double>(first_.points.size() + second_.points.size()), 30);
  EXPECT_LT(WorstPosition(joined), 0.01);
  const Json report = Report();
  EXPECT_THAT(report["images"], SizeIs(case_.model.images.size()));
  ASSERT_THAT(report["models"], SizeIs(2));
  for (const Json& one : report["models"]) {
    EXPECT_TRUE(one["trusted"].get<bool>());
    EXPECT_TRUE(one["joined"].get<bool>());
    EXPECT_EQ(one["num_images"], case_.model.images.size() / 2);
    EXPECT_LT(one["expected_error"]["at_cameras_mm"].get<double>(), 20);
  }
  EXPECT_NEAR(report["models"][1]["scan_from_sparse"]["scale"].get<double>() /
                  report["scan_from_sparse"]["scale"].get<double>(),
              1 / 0.3, 0.01);
}

// The first says how the scan is to be read, and the second stands in that scan.
TEST_F(SeveralModels, AreTurnedTogetherWhereTheScanIsMirrored) {
  ScanWriterOptions options;
  options.counterclockwise = true;
  WriteScan(case_.scans[0], {}, files_.scan_path, options);
  const CommandResult result = AlignWith({PicksOf(first_), PicksOf(second_)});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Report();
  EXPECT_EQ(report["scans"][0]["azimuth"], "counterclockwise");
  for (const Json& one : report["models"]) EXPECT_TRUE(one["joined"].get<bool>());
  EXPECT_LT(WorstPosition(ReadSparseModel(files_.output_path)), 0.01);
}

TEST_F(SeveralModels, OneThatCannotBePlacedIsLeftOutByName) {
  const CommandResult result = AlignWith({PicksOf(second_)});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string warnings = Report()["warnings"].dump();
  EXPECT_THAT(warnings,
              HasSubstr("/0 (" + std::to_string(first_.images.size()) + " photos) is left out"));
  EXPECT_THAT(warnings, HasSubstr("none of the picks is in its photos"));
  const SparseModel alone = ReadSparseModel(files_.output_path);
  EXPECT_EQ(alone.images.size(), second_.images.size());
  EXPECT_LT(WorstPosition(alone), 0.01);
  const Json report = Report();
  EXPECT_FALSE(report["models"][0]["joined"].get<bool>());
  EXPECT_TRUE(report["models"][1]["joined"].get<bool>());
  // The report is of what was written.
  EXPECT_EQ(report["scan_from_sparse"], report["models"][1]["scan_from_sparse"]);
}

TEST_F(SeveralModels, WhereNoneIsTrustedTheFirstSaysWhy) {
  std::vector<std::vector<Pick>> picks = {PicksOf(first_), PicksOf(second_)};
  for (auto& some : picks) std::swap(some[0].x_in_scan, some[4].x_in_scan);
  for (auto& some : picks) std::swap(some[1].x_in_scan, some[5].x_in_scan);
  for (auto& some : picks) std::swap(some[2].x_in_scan, some[6].x_in_scan);
  const CommandResult result = AlignWith(picks);
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, HasSubstr("/0 ("));
  EXPECT_THAT(Report()["models"], SizeIs(2));
}

// As roomtex-mapper says of photos of a hotel's rooms: both fit the scan of one.
TEST_F(SeveralModels, OfRoomsThatAreAlikeOnlyOneStandsInOnePlace) {
  const auto say_alike = [&](const std::string& name, const SparseModel& model) {
    const Json json = {{"num_reg_images", model.images.size()},
                       {"num_points", model.points.size()},
                       {"is_alike", true}};
    WriteBytes(files_.folder / (name + "/roomtex-mapper.json"), json.dump());
  };
  say_alike("0", first_);
  say_alike("1", second_);
  const CommandResult result = AlignWith({PicksOf(first_), PicksOf(second_)});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadSparseModel(files_.output_path).images.size(), first_.images.size());
  const Json report = Report();
  EXPECT_TRUE(report["models"][0]["joined"].get<bool>());
  EXPECT_FALSE(report["models"][1]["joined"].get<bool>());
  EXPECT_THAT(report["models"][1]["reason"].get<std::string>(), HasSubstr("a room that is alike"));
}

TEST_F(SeveralModels, APickInNoneOfThemGetsASentence) {
  std::vector<Pick> picks = PicksOf(first_);
  picks[3].image_name = "photo_0l3.jpg";
  const CommandResult result = AlignWith({picks});
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("photo_0l3.jpg is not in any of the sparse models"));
  WritePicks(files_.picks_path, PicksOf(first_));
  const CommandResult hint = files_.Align("--near nobody.jpg,1,2,3");
  EXPECT_EQ(hint.exit_code, 3);
  EXPECT_THAT(hint.err, HasSubstr("nobody.jpg, which is not in any of the sparse models (nearest"));
  EXPECT_FALSE(std::filesystem::exists(files_.output_path));
}

// COLMAP names photos by their folders, people who pick may not: of two rooms it could be either.
TEST_F(SeveralModels, APickWhosePhotoCouldBeInTwoGetsASentence) {
  const std::vector<Pick> picks = PicksOf(first_);
  const auto rename = [&](SparseModel model, const std::string& folder, const std::string& name) {
    SparseImage& image = model.images.begin()->second;
    image.name = folder + "/" + name;
    WriteSparseModel(model, files_.folder / folder);
  };
  rename(first_, "0", "picked.jpg");
  rename(second_, "1", "picked.jpg");
  std::vector<Pick> of_either = picks;
  for (Pick& pick : of_either) pick.image_name = "picked.jpg";
  const CommandResult result = AlignWith({of_either});
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("picked.jpg is not in any of the sparse models"));
  EXPECT_THAT(result.err, HasSubstr("0/picked.jpg"));
}

}  // namespace
}  // namespace roomtex
