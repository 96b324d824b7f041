#include "texture/sampling/photo_list.h"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "tests/colmap_ext/database_maker.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

class PhotoListTest : public ::testing::Test {
 protected:
  PhotoListTest() {
    Camera camera;
    camera.camera_id = 1;
    camera.model = CameraModel::kOpenCv;
    camera.width = 60;
    camera.height = 40;
    camera.params = {50, 51, 30, 20, 0.1, 0, 0, 0};
    model_.cameras[1] = camera;
    for (uint32_t id = 1; id <= 3; ++id) {
      SparseImage image;
      image.image_id = id;
      image.camera_id = 1;
      image.name = std::string(1, "cba"[id - 1]) + ".png";
      image.cam_from_model.translation.x() = id;
      model_.images[id] = image;
      Photo(image.name, 60, 40);
    }
    sources_.image_path = folder_.path();
  }
  void Photo(const std::string& name, int width, int height) {
    cv::imwrite(folder_ / name, cv::Mat(height, width, CV_8UC3, cv::Scalar(1, 2, 3)));
  }
  std::vector<std::string> Names() {
    std::vector<std::string> names;
    for (const PhotoView& photo : ListPhotos(model_, sources_).photos) names.push_back(photo.name);
    return names;
  }
  void Associate(const std::string& text) {
    sources_.associations_path = folder_ / "associations.csv";
    WriteBytes(sources_.associations_path, text);
  }

  TempFolder folder_;
  SparseModel model_;
  PhotoSources sources_;
};

TEST_F(PhotoListTest, OrdersPhotosByName) {
  EXPECT_EQ(Names(), (std::vector<std::string>{"a.png", "b.png", "c.png"}));
}

TEST_F(PhotoListTest, ScalesTheCameraForResizedPhotos) {
  Photo("b.png", 120, 80);
  const PhotoList list = ListPhotos(model_, sources_);
  const Camera& camera = list.photos[1].camera;
  EXPECT_EQ(camera.width, 120);
  EXPECT_EQ(camera.params, (std::vector<double>{100, 102, 60, 40, 0.1, 0, 0, 0}));
  EXPECT_EQ(list.warnings.size(), 1u);
}

TEST_F(PhotoListTest, LeavesOutDoubtfulPhotos) {
  sources_.doubtful_photos["b.png"] = "roomtex-align doubts b.png: it floats.";
  const PhotoList list = ListPhotos(model_, sources_);
  EXPECT_EQ(Names(), (std::vector<std::string>{"a.png", "c.png"}));
  ASSERT_EQ(list.left_out.size(), 1u);
  EXPECT_EQ(list.left_out[0].name, "b.png");
  EXPECT_EQ(list.left_out[0].reason, "roomtex-align doubts b.png: it floats.");
}

TEST_F(PhotoListTest, LeavesOutPhotosOfAnotherShapeAndMissingOnes) {
  const auto expect_left_out = [this](const std::string& reason) {
    const PhotoList list = ListPhotos(model_, sources_);
    EXPECT_EQ(list.photos.size(), 2u);
    ASSERT_EQ(list.left_out.size(), 1u);
    EXPECT_EQ(list.left_out[0].name, "b.png");
    EXPECT_NE(list.left_out[0].reason.find(reason), std::string::npos) << list.left_out[0].reason;
  };
  Photo("b.png", 40, 60);
  expect_left_out("40 x 60 pixels, its camera 60 x 40");
  std::filesystem::remove(folder_ / "b.png");
  expect_left_out("There is no photo");
  WriteBytes(folder_ / "b.png", "no picture");
  expect_left_out("b.png");
  std::filesystem::remove(folder_ / "a.png");
  std::filesystem::remove(folder_ / "c.png");
  EXPECT_INPUT_ERROR(ListPhotos(model_, sources_), "no photo of the model that can be used");
}

TEST_F(PhotoListTest, TakesThePlainTwin) {
  Photo("plain_a.png", 60, 40);
  Associate(
      "patterned_image,plain_image,offset_px,brightness_ratio\r\na.png,plain_a.png,0.2,1.6\r\n"
      "b.png,c.png,0,1\r\n");
  const PhotoList list = ListPhotos(model_, sources_);
  ASSERT_EQ(list.photos.size(), 2u);  // c.png once, although it is registered itself
  EXPECT_EQ(list.photos[0].name, "c.png");
  EXPECT_EQ(list.photos[1].name, "plain_a.png");
  EXPECT_EQ(list.photos[1].cam_from_scan.translation.x(), 3);  // the pose of a.png
}

TEST_F(PhotoListTest, LeavesPhotosWithoutATwinOutAndSaysSo) {
  Associate("# by hand\npatterned_image,plain_image\na.png,b.png\n");
  const PhotoList list = ListPhotos(model_, sources_);
  ASSERT_EQ(list.photos.size(), 1u);
  EXPECT_EQ(list.photos[0].name, "b.png");
  ASSERT_EQ(list.warnings.size(), 1u);
  EXPECT_NE(list.warnings[0].find("1 registered photos have no plain twin"), std::string::npos);
}

TEST_F(PhotoListTest, LeavesPhotosOutWhoseTwinIsNotInTheFolderAndNamesThem) {
  Photo("plain_a.png", 60, 40);
  Associate("patterned_image,plain_image\na.png,plain_a.png\nb.png,plain_b.png\nc.png,\n");
  const PhotoList list = ListPhotos(model_, sources_);
  ASSERT_EQ(list.photos.size(), 1u);  // never the patterned b.png or c.png
  EXPECT_EQ(list.photos[0].name, "plain_a.png");
  ASSERT_EQ(list.warnings.size(), 2u);
  EXPECT_NE(list.warnings[0].find("give no colour: c.png"), std::string::npos);
  EXPECT_NE(list.warnings[1].find("plain_b.png (twin of b.png)"), std::string::npos);
  std::filesystem::remove(folder_ / "plain_a.png");
  EXPECT_INPUT_ERROR(Names(), "holds none of the plain photos");
}

TEST_F(PhotoListTest, TakesAPlainPhotoOnceForTwoPatternedOnes) {
  Photo("plain.png", 60, 40);
  Associate("patterned_image,plain_image\na.png,plain.png\nb.png,plain.png\n");
  EXPECT_EQ(Names(), (std::vector<std::string>{"plain.png"}));
}

TEST_F(PhotoListTest, RefusesAPhotoThatIsBothPatternedAndPlain) {
  Associate("patterned_image,plain_image\na.png,b.png\nb.png,c.png\n");
  EXPECT_INPUT_ERROR(Names(), "names b.png as a patterned photo and as a plain one");
}

TEST_F(PhotoListTest, RefusesBrokenTables) {
  Associate("");
  EXPECT_INPUT_ERROR(Names(), "is empty");
  Associate("one,two\n");
  EXPECT_INPUT_ERROR(Names(), "line 1");
  Associate("patterned_image,plain_image\na.png\n");
  EXPECT_INPUT_ERROR(Names(), "line 2");
  Associate("patterned_image,plain_image\nx.png,y.png\n");
  EXPECT_INPUT_ERROR(Names(), "names no photo of the model");
}

TEST_F(PhotoListTest, NamesPhotosThatTheDatabaseLacks) {
  sources_.database_path = folder_ / "none.db";
  EXPECT_INPUT_ERROR(Names(), "none.db");
}

// The poses of an aligned model were found with its own lens, which may have been adjusted.
TEST_F(PhotoListTest, AnAlignedModelKeepsItsLensAgainstTheDatabase) {
  sources_.database_path = folder_ / "told.db";
  {
    DatabaseMaker database(sources_.database_path, DatabaseMaker::Schema::k38);
    database.AddCamera(model_.cameras[1]);
    Camera told = model_.cameras[1];
    told.camera_id = 2;
    told.params[0] = 55;
    database.AddCamera(told);
    database.AddImage(1, "c.png", 1);
    database.AddImage(2, "b.png", 2);
    database.AddImage(3, "a.png", 1);
  }
  const PhotoList by_database = ListPhotos(model_, sources_);
  EXPECT_EQ(by_database.photos[1].camera.params[0], 55);
  EXPECT_THAT(by_database.warnings, testing::IsEmpty());
  sources_.aligned_model = true;
  const PhotoList aligned = ListPhotos(model_, sources_);
  EXPECT_EQ(aligned.photos[1].camera.params, model_.cameras[1].params);
  EXPECT_THAT(aligned.warnings, testing::ElementsAre(testing::HasSubstr("for b.png")));
}

}  // namespace
}  // namespace roomtex
