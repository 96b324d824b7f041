#include "align/trust/photo_detail.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "align/trust/free_space.h"
#include "tests/align/case_folder.h"
#include "tests/align/photographed_room.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

SimulatedRoomOptions SmallRoom(int seed = 0) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.num_photos = 9;
  options.photo_width = 600;
  options.photo_height = 400;
  return options;
}

constexpr uint32_t kAsked = 9;  // image_id of photo_008.jpg

// The photo of a room with the same walls and furniture, other pictures and cloths.
void WriteStranger(const std::string& image_path) {
  cv::imwrite(image_path + "/photo_008.jpg", SimulatedRoom(SmallRoom(7)).RenderPhoto(8));
}

TEST(PhotoDetail, PhotosOfTheRoomShowTheSameAndThoseOfAnotherDoNot) {
  const PhotographedRoom room(SmallRoom(), 50, 0.5);
  const FreeSpace free_space(room.scans, 100000);
  const ScanViewer viewer(room.scans, free_space);
  const AlignedPhotos aligned{room.model, room.folder.path()};
  const auto compare = [&](int num_threads) {
    return CompareDetail(aligned, viewer, {2, kAsked}, {kAsked}, PhotoDetailOptions(), num_threads);
  };
  for (const auto& [id, detail] : compare(2)) {
    EXPECT_GT(detail.num_windows, 150) << id;
    EXPECT_GT(detail.Share(), 0.95) << id;
    EXPECT_TRUE(detail.Agrees());
  }
  WriteStranger(room.folder.path());
  const auto one = compare(1), two = compare(2);
  ASSERT_EQ(two.size(), 2u);
  EXPECT_TRUE(two.at(2).Agrees());
  EXPECT_LT(two.at(kAsked).Share(), 0.8);
  EXPECT_FALSE(two.at(kAsked).Agrees());
  EXPECT_EQ(one.at(kAsked).num_alike, two.at(kAsked).num_alike);
  EXPECT_EQ(one.at(kAsked).num_windows, two.at(kAsked).num_windows);
}

TEST(PhotoDetail, SaysNothingOnFewWindows) {
  DetailAgreement few;
  few.num_windows = few.num_alike = 40;
  EXPECT_FALSE(few.Agrees());
  EXPECT_TRUE(std::isnan(DetailAgreement().Share()));
}

// A photo of which nearly no keypoint was matched, though it shows what the others show.
TEST(PhotoDetail, EndsTheDoubtOfAPhotoThatIsNotMatched) {
  SimulatedCase one = MakeCase(SmallRoom(), 6);
  SparseImage& image = one.model.images.at(kAsked);
  size_t seen = 0;
  for (auto& [id, point] : one.model.points) {
    const auto gone =
        std::find_if(point.track.begin(), point.track.end(),
                     [](const TrackElement& element) { return element.image_id == kAsked; });
    if (gone == point.track.end() || point.track.size() < 3 || ++seen % 12 == 0) continue;
    image.point3d_ids[gone->point2d_index] = kInvalidPoint3dId;
    point.track.erase(gone);
  }
  const CaseFolder files(one);
  const std::string image_path = files.folder / "photos";
  WritePhotos(*one.room, image_path);
  const auto align = [&](const std::string& more) {
    const CommandResult result = files.Align(more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
    for (const Json& photo : report["images"]) {
      if (photo["name"] == "photo_008.jpg") return photo;
    }
    return Json();
  };
  const Json alone = align("");
  EXPECT_THAT(alone["doubt"].dump(), HasSubstr("of the sparse points that it ought to show"));
  EXPECT_TRUE(alone["detail_share"].is_null());

  const Json shown = align("--image_path " + image_path);
  EXPECT_TRUE(shown["doubt"].is_null()) << shown;
  EXPECT_GT(shown["detail_share"].get<double>(), 0.95);
  EXPECT_GT(shown["detail_windows"].get<int>(), 300);

  WriteStranger(image_path);
  const Json stranger = align("--image_path " + image_path);
  EXPECT_THAT(stranger["doubt"].dump(), HasSubstr("of the sparse points that it ought to show"));
  EXPECT_LT(stranger["detail_share"].get<double>(), 0.8);
}

}  // namespace
}  // namespace roomtex
