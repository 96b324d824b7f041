#include "align/clicks/photo_model.h"

#include <filesystem>
#include <fstream>

#include <exiv2/exiv2.hpp>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/photo.h"
#include "core/photo_files.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

void WritePhoto(const std::string& path, int width, int height) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  cv::imwrite(path, cv::Mat3b(height, width, cv::Vec3b(90, 120, 30)));
}
void SetExif(const std::string& path, const std::string& key, const std::string& value) {
  auto image = Exiv2::ImageFactory::open(path);
  image->readMetadata();
  image->exifData()[key] = value;
  image->writeMetadata();
}

TEST(FocalLength, IsReadFromExif) {
  const TempFolder folder;
  const std::string path = folder / "a.jpg";
  WritePhoto(path, 360, 240);
  EXPECT_FALSE(ReadFocalLength(path));
  EXPECT_FALSE(ReadFocalLength(folder / "nowhere.jpg"));
  SetExif(path, "Exif.Photo.FocalLength", "50/1");
  EXPECT_FALSE(ReadFocalLength(path));  // on a sensor of unknown size
  SetExif(path, "Exif.Photo.FocalPlaneXResolution", "3600/18");
  SetExif(path, "Exif.Photo.FocalPlaneResolutionUnit", "3");  // per centimetre
  SetExif(path, "Exif.Photo.PixelXDimension", "3600");        // before it was made smaller
  EXPECT_NEAR(ReadFocalLength(path).value(), 100, 1e-3);
  SetExif(path, "Exif.Photo.FocalLengthIn35mmFilm", "72");
  EXPECT_NEAR(ReadFocalLength(path).value(), 2 * 360, 0.1);
  SetExif(path, "Exif.Photo.FocalLengthIn35mmFilm", "1");  // no lens
  EXPECT_FALSE(ReadFocalLength(path));
}

TEST(PhotoModel, TakesTheCameraFromOptionsOrExifOrLeavesItToThePicks) {
  const TempFolder folder;
  WritePhoto(folder / "b/exif.jpg", 600, 400);
  WritePhoto(folder / "none.png", 600, 400);
  SetExif(folder / "b/exif.jpg", "Exif.Photo.FocalLengthIn35mmFilm", "36");
  const std::vector<std::string> names = ListPhotoFiles(folder.path(), "");
  EXPECT_THAT(names, ElementsAre("b/exif.jpg", "none.png"));
  const PhotoModel found = MakePhotoModel(folder.path(), names, {});
  EXPECT_EQ(found.focal_sources.at("b/exif.jpg"), FocalSource::kExif);
  EXPECT_EQ(found.focal_sources.at("none.png"), FocalSource::kPicks);
  EXPECT_NEAR(found.model.cameras.at(1).params[0], 600, 0.1);
  EXPECT_EQ(found.model.cameras.at(1).model, CameraModel::kSimpleRadial);
  const PhotoModel given =
      MakePhotoModel(folder.path(), names, {"OPENCV", "610, 605,300,200,0.01,0,0,0"});
  EXPECT_EQ(given.focal_sources.at("b/exif.jpg"), FocalSource::kGiven);
  EXPECT_EQ(given.model.cameras.at(2).params[1], 605);
}

TEST(PhotoModel, RefusesParametersOfAnotherPhotoSizeAndFilesThatAreNoPhotos) {
  const TempFolder folder;
  WritePhoto(folder / "a.jpg", 600, 400);
  std::ofstream(folder / "z.jpg") << "no photo";
  const PhotoCameraOptions larger{"SIMPLE_RADIAL", "1220,600,400,0"};
  EXPECT_INPUT_ERROR(MakePhotoModel(folder.path(), {"a.jpg"}, larger), "600 x 400 pixels");
  EXPECT_INPUT_ERROR(MakePhotoModel(folder.path(), {"z.jpg"}, {}), "no photo");
  const PhotoModel taken =
      MakePhotoModel(folder.path(), {"a.jpg", "z.jpg"}, larger, UnfitPhotos::kTaken);
  EXPECT_EQ(taken.focal_sources.at("a.jpg"), FocalSource::kPicks);
  EXPECT_EQ(taken.model.cameras.at(2).width, 1);
  std::vector<Pick> picks = {{"../a.jpg", {1, 1}, {0, 0, 0}, 2}};
  EXPECT_INPUT_ERROR(MakePhotoModel(folder.path(), "picks.csv", picks, {}), "line 2");
}

TEST(PhotoCamera, OptionsSayWhatIsWrong) {
  EXPECT_THAT(PhotoCameraOptions().Problems(), IsEmpty());
  EXPECT_THAT((PhotoCameraOptions{"RADIAL", "500,300,200,0.1,0"}).Problems(), IsEmpty());
  EXPECT_THAT((PhotoCameraOptions{"NONE", ""}).Problems(),
              ElementsAre(HasSubstr("no camera model")));
  EXPECT_THAT((PhotoCameraOptions{"OPENCV", ""}).Problems(),
              ElementsAre(HasSubstr("needs --camera_params")));
  EXPECT_THAT((PhotoCameraOptions{"SIMPLE_RADIAL", "500,300"}).Problems(),
              ElementsAre(HasSubstr("--camera_params 500,300")));
  EXPECT_THAT((PhotoCameraOptions{"SIMPLE_RADIAL", "500,300,x,0"}).Problems(),
              ElementsAre(HasSubstr("--camera_params 500,300,x,0")));
}

}  // namespace
}  // namespace roomtex
