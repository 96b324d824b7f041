// roomtex-pairs where photos that overlap do not look alike: hints of EXIF, and rings of photos.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <set>

#include <exiv2/exiv2.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "colmap_ext/nearest_places.h"
#include "colmap_ext/view_graph.h"
#include "core/photo.h"
#include "core/report.h"
#include "tests/colmap_ext/room_database.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

// The features of a photo to come.
struct MadeFeatures {
  std::vector<Eigen::Vector2d> x_in_img;
  std::vector<uint8_t> descriptors;

  void Add(const Eigen::Vector2d& x, uint64_t look, uint64_t view) {
    x_in_img.push_back(x);
    const std::vector<uint8_t> one = DescriptorOfLook(look, view);
    descriptors.insert(descriptors.end(), one.begin(), one.end());
  }
  // A wallpaper: what the photo mostly looks like, and no match, since every part is there twice.
  void AddWallpaper(uint64_t kind, uint64_t view) {
    constexpr uint64_t kParts = 60;
    RandomStream random(MixBits(view, kind));
    for (uint64_t copy = 0; copy < 2; ++copy) {
      for (uint64_t part = 0; part < kParts; ++part) {
        Add({random.Uniform(0, 1000), random.Uniform(0, 750)}, MixBits(1000 + kind, part),
            MixBits(view, copy));
      }
    }
  }
};

class PairsReach : public testing::Test {
 protected:
  void WritePhotos(const std::vector<std::pair<std::string, MadeFeatures>>& photos,
                   const Camera& camera) {
    DatabaseMaker maker(database_, DatabaseMaker::Schema::k38);
    maker.Run("BEGIN");
    maker.AddCamera(camera);
    uint32_t image_id = 0;
    for (const auto& [name, features] : photos) {
      maker.AddImage(++image_id, name, camera.camera_id);
      maker.AddKeypoints(image_id, features.x_in_img, 6);
      maker.AddDescriptors(image_id, features.descriptors);
    }
    maker.Run("COMMIT");
  }
  void Run(const std::string& more = "") {
    const CommandResult result =
        RunCommandLine("roomtex-pairs --database_path " + database_ + " --output_path " +
                       (folder_ / "pairs.txt") + " --report_path " + (folder_ / "report.json") +
                       " --graph_path " + (folder_ / "graph.json") + " " + more);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    graph_ = Json::parse(std::ifstream(folder_ / "graph.json"));
    report_ = Json::parse(std::ifstream(folder_ / "report.json"));
  }
  // How a pair that agrees was found; "" = it was not.
  std::string FoundBy(const std::string& name1, const std::string& name2) const {
    for (const Json& edge : graph_["edges"]) {
      const bool is_it = (edge["name1"] == name1 && edge["name2"] == name2) ||
                         (edge["name1"] == name2 && edge["name2"] == name1);
      if (is_it && edge["agrees"] && edge["listed"]) return edge["found_by"];
    }
    return "";
  }

  TempFolder folder_;
  const std::string database_ = folder_ / "database.db";
  Json graph_, report_;
};

// Two photos of one thing on different wallpapers, among fifty of each that show something else:
// neither is among the likest of the other.
class PairsHints : public PairsReach {
 protected:
  static constexpr int kNumOthers = 50;
  const std::string first_ = "one/a.jpg", second_ = "two/b.jpg";
  const std::string few_ = "--Pairs.num_candidates 6";

  void SetUp() override {
    SimulatedViewsOptions options;
    options.num_points = 90;
    const SimulatedViews views = SimulateViews(options);
    std::vector<std::pair<std::string, MadeFeatures>> photos;
    for (uint64_t kind = 0; kind < 2; ++kind) {
      MadeFeatures features;
      const auto id = static_cast<uint32_t>(kind + 1);
      for (size_t i = 0; i < views.keypoints.at(id).size(); ++i) {
        features.Add(views.keypoints.at(id)[i],
                     static_cast<uint64_t>(views.point_of_keypoint.at(id)[i]), kind);
      }
      features.AddWallpaper(kind, kind);
      photos.emplace_back(kind == 0 ? first_ : second_, features);
      for (int i = 0; i < kNumOthers; ++i) {
        MadeFeatures others;
        const uint64_t view = 100 * (kind + 1) + static_cast<uint64_t>(i);
        for (uint64_t point = 0; point < 30; ++point) {
          RandomStream random(MixBits(view, point));
          others.Add({random.Uniform(0, 1000), random.Uniform(0, 750)}, MixBits(view, point), view);
        }
        others.AddWallpaper(kind, view);
        photos.emplace_back(OtherName(static_cast<int>(kind), i), others);
      }
    }
    WritePhotos(photos, views.cameras.at(1));
  }
  static std::string OtherName(int kind, int i) {
    return (kind == 0 ? "one/" : "two/") + std::to_string(100 + i) + ".jpg";
  }
  // An empty picture, with what EXIF says of time and place.
  void WritePicture(const std::string& name, const std::string& date_time) {
    const std::string path = folder_ / name;
    fs::create_directories(fs::path(path).parent_path());
    cv::imwrite(path, cv::Mat3b(8, 8, cv::Vec3b(90, 90, 90)));
    if (date_time.empty()) return;
    ExposureData exposure;
    exposure.date_time = date_time;
    WriteExposureData(path, exposure);
  }
  // 52 degrees north, 13 east and so many thousandths of a second of arc more, 0.02 to 0.03 m each.
  void WritePlace(const std::string& name, int north, int east) {
    WritePicture(name, "");
    auto image = Exiv2::ImageFactory::open(folder_ / name);
    image->readMetadata();
    Exiv2::ExifData& exif = image->exifData();
    exif["Exif.GPSInfo.GPSLatitudeRef"] = "N";
    exif["Exif.GPSInfo.GPSLatitude"] = "52/1 0/1 " + std::to_string(north) + "/1000";
    exif["Exif.GPSInfo.GPSLongitudeRef"] = "E";
    exif["Exif.GPSInfo.GPSLongitude"] = "13/1 0/1 " + std::to_string(east) + "/1000";
    image->writeMetadata();
  }
};

TEST_F(PairsHints, LikenessAndNamesAloneDoNotFindThePair) {
  Run(few_);
  EXPECT_EQ(FoundBy(first_, second_), "");
}

TEST_F(PairsHints, PhotosTakenOneAfterTheOtherAreLookedAt) {
  for (int i = 0; i < 6; ++i) {
    const std::string second = std::to_string(10 + i);
    WritePicture(OtherName(0, i), "2024:05:01 09:59:" + second);
    WritePicture(OtherName(1, i), "2024:05:01 10:01:" + second);
  }
  WritePicture(first_, "2024:05:01 10:00:20");
  WritePicture(second_, "2024:05:01 10:00:24");
  Run(few_ + " --image_path " + folder_.path());
  EXPECT_EQ(FoundBy(first_, second_), "time");
  Run(few_ + " --Pairs.num_in_sequence 0 --image_path " + folder_.path());
  EXPECT_EQ(FoundBy(first_, second_), "");
}

TEST_F(PairsHints, PhotosTakenSideBySideAreLookedAt) {
  for (int i = 0; i < 6; ++i) {
    WritePlace(OtherName(0, i), 1000 + 400 * i, 1000);
    WritePlace(OtherName(1, i), 1000 + 400 * i, 9000);
  }
  WritePlace(first_, 2100, 5000);
  WritePlace(second_, 2150, 5050);
  Run(few_ + " --Pairs.num_by_place 1 --image_path " + folder_.path());
  EXPECT_EQ(FoundBy(first_, second_), "place");
  Run(few_ + " --Pairs.num_by_place 0 --image_path " + folder_.path());
  EXPECT_EQ(FoundBy(first_, second_), "");
}

TEST(NearestPlaces, AreThoseOfAComparisonWithAll) {
  RandomStream random(3);
  std::vector<Place> places;
  for (int i = 0; i < 400; ++i) {
    // A crowd, a row, a coarse raster with many at one place, and some far away.
    const double x = random.Uniform(0, 10), y = random.Uniform(0, 10);
    if (i % 4 == 0) places.push_back({x, y});
    if (i % 4 == 1) places.push_back({100 * x, 5});
    if (i % 4 == 2) places.push_back({std::floor(x / 3), std::floor(y / 3)});
    if (i % 4 == 3) places.push_back({1e5 * x, -1e5 * y});
  }
  constexpr size_t kCount = 6;
  const auto nearest = NearestPlaces(places, kCount);
  ASSERT_THAT(nearest, SizeIs(places.size()));
  for (size_t i = 0; i < places.size(); ++i) {
    std::vector<std::pair<double, int>> all;
    for (size_t k = 0; k < places.size(); ++k) {
      if (k == i) continue;
      all.emplace_back(std::hypot(places[i][0] - places[k][0], places[i][1] - places[k][1]), k);
    }
    std::sort(all.begin(), all.end());
    ASSERT_THAT(nearest[i], SizeIs(kCount));
    for (size_t k = 0; k < kCount; ++k) EXPECT_EQ(nearest[i][k], all[k].second) << i;
  }
  EXPECT_THAT(NearestPlaces({{0, 0}, {0, 0}}, 6), ElementsAre(ElementsAre(1), ElementsAre(0)));
  EXPECT_THAT(NearestPlaces({{0, 0}, {0, 0}}, 0), ElementsAre(IsEmpty(), IsEmpty()));
  EXPECT_THAT(NearestPlaces({}, 6), IsEmpty());
}

// Photos around a block of walls, each of which overlaps with the one before and the one after.
class PairsRing : public PairsReach {
 protected:
  // order[i]: the number in the name of the i-th photo of the ring. wallpapers: how many, each
  // behind as many photos that follow each other.
  void WriteRing(const std::vector<int>& order, int num_wallpapers) {
    constexpr double kSpacing = 2, kDistance = 3;  // metres, on the wall and from it
    const auto num_photos = static_cast<int>(order.size());
    const double radius = num_photos * kSpacing / (2 * kPi);
    const Camera camera = SimulatedCamera(1, SimulatedViewsOptions());
    const CameraProjection projection(camera);
    RandomStream random(5);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 140 * num_photos; ++i) {
      const double angle = random.Uniform(0, 2 * kPi), far = radius + random.Uniform(-0.7, 0.7);
      points.emplace_back(far * std::cos(angle), random.Uniform(-1.3, 1.3), far * std::sin(angle));
    }
    std::vector<std::pair<std::string, MadeFeatures>> photos;
    for (int i = 0; i < num_photos; ++i) {
      const double angle = 2 * kPi * i / num_photos;
      Eigen::Matrix3d rotation;  // looks outward
      rotation.row(2) << std::cos(angle), 0, std::sin(angle);
      rotation.row(1) << 0, 1, 0;
      rotation.row(0) = rotation.row(1).cross(rotation.row(2));
      const Eigen::Vector3d centre =
          (radius - kDistance - random.Uniform(0, 0.2)) * rotation.row(2).transpose();
      MadeFeatures features;
      const auto view = static_cast<uint64_t>(i);
      for (size_t point = 0; point < points.size(); ++point) {
        const auto x = projection.ImgFromCam(rotation * (points[point] - centre));
        if (x && projection.InImage(*x)) features.Add(*x, point, view);
      }
      if (num_wallpapers > 0) {
        features.AddWallpaper(static_cast<uint64_t>(i * num_wallpapers / num_photos), view);
      }
      photos.emplace_back(NameOf(order[static_cast<size_t>(i)]), features);
    }
    std::sort(photos.begin(), photos.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    WritePhotos(photos, camera);
  }
  static std::string NameOf(int number) { return std::to_string(1000 + number) + ".jpg"; }

  void ExpectClosedRing(const std::vector<int>& order) const {
    EXPECT_THAT(report_["groups"], SizeIs(1));
    EXPECT_THAT(report_["groups"][0], SizeIs(order.size()));
    EXPECT_THAT(report_["isolated"], IsEmpty());
    std::set<std::pair<std::string, std::string>> listed;
    std::ifstream stream(folder_ / "pairs.txt");
    for (std::string a, b; stream >> a >> b;) listed.insert(std::minmax(a, b));
    std::set<std::pair<std::string, std::string>> ring;
    for (size_t i = 0; i < order.size(); ++i) {
      ring.insert(std::minmax(NameOf(order[i]), NameOf(order[(i + 1) % order.size()])));
    }
    EXPECT_EQ(listed, ring);
  }
};

TEST_F(PairsRing, IsOnePieceAndClosed) {
  std::vector<int> order(48);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [](int a, int b) {
    return MixBits(static_cast<uint64_t>(a)) < MixBits(static_cast<uint64_t>(b));
  });
  WriteRing(order, 0);
  Run();
  ExpectClosedRing(order);
}

TEST_F(PairsRing, IsClosedWhereItsEndsLookDifferent) {
  std::vector<int> order(80);
  std::iota(order.begin(), order.end(), 0);
  WriteRing(order, 2);
  Run();
  ExpectClosedRing(order);
  EXPECT_EQ(FoundBy(NameOf(0), NameOf(79)), "loop");
}

TEST(LooseEnds, AreWhatOneEdgeConnects) {
  // Two triangles at the ends of a chain 2-3-4-5, a photo that hangs on it, and a pair apart.
  const std::vector<std::pair<int, int>> edges = {{0, 1}, {1, 2}, {0, 2}, {2, 3}, {3, 4}, {4, 5},
                                                  {5, 6}, {6, 7}, {5, 7}, {3, 8}, {9, 10}};
  EXPECT_THAT(LooseEnds(12, edges), ElementsAre(ElementsAre(0, 1, 2), ElementsAre(5, 6, 7),
                                                ElementsAre(8), ElementsAre(9), ElementsAre(10)));
  EXPECT_THAT(LooseEnds(3, {{0, 1}, {1, 2}, {0, 2}}), IsEmpty());
  EXPECT_THAT(LooseEnds(3, {}), IsEmpty());
}

}  // namespace
}  // namespace roomtex
