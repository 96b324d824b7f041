#include "workflow/capture_facts.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/photo.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;

PhotoFacts Photo(const std::string& name, int width, const std::string& camera, double mm) {
  PhotoFacts photo;
  photo.name = name;
  photo.width = width;
  photo.height = 100;
  photo.camera = camera;
  if (mm > 0) photo.focal_length_mm = mm;
  return photo;
}

TEST(GroupByCamera, KeepsTogetherWhatOneLensMayHaveTaken) {
  const auto groups =
      GroupByCamera({Photo("a", 600, "A", 24), Photo("b", 600, "A", 35), Photo("c", 600, "A", 24),
                     Photo("d", 300, "A", 24), Photo("e", 600, "B", 24), Photo("f", 600, "A", 24)});
  ASSERT_EQ(groups.size(), 4u);
  EXPECT_THAT(groups[0].names, ElementsAre("a", "c", "f"));
  EXPECT_EQ(groups[0].Text(), "3 photos of 600 x 100, A, 24 mm");
  for (size_t i = 1; i < 4; ++i) EXPECT_EQ(groups[i].names.size(), 1u);
}

TEST(GroupByCamera, PhotosWithoutExifAreToldApartBySize) {
  const auto groups = GroupByCamera({Photo("a", 600, "", 0), Photo("b", 500, "", 0)});
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_EQ(groups[0].Text(), "1 photo of 500 x 100");
}

TEST(ReadPhotoFacts, FindsPhotosBelowTheFolderByName) {
  const TempFolder folder;
  fs::create_directories(folder / "more");
  cv::imwrite(folder / "b.JPG.jpg", cv::Mat3b(20, 30));
  cv::imwrite(folder / "more/a.png", cv::Mat3b(20, 40));
  WriteBytes(folder / "notes.txt", "no photo");
  const auto photos = ReadPhotoFacts(folder.path());
  ASSERT_EQ(photos.size(), 2u);
  EXPECT_EQ(photos[0].name, "b.JPG.jpg");
  EXPECT_EQ(photos[1].name, "more/a.png");
  EXPECT_EQ(photos[1].width, 40);
  EXPECT_EQ(photos[1].height, 20);
}

TEST(ReadPhotoFacts, RefusesAFolderWithoutPhotos) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(ReadPhotoFacts(folder.path()), "holds no photo");
  EXPECT_INPUT_ERROR(ReadPhotoFacts(folder / "none"), "does not exist");
}

TEST(ReadKnownCameras, ReadsWhatRoomtexCalibrateWrites) {
  const TempFolder folder;
  WriteBytes(folder / "cameras.txt",
             "# Camera list\n1 OPENCV 640 427 502.3 502.6 321.92 212.2 -0.08 0.03 0.0008 -0.0006\n"
             "2 PINHOLE 300 200 250 250 150 100\n");
  const auto cameras = ReadKnownCameras(folder / "cameras.txt");
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].model, "OPENCV");
  EXPECT_EQ(cameras[0].params, "502.3,502.6,321.92,212.2,-0.08,0.03,0.0008,-0.0006");
  EXPECT_EQ(cameras[1].width, 300);
}

TEST(ReadKnownCameras, NamesTheBadLine) {
  const TempFolder folder;
  for (const char* line : {"1 OPENCV", "1 OPENCV 640 x 1 2", "1 PINHOLE 640 427 5 six", "hello"}) {
    WriteBytes(folder / "cameras.txt", std::string("# list\n") + line + "\n");
    EXPECT_INPUT_ERROR(ReadKnownCameras(folder / "cameras.txt"), "line 2");
  }
  WriteBytes(folder / "cameras.txt", "# list\n");
  EXPECT_INPUT_ERROR(ReadKnownCameras(folder / "cameras.txt"), "holds no camera");
}

// A view of shapes: the same for the same seed, but for its light and a projected pattern.
cv::Mat View(int seed, bool patterned) {
  cv::RNG random(static_cast<uint64_t>(seed) + 1);
  cv::Mat picture(400, 600, CV_8UC3, cv::Scalar(170, 180, 190));
  for (int i = 0; i < 14; ++i) {
    const cv::Point corner(random.uniform(0, 500), random.uniform(0, 300));
    const cv::Scalar color(random.uniform(0, 150), random.uniform(0, 150), random.uniform(0, 150));
    cv::RotatedRect box(corner, {60.f + 8 * static_cast<float>(i), 90}, random.uniform(0.f, 180.f));
    cv::Point2f corners[4];
    box.points(corners);
    std::vector<cv::Point> polygon(corners, corners + 4);
    cv::fillConvexPoly(picture, polygon, color, cv::LINE_AA);
  }
  if (!patterned) return picture * 0.5;
  cv::RNG dots(77);
  for (int i = 0; i < 150; ++i) {
    cv::circle(picture, {dots.uniform(0, 600), dots.uniform(0, 400)}, dots.uniform(2, 6),
               cv::Scalar::all(dots.uniform(0, 255)), -1, cv::LINE_AA);
  }
  return picture;
}

TEST(LooksPatterned, WhereEveryViewIsThereInTwoLights) {
  const TempFolder folder;
  for (int i = 0; i < 8; ++i) {
    cv::imwrite(folder / ("photo_" + std::to_string(i) + ".jpg"), View(i / 2, i % 2 == 0));
  }
  EXPECT_TRUE(LooksPatterned(folder.path(), ReadPhotoFacts(folder.path())));
}

TEST(LooksPatterned, NotWhereEveryPhotoShowsAnotherView) {
  const TempFolder folder;
  for (int i = 0; i < 8; ++i) {
    cv::imwrite(folder / ("photo_" + std::to_string(i) + ".jpg"), View(i, false));
  }
  EXPECT_FALSE(LooksPatterned(folder.path(), ReadPhotoFacts(folder.path())));
}

}  // namespace
}  // namespace roomtex
