#include "core/camera_model.h"

#include <cmath>
#include <limits>

#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/projection_jacobian.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Params = std::vector<double>;

Camera MakeCamera(CameraModel model, const Params& params, int width = 640, int height = 480) {
  Camera camera;
  camera.camera_id = 5;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.params = params;
  return camera;
}

// One camera per model, distorted as real lenses are.
Camera TypicalCamera(CameraModel model) {
  switch (model) {
    case CameraModel::kSimplePinhole:
      return MakeCamera(model, {500, 318, 243});
    case CameraModel::kPinhole:
      return MakeCamera(model, {500, 510, 318, 243});
    case CameraModel::kSimpleRadial:
      return MakeCamera(model, {500, 318, 243, -0.12});
    case CameraModel::kRadial:
      return MakeCamera(model, {500, 318, 243, -0.2, 0.05});
    case CameraModel::kOpenCv:
      return MakeCamera(model, {500, 510, 318, 243, -0.2, 0.06, 1e-3, -2e-3});
    case CameraModel::kOpenCvFisheye:
      return MakeCamera(model, {300, 305, 318, 243, -0.02, 0.01, -0.004, 0.001});
    case CameraModel::kFullOpenCv:
      return MakeCamera(model, {500, 510, 318, 243, 0.3, 0.1, 1e-3, -2e-3, 0.02, 0.5, 0.15, 0.03});
    case CameraModel::kFov:
      return MakeCamera(model, {400, 405, 318, 243, 0.9});
    case CameraModel::kSimpleRadialFisheye:
      return MakeCamera(model, {300, 318, 243, -0.03});
    case CameraModel::kRadialFisheye:
      return MakeCamera(model, {300, 318, 243, -0.02, 0.005});
    case CameraModel::kThinPrismFisheye:
      return MakeCamera(model,
                        {300, 305, 318, 243, -0.02, 0.01, 1e-3, -2e-3, -0.004, 0.001, 2e-3, -1e-3});
    case CameraModel::kRadTanThinPrismFisheye:
      return MakeCamera(model, {300, 305, 318, 243, -0.02, 0.03, -0.02, 0.004, 1e-3, -3e-4, 1e-3,
                                -2e-3, 2e-3, -3e-4, -1e-3, 2e-4});
    case CameraModel::kSimpleDivision:
      return MakeCamera(model, {500, 318, 243, -0.15});
    case CameraModel::kDivision:
      return MakeCamera(model, {500, 510, 318, 243, -0.1});
    case CameraModel::kSimpleFisheye:
      return MakeCamera(model, {300, 318, 243});
    case CameraModel::kFisheye:
      return MakeCamera(model, {300, 305, 318, 243});
    case CameraModel::kEucm:
      return MakeCamera(model, {300, 305, 318, 243, 0.6, 1.1});
    case CameraModel::kEquirectangular:
      return MakeCamera(model, {640, 480});
  }
  return {};
}

// The formulas of the documentation of OpenCV (calib3d, fisheye), Devernay & Faugeras 2001 (FOV),
// Weng et al. 1992 (thin prism), Fitzgibbon 2001 (division), Khomutenko et al. 2016 (EUCM) and
// Project Aria (Fisheye624), written without a look at core/: rays (x, y, 1) to pixels.
Eigen::Vector2d ReferenceProjection(const Camera& camera, double x, double y) {
  const Params& p = camera.params;
  const double r = std::sqrt(x * x + y * y), theta = std::atan(r);
  const auto pixel_one = [&](double u, double v) {
    return Eigen::Vector2d(p[0] * u + p[1], p[0] * v + p[2]);
  };
  const auto pixel_two = [&](double u, double v) {
    return Eigen::Vector2d(p[0] * u + p[2], p[1] * v + p[3]);
  };
  switch (camera.model) {
    case CameraModel::kSimplePinhole:
      return pixel_one(x, y);
    case CameraModel::kPinhole:
      return pixel_two(x, y);
    case CameraModel::kSimpleRadial: {
      const double d = 1 + p[3] * std::pow(r, 2);
      return pixel_one(x * d, y * d);
    }
    case CameraModel::kRadial: {
      const double d = 1 + p[3] * std::pow(r, 2) + p[4] * std::pow(r, 4);
      return pixel_one(x * d, y * d);
    }
    case CameraModel::kOpenCv:
    case CameraModel::kFullOpenCv: {
      double d = 1 + p[4] * std::pow(r, 2) + p[5] * std::pow(r, 4);
      if (camera.model == CameraModel::kFullOpenCv) {
        d += p[8] * std::pow(r, 6);
        d /= 1 + p[9] * std::pow(r, 2) + p[10] * std::pow(r, 4) + p[11] * std::pow(r, 6);
      }
      return pixel_two(x * d + 2 * p[6] * x * y + p[7] * (r * r + 2 * x * x),
                       y * d + p[6] * (r * r + 2 * y * y) + 2 * p[7] * x * y);
    }
    case CameraModel::kFov: {
      const double rd = std::atan(2 * r * std::tan(p[4] / 2)) / p[4];
      return r > 0 ? pixel_two(x * rd / r, y * rd / r) : pixel_two(0, 0);
    }
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye: {
      double rd = theta + p[3] * std::pow(theta, 3);
      if (camera.model == CameraModel::kRadialFisheye) rd += p[4] * std::pow(theta, 5);
      return r > 0 ? pixel_one(x * rd / r, y * rd / r) : pixel_one(0, 0);
    }
    case CameraModel::kOpenCvFisheye: {
      const double rd = theta + p[4] * std::pow(theta, 3) + p[5] * std::pow(theta, 5) +
                        p[6] * std::pow(theta, 7) + p[7] * std::pow(theta, 9);
      return r > 0 ? pixel_two(x * rd / r, y * rd / r) : pixel_two(0, 0);
    }
    case CameraModel::kThinPrismFisheye: {
      const double u = r > 0 ? x * theta / r : 0, v = r > 0 ? y * theta / r : 0;
      const double t2 = theta * theta;
      const double d = 1 + p[4] * t2 + p[5] * std::pow(theta, 4) + p[8] * std::pow(theta, 6) +
                       p[9] * std::pow(theta, 8);
      return pixel_two(u * d + 2 * p[6] * u * v + p[7] * (t2 + 2 * u * u) + p[10] * t2,
                       v * d + p[6] * (t2 + 2 * v * v) + 2 * p[7] * u * v + p[11] * t2);
    }
    case CameraModel::kRadTanThinPrismFisheye: {
      double d = 1;
      for (int i = 0; i < 6; ++i) d += p[4 + i] * std::pow(theta, 2 * (i + 1));
      const Eigen::Vector2d ray(x, y), tangential(p[10], p[11]);
      const Eigen::Vector2d q = r > 0 ? Eigen::Vector2d(d * theta / r * ray) : ray;
      const double q2 = q.squaredNorm();
      const Eigen::Vector2d prism(p[12] * q2 + p[13] * q2 * q2, p[14] * q2 + p[15] * q2 * q2);
      const Eigen::Vector2d xd = q + 2 * q.dot(tangential) * q + q2 * tangential + prism;
      return pixel_two(xd.x(), xd.y());
    }
    case CameraModel::kSimpleDivision:
    case CameraModel::kDivision: {
      // The distorted radius whose ray (rd, 1 + k rd^2) this is, by bisection.
      const bool one = camera.model == CameraModel::kSimpleDivision;
      const double k = one ? p[3] : p[4];
      double low = 0, high = 10 * r + 1e-9;
      for (int i = 0; i < 200; ++i) {
        const double rd = 0.5 * (low + high);
        (rd < r * (1 + k * rd * rd) ? low : high) = rd;
      }
      const double gain = r > 0 ? low / r : 0;
      return one ? pixel_one(x * gain, y * gain) : pixel_two(x * gain, y * gain);
    }
    case CameraModel::kSimpleFisheye:
      return r > 0 ? pixel_one(x * theta / r, y * theta / r) : pixel_one(0, 0);
    case CameraModel::kFisheye:
      return r > 0 ? pixel_two(x * theta / r, y * theta / r) : pixel_two(0, 0);
    case CameraModel::kEucm: {
      const double denominator = p[4] * std::sqrt(p[5] * r * r + 1) + 1 - p[4];
      return pixel_two(x / denominator, y / denominator);
    }
    case CameraModel::kEquirectangular: {
      const double longitude = std::atan2(x, 1), latitude = std::atan2(-y, std::hypot(x, 1));
      return {(longitude / (2 * kPi) + 0.5) * p[0], (0.5 - latitude / kPi) * p[1]};
    }
  }
  return {};
}

class EveryModel : public testing::TestWithParam<int> {
 protected:
  const CameraModel model_ = static_cast<CameraModel>(GetParam());
  const Camera camera_ = TypicalCamera(model_);
  const CameraProjection projection_{camera_};
};
INSTANTIATE_TEST_SUITE_P(Colmap, EveryModel, testing::Range(0, kNumCameraModels),
                         [](const auto& model) {
                           return std::string(
                               CameraModelName(static_cast<CameraModel>(model.param)));
                         });

TEST_P(EveryModel, NameAndNumberOfParametersAreColmaps) {
  // As on colmap.github.io/cameras.html and in the list of its camera models.
  const std::pair<const char*, int> expected[] = {{"SIMPLE_PINHOLE", 3},
                                                  {"PINHOLE", 4},
                                                  {"SIMPLE_RADIAL", 4},
                                                  {"RADIAL", 5},
                                                  {"OPENCV", 8},
                                                  {"OPENCV_FISHEYE", 8},
                                                  {"FULL_OPENCV", 12},
                                                  {"FOV", 5},
                                                  {"SIMPLE_RADIAL_FISHEYE", 4},
                                                  {"RADIAL_FISHEYE", 5},
                                                  {"THIN_PRISM_FISHEYE", 12},
                                                  {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                  {"SIMPLE_DIVISION", 4},
                                                  {"DIVISION", 5},
                                                  {"SIMPLE_FISHEYE", 3},
                                                  {"FISHEYE", 4},
                                                  {"EUCM", 6},
                                                  {"EQUIRECTANGULAR", 2}};
  EXPECT_STREQ(CameraModelName(model_), expected[GetParam()].first);
  EXPECT_EQ(NumCameraParams(GetParam()), expected[GetParam()].second);
  EXPECT_EQ(CameraModelFromName(expected[GetParam()].first), model_);
  EXPECT_THAT(camera_.Problems(), testing::IsEmpty());
}

TEST_P(EveryModel, ProjectsAsTheFormulasSay) {
  for (double x = -0.7; x <= 0.7; x += 0.1) {
    for (double y = -0.6; y <= 0.6; y += 0.1) {
      const auto x_in_img = projection_.ImgFromCam(2.5 * Eigen::Vector3d(x, y, 1));
      ASSERT_TRUE(x_in_img);
      EXPECT_THAT(*x_in_img, IsNearMatrix(ReferenceProjection(camera_, x, y), 1e-10));
    }
  }
}

TEST_P(EveryModel, OpticalAxisMeetsThePrincipalPoint) {
  const auto x_in_img = projection_.ImgFromCam({0, 0, 3});
  ASSERT_TRUE(x_in_img);
  const Eigen::Vector2d centre =
      camera_.IsPanorama() ? Eigen::Vector2d(320, 240) : Eigen::Vector2d(318, 243);
  EXPECT_THAT(*x_in_img, IsNearMatrix(centre, 1e-12));
}

TEST_P(EveryModel, UnprojectionInvertsOverTheWholeImage) {
  int num_valid = 0, num_pixels = 0;
  for (double x = 0; x <= 640; x += 16) {
    for (double y = 0; y <= 480; y += 16) {
      ++num_pixels;
      const auto ray = projection_.RayFromImg({x, y});
      if (!ray) continue;
      ++num_valid;
      EXPECT_NEAR(camera_.IsPerspective() ? ray->z() : ray->norm(), 1, 1e-12);
      const auto again = projection_.ImgFromCam(2.5 * *ray);
      ASSERT_TRUE(again);
      const bool pole = camera_.IsPanorama() && (y == 0 || y == 480);
      // At the poles all x are one ray, and at the seam 0 is the width.
      const double apart = std::remainder(again->x() - x, camera_.IsPanorama() ? 640 : 1e9);
      EXPECT_NEAR(pole ? 0 : apart, 0, 1e-6);
      EXPECT_NEAR(again->y(), y, 1e-6);
    }
  }
  EXPECT_EQ(num_valid, num_pixels);
}

TEST_P(EveryModel, ProjectionIsInvertedByUnprojection) {
  const double limit = std::min(projection_.max_radius(), 2.5);
  for (int i = 0; i < 400; ++i) {
    const double radius = limit * std::sqrt((i + 0.5) / 400), angle = 2.4 * i;
    const Eigen::Vector2d ray(radius * std::cos(angle), radius * std::sin(angle));
    const auto x_in_img = projection_.ImgFromCam(ray.homogeneous());
    ASSERT_TRUE(x_in_img);
    const auto again = projection_.CamFromImg(*x_in_img);
    ASSERT_TRUE(again) << "radius " << radius;
    // Near the fold of a polynomial the ray is less certain than the pixel.
    EXPECT_THAT(*again, IsNearMatrix(ray, radius < 0.95 * limit ? 1e-7 : 1e-5)) << radius;
  }
}

TEST_P(EveryModel, PointsBehindOrNowhereAreRefused) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& x_in_cam :
       {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0.1, 0.1, 0)}) {
    if (camera_.IsPerspective()) {
      EXPECT_FALSE(projection_.ImgFromCam(x_in_cam)) << x_in_cam.transpose();
    }
  }
  for (const Eigen::Vector3d& x_in_cam :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(nan, 0, 1), Eigen::Vector3d(0, nan, 1),
        Eigen::Vector3d(0, 0, nan), Eigen::Vector3d(inf, 0, 1), Eigen::Vector3d(0, 0, inf)}) {
    EXPECT_FALSE(projection_.ImgFromCam(x_in_cam)) << x_in_cam.transpose();
  }
  for (const Eigen::Vector2d& x_in_img : {Eigen::Vector2d(nan, 0), Eigen::Vector2d(0, inf)}) {
    EXPECT_FALSE(projection_.CamFromImg(x_in_img));
  }
}

// Straight out along any direction the distance from the principal point must grow as long as
// points are accepted: nothing folds back.
TEST_P(EveryModel, NothingFoldsBack) {
  for (int d = 0; d < 24; ++d) {
    const Eigen::Vector2d direction(std::cos(2 * kPi * d / 24), std::sin(2 * kPi * d / 24));
    double last = 0;
    if (camera_.IsPanorama()) continue;
    for (double angle_deg = 0.25; angle_deg < 179.9; angle_deg += 0.25) {
      const double angle = RadFromDeg(angle_deg);
      const Eigen::Vector3d ray(std::sin(angle) * direction.x(), std::sin(angle) * direction.y(),
                                std::cos(angle));
      const auto x_in_img = projection_.ImgFromCam(ray);
      if (std::abs(angle - projection_.max_angle()) > 1e-3) {
        EXPECT_EQ(x_in_img.has_value(), angle < projection_.max_angle()) << angle_deg;
      }
      if (!x_in_img) break;
      const double distance = (*x_in_img - Eigen::Vector2d(318, 243)).norm();
      EXPECT_GT(distance, last) << angle_deg;
      last = distance;
    }
  }
}

// Derivatives that bundle adjustment gets, by the ray and by every parameter, against differences.
TEST_P(EveryModel, JetsAreTheNumericDerivatives) {
  for (const Eigen::Vector2d& ray : {Eigen::Vector2d(0, 0), Eigen::Vector2d(1e-6, -1e-6),
                                     Eigen::Vector2d(0.3, -0.2), Eigen::Vector2d(-0.6, 0.5)}) {
    std::vector<double> all = {ray.x(), ray.y()};
    all.insert(all.end(), camera_.params.begin(), camera_.params.end());
    const auto seen = ProjectRay<kMaxCameraParams>(
        model_, all.data() + 2, static_cast<int>(camera_.params.size()), ray.x(), ray.y());
    Eigen::Matrix<double, 2, 2 + kMaxCameraParams> derivatives;
    derivatives << seen.by_ray, seen.by_params;
    EXPECT_EQ(seen.x_in_img,
              ProjectRay<0>(model_, all.data() + 2, static_cast<int>(camera_.params.size()),
                            ray.x(), ray.y())
                  .x_in_img);
    const auto project = [&](const std::vector<double>& v) {
      Eigen::Vector2d x_in_img;
      camera_formulas::Project(model_, v.data() + 2, v[0], v[1], &x_in_img.x(), &x_in_img.y());
      return x_in_img;
    };
    for (size_t i = 0; i < all.size(); ++i) {
      const double step = 1e-6 * std::max(1.0, std::abs(all[i]));
      std::vector<double> more = all, less = all;
      more[i] += step;
      less[i] -= step;
      const Eigen::Vector2d numeric = (project(more) - project(less)) / (2 * step);
      EXPECT_THAT(Eigen::Vector2d(derivatives.col(static_cast<int>(i))),
                  IsNearMatrix(numeric, 1e-4))
          << "parameter " << i << " at " << ray.transpose();
    }
  }
}

// And those of whole rays, in front and behind, against CameraProjection.
TEST_P(EveryModel, DerivativesByThePointAreTheNumericOnes) {
  const int num_params = static_cast<int>(camera_.params.size());
  int num_seen = 0;
  for (int i = 0; i < 60; ++i) {
    const double z = 1 - (2 * i + 1.0) / 60, r = std::sqrt(1 - z * z);
    const Eigen::Vector3d point(2 * r * std::cos(2.4 * i), 2 * r * std::sin(2.4 * i), 2 * z);
    const auto x_in_img = projection_.ImgFromCam(1.01 * point + Eigen::Vector3d(0.01, -0.02, 0.01));
    if (!x_in_img || !projection_.ImgError(point, *x_in_img) ||
        (camera_.IsPerspective() && z < 0.2)) {
      continue;
    }
    ++num_seen;
    const auto seen =
        ErrorOfPoint<kMaxCameraParams>(model_, camera_.params.data(), num_params, point, *x_in_img);
    EXPECT_THAT(seen.error, IsNearMatrix(*projection_.ImgError(point, *x_in_img), 1e-9));
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(k);
      const auto more = projection_.ImgError(point + step, *x_in_img);
      const auto less = projection_.ImgError(point - step, *x_in_img);
      if (!more || !less) continue;
      EXPECT_THAT(Eigen::Vector2d(seen.by_point.col(k)),
                  IsNearMatrix(((*more - *less) / 2e-6).eval(), 1e-3 + 1e-6 * more->norm()));
    }
  }
  EXPECT_GT(num_seen, camera_.IsPanorama() ? 59 : 10);
}

TEST(CameraProjection, FisheyesSeeBehindThemselves) {
  // 220 degrees across: 1.92 rad at the border.
  for (const CameraModel model :
       {CameraModel::kSimpleFisheye, CameraModel::kFisheye, CameraModel::kOpenCvFisheye,
        CameraModel::kEucm, CameraModel::kSimpleDivision}) {
    Params params = {160, 320, 320};
    if (model == CameraModel::kFisheye) params = {160, 160, 320, 320};
    if (model == CameraModel::kOpenCvFisheye) params = {160, 160, 320, 320, 0.01, 0, 0, 0};
    if (model == CameraModel::kEucm) params = {110, 110, 320, 320, 0.65, 1.0};
    if (model == CameraModel::kSimpleDivision) params = {110, 320, 320, -0.3};
    const CameraProjection projection(MakeCamera(model, params, 640, 640));
    EXPECT_GT(projection.max_angle(), RadFromDeg(105)) << CameraModelName(model);
    const Eigen::Vector3d behind(std::sin(1.8), 0, std::cos(1.8));
    const auto x_in_img = projection.ImgFromCam(3 * behind);
    ASSERT_TRUE(x_in_img) << CameraModelName(model);
    EXPECT_THAT(projection.RayFromImg(*x_in_img).value(), IsNearMatrix(behind, 1e-9));
    EXPECT_FALSE(projection.CamFromImg(*x_in_img));
    EXPECT_NEAR(projection.Depth(3 * behind), 3, 1e-12);
  }
}

TEST(CameraProjection, EucmEndsWhereItsFormulaDoes) {
  // Khomutenko et al. 2016, (7): alpha > 1/2 reaches z > -(1 - alpha) / alpha d.
  const CameraProjection projection(MakeCamera(CameraModel::kEucm, {200, 200, 320, 240, 0.6, 1.0}));
  EXPECT_NEAR(projection.max_angle(), kPi - std::acos(0.4 / 0.6), 0.01);
}

TEST(CameraProjection, DivisionIsItsOwnInverseFormula) {
  // Fitzgibbon 2001: a pixel's ray is (x, y, 1 + k r^2).
  for (const double k : {-0.2, 0.0, 0.1}) {
    const CameraProjection projection(MakeCamera(CameraModel::kSimpleDivision, {500, 320, 240, k}));
    const Eigen::Vector2d x(0.3, -0.4);
    const auto ray = projection.CamFromImg(500 * x + Eigen::Vector2d(320, 240));
    ASSERT_TRUE(ray);
    EXPECT_THAT(*ray, IsNearMatrix(Eigen::Vector2d(x / (1 + k * 0.25)), 1e-9));
  }
}

TEST(CameraProjection, APanoramaHasNoSeamAndNoPoles) {
  const CameraProjection projection(
      MakeCamera(CameraModel::kEquirectangular, {2000, 1000}, 2000, 1000));
  EXPECT_THAT(projection.ImgFromCam({0, 0, 2}).value(),
              IsNearMatrix(Eigen::Vector2d(1000, 500), 1e-9));
  EXPECT_THAT(projection.ImgFromCam({2, 0, 0}).value(),
              IsNearMatrix(Eigen::Vector2d(1500, 500), 1e-9));
  EXPECT_THAT(projection.ImgFromCam({0, -2, 0})->y(), testing::DoubleNear(0, 1e-9));
  // One pixel across the seam is one pixel.
  const auto left = projection.RayFromImg({0.5, 500}), right = projection.RayFromImg({1999.5, 500});
  EXPECT_THAT(projection.ImgError(*right, {0.5, 500}).value(),
              IsNearMatrix(Eigen::Vector2d(-1, 0), 1e-6));
  EXPECT_THAT(projection.ImgError(*left, {1999.5, 500}).value(),
              IsNearMatrix(Eigen::Vector2d(1, 0), 1e-6));
  // Half around, close to the pole, is a step over the pole.
  const auto near = projection.RayFromImg({500, 1});
  EXPECT_THAT(projection.ImgError(*near, {1500, 1}).value(),
              IsNearMatrix(Eigen::Vector2d(0, -2), 1e-6));
  EXPECT_NEAR(projection.camera().MeanFocalLength(), 1000 / kPi, 1e-9);
}

TEST(Camera, ResizedItSeesTheSame) {
  for (int id = 0; id < kNumCameraModels; ++id) {
    const Camera camera = TypicalCamera(static_cast<CameraModel>(id));
    Camera half = camera;
    half.Resize(camera.width / 2, camera.height / 2);
    const Eigen::Vector3d x_in_cam(0.2, -0.3, 1);
    EXPECT_THAT((2 * CameraProjection(half).ImgFromCam(x_in_cam).value()).eval(),
                IsNearMatrix(CameraProjection(camera).ImgFromCam(x_in_cam).value(), 1e-9));
  }
}

TEST(CameraProjection, SimpleRadialDoesNotFoldAPointAt70DegreesBackIntoTheImage) {
  const CameraProjection projection(MakeCamera(CameraModel::kSimpleRadial, {500, 320, 240, -0.3}));
  // 1 - 3 * 0.3 r^2 = 0 at r = 1.054.
  EXPECT_NEAR(projection.max_radius(), std::sqrt(1 / 0.9), 0.02);
  EXPECT_FALSE(projection.ImgFromCam({std::tan(RadFromDeg(70)), 0, 1}));
  EXPECT_FALSE(projection.ImgFromCam({0, -std::tan(RadFromDeg(50)), 1}));
  EXPECT_TRUE(projection.ImgFromCam({std::tan(RadFromDeg(45)), 0, 1}));
  // The formula would have put it well inside: this is what must not happen.
  EXPECT_TRUE(projection.InImage(ReferenceProjection(projection.camera(), 1.8, 0)));
  EXPECT_FALSE(projection.ImgFromCam({1.8, 0, 1}));
  // No ray reaches pixels beyond the fold: 500 * 1.054 * (1 - 0.333) = 351.
  EXPECT_TRUE(projection.CamFromImg({320 + 345, 240}));
  EXPECT_FALSE(projection.CamFromImg({320 + 360, 240}));
}

TEST(CameraProjection, AMomentarilyFallingPolynomialEndsTheValidField) {
  // x (1 - 0.9 r^2 + 0.2 r^4) has the slope 1 - 2.7 r^2 + r^4: it falls from r = 0.666 to 1.50.
  const CameraProjection projection(MakeCamera(CameraModel::kRadial, {500, 320, 240, -0.9, 0.2}));
  EXPECT_NEAR(projection.max_radius(), 0.666, 0.02);
  EXPECT_FALSE(projection.ImgFromCam({3, 0, 1}));
}

TEST(CameraProjection, DenominatorPassingZeroEndsTheValidField) {
  // FULL_OPENCV with 1 - 0.5 r^2 below the line: infinite at r = 1.41.
  const CameraProjection projection(
      MakeCamera(CameraModel::kFullOpenCv, {500, 500, 320, 240, 0, 0, 0, 0, 0, -0.5, 0, 0}));
  EXPECT_LT(projection.max_radius(), std::sqrt(2.0));
  EXPECT_FALSE(projection.ImgFromCam({1.6, 0, 1}));
}

TEST(CameraProjection, UndistortedModelsHaveNoLimit) {
  for (const CameraModel model : {CameraModel::kSimplePinhole, CameraModel::kPinhole}) {
    const CameraProjection projection(TypicalCamera(model));
    EXPECT_EQ(projection.max_radius(), std::numeric_limits<double>::infinity());
    EXPECT_TRUE(projection.ImgFromCam({1000, 0, 1}));
  }
}

TEST(CameraProjection, ZeroDistortionIsNoDistortion) {
  for (const CameraModel model : {CameraModel::kSimpleRadial, CameraModel::kRadial,
                                  CameraModel::kOpenCv, CameraModel::kFullOpenCv}) {
    Params params = {500, 320, 240};
    if (model == CameraModel::kOpenCv || model == CameraModel::kFullOpenCv)
      params = {500, 500, 320, 240};
    params.resize(NumCameraParams(static_cast<int>(model)), 0.0);
    const CameraProjection projection(MakeCamera(model, params));
    EXPECT_GT(projection.max_radius(), 50);
    EXPECT_THAT(projection.ImgFromCam({3, -4, 2}).value(),
                IsNearMatrix(Eigen::Vector2d(320 + 750, 240 - 1000), 1e-9));
    EXPECT_THAT(projection.CamFromImg({320 + 750, 240 - 1000}).value(),
                IsNearMatrix(Eigen::Vector2d(1.5, -2), 1e-9));
  }
  // FOV with a vanishing omega is a pinhole as well.
  const CameraProjection fov(MakeCamera(CameraModel::kFov, {500, 500, 320, 240, 1e-6}));
  EXPECT_THAT(fov.ImgFromCam({0.5, -0.25, 1}).value(),
              IsNearMatrix(Eigen::Vector2d(570, 115), 1e-6));
}

TEST(CameraProjection, FisheyeOfIdealLensIsTheAngle) {
  const CameraProjection projection(
      MakeCamera(CameraModel::kOpenCvFisheye, {300, 300, 320, 240, 0, 0, 0, 0}));
  for (const double angle_deg : {1.0, 30.0, 60.0, 85.0, 89.0}) {
    const auto x_in_img = projection.ImgFromCam({std::tan(RadFromDeg(angle_deg)), 0, 1});
    ASSERT_TRUE(x_in_img) << angle_deg;
    EXPECT_NEAR(x_in_img->x() - 320, 300 * RadFromDeg(angle_deg), 1e-9);
    const auto ray = projection.CamFromImg(*x_in_img);
    ASSERT_TRUE(ray) << angle_deg;
    EXPECT_NEAR(DegFromRad(std::atan(ray->x())), angle_deg, 1e-6);
  }
}

TEST(CameraProjection, ImageReachesFromCornerToCorner) {
  const CameraProjection projection(TypicalCamera(CameraModel::kPinhole));
  EXPECT_TRUE(projection.InImage({0, 0}));
  EXPECT_TRUE(projection.InImage({640, 480}));
  EXPECT_FALSE(projection.InImage({-0.01, 5}));
  EXPECT_FALSE(projection.InImage({5, 480.01}));
  EXPECT_FALSE(projection.InImage({std::nan(""), 5}));
}

TEST(Camera, ProblemsAreNamed) {
  const auto problem = [](CameraModel model, const Params& params, int width = 640) {
    const std::vector<std::string> problems = MakeCamera(model, params, width).Problems();
    return problems.empty() ? "" : problems[0];
  };
  using testing::HasSubstr;
  EXPECT_EQ(problem(CameraModel::kPinhole, {500, 500, 320, 240}), "");
  EXPECT_THAT(problem(CameraModel::kPinhole, {500, 320, 240}),
              HasSubstr("3 parameters, expected 4"));
  EXPECT_THAT(problem(CameraModel::kPinhole, {500, 0, 320, 240}), HasSubstr("focal length"));
  EXPECT_THAT(problem(CameraModel::kSimplePinhole, {-1, 320, 240}), HasSubstr("focal length"));
  EXPECT_THAT(problem(CameraModel::kPinhole, {500, 500, std::nan(""), 240}), HasSubstr("finite"));
  EXPECT_THAT(problem(CameraModel::kPinhole, {500, 500, 320, 240}, 0), HasSubstr("0 x 480"));
  EXPECT_THAT(problem(static_cast<CameraModel>(18), {500, 500, 320, 240}),
              HasSubstr("model id 18"));
  EXPECT_EQ(problem(CameraModel::kOpenCv, {500, 500, 320, 240, -0.5, 0.2, 0.02, 0.02}), "");
  EXPECT_THAT(problem(CameraModel::kOpenCv, {500, 500, 320, 240, 0.1, -0.85, 10001, 0.002}),
              HasSubstr("fold the picture over in its middle"));
  EXPECT_EQ(NumCameraParams(-1), -1);
  EXPECT_EQ(NumCameraParams(18), -1);
  EXPECT_FALSE(CameraModelFromName("simple_radial"));
  EXPECT_EQ(MakeCamera(CameraModel::kPinhole, {500, 510, 320, 240}).MeanFocalLength(), 505);
  EXPECT_EQ(MakeCamera(CameraModel::kSimplePinhole, {500, 320, 240}).MeanFocalLength(), 500);
}

}  // namespace
}  // namespace roomtex
