// What roomtex-mapper held against a sparse model, in roomtex-align as a user runs it.

#include <filesystem>

#include <gmock/gmock.h>

#include "colmap_ext/mapper_verdict.h"
#include "core/report.h"
#include "core/result_names.h"
#include "tests/align/case_folder.h"
#include "tests/align/photographed_room.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

const SimulatedCase& Photographed() {
  static const SimulatedCase one = [] {
    SimulatedRoomOptions options = CaseOptions(0);
    options.num_photos = 10;
    options.photo_width = 600;
    options.photo_height = 400;
    return MakeCase(options, 6);
  }();
  return one;
}

// Its photos, drawn once.
std::string PhotosOf() {
  static const TempFolder folder;
  const std::string photos = folder / "photos";
  if (!std::filesystem::exists(photos)) WritePhotos(*Photographed().room, photos);
  return photos;
}

struct RefusedModel {
  explicit RefusedModel(const std::string& about) {
    const Json report = {{"num_reg_images", one.model.images.size()},
                         {"num_points", one.model.points.size()},
                         {"reasons", {{{"about", about}, {"reason", "two pairs contradict it."}}}}};
    WriteBytes(files.input_path + "/" + kMapperReportName, report.dump());
  }
  Json Report(const std::string& output) const {
    return Json::parse(ReadBytes(output + "/alignment.json"));
  }

  const SimulatedCase& one = Photographed();
  CaseFolder files{one};
  std::string photos = PhotosOf();
  std::string untrusted = files.output_path + ".untrusted";
};

// From matches alone the mapper cannot know what scan and photos show.
TEST(MapperVerdictCommand, OfTheCamerasMotionIsOverruledByPhotosThatShowTheScan) {
  const RefusedModel model("motion");
  const CommandResult blind = model.files.Align();
  EXPECT_EQ(blind.exit_code, 4);
  EXPECT_THAT(blind.err, HasSubstr("two pairs contradict it."));

  const CommandResult seeing = model.files.Align("--image_path " + model.photos);
  ASSERT_EQ(seeing.exit_code, 0) << seeing.err;
  const Json report = model.Report(model.files.output_path);
  EXPECT_TRUE(report["trusted"]);
  EXPECT_THAT(report["warnings"].dump(), HasSubstr("two pairs contradict it. It is believed all"));
}

TEST(MapperVerdictCommand, OfTheCamerasMotionStandsWherePhotosShowSomethingElse) {
  const RefusedModel model("motion");
  // Each photo under the name of the one before it.
  const std::string others = model.files.folder / "others";
  std::filesystem::create_directories(others);
  const int count = model.one.room->NumPhotos();
  for (int photo = 0; photo < count; ++photo) {
    std::filesystem::copy_file(model.photos + "/" + model.one.room->PhotoName((photo + 1) % count),
                               others + "/" + model.one.room->PhotoName(photo));
  }
  const CommandResult result = model.files.Align("--image_path " + others);
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.err, HasSubstr("two pairs contradict it."));
}

TEST(MapperVerdictCommand, OfALensThatStaysIsNotOverruled) {
  const RefusedModel model("calibration");
  const CommandResult result =
      model.files.Align("--refine_intrinsics 0 --image_path " + model.photos);
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.err, HasSubstr("two pairs contradict it."));
}

}  // namespace
}  // namespace roomtex
