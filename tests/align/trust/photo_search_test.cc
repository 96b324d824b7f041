#include "align/trust/photo_search.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

Camera TestCamera() {
  Camera camera;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = 640;
  camera.height = 480;
  camera.params = {525, 320, 240, -0.03};
  return camera;
}

// A photo of places between 1.5 and 5 m in front of it: `num_right` matches to 1 pixel, the others
// with a place anywhere in the room.
struct PhotoOfPlaces {
  Rigid truth;
  std::vector<PhotoMatch> matches;

  PhotoOfPlaces(uint64_t seed, int num_right, int num_wrong) {
    RandomStream random(seed);
    truth.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(
        random.Uniform(0, 3), Eigen::Vector3d(1, random.Uniform(-1, 1), 0.4).normalized()));
    truth.translation = {random.Uniform(-2, 2), random.Uniform(-1, 1), random.Uniform(-2, 2)};
    const CameraProjection projection(TestCamera());
    const auto anywhere = [&] {
      const Eigen::Vector2d x(random.Uniform(0, 640), random.Uniform(0, 480));
      const Eigen::Vector3d ray = *projection.RayFromImg(x);
      return std::make_pair(x, Eigen::Vector3d(truth.Inverse() * (random.Uniform(1.5, 5) * ray)));
    };
    for (int i = 0; i < num_right + num_wrong; ++i) {
      auto [x_in_img, x_in_scan] = anywhere();
      if (i >= num_right) x_in_scan = anywhere().second;
      x_in_img += Eigen::Vector2d(random.Gaussian(), random.Gaussian());
      matches.push_back({x_in_img, x_in_scan});
    }
  }
  // Metres.
  double Error(const PhotoPlace& place) const {
    return (place.cam_from_scan.TargetOriginInSource() - truth.TargetOriginInSource()).norm();
  }
};

TEST(PhotoSearch, FindsThePoseAmongFiveTimesAsManyWrongMatches) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const PhotoOfPlaces photo(seed, 30, 150);
    const std::vector<PhotoPlace> places = SearchPhotoPlaces(photo.matches, TestCamera(), {}, 2);
    ASSERT_FALSE(places.empty());
    EXPECT_LT(photo.Error(places[0]), 0.02);
    EXPECT_GE(places[0].num_cells, 25);
    if (places.size() > 1) {
      EXPECT_LT(places[1].num_cells, places[0].num_cells / 2);  // some of the same matches, askew
    }
    const std::vector<int>& agreeing = places[0].agreeing;
    const auto num_wrong =
        std::count_if(agreeing.begin(), agreeing.end(), [](int i) { return i >= 30; });
    EXPECT_LE(num_wrong, 1);  // measured: 0 of 29 or 30
  }
}

TEST(PhotoSearch, OfWrongMatchesAloneFewAgree) {
  const PhotoOfPlaces photo(7, 0, 200);
  const std::vector<PhotoPlace> places = SearchPhotoPlaces(photo.matches, TestCamera(), {}, 2);
  ASSERT_FALSE(places.empty());
  EXPECT_LT(places[0].num_cells, 10);
}

TEST(PhotoSearch, TriesEveryFocalLength) {
  const PhotoOfPlaces photo(8, 40, 80);
  const Camera told = WithFocalScale(TestCamera(), 1.5);
  PhotoSearchOptions options;
  options.focal_scales = {0.5, 2.0 / 3, 0.85, 1};
  const std::vector<PhotoPlace> places = SearchPhotoPlaces(photo.matches, told, options, 2);
  ASSERT_FALSE(places.empty());
  EXPECT_DOUBLE_EQ(places[0].focal_scale, 2.0 / 3);
  EXPECT_LT(photo.Error(places[0]), 0.03);
  // By as much as is asked for, and both of two focal lengths.
  Camera two = TestCamera();
  two.model = CameraModel::kPinhole;
  two.params = {500, 510, 320, 240};
  EXPECT_EQ(WithFocalScale(two, 2).params, (std::vector<double>{1000, 1020, 320, 240}));
}

TEST(PhotoSearch, MatchesOfOnePlaceOrOneSpotOfThePhotoCountOnce) {
  PhotoOfPlaces photo(9, 6, 0);
  std::vector<PhotoMatch> many;
  for (int copy = 0; copy < 20; ++copy) {
    many.insert(many.end(), photo.matches.begin(), photo.matches.end());
  }
  const std::vector<PhotoPlace> places = SearchPhotoPlaces(many, TestCamera(), {}, 2);
  ASSERT_FALSE(places.empty());
  EXPECT_LE(places[0].num_cells, 6);
}

TEST(PhotoSearch, IsTheSameForEveryNumberOfThreads) {
  const PhotoOfPlaces photo(10, 20, 100);
  const auto one = SearchPhotoPlaces(photo.matches, TestCamera(), {}, 1);
  const auto four = SearchPhotoPlaces(photo.matches, TestCamera(), {}, 4);
  ASSERT_EQ(one.size(), four.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].num_cells, four[i].num_cells);
    EXPECT_EQ(one[i].agreeing, four[i].agreeing);
    EXPECT_EQ(one[i].cam_from_scan.translation, four[i].cam_from_scan.translation);
  }
}

TEST(PhotoSearch, NothingComesOfNothing) {
  EXPECT_TRUE(SearchPhotoPlaces({}, TestCamera(), {}, 2).empty());
  const PhotoOfPlaces photo(11, 3, 0);
  EXPECT_TRUE(SearchPhotoPlaces(photo.matches, TestCamera(), {}, 2).empty());
}

}  // namespace
}  // namespace roomtex
