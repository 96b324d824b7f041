#include "align/trust/transparent_parts.h"

#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "align/trust/agreement.h"
#include "align/trust/appearance_features.h"
#include "align/trust/photo_comparison.h"
#include "tests/align/photographed_room.h"

namespace roomtex {
namespace {

// A room whose photos, as PNG files, are cut out: what lies beyond the left half of each is
// transparent, and its colours there are those of another place.
struct CutOutRoom {
  CutOutRoom() : one(Options(), 1500, 0.7), cut(one.model), plain(one.model) {
    for (auto& [id, image] : cut.images) {
      const cv::Mat photo = cv::imread(one.folder.path() + "/" + image.name);
      cv::Mat with_alpha, turned;
      cv::flip(photo, turned, -1);
      const cv::Rect right(photo.cols / 2, 0, photo.cols - photo.cols / 2, photo.rows);
      turned(right).copyTo(photo(right));
      image.name += ".png";
      plain.images.at(id).name = "opaque/" + image.name;
      std::filesystem::create_directories(one.folder.path() + "/opaque");
      cv::imwrite(one.folder.path() + "/" + plain.images.at(id).name, photo);
      cv::cvtColor(photo, with_alpha, cv::COLOR_BGR2BGRA);
      with_alpha(right).forEach<cv::Vec4b>([](cv::Vec4b& pixel, const int*) { pixel[3] = 0; });
      cv::imwrite(one.folder.path() + "/" + image.name, with_alpha);
    }
  }

  static SimulatedRoomOptions Options() {
    SimulatedRoomOptions options;
    options.num_photos = 10;
    options.photo_width = 720;
    options.photo_height = 480;
    options.scan_columns = 1200;
    options.scan_rows = 600;
    return options;
  }

  PhotographedRoom one;
  SparseModel cut, plain;  // in `scan`; names of the cut photos, and of the same without alpha
};

const CutOutRoom& Room() {
  static const CutOutRoom room;
  return room;
}

const ScanViewer& Viewer() {
  static const FreeSpace free_space(Room().one.scans, 100000);
  static const ScanViewer viewer(Room().one.scans, free_space);
  return viewer;
}

Agreement AgreementOf(const SparseModel& model) {
  std::vector<std::string> warnings;
  AgreementOptions options;
  options.enough_patches = 1000000;  // the same photos, however much each of them holds
  const Agreement agreement =
      MeasureAgreement({model, Room().one.folder.path()}, Viewer(), options, 2, &warnings);
  EXPECT_TRUE(warnings.empty()) << warnings[0];
  return agreement;
}

TEST(TransparentParts, TakeCellsWithinEightPixelsOutOfAView) {
  ScanView view;
  view.cell_px = 4;
  view.grey = cv::Mat1f(20, 30, 100.0f);
  view.valid = cv::Mat1b(20, 30, static_cast<uchar>(255));
  view.depth = cv::Mat1f(20, 30, 2.0f);
  view.column = view.row = cv::Mat1f(20, 30, 5.0f);
  cv::Mat1b transparent(82, 121, static_cast<uchar>(0));  // two rows and a pixel beyond the cells
  transparent(41, 61) = 255;
  LeaveOutTransparent(transparent, &view);
  // Pixels 53 to 69 across and 33 to 49 down: columns 13 to 17, rows 8 to 12.
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) {
      const bool is_near = x >= 13 && x <= 17 && y >= 8 && y <= 12;
      EXPECT_EQ(view.valid(y, x), is_near ? 0 : 255) << x << " " << y;
      EXPECT_EQ(view.unseen(y, x), is_near ? 255 : 0) << x << " " << y;
      EXPECT_EQ(view.depth(y, x), is_near ? 0 : 2) << x << " " << y;
    }
  }
  EXPECT_NEAR(view.valid_share, 1 - 25.0 / 600, 1e-12);
}

TEST(TransparentParts, AreReadInThePixelsOfTheCamera) {
  const auto& [id, image] = *Room().cut.images.begin();
  Camera camera = Room().cut.cameras.at(image.camera_id);
  const std::string folder = Room().one.folder.path();
  const cv::Mat1b transparent = ReadTransparencyOf(image, camera, folder);
  ASSERT_EQ(transparent.size(), cv::Size(720, 480));
  EXPECT_EQ(transparent(200, 359), 0);
  EXPECT_EQ(transparent(200, 360), 255);
  camera.Resize(360, 240);
  const cv::Mat1b small = ReadTransparencyOf(image, camera, folder);
  ASSERT_EQ(small.size(), cv::Size(360, 240));
  EXPECT_EQ(small(100, 179), 0);
  EXPECT_EQ(small(100, 180), 255);
  EXPECT_TRUE(
      ReadTransparencyOf(Room().plain.images.at(id), Room().cut.cameras.at(image.camera_id), folder)
          .empty());
}

// The scan is compared with what photos show, not with what is under their transparent parts.
TEST(TransparentParts, TakeNoPartInTheAgreement) {
  const Agreement whole = AgreementOf(Room().one.model), cut = AgreementOf(Room().cut),
                  plain = AgreementOf(Room().plain);
  EXPECT_LT(cut.num_pixels, 0.6 * whole.num_pixels);
  EXPECT_GT(cut.gradient.shifts.at_pose.Share(), 0.9 * whole.gradient.shifts.at_pose.Share());
  EXPECT_LT(plain.gradient.shifts.at_pose.Share(), 0.7 * whole.gradient.shifts.at_pose.Share());
  EXPECT_GT(cut.at_pose.patch_ncc, 0.9 * whole.at_pose.patch_ncc);
}

TEST(TransparentParts, TakeNoPartInTheComparisonOfPhotos) {
  PhotoComparisonOptions options;
  options.num_samples = 400000;  // of half photos that overlap little
  const auto compare = [&options](const SparseModel& model) {
    return ComparePhotosOnScan({model, Room().one.folder.path()}, Viewer(), options, 2)
        .MedianCorrelation();
  };
  EXPECT_GT(compare(Room().cut), 0.95 * compare(Room().one.model));
  EXPECT_LT(compare(Room().plain), 0.7 * compare(Room().one.model));
}

TEST(TransparentParts, HaveNoFeatures) {
  const SparseImage& image = Room().cut.images.begin()->second;
  const cv::Mat1b picture = ReadPictureOf(image, Room().cut.cameras.at(image.camera_id),
                                          Room().one.folder.path(), Viewer());
  ASSERT_FALSE(picture.empty());
  const cv::Rect right(picture.cols / 2 + 1, 0, picture.cols - picture.cols / 2 - 1, picture.rows);
  EXPECT_EQ(cv::countNonZero(picture(right) != 128), 0);
  EXPECT_GT(cv::countNonZero(picture != 128), picture.rows * picture.cols / 3);
}

}  // namespace
}  // namespace roomtex
