#include "align/agreement.h"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/align/simulated_alignment.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(MutualInformation, OfIndependentImagesIsZero) {
  JointHistogram histogram;
  for (int a = 0; a < 256; a += 5) {
    for (int b = 0; b < 256; b += 5)
      histogram.Add(static_cast<uint8_t>(a), static_cast<uint8_t>(b));
  }
  EXPECT_NEAR(histogram.MutualInformation(), 0, 1e-6);
}

TEST(MutualInformation, OfEightGreysThatDetermineEachOtherIsTheirEntropy) {
  // The Parzen window does not blur eight greys that are 32 apart into each other.
  JointHistogram same, opposite;
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 100; ++k) {
      same.Add(static_cast<uint8_t>(16 + 32 * i), static_cast<uint8_t>(16 + 32 * i));
      opposite.Add(static_cast<uint8_t>(16 + 32 * i), static_cast<uint8_t>(240 - 32 * i));
    }
  }
  EXPECT_NEAR(same.MutualInformation(), std::log(8.0), 1e-3);
  EXPECT_NEAR(opposite.MutualInformation(), std::log(8.0), 1e-3);
}

TEST(MutualInformation, OfNothingIsZero) { EXPECT_EQ(JointHistogram().MutualInformation(), 0); }

TEST(Agreement, IsHighestAtTheTruePosesAndFallsWithTheTurn) {
  const TempFolder folder;
  SimulatedRoomOptions room_options;
  room_options.num_photos = 3;
  room_options.photo_width = 480;
  room_options.photo_height = 320;
  const SimulatedRoom room(room_options);
  SparseModel model = room.MakeSparseModel(100, 0.5);
  TransformModel(room.ScanFromSparse(), &model);
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    cv::imwrite(folder / room.PhotoName(photo), room.RenderPhoto(photo));
  }
  const AgreementOptions options;
  const FreeSpace free_space({room.MakeScan(0)}, 400000);
  std::vector<std::string> warnings;
  const Agreement agreement =
      MeasureAgreement(model, folder.path(), free_space, options, 2, &warnings);
  EXPECT_TRUE(warnings.empty()) << warnings[0];
  EXPECT_EQ(agreement.num_photos, 3);
  EXPECT_GT(agreement.num_pixels, 30000);
  ASSERT_EQ(agreement.turned.size(), 3u);
  double last = agreement.mutual_information;
  for (const Agreement::Turned& turned : agreement.turned) {
    EXPECT_LT(turned.mutual_information, last);
    last = turned.mutual_information;
  }
}

TEST(Agreement, NamesPhotosThatAreMissing) {
  const TempFolder folder;
  SimulatedCase one = MakeCase();
  TransformModel(one.room->ScanFromSparse(), &one.model);
  const FreeSpace free_space(one.scans, 10000);
  std::vector<std::string> warnings;
  const Agreement agreement =
      MeasureAgreement(one.model, folder.path(), free_space, AgreementOptions(), 1, &warnings);
  EXPECT_EQ(agreement.num_photos, 0);
  EXPECT_EQ(warnings.size(), 8u);
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

}  // namespace
}  // namespace roomtex
