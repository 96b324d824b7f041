#include "align/trust/overlay.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/report.h"
#include "tests/align/case_folder.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using Kind = ScanEdge::Kind;

// A scanner in the origin looks at two walls that meet at x = 0.3, z = -3: one faces it, one
// recedes at 45 degrees. 0.2 degrees between samples, noise by a fixed sequence.
constexpr double kCornerX = 0.3, kWallZ = -3;
Scan TwoWalls(double noise) {
  Scan scan;
  scan.num_columns = 200;
  scan.num_rows = 100;
  uint32_t random = 1;
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const double theta = RadFromDeg(0.2 * (column - 99.5)), phi = RadFromDeg(0.2 * (49.5 - row));
      const Eigen::Vector3d ray(std::sin(theta) * std::cos(phi), std::sin(phi),
                                -std::cos(theta) * std::cos(phi));
      double range = kWallZ / ray.z();
      // Beyond the corner: the plane x - kCornerX = -(z - kWallZ), away from the scanner.
      const Eigen::Vector3d normal(1, 0, 1);
      if (range * ray.x() > kCornerX) {
        range = normal.dot(Eigen::Vector3d(kCornerX, 0, kWallZ)) / normal.dot(ray);
      }
      double error = 0;
      for (int k = 0; k < 12; ++k) {
        random = random * 1664525u + 1013904223u;
        error += (random >> 8) / 16777216.0;
      }
      range += noise * (error - 6);
      scan.points.push_back(range * ray);
      // A step of the intensity at x = -0.5 on the facing wall.
      scan.intensity.push_back(range * ray.x() < -0.5 ? 100.0f : 160.0f);
    }
  }
  return scan;
}

TEST(ScanEdges, FindACreaseToATenthOfASample) {
  // 45 degrees away from the scanner: is the plane behind? x grows, z falls.
  const Scan scan = TwoWalls(0.001);
  const double sample = 3 * RadFromDeg(0.2);
  int creases = 0;
  double worst = 0, sum = 0;
  size_t points = 0;
  for (const ScanEdge& edge : FindScanEdges(scan, ScanEdgeOptions())) {
    if (edge.kind != Kind::kCrease) continue;
    ++creases;
    for (const Eigen::Vector3d& x : edge.points) {
      worst = std::max(worst, std::abs(x.x() - kCornerX));
      sum += std::abs(x.x() - kCornerX);
      EXPECT_NEAR(x.z(), kWallZ, 0.01);
      ++points;
    }
  }
  EXPECT_GE(creases, 1);
  EXPECT_GT(points, 85u);  // of 100 rows
  EXPECT_LT(sum / static_cast<double>(points), 0.1 * sample);
  EXPECT_LT(worst, 0.5 * sample);
}

TEST(ScanEdges, FindAStepOfIntensityBetweenItsTwoSamples) {
  const Scan scan = TwoWalls(0.001);
  const double sample = 3 * RadFromDeg(0.2);
  size_t points = 0;
  for (const ScanEdge& edge : FindScanEdges(scan, ScanEdgeOptions())) {
    if (edge.kind != Kind::kIntensity) continue;
    for (const Eigen::Vector3d& x : edge.points) {
      EXPECT_NEAR(x.x(), -0.5, 0.55 * sample);
      EXPECT_NEAR(x.z(), kWallZ, 0.01);
      ++points;
    }
  }
  EXPECT_GT(points, 80u);
}

TEST(ScanEdges, OfAPlainNoisyWallAreNone) {
  Scan scan = TwoWalls(0.002);
  for (int i = 0; i < static_cast<int>(scan.points.size()); ++i) {
    const Eigen::Vector3d ray = scan.points[i].normalized();
    scan.points[i] = ray * (scan.points[i].norm() + (kWallZ / ray.z() - scan.points[i].norm()) *
                                                        (scan.points[i].x() > kCornerX - 0.02));
    scan.intensity[i] = 100;
  }
  EXPECT_EQ(FindScanEdges(scan, ScanEdgeOptions()).size(), 0u);
}

// A unit box as a mesh, and a camera at (3, 2.5, 3.5) that sees three of its faces.
Scan BoxMesh() {
  Scan box;
  box.organised = false;
  for (int i = 0; i < 8; ++i) box.points.emplace_back(i & 1, i >> 1 & 1, i >> 2 & 1);
  box.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                   {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  box.num_columns = 8;
  box.num_rows = 1;
  box.intensity.assign(8, 0);
  return box;
}
Camera BoxCamera() { return {1, CameraModel::kPinhole, 400, 300, {400, 400, 200, 150}}; }
Rigid CamFromBox() {
  const Eigen::Vector3d centre(3, 2.5, 3.5);
  const Eigen::Vector3d z = (Eigen::Vector3d::Constant(0.5) - centre).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitY()).normalized();
  Eigen::Matrix3d rotation;
  rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  return {Eigen::Quaterniond(rotation), -(rotation * centre)};
}

// A mesh has no grid of its own: a camera in front of it sees the creases between its faces.
TEST(ScanEdges, OfABoxMeshAreFoundFromThePhoto) {
  const Scan box = BoxMesh();
  EXPECT_EQ(FindScanEdges(box, ScanEdgeOptions()).size(), 0u);

  const Camera camera = BoxCamera();
  const FreeSpace free_space({box}, 1000);
  const Scan scan =
      ScanFromPhoto(free_space, RayLattice(CameraProjection(camera), 1), camera, CamFromBox());
  EXPECT_EQ(scan.num_columns, 400);
  EXPECT_EQ(scan.num_rows, 300);
  double length = 0;
  for (const ScanEdge& edge : FindScanEdges(scan, ScanEdgeOptions())) {
    if (edge.kind != Kind::kCrease) continue;
    for (size_t i = 0; i < edge.points.size(); ++i) {
      // On one of the three edges at the corner (1, 1, 1): two coordinates are 1.
      Eigen::Array3d off = (edge.points[i].array() - 1).abs();
      std::sort(off.begin(), off.end());
      // Samples are 0.011 m apart; near the corner the third face is among those that are fitted.
      EXPECT_LT(off[1], off[2] > 0.1 ? 0.003 : 0.008) << edge.points[i].transpose();
      if (i > 0) length += (edge.points[i] - edge.points[i - 1]).norm();
    }
  }
  // All of the three edges but their ends; one that runs obliquely is met by rows and by columns.
  EXPECT_GT(length, 2.5);
}

// A scan with a grid has edges of its own.
TEST(ScanEdges, OfAGridAreNotFoundOnceMoreFromThePhoto) {
  const FreeSpace free_space({TwoWalls(0)}, 100000);
  const Camera camera = BoxCamera();
  Rigid cam_from_scan;  // in the scanner's place, looking along -z
  cam_from_scan.rotation = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX());
  const Scan scan =
      ScanFromPhoto(free_space, RayLattice(CameraProjection(camera), 1), camera, cam_from_scan);
  for (int i = 0; i < static_cast<int>(scan.points.size()); ++i) ASSERT_TRUE(scan.IsMissing(i));
}

// The crease of the two walls as a distorted camera sees it, and not what is behind a surface.
TEST(SeeEdges, ProjectsThroughTheLensAndLeavesOutWhatIsHidden) {
  const std::vector<Scan> scans = {TwoWalls(0)};
  const FreeSpace free_space(scans, 100000);
  Camera camera{1, CameraModel::kOpenCv, 800, 600, {700, 690, 400, 300, -0.1, 0.03, 0.001, -0.001}};
  const CameraProjection projection(camera);
  Rigid cam_from_scan;  // camera at (0.4, 0.1, 0), looking along -z
  cam_from_scan.rotation = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX());
  cam_from_scan.translation = cam_from_scan.rotation * Eigen::Vector3d(-0.4, -0.1, 0);
  const ScanEdge crease{Kind::kCrease, {{kCornerX, -0.2, kWallZ}, {kCornerX, 0.2, kWallZ}}};
  ScanEdge hidden = crease;
  for (Eigen::Vector3d& x : hidden.points) x.z() -= 1;
  const auto seen = SeeEdges({crease, hidden}, free_space, projection, cam_from_scan);
  ASSERT_EQ(seen.size(), 1u);
  for (int k = 0; k < 2; ++k) {
    const auto expected = projection.ImgFromCam(cam_from_scan * crease.points[k]);
    EXPECT_NEAR((seen[0].points[k] - *expected).norm(), 0, 1e-9);
  }
}

// Where the drawn lines lie: on a black photo every coloured pixel is near a projected edge.
TEST(DrawOverlay, DrawsTheEdgesWhereTheyAre) {
  const cv::Mat photo(600, 800, CV_8UC3, cv::Scalar(0, 0, 0));
  ScanView view;
  view.grey = cv::Mat1f(600, 800, 50.0f);
  view.valid = cv::Mat1b(600, 800, static_cast<uchar>(255));
  ImgEdge edge{Kind::kIntensity, {{300.5, 200.5}, {300.5, 280.5}, {380.5, 280.5}}};
  OverlayOptions options;
  options.panel_width = 800;
  const cv::Mat sheet = DrawOverlay(photo, view, {edge}, {}, "photo.jpg", options);
  EXPECT_EQ(sheet.cols, 2400);
  // Right panel, below the line of text: the middle of pixel (300, y) is img 300.5.
  const int left = 1600, top = 26;
  EXPECT_GT(sheet.at<cv::Vec3b>(top + 240, left + 300)[2], 200);
  EXPECT_LT(sheet.at<cv::Vec3b>(top + 240, left + 303)[2], 30);
  EXPECT_LT(sheet.at<cv::Vec3b>(top + 240, left + 297)[2], 30);
  EXPECT_GT(sheet.at<cv::Vec3b>(top + 280, left + 350)[2], 200);
  // The left panel is the photo alone.
  EXPECT_LT(sheet.at<cv::Vec3b>(top + 240, 300)[2], 30);
}

// Where lines are drawn on the photo: there is colour in what was grey.
cv::Mat1b Coloured(const cv::Mat& bgr) {
  cv::Mat planes[3], coloured;
  cv::split(bgr, planes);
  cv::Mat most = cv::max(cv::max(planes[0], planes[1]), planes[2]);
  cv::Mat least = cv::min(cv::min(planes[0], planes[1]), planes[2]);
  cv::compare(most - least, 60, coloured, cv::CMP_GT);
  return coloured;
}

TEST(WriteOverlays, DrawsTheEdgesOfAMesh) {
  const TempFolder folder;
  const std::vector<Scan> scans = {BoxMesh()};
  const FreeSpace free_space(scans, 1000);
  const ScanViewer viewer(scans, free_space);
  cv::imwrite(folder / "box.png", cv::Mat(300, 400, CV_8UC3, cv::Scalar(90, 90, 90)));
  SparseModel model;
  model.cameras[1] = BoxCamera();
  SparseImage& image = model.images[1];
  image.image_id = image.camera_id = 1;
  image.name = "box.png";
  image.cam_from_model = CamFromBox();
  OverlayOptions options;
  options.panel_width = 400;
  options.num_crops = 0;
  std::vector<std::string> warnings;
  const std::vector<std::string> paths =
      WriteOverlays({model, folder.path()}, folder / "overlays", viewer, 1, options, 2, &warnings);
  ASSERT_EQ(paths.size(), 1u) << (warnings.empty() ? "" : warnings[0]);
  const cv::Mat sheet = cv::imread(paths[0]);
  constexpr int kTop = 26;
  ASSERT_EQ(sheet.cols, 1200);
  EXPECT_EQ(cv::countNonZero(Coloured(sheet(cv::Rect(0, kTop, 400, 300)))), 0) << "the photo";
  const cv::Mat1b drawn = Coloured(sheet(cv::Rect(800, kTop, 400, 300)));

  // The three edges at the corner (1, 1, 1), two pixels to either side: the lines, and no others.
  const CameraProjection projection(BoxCamera());
  cv::Mat1b wanted(300, 400, uchar{0}), thin = wanted.clone();
  const auto at = [&](const Eigen::Vector3d& x) {
    const Eigen::Vector2d x_in_cv = OpenCvFromImg(*projection.ImgFromCam(CamFromBox() * x));
    return cv::Point(static_cast<int>(std::lround(x_in_cv.x())),
                     static_cast<int>(std::lround(x_in_cv.y())));
  };
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d corner = Eigen::Vector3d::Ones(),
                          end = corner - Eigen::Vector3d::Unit(axis);
    cv::line(wanted, at(corner), at(end), 255, 5);
    cv::line(thin, at(corner), at(end), 255, 1);
  }
  cv::Mat1b reached;
  cv::dilate(drawn, reached, cv::Mat1b::ones(5, 5));
  const double length = cv::countNonZero(thin);
  EXPECT_GT(cv::countNonZero(reached & thin), 0.8 * length);  // measured: 206 of 227 pixels
  EXPECT_EQ(cv::countNonZero(drawn & ~wanted), 0);
}

// On photo and intensity alike, in place and not told apart; the panel with the edges has none.
TEST(DrawOverlay, MarksTheCornersThatThePhotoShowsAndThoseThatItDoesNot) {
  const cv::Mat photo(600, 800, CV_8UC3, cv::Scalar(0, 0, 0));
  ScanView view;
  view.grey = cv::Mat1f(600, 800, 50.0f);
  view.valid = cv::Mat1b(600, 800, static_cast<uchar>(255));
  GradientShifts shifts;
  shifts.corners.push_back({0, {300.5, 200.5}, {}});
  shifts.corners_amiss.emplace_back(500.5, 400.5);
  OverlayOptions options;
  options.panel_width = 800;
  const cv::Mat with = DrawOverlay(photo, view, {}, shifts, "photo.jpg", options),
                without = DrawOverlay(photo, view, {}, {}, "photo.jpg", options);
  constexpr int kTop = 26;
  for (const int left : {0, 800}) {
    const auto at = [&](int x, int y) { return with.at<cv::Vec3b>(kTop + y, left + x); };
    const auto ground = [&](int x, int y) { return without.at<cv::Vec3b>(kTop + y, left + x); };
    EXPECT_GT(at(306, 200)[0], 200) << "the ring, blue and more";
    EXPECT_LT(at(306, 200)[2], 120);
    EXPECT_EQ(at(300, 200), ground(300, 200)) << "open in its middle";
    EXPECT_GT(at(500, 400)[2], 200) << "the cross, red";
    EXPECT_LT(at(500, 400)[0], 120);
  }
  const cv::Rect edges(1600, kTop, 800, 600);
  EXPECT_EQ(cv::norm(with(edges), without(edges), cv::NORM_INF), 0);
}

TEST(AlignCommand, WritesAsManyOverlaysAsAskedFor) {
  const SimulatedCase& one = MakeCase();
  const CaseFolder files(one);
  std::filesystem::create_directory(files.folder / "photos");
  // Plain pictures of the right size do: what is in them is not the question here.
  for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
    cv::Mat picture(one.room->camera().height, one.room->camera().width, CV_8UC3,
                    cv::Scalar(90, 120, 150));
    cv::imwrite(files.folder / ("photos/" + one.room->PhotoName(photo)), picture);
  }
  const CommandResult result =
      files.Align("--overlays 2 --image_path " + (files.folder / "photos"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  ASSERT_EQ(report["overlays"].size(), 2u);
  for (const auto& path : report["overlays"]) {
    const cv::Mat sheet = cv::imread(path.get<std::string>());
    EXPECT_EQ(sheet.cols, 2880);
    EXPECT_GT(sheet.rows, 900);
  }
  EXPECT_FALSE(report["agreement"]["gradient_shift"]["supports"]);
}

TEST(AlignCommand, RefusesOverlaysWithoutPhotos) {
  const CaseFolder files(MakeCase());
  const CommandResult result = files.Align("--overlays 2");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("--image_path"));
  EXPECT_EQ(files.Align("--overlays -1").exit_code, 2);
}

}  // namespace
}  // namespace roomtex
