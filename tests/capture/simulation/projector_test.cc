// Projectors of the simulated room: the laws of their light, and the photos taken in it.

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern.h"
#include "capture/simulation/simulated_projector.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "core/photo.h"
#include "core/random_stream.h"
#include "core/ray_caster.h"
#include "core/scan_mesh.h"
#include "tests/capture/simulation/small_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const Vector3d kPointLike = Vector3d::Zero();

Camera PatternCamera(int width = 640, int height = 480) {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = width;
  camera.height = height;
  camera.params = {500.0, 510.0, 310.0, 250.0};
  return camera;
}

// At the origin of `room`, looking along +z.
Projector AtOrigin(const cv::Mat1b& pattern, double white = 10, double focus = 2,
                   double aperture = 0) {
  return Projector(PatternCamera(pattern.cols, pattern.rows), Rigid(), pattern, white, focus,
                   aperture);
}
cv::Mat1b White() { return cv::Mat1b(480, 640, 255); }

TEST(Projector, LightFallsWithTheSquareOfTheDistance) {
  const Projector projector = AtOrigin(White());
  for (const double distance : {0.5, 1.0, 2.0, 4.0}) {
    const double light =
        projector.LightAt({0, 0, distance}, -Vector3d::UnitZ(), kPointLike, kPointLike);
    EXPECT_NEAR(light, 10 / (distance * distance), 1e-6);
  }
  // Along any other ray as well.
  const Vector3d ray = Vector3d(0.3, -0.2, 1).normalized();
  const double near = projector.LightAt(1.5 * ray, -ray, kPointLike, kPointLike);
  EXPECT_NEAR(projector.LightAt(4.5 * ray, -ray, kPointLike, kPointLike), near / 9, 1e-6);
}

TEST(Projector, LightsAScreenEvenly) {
  const Projector projector = AtOrigin(White());
  for (const double x : {-1.4, 0.0, 0.9}) {
    for (const double y : {-1.1, 0.3, 1.0}) {
      EXPECT_NEAR(projector.LightAt({x, y, 3}, -Vector3d::UnitZ(), kPointLike, kPointLike),
                  10.0 / 9, 1e-6);
    }
  }
}

TEST(Projector, ObeysTheCosineLawAndLightsNoBacks) {
  const Projector projector = AtOrigin(White());
  for (const double angle_deg : {0.0, 30.0, 60.0, 89.0, 91.0, 180.0}) {
    const double angle = RadFromDeg(angle_deg);
    const Vector3d normal(std::sin(angle), 0, -std::cos(angle));
    EXPECT_NEAR(projector.LightAt({0, 0, 2}, normal, kPointLike, kPointLike),
                2.5 * std::max(0.0, std::cos(angle)), 1e-6)
        << angle_deg;
  }
  EXPECT_EQ(projector.LightAt({0, 0, -2}, Vector3d::UnitZ(), kPointLike, kPointLike), 0);
}

TEST(Projector, ThrowsEveryPixelAlongItsRay) {
  cv::Mat1b pattern(480, 640, uchar{0});
  pattern(cv::Rect(400, 120, 12, 10)) = 255;
  const Rigid proj_from_room{
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized())), {0.3, -0.2, 1}};
  const Projector projector(PatternCamera(), proj_from_room, pattern, 10, 2, 0);
  const CameraProjection camera(PatternCamera());
  const Rigid room_from_proj = proj_from_room.Inverse();
  RandomStream random(1);
  int inside = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vector2d pixel(random.Uniform(380, 430), random.Uniform(100, 150));
    const Vector3d ray = camera.CamFromImg(pixel)->homogeneous();
    const Vector3d point = room_from_proj * (random.Uniform(1, 5) * ray);
    ASSERT_LT((*projector.PatternFromRoom(point) - pixel).norm(), 1e-9);
    const Vector3d normal = (projector.Lens() - point).normalized();
    const double light = projector.LightAt(point, normal, kPointLike, kPointLike);
    const double border = std::max(std::abs(pixel.x() - 406) - 6, std::abs(pixel.y() - 125) - 5);
    const double full = 10 * std::pow(ray.norm(), 3) / (projector.Lens() - point).squaredNorm();
    if (border < -0.5) {
      EXPECT_NEAR(light / full, 1, 1e-6);
      ++inside;
    }
    if (border > 0.5) {
      EXPECT_LT(light / full, 0.002);
    }
  }
  EXPECT_GT(inside, 100);
  // Beyond the picture there is no light at all, not even that of black.
  const Vector3d beyond = room_from_proj * Vector3d(2, 0, 2);
  EXPECT_EQ(
      projector.LightAt(beyond, (projector.Lens() - beyond).normalized(), kPointLike, kPointLike),
      0);
}

TEST(Projector, AveragesOverTheFootprintOfAPixel) {
  RandomStream random(2);
  cv::Mat1b pattern(480, 640);
  for (uchar& value : pattern) value = static_cast<uchar>(random.Index(256));
  const Projector projector = AtOrigin(pattern);
  const Vector3d normal = -Vector3d::UnitZ();
  for (const Vector2d& size : {Vector2d(0.05, 0.05), Vector2d(0.12, 0.03)}) {
    double squares = 0, mean_light = 0;
    constexpr int kPlaces = 40, kSide = 24;
    for (int i = 0; i < kPlaces; ++i) {
      const Vector3d middle(random.Uniform(-0.6, 0.6), random.Uniform(-0.5, 0.5), 2);
      double mean = 0;
      for (int k = 0; k < kSide * kSide; ++k) {
        const Vector3d offset(size.x() * ((k % kSide + 0.5) / kSide - 0.5),
                              size.y() * ((k / kSide + 0.5) / kSide - 0.5), 0);
        mean +=
            projector.LightAt(middle + offset, normal, kPointLike, kPointLike) / (kSide * kSide);
      }
      const double averaged = projector.LightAt(middle, normal, {size.x(), 0, 0}, {0, size.y(), 0});
      squares += std::pow(averaged - mean, 2) / kPlaces;
      mean_light += mean / kPlaces;
    }
    // A pixel by itself is off by 0.9 of the mean.
    EXPECT_LT(std::sqrt(squares), 0.06 * mean_light) << size.transpose();
  }
}

TEST(Projector, IsSharpOnlyAtItsFocus) {
  cv::Mat1b stripes(480, 640);
  for (int x = 0; x < 640; ++x) stripes.col(x) = x / 3 % 2 == 0 ? 255 : 0;
  const Projector projector = AtOrigin(stripes, 10, 2, 0.012);
  const auto contrast = [&](double z) {
    double least = 1e9, most = 0;
    for (int i = 0; i < 200; ++i) {
      const double light =
          projector.LightAt({i * 0.0002 * z, 0, z}, -Vector3d::UnitZ(), kPointLike, kPointLike);
      least = std::min(least, light);
      most = std::max(most, light);
    }
    return (most - least) / (most + least);
  };
  EXPECT_GT(contrast(2), 0.98);
  EXPECT_LT(contrast(1), 0.9 * contrast(2));
  EXPECT_LT(contrast(0.6), contrast(1));
  EXPECT_LT(contrast(8), 0.95 * contrast(2));
}

// A floor of 4 x 4 m, a box of 0.5 m on it.
struct BoxScene {
  BoxScene() {
    const int surface = scene.AddSurface({MakePlain(LinearRgb(0.5f, 0.5f, 0.5f)), {}});
    scene.AddQuad(surface, {-2, 2, 0}, {4, 0, 0}, {0, -4, 0});
    scene.AddBox(surface, {Eigen::Quaterniond::Identity(), {-0.25, -0.25, 0}}, {0.5, 0.5, 0.5});
    scene.Finish(false, false, 1);
  }
  SceneHit Below(double x, double y) const { return *scene.Cast({x, y, 0.9}, -Vector3d::UnitZ()); }
  RoomScene scene;
};

// Looks at the middle of the floor.
Projector LookingDownFrom(const Vector3d& lens) {
  const Vector3d forward = -lens.normalized();
  const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;
  axes << right, forward.cross(right), forward;
  return Projector(PatternCamera(), Rigid{Eigen::Quaterniond(axes), lens}.Inverse(), White(), 10, 2,
                   0);
}

TEST(ProjectedLight, IsKeptOffByWhatStandsInTheWay) {
  const BoxScene box;
  const std::vector<Projector> projectors = {LookingDownFrom({1.5, 0, 1.5})};
  const ProjectedLight light(projectors, box.scene, 100);
  // The upper edge at (-0.25, 0.5) throws the end of the shadow to x = -1.125, its sides widen.
  EXPECT_EQ(light.At(box.Below(-0.6, 0), kPointLike, kPointLike).lit_by, 0u);
  EXPECT_EQ(light.At(box.Below(-1.10, 0), kPointLike, kPointLike).lit_by, 0u);
  EXPECT_EQ(light.At(box.Below(-1.15, 0), kPointLike, kPointLike).lit_by, 1u);
  EXPECT_EQ(light.At(box.Below(0.6, 0), kPointLike, kPointLike).lit_by, 1u);
  EXPECT_EQ(light.At(box.Below(-0.6, 0.6), kPointLike, kPointLike).lit_by, 1u);
  EXPECT_EQ(light.At(box.Below(0, 0), kPointLike, kPointLike).lit_by, 1u);  // its top
  const double shade = light.At(box.Below(-0.6, 0), kPointLike, kPointLike).light;
  EXPECT_GT(shade, 0);  // what comes back from the walls
  EXPECT_LT(shade, 0.3 * light.At(box.Below(0.6, 0), kPointLike, kPointLike).light);
}

TEST(ProjectedLight, OfSeveralProjectorsAddsUp) {
  const BoxScene box;
  const std::vector<Projector> first = {LookingDownFrom({1.5, 0.1, 1.5})};
  const std::vector<Projector> second = {LookingDownFrom({-1.5, 0.2, 1.4})};
  const std::vector<Projector> both = {first[0], second[0]};
  const ProjectedLight light_first(first, box.scene, 100), light_second(second, box.scene, 100),
      light_both(both, box.scene, 100);
  std::set<uint32_t> kinds;
  for (const double x : {-0.9, -0.5, 0.0, 0.5, 0.9}) {
    for (const double y : {-0.8, 0.0, 0.8}) {
      const SceneHit hit = box.Below(x, y);
      const auto sum = light_both.At(hit, kPointLike, kPointLike);
      EXPECT_NEAR(sum.light,
                  light_first.At(hit, kPointLike, kPointLike).light +
                      light_second.At(hit, kPointLike, kPointLike).light,
                  1e-5);
      kinds.insert(sum.lit_by);
    }
  }
  EXPECT_EQ(kinds, (std::set<uint32_t>{1, 2, 3}));
}

SimulatedRoomOptions SmallProjectedRoom() {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 4;
  options.bare = true;
  options.projectors = 2;
  options.projector_width = 960;
  options.projector_height = 540;
  options.pattern = [](int width, int height, int seed) {
    PatternOptions pattern;
    pattern.width = width;
    pattern.height = height;
    pattern.random_seed = seed;
    return MakePattern(pattern);
  };
  return options;
}

int CountSiftFeatures(const cv::Mat& photo) {
  cv::Mat grey;
  cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  std::vector<cv::KeyPoint> keypoints;
  cv::SIFT::create(0, 3, 0.02)->detect(grey, keypoints);  // COLMAP's contrast
  return static_cast<int>(keypoints.size());
}

TEST(ProjectedRoom, ShowsEveryPlaceTwice) {
  const SimulatedRoom room(SmallProjectedRoom());
  ASSERT_EQ(room.NumPhotos(), 8);
  EXPECT_EQ(room.PhotoName(0), "IMG_0001.jpg");
  EXPECT_EQ(room.PhotoName(7), "IMG_0008.jpg");
  for (int photo = 0; photo < 8; photo += 2) {
    EXPECT_TRUE(room.IsPatterned(photo));
    EXPECT_FALSE(room.IsPatterned(photo + 1));
    EXPECT_EQ(room.PlaceOf(photo), room.PlaceOf(photo + 1));
    EXPECT_THAT(room.CamFromScan(photo), IsNearRigid(room.CamFromScan(photo + 1), 0, 0));
    // The light meter sees more light; the plain exposures vary by up to an EV.
    EXPECT_LE(room.ExposureTime(photo), room.ExposureTime(photo + 1));
  }
  EXPECT_TRUE(room.IsPatterned(room.BestPhotoForPicks()));
  const SparseModel model = room.MakeSparseModel(60, 0.5);
  ASSERT_EQ(model.images.size(), 4u);
  for (int photo = 0; photo < 8; photo += 2) {
    EXPECT_NE(model.FindImage(room.PhotoName(photo)), nullptr);
  }
}

TEST(ProjectedRoom, HoldsFeaturesInThePatternedPhotosOnly) {
  SimulatedRoomOptions options = SmallProjectedRoom();
  options.photo_width = 960;
  options.photo_height = 640;
  const SimulatedRoom room(options);
  for (int photo = 0; photo < room.NumPhotos(); photo += 2) {
    EXPECT_GT(CountSiftFeatures(room.RenderPhoto(photo)), 1200) << photo;
    EXPECT_LT(CountSiftFeatures(room.RenderPhoto(photo + 1)), 200) << photo;
  }
}

// A share of the photos is of the places: else one half would be all plain photos and no other.
TEST(ProjectedRoom, IsBlurredAndVisitedPlaceByPlace) {
  SimulatedRoomOptions options = SmallProjectedRoom();
  options.num_photos = 6;
  options.blurred = 0.5;
  options.strangers = 0.5;
  options.wrong_exif = "one";
  const SimulatedRoom room(options);
  int num_blurred = 0, num_wrong = 0;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    num_blurred += room.IsBlurred(photo);
    EXPECT_EQ(room.IsBlurred(photo), room.PlaceOf(photo) % 2 == 1) << photo;
    EXPECT_EQ(room.HasStranger(photo), room.PlaceOf(photo) % 2 == 1) << photo;
    if (room.NotedTime(photo) == room.ExposureTime(photo)) continue;
    ++num_wrong;
    EXPECT_FALSE(room.IsPatterned(photo)) << "gives no colours";
  }
  EXPECT_EQ(num_blurred, 6);
  EXPECT_EQ(num_wrong, 1);
}

TEST(ProjectedRoom, IsScannedWithoutThePattern) {
  SimulatedRoomOptions options = SmallProjectedRoom();
  const Scan bright = SimulatedRoom(options).MakeScan();
  options.projector_light = 0;
  const Scan dark = SimulatedRoom(options).MakeScan();
  EXPECT_EQ(bright.intensity, dark.intensity);
}

TEST(ProjectedRoom, PlainPhotosAreThoseOfTheRoomWithoutProjectorsSwitchedOn) {
  SimulatedRoomOptions options = SmallProjectedRoom();
  options.num_photos = 1;
  const SimulatedRoom on(options);
  options.projector_light = 0;
  const SimulatedRoom off(options);
  EXPECT_EQ(cv::norm(on.RenderPhoto(1), off.RenderPhoto(1), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(on.RenderPhoto(0), off.RenderPhoto(0), cv::NORM_INF), 50);
}

TEST(ProjectedRoom, PatternLiesWhereTheProjectorsThrowIt) {
  SimulatedRoomOptions options = SmallProjectedRoom();
  options.photo_width = 960;
  options.photo_height = 640;
  options.range_noise = 0;
  options.photo_noise = 0;
  options.num_photos = 2;
  const SimulatedRoom room(options);
  const Scan scan = room.MakeScan();
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  const std::vector<Eigen::Vector3f> normals = VertexNormals(scan, triangles);
  const RayCaster caster(scan.points, triangles);
  const CameraProjection camera(room.camera());
  const Rigid room_from_scan = room.ScanFromRoom().Inverse();
  const std::array<float, 256>& linear = LinearFromSrgbByte();
  for (const int photo : {0, 2}) {
    const cv::Mat patterned = room.RenderPhoto(photo), plain = room.RenderPhoto(photo + 1);
    const Rigid cam_from_scan = room.CamFromScan(photo);
    const double ev = room.ExposureEv(photo) - room.ExposureEv(photo + 1);
    // Without shading the plain photo shows the albedo: patterned / plain = 1 + projected light.
    double sum_x = 0, sum_y = 0, sum_xx = 0, sum_yy = 0, sum_xy = 0, count = 0;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      const Vector3d& point = scan.points[i];
      if (scan.IsMissing(static_cast<int>(i)) || normals[i].norm() < 0.5f) continue;
      const auto at = camera.ImgFromCam(cam_from_scan * point);
      if (!at || !camera.InImage(*at)) continue;
      if (caster.IsOccluded(cam_from_scan.TargetOriginInSource(), point, 0.02)) continue;
      const int x = std::min(static_cast<int>(at->x()), plain.cols - 1);
      const int y = std::min(static_cast<int>(at->y()), plain.rows - 1);
      const uchar bright = patterned.at<cv::Vec3b>(y, x)[1], dim = plain.at<cv::Vec3b>(y, x)[1];
      if (bright > 245 || dim > 245 || dim < 60) continue;
      double light = 0;
      for (const Projector& projector : room.Projectors()) {
        const Vector3d lens = room_from_scan.Inverse() * projector.Lens();
        if (caster.IsOccluded(lens, point, 0.05)) continue;
        const Vector3d normal = room_from_scan.rotation * normals[i].cast<double>();
        // A photo's pixel is 3 to 6 mm wide there.
        light += projector.LightAt(room_from_scan * point, normal, 0.004 * normal.unitOrthogonal(),
                                   0.004 * normal.cross(normal.unitOrthogonal()));
      }
      const double measured = linear[bright] / linear[dim] * std::exp2(-ev) - 1;
      sum_x += light;
      sum_y += measured;
      sum_xx += light * light;
      sum_yy += measured * measured;
      sum_xy += light * measured;
      ++count;
    }
    ASSERT_GT(count, 5000);
    const double covariance = sum_xy - sum_x * sum_y / count;
    const double spread_x = sum_xx - sum_x * sum_x / count;
    const double spread_y = sum_yy - sum_y * sum_y / count;
    EXPECT_GT(covariance / std::sqrt(spread_x * spread_y), 0.95) << photo;
    EXPECT_NEAR(covariance / spread_x, 1, 0.06) << photo;
  }
}

TEST(ProjectedRoom, IsTheSameForEveryNumberOfThreads) {
  SimulatedRoomOptions options = SmallProjectedRoom();
  options.num_photos = 1;
  options.shading = true;
  options.num_threads = 1;
  const cv::Mat alone = SimulatedRoom(options).RenderPhoto(0);
  options.num_threads = 3;
  EXPECT_EQ(cv::norm(alone, SimulatedRoom(options).RenderPhoto(0), cv::NORM_INF), 0);
}

TEST(ProjectedRoom, HasItsWallsLitByTwoProjectors) {
  const SimulatedRoom room(SmallProjectedRoom());
  ASSERT_EQ(room.Projectors().size(), 2u);
  // Share of the walls' area that falls into the picture of a projector on the other side.
  int lit = 0, count = 0;
  const double w = room.options().width, d = room.options().depth, h = room.options().height;
  for (double along = 0.05; along < w + d; along += 0.1) {
    for (double z = 0.05; z < h; z += 0.1, ++count) {
      const auto in_picture = [&](const Vector3d& point, const Vector3d& normal) {
        return std::any_of(room.Projectors().begin(), room.Projectors().end(),
                           [&](const Projector& projector) {
                             return projector.LightAt(point, normal, kPointLike, kPointLike) > 0;
                           });
      };
      const bool west_or_south = along < d ? in_picture({0, along, z}, Vector3d::UnitX())
                                           : in_picture({along - d, 0, z}, Vector3d::UnitY());
      lit += west_or_south;
    }
  }
  EXPECT_GT(static_cast<double>(lit) / count, 0.85);
}

}  // namespace
}  // namespace roomtex
