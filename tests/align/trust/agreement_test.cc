#include "align/trust/agreement.h"

#include <map>
#include <memory>

#include <gtest/gtest.h>

#include "core/report.h"
#include "tests/align/case_folder.h"
#include "tests/align/photographed_room.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(JointHistogram, OfIndependentImagesMeasuresNothing) {
  JointHistogram histogram;
  for (int a = 0; a < 256; a += 5) {
    for (int b = 0; b < 256; b += 5)
      histogram.Add(static_cast<uint8_t>(a), static_cast<uint8_t>(b));
  }
  EXPECT_NEAR(histogram.Measure().mutual_information, 0, 1e-6);
  EXPECT_NEAR(histogram.Measure().chi_square, 0, 1e-6);
}

TEST(JointHistogram, OfEightGreysThatDetermineEachOtherMeasuresTheirNumber) {
  // The Parzen window does not blur eight greys that are 32 apart into each other.
  JointHistogram same, opposite;
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 100; ++k) {
      same.Add(static_cast<uint8_t>(16 + 32 * i), static_cast<uint8_t>(16 + 32 * i));
      opposite.Add(static_cast<uint8_t>(16 + 32 * i), static_cast<uint8_t>(240 - 32 * i));
    }
  }
  EXPECT_NEAR(same.Measure().mutual_information, std::log(8.0), 1e-3);
  EXPECT_NEAR(opposite.Measure().mutual_information, std::log(8.0), 1e-3);
  // With one cell in eight of every row: (1/8 - 1/64)^2 / (1/64) * 8 + (1/64) * 56 = 8 - 1.
  EXPECT_NEAR(same.Measure().chi_square, 7, 1e-3);
  EXPECT_NEAR(opposite.Measure().chi_square, 7, 1e-3);
}

TEST(JointHistogram, OfNothingIsZero) {
  EXPECT_EQ(JointHistogram().Measure().mutual_information, 0);
  EXPECT_EQ(JointHistogram().Measure().chi_square, 0);
}

// A picture of 64 x 32 pixels whose patches of 16 pixels have the given greys = offset + slope * x.
cv::Mat1b Ramp(int offset, int slope) {
  cv::Mat1b image(32, 64);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image(y, x) = static_cast<uchar>(offset + slope * (x % 16) + y % 16);
    }
  }
  return image;
}

TEST(PatchNcc, IsOneForEqualImagesUpToBrightnessAndContrast) {
  const cv::Mat1b valid(32, 64, static_cast<uchar>(255));
  EXPECT_NEAR(PatchNcc(Ramp(10, 3), Ramp(10, 3), valid, 16), 1, 1e-12);
  cv::Mat1b stretched;
  cv::Mat(2 * Ramp(10, 3) + 20).convertTo(stretched, CV_8U);
  EXPECT_NEAR(PatchNcc(Ramp(10, 3), stretched, valid, 16), 1, 1e-12);
}

TEST(PatchNcc, LeavesOutWhatIsInvalidFlatOrOpposite) {
  cv::Mat1b valid(32, 64, static_cast<uchar>(255));
  const cv::Mat1b image = Ramp(10, 3);
  cv::Mat1b opposite = 255 - image;
  EXPECT_EQ(PatchNcc(image, opposite, valid, 16), 0);
  EXPECT_EQ(PatchNcc(image, cv::Mat1b(32, 64, static_cast<uchar>(9)), valid, 16), 0);
  // Only the patches of the left half are equal; the others are opposite or hold an invalid pixel.
  cv::Mat1b half = image.clone();
  opposite(cv::Rect(32, 0, 32, 32)).copyTo(half(cv::Rect(32, 0, 32, 32)));
  EXPECT_NEAR(PatchNcc(image, half, valid, 16), 1, 1e-12);
  half(5, 5) = 255;
  EXPECT_LT(PatchNcc(image, half, valid, 16), 0.999);
  valid(5, 5) = 0;
  EXPECT_NEAR(PatchNcc(image, half, valid, 16), 1, 1e-12);
}

Agreement MeasureAt(const SparseModel& aligned, const PhotographedRoom& one, int num_threads = 2) {
  const FreeSpace free_space(one.scans, 100000);
  std::vector<std::string> warnings;
  const Agreement agreement =
      MeasureAgreement({aligned, one.folder.path()}, ScanViewer(one.scans, free_space),
                       AgreementOptions(), num_threads, &warnings);
  EXPECT_TRUE(warnings.empty()) << warnings[0];
  return agreement;
}

const PhotographedRoom& SmallRoom(int seed = 0) {
  static std::map<int, std::unique_ptr<PhotographedRoom>> rooms;
  std::unique_ptr<PhotographedRoom>& room = rooms[seed];
  if (room == nullptr) {
    SimulatedRoomOptions options;
    options.random_seed = seed;
    options.num_photos = 6;
    options.photo_width = 720;
    options.photo_height = 480;
    options.scan_columns = 1200;
    options.scan_rows = 600;
    room = std::make_unique<PhotographedRoom>(options, 2000, 0.7);
  }
  return *room;
}

TEST(Agreement, IsHighestAtTheTruePosesAndFallsWithTheTurn) {
  const Agreement agreement = MeasureAt(SmallRoom().model, SmallRoom());
  EXPECT_EQ(agreement.num_photos, 6);
  EXPECT_GT(agreement.num_pixels, 100000);
  ASSERT_EQ(agreement.turned.size(), 3u);
  ImageMeasures last = agreement.at_pose;
  for (const Agreement::Turned& turned : agreement.turned) {
    EXPECT_LT(turned.measures.mutual_information, last.mutual_information);
    EXPECT_LT(turned.measures.chi_square, last.chi_square);
    EXPECT_LT(turned.measures.patch_ncc, last.patch_ncc);
    last = turned.measures;
  }
  EXPECT_TRUE(agreement.gradient.supports);
  EXPECT_FALSE(agreement.gradient.contradicts);
}

TEST(Agreement, DoesNotDependOnTheNumberOfThreads) {
  const Agreement one = MeasureAt(SmallRoom().model, SmallRoom(), 1);
  const Agreement four = MeasureAt(SmallRoom().model, SmallRoom(), 4);
  EXPECT_EQ(one.at_pose.mutual_information, four.at_pose.mutual_information);
  EXPECT_EQ(one.at_pose.chi_square, four.at_pose.chi_square);
  EXPECT_EQ(one.at_pose.patch_ncc, four.at_pose.patch_ncc);
  EXPECT_EQ(one.gradient.shifts.shifts_px, four.gradient.shifts.shifts_px);
  EXPECT_EQ(one.gradient.shifts.far.hits, four.gradient.shifts.far.hits);
}

TEST(Agreement, NamesPhotosThatAreMissing) {
  const TempFolder folder;
  SimulatedCase one = MakeCase();
  TransformModel(one.room->ScanFromSparse(), &one.model);
  const FreeSpace free_space(one.scans, 10000);
  std::vector<std::string> warnings;
  const Agreement agreement =
      MeasureAgreement({one.model, folder.path()}, ScanViewer(one.scans, free_space),
                       AgreementOptions(), 1, &warnings);
  EXPECT_EQ(agreement.num_photos, 0);
  EXPECT_EQ(warnings.size(), 8u);
  EXPECT_FALSE(agreement.gradient.supports);
  EXPECT_FALSE(agreement.gradient.contradicts);
}

// As a user would see it: the photos of this room, and those of another one under the same names.
TEST(AlignCommand, IsNotTrustedWithThePhotosOfAnotherRoom) {
  const PhotographedRoom& one = SmallRoom(0);
  SimulatedCase files_of_case;
  files_of_case.model = one.sparse;
  files_of_case.scans = one.scans;
  files_of_case.picks = PicksOfPhoto(one.room, one.room.BestPhotoForPicks(), 8);
  const CaseFolder files(files_of_case);
  const CommandResult right = files.Align("--image_path " + one.folder.path());
  EXPECT_EQ(right.exit_code, 0) << right.err;
  Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report["agreement"]["gradient_shift"]["supports"], true);
  EXPECT_EQ(report["agreement"]["gradient_shift"]["turned"].size(), 3u);
  EXPECT_EQ(report["agreement"]["gradient_shift"]["moved"].size(), 3u);
  EXPECT_EQ(report["agreement"]["turned"].size(), 3u);
  EXPECT_EQ(report["overlays"].size(), 0u);
  // Model and scan have the same shape.
  EXPECT_TRUE(report["plane_bundle"]["corners"].is_null());

  const CommandResult wrong = files.Align("--image_path " + SmallRoom(1).folder.path());
  EXPECT_EQ(wrong.exit_code, 4);
  EXPECT_NE(wrong.err.find("Photos and scan do not show the same"), std::string::npos) << wrong.err;
  // The trusted one is kept.
  report = Json::parse(ReadBytes(files.folder / "aligned.untrusted/alignment.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_EQ(report["agreement"]["gradient_shift"]["contradicts"], true);
}

TEST(FreeSpace, KnowsWhatFloatsWhatIsHiddenAndWhatIsOnTheSurface) {
  const SimulatedCase& one = MakeCase();
  const FreeSpace free_space(one.scans, 100000);
  int tried = 0;
  for (size_t i = 1000; i < one.scans[0].points.size(); i += 7919) {
    if (one.scans[0].IsMissing(static_cast<int>(i))) continue;
    const Eigen::Vector3d p = one.scans[0].points[i];  // the station is the origin
    if (free_space.Locate(p, 0.05) != FreeSpace::Place::kSurface) continue;  // at an edge
    EXPECT_EQ(free_space.Locate(0.7 * p, 0.05), FreeSpace::Place::kFloating);
    EXPECT_EQ(free_space.Locate(1.4 * p, 0.05), FreeSpace::Place::kHidden);
    ++tried;
  }
  EXPECT_GT(tried, 20);
}

// The ray of a sample meets the coarse mesh at that sample's own place in the full grid.
TEST(FreeSpace, SaysWhereInTheGridItLooks) {
  const SimulatedCase& one = MakeCase();
  const Scan& scan = one.scans[0];
  const FreeSpace free_space(one.scans, 40000);
  int tried = 0, near = 0;
  for (size_t i = 1000; i < scan.points.size(); i += 997) {
    const int index = static_cast<int>(i);
    if (scan.IsMissing(index)) continue;
    const auto sight = free_space.Look(Eigen::Vector3d::Zero(), scan.points[i].normalized());
    if (!sight) continue;
    ++tried;
    double off = std::abs(sight->column - index % scan.num_columns);
    off = std::min(off, scan.num_columns - off);  // a full turn
    near += std::hypot(off, sight->row - index / scan.num_columns) < 0.5;
  }
  EXPECT_GT(tried, 200);
  EXPECT_GT(near, 0.97 * tried);
}

}  // namespace
}  // namespace roomtex
