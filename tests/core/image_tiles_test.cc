#include "core/image_tiles.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/photo.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// Every pixel tells where it is.
cv::Mat PlacePicture(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<uchar>(x), static_cast<uchar>(y),
                                            static_cast<uchar>(x / 256 + 16 * (y / 256)));
    }
  }
  return image;
}

cv::Mat Decoded(const std::shared_ptr<const std::string>& tile) {
  if (!tile) return {};
  const std::vector<unsigned char> bytes(tile->begin(), tile->end());
  return cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
}

bool AreEqual(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

class PlaceTiles : public testing::Test {
 protected:
  void SetUp() override {
    tiles_.Add("a", 1100, 700, ImageTiles::Format::kPng, [this] {
      ++num_loads_;
      return picture_;
    });
  }
  const cv::Mat picture_ = PlacePicture(1100, 700);
  std::atomic<int> num_loads_{0};
  ImageTiles tiles_{ImageTilesOptions()};
};

TEST_F(PlaceTiles, TileHasThePixelsOfItsPlace) {
  EXPECT_EQ(num_loads_, 0);
  EXPECT_TRUE(AreEqual(Decoded(tiles_.Tile("a", 0, 0, 0)), picture_(cv::Rect(0, 0, 512, 512))));
  EXPECT_TRUE(AreEqual(Decoded(tiles_.Tile("a", 0, 1, 0)), picture_(cv::Rect(512, 0, 512, 512))));
  EXPECT_EQ(num_loads_, 1);
}

TEST_F(PlaceTiles, TilesAtTheBorderAreSmaller) {
  EXPECT_TRUE(AreEqual(Decoded(tiles_.Tile("a", 0, 2, 1)), picture_(cv::Rect(1024, 512, 76, 188))));
}

TEST_F(PlaceTiles, OutsideThereIsNone) {
  constexpr int kMost = std::numeric_limits<int>::max();
  EXPECT_EQ(tiles_.Tile("b", 0, 0, 0), nullptr);
  for (const auto& [level, x, y] : std::vector<std::array<int, 3>>{{-1, 0, 0},
                                                                   {3, 0, 0},
                                                                   {kMost, 0, 0},
                                                                   {0, 3, 0},
                                                                   {0, 0, 2},
                                                                   {0, -1, 0},
                                                                   {0, 0, -1},
                                                                   {0, kMost, 0},
                                                                   {0, 0, kMost},
                                                                   {2, 1, 0},
                                                                   {2, 0, 1}}) {
    EXPECT_EQ(tiles_.Tile("a", level, x, y), nullptr) << level << " " << x << " " << y;
  }
  EXPECT_EQ(num_loads_, 0);
  EXPECT_EQ(tiles_.Pyramid("b").num_levels, 0);
}

TEST_F(PlaceTiles, EveryLevelHalvesUntilOneTileHoldsIt) {
  const TilePyramid pyramid = tiles_.Pyramid("a");
  ASSERT_EQ(pyramid.num_levels, 3);
  EXPECT_EQ(pyramid.LevelWidth(1), 550);
  EXPECT_EQ(pyramid.LevelHeight(1), 350);
  EXPECT_EQ(pyramid.LevelWidth(2), 275);
  EXPECT_EQ(pyramid.LevelHeight(2), 175);
  EXPECT_EQ(Decoded(tiles_.Tile("a", 2, 0, 0)).size(), cv::Size(275, 175));
}

TEST(ImageTiles, PixelOfALevelIsTheMeanOfTheBlockItStandsFor) {
  // Odd sizes: the blocks must not shift toward the right and lower border.
  cv::Mat picture(601, 1027, CV_8UC1);
  cv::RNG random(1);
  random.fill(picture, cv::RNG::UNIFORM, 0, 256);
  ImageTiles tiles{ImageTilesOptions()};
  tiles.Add("grey", 1027, 601, ImageTiles::Format::kPng, [&] { return picture; });
  const cv::Mat right = Decoded(tiles.Tile("grey", 1, 1, 0));
  ASSERT_EQ(right.type(), CV_8UC1);
  ASSERT_EQ(right.size(), cv::Size(2, 301));
  const cv::Mat left = Decoded(tiles.Tile("grey", 1, 0, 0));
  ASSERT_EQ(left.size(), cv::Size(512, 301));
  const auto mean = [&](int x, int y) {
    double sum = 0;
    for (const int dy : {0, 1}) {
      for (const int dx : {0, 1}) {
        sum += picture.at<uchar>(std::min(2 * y + dy, 600), std::min(2 * x + dx, 1026));
      }
    }
    return sum / 4;
  };
  double worst = 0;
  for (int y = 0; y < 301; ++y) {
    for (int x = 0; x < 514; ++x) {
      const int value = x < 512 ? left.at<uchar>(y, x) : right.at<uchar>(y, x - 512);
      worst = std::max(worst, std::abs(value - mean(x, y)));
    }
  }
  EXPECT_LE(worst, 0.5);
}

TEST(ImageTiles, JpegIsCloseToThePicture) {
  const cv::Mat picture(300, 400, CV_8UC3, cv::Scalar(40, 90, 200));
  ImageTiles tiles{ImageTilesOptions()};
  tiles.Add("photo", 400, 300, ImageTiles::Format::kJpeg, [&] { return picture; });
  const auto tile = tiles.Tile("photo", 0, 0, 0);
  ASSERT_NE(tile, nullptr);
  EXPECT_EQ(tile->substr(0, 2), "\xff\xd8");
  EXPECT_LE(cv::norm(Decoded(tile), picture, cv::NORM_INF), 4);
  EXPECT_STREQ(ImageTiles::ContentType(tiles.FormatOf("photo")), "image/jpeg");
}

TEST(ImageTiles, CacheStaysWithinItsBytesAndForgetsTheLeastRecentlyUsed) {
  ImageTilesOptions options;
  options.max_megabytes = 4;
  ImageTiles tiles(options);
  std::array<int, 3> num_loads{};
  for (int i = 0; i < 3; ++i) {  // 1.6 MB of level 0 each: two fit, three do not
    tiles.Add(std::to_string(i), 700, 760, ImageTiles::Format::kJpeg, [&num_loads, i] {
      ++num_loads[i];
      return cv::Mat(760, 700, CV_8UC3, cv::Scalar(i, 100, 200));
    });
  }
  const auto ask = [&](const char* id, int x, int y) {
    EXPECT_NE(tiles.Tile(id, 0, x, y), nullptr);
    EXPECT_LE(tiles.cached_bytes(), int64_t{4} << 20);
    EXPECT_GT(tiles.cached_bytes(), 0);
  };
  ask("0", 0, 0);
  ask("1", 0, 0);
  ask("0", 1, 0);
  EXPECT_EQ(num_loads, (std::array<int, 3>{1, 1, 0}));
  ask("2", 0, 0);  // drives out 1, which was used longest ago
  ask("0", 0, 1);
  EXPECT_EQ(num_loads, (std::array<int, 3>{1, 1, 1}));
  ask("1", 0, 0);  // an encoded tile is small and still there
  EXPECT_EQ(num_loads, (std::array<int, 3>{1, 1, 1}));
  ask("1", 1, 1);
  EXPECT_EQ(num_loads, (std::array<int, 3>{1, 2, 1}));
}

TEST(ImageTiles, PictureLargerThanTheCacheIsServedAllTheSame) {
  ImageTilesOptions options;
  options.max_megabytes = 1;
  ImageTiles tiles(options);
  const cv::Mat picture = PlacePicture(1000, 700);
  tiles.Add("large", 1000, 700, ImageTiles::Format::kPng, [&] { return picture; });
  EXPECT_TRUE(
      AreEqual(Decoded(tiles.Tile("large", 0, 1, 1)), picture(cv::Rect(512, 512, 488, 188))));
  EXPECT_LE(tiles.cached_bytes(), int64_t{1} << 20);
}

TEST_F(PlaceTiles, ThreadsGetTheSameTilesAndThePictureIsDecodedOnce) {
  std::vector<std::thread> threads;
  std::atomic<int> num_wrong{0};
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 6; ++i) {
        const int x = (i + t) % 3, y = (i + t) / 3 % 2;
        const cv::Rect area = cv::Rect(512 * x, 512 * y, 512, 512) & cv::Rect(0, 0, 1100, 700);
        if (!AreEqual(Decoded(tiles_.Tile("a", 0, x, y)), picture_(area))) ++num_wrong;
        if (!tiles_.Tile("a", 2, 0, 0)) ++num_wrong;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_wrong, 0);
  EXPECT_EQ(num_loads_, 1);
}

TEST(ImageTiles, NoMorePicturesAreDecodedSideBySideThanAllowed) {
  ImageTiles tiles{ImageTilesOptions()};
  std::atomic<int> num_now{0}, most{0};
  for (int i = 0; i < 8; ++i) {
    tiles.Add(std::to_string(i), 20, 20, ImageTiles::Format::kJpeg, [&] {
      const int now = ++num_now;
      for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      --num_now;
      return cv::Mat(20, 20, CV_8UC1, cv::Scalar(7));
    });
  }
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, i] { EXPECT_NE(tiles.Tile(std::to_string(i), 0, 0, 0), nullptr); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(most, ImageTilesOptions().max_decodes);
}

TEST_F(PlaceTiles, ANewPictureOfTheSameNameReplacesTheOldOne) {
  ASSERT_NE(tiles_.Tile("a", 0, 0, 0), nullptr);
  const cv::Mat other(60, 80, CV_8UC3, cv::Scalar(1, 2, 3));
  tiles_.Add("a", 80, 60, ImageTiles::Format::kPng, [&] { return other; });
  EXPECT_TRUE(AreEqual(Decoded(tiles_.Tile("a", 0, 0, 0)), other));
  EXPECT_EQ(tiles_.Pyramid("a").num_levels, 1);
}

TEST(ImageTiles, FailuresOfTheLoaderAreThrownAndTriedAgain) {
  const TempFolder folder;
  const std::string path = folder / "photo.png";
  ImageTiles tiles{ImageTilesOptions()};
  tiles.Add("p", 80, 60, ImageTiles::Format::kPng, [&] { return ReadPhoto(path); });
  for (int i = 0; i < 3; ++i) {  // more often than decodes may run: none may be left occupied
    EXPECT_INPUT_ERROR(tiles.Tile("p", 0, 0, 0), "does not exist");
  }
  cv::imwrite(path, cv::Mat(60, 81, CV_8UC3, cv::Scalar(1, 2, 3)));
  EXPECT_INPUT_ERROR(tiles.Tile("p", 0, 0, 0), "p: has 81 x 60 pixels, expected 80 x 60");
  cv::imwrite(path, cv::Mat(60, 80, CV_8UC3, cv::Scalar(1, 2, 3)));
  EXPECT_NE(tiles.Tile("p", 0, 0, 0), nullptr);
}

TEST(ImageTiles, OptionsThatCannotBeMeantAreRefused) {
  ImageTilesOptions options;
  EXPECT_TRUE(options.Problems().empty());
  options.tile_size = 0;
  options.jpeg_quality = 101;
  options.max_megabytes = 0;
  options.max_decodes = 0;
  EXPECT_EQ(options.Problems().size(), 4u);
  EXPECT_THROW(ImageTiles tiles(options), UsageError);
  ImageTiles tiles{ImageTilesOptions()};
  EXPECT_THROW(tiles.Add("empty", 0, 5, ImageTiles::Format::kPng, [] { return cv::Mat(); }),
               InputError);
}

}  // namespace
}  // namespace roomtex
