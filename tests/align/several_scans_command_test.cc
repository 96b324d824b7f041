// Several scans, and scans on the Earth, as a user aligns to them: the capture comes from
// roomtex-simulate.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>

#include <gmock/gmock.h>

#include "align/clicks/picks.h"
#include "capture/simulation/simulated_room.h"
#include "colmap_ext/sparse_model.h"
#include "core/frames.h"
#include "core/report.h"
#include "importers/geo_frame.h"
#include "importers/ptx.h"
#include "importers/scan_poses.h"
#include "tests/align/geo/gps_photo.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;

// A room near the border of zones 60 and 1 and of the date line, south of the equator.
const GeoPosition kFirst = {-16.5, 179.99999, 41.25};  // of the first scanner

// A capture of two stations with the sparse model of the same room, made once.
class TwoStations : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TempFolder>();
    const CommandResult result = RunCommandLine(
        "roomtex-simulate --quiet --random_seed 5 --num_stations 2 --num_photos 16 "
        "--photo_width 968 --photo_height 644 --scan_columns 800 --scan_rows 400 --num_picks 8 "
        "--click_noise_px 0.75 --output_path " +
        (*folder_ / "capture"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_stations = 2;
    options.num_photos = 16;
    options.photo_width = 968;
    options.photo_height = 644;
    options.scan_columns = 800;
    options.scan_rows = 400;
    room_ = std::make_unique<SimulatedRoom>(options);
    WriteSparseModel(room_->MakeSparseModel(2000, 0.35), *folder_ / "sparse");
    Survey();
  }
  // The same scans as a surveyor gives them: PTX files in the frame of the room, whose poses say
  // that the scanners lean by a milliradian or two, and the stations on the Earth.
  static void Survey() {
    const Rigid room_from_scan = room_->ScanFromRoom().Inverse();
    const Eigen::Quaterniond east_north_from_room(
        Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()));  // the room's walls face no wind
    enu_from_scan_ =
        Rigid{east_north_from_room, -(east_north_from_room * room_from_scan.translation)} *
        room_from_scan;
    const GeoFrame frame(kFirst);
    std::ostringstream stations;
    stations << std::setprecision(15) << "# surveyed\n";
    for (int k = 0; k < 2; ++k) {
      Scan scan = room_->MakeScan(k);
      const Rigid enu_from_station = enu_from_scan_ * scan.scan_from_station;
      const Eigen::Vector3d forward = enu_from_station.rotation * -Eigen::Vector3d::UnitZ();
      const GeoPosition place = frame.GeoFromEnu(enu_from_station.translation);
      stations << "room_" << k << ".ptx geo " << place.latitude_deg << " " << place.longitude_deg
               << " " << place.height << " " << DegFromRad(std::atan2(forward.x(), forward.y()))
               << "\n";
      PlaceScan(room_from_scan * scan.scan_from_station, &scan);
      WritePtx({scan}, Capture("room_" + std::to_string(k) + ".ptx"));
    }
    WriteBytes(Capture("stations.txt"), stations.str());
    std::vector<Pick> picks = ReadPicks(Capture("picks.csv"));
    for (Pick& pick : picks) pick.x_in_scan = enu_from_scan_ * pick.x_in_scan;
    WritePicks(Capture("picks_enu.csv"), picks);
  }
  static void TearDownTestSuite() {
    room_.reset();
    folder_.reset();
  }
  static std::string Capture(const std::string& name) { return *folder_ / ("capture/" + name); }

  // roomtex-align on both scans, with their poses ("" = without).
  CommandResult Align(const std::string& poses, const std::string& more = "") const {
    return Run("--scan_path " + Capture("scan.rtpi") + " --scan_path " + Capture("scan_1.rtpi") +
               (poses.empty() ? "" : " --scan_poses " + poses) + " --picks_path " +
               Capture("picks.csv") + " " + more);
  }
  // The same with surveyed stations.
  CommandResult AlignSurveyed(const std::string& more = "") const {
    return Run("--scan_path " + Capture("room_0.ptx") + " --scan_path " + Capture("room_1.ptx") +
               " --scan_poses " + Capture("stations.txt") + " --picks_path " +
               Capture("picks_enu.csv") + " " + more);
  }
  CommandResult Run(const std::string& options) const {
    return RunCommandLine("roomtex-align --quiet --input_path " + sparse_ + " --output_path " +
                          (output_ / "aligned") + " " + options);
  }
  // The poses with the second station so many times 13 mm off.
  std::string StationOff(double times) const {
    std::istringstream poses(ReadBytes(Capture("scan_poses.txt")));
    std::ostringstream off;
    for (std::string line; std::getline(poses, line);) {
      std::istringstream words(line);
      std::string name;
      double w, x, y, z, tx, ty, tz;
      if (words >> name >> w >> x >> y >> z >> tx >> ty >> tz && name == "scan_1.rtpi") {
        off << name << " " << w << " " << x << " " << y << " " << z << " " << tx + 0.009 * times
            << " " << ty - 0.007 * times << " " << tz + 0.006 * times << "\n";
      } else {
        off << line << "\n";
      }
    }
    WriteBytes(output_ / "off.txt", off.str());
    return output_ / "off.txt";
  }
  // Largest distance of a camera of the written model from its true place.
  static double WorstPosition(const std::string& model_path, const Rigid& frame_from_scan) {
    const SparseModel model = ReadSparseModel(model_path);
    EXPECT_EQ(model.images.size(), 16u);
    double worst = 0;
    for (int photo = 0; photo < 16; ++photo) {
      const SparseImage* const image = model.FindImage(room_->PhotoName(photo));
      const Eigen::Vector3d truth = room_->CamFromScan(photo).TargetOriginInSource();
      worst = std::max(
          worst, (image->cam_from_model.TargetOriginInSource() - frame_from_scan * truth).norm());
    }
    return worst;
  }
  Json ReadReport() const { return Json::parse(ReadBytes(output_ / "aligned/alignment.json")); }
  void ExpectRefusal(const std::string& poses_text, const std::string& message) const {
    WriteBytes(output_ / "poses.txt", poses_text);
    const CommandResult result = Align(output_ / "poses.txt");
    EXPECT_EQ(result.exit_code, 3) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_FALSE(std::filesystem::exists(output_ / "aligned"));
  }

  TempFolder output_;
  std::string sparse_ = *folder_ / "sparse";
  static std::unique_ptr<TempFolder> folder_;
  static std::unique_ptr<SimulatedRoom> room_;
  static Rigid enu_from_scan_;
};
std::unique_ptr<TempFolder> TwoStations::folder_;
std::unique_ptr<SimulatedRoom> TwoStations::room_;
Rigid TwoStations::enu_from_scan_;

TEST_F(TwoStations, AreAlignedToWithTheirPoses) {
  const CommandResult result = Align(Capture("scan_poses.txt"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const double worst = WorstPosition(output_ / "aligned", Rigid());
  RecordProperty("worst_position_mm", std::to_string(1000 * worst));
  EXPECT_LT(worst, 0.003);
  EXPECT_TRUE(ReadReport()["geo"].is_null());
  EXPECT_FALSE(std::filesystem::exists(output_ / "aligned/geo"));
}

// Also of scans that have to be thinned out.
TEST_F(TwoStations, GiveTheSameBytesInEitherOrder) {
  for (const char* bound : {"", " --max_samples 200000"}) {
    std::string bytes[2];
    for (const bool turned : {false, true}) {
      const std::string poses = " --scan_poses " + Capture("scan_poses.txt") + " --picks_path " +
                                Capture("picks.csv") + bound;
      const CommandResult result =
          Run("--scan_path " + Capture(turned ? "scan_1.rtpi" : "scan.rtpi") + " --scan_path " +
              Capture(turned ? "scan.rtpi" : "scan_1.rtpi") + poses);
      ASSERT_EQ(result.exit_code, 0) << result.err;
      for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
        bytes[turned] += ReadBytes(output_ / "aligned/" + name);
      }
      const Json report = ReadReport();
      EXPECT_EQ(report["sample_stride"], *bound == 0 ? 1 : 2);
      // What is remembered stands in the order of the command line.
      EXPECT_THAT(report["scans"][0]["path"].get<std::string>(),
                  testing::EndsWith(turned ? "scan_1.rtpi" : "scan.rtpi"));
      EXPECT_EQ(report["scans"][turned ? 0 : 1]["poses"][0]["given"], true);
    }
    EXPECT_LT(WorstPosition(output_ / "aligned", Rigid()), 0.004);
    EXPECT_TRUE(bytes[0] == bytes[1]);
  }
}

TEST_F(TwoStations, AreAlignedToAsSurveyed) {
  const CommandResult result = AlignSurveyed();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_LT(WorstPosition(output_ / "aligned", enu_from_scan_), 0.003);
  // The report's origin is the first station; no second model is written.
  const Json geo = ReadReport()["geo"];
  EXPECT_EQ(geo["origin"]["longitude"], kFirst.longitude_deg);
  EXPECT_EQ(geo["utm"]["zone"], "60S");
  EXPECT_EQ(geo["stations"].size(), 2u);
  EXPECT_TRUE(geo["gps"].is_null());
  EXPECT_FALSE(std::filesystem::exists(output_ / "aligned/geo"));
}

TEST_F(TwoStations, AreWrittenOnTheEarthAndCheckedByGps) {
  // Two photos in three carry GPS, five metres off.
  const GeoFrame frame(kFirst);
  const auto write_gps = [&](double east) {
    for (int photo = 0; photo < 16; ++photo) {
      if (photo % 3 == 0) continue;
      const Eigen::Vector3d centre = room_->CamFromScan(photo).TargetOriginInSource();
      WriteGpsPosition(Capture("photos/" + room_->PhotoName(photo)),
                       frame.GeoFromEnu(enu_from_scan_ * centre + Eigen::Vector3d(east, 0, 0)), "");
    }
  };
  write_gps(5);
  const std::string options = "--image_path " + Capture("photos") +
                              " --geo_origin -16.501,-179.999,30 --report_path " +
                              (output_ / "report.json");
  const CommandResult result = AlignSurveyed(options);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  // aligned/ is about the first station, aligned/geo/ about the origin, across the date line.
  EXPECT_LT(WorstPosition(output_ / "aligned", enu_from_scan_), 0.003);
  const GeoFrame origin({-16.501, -179.999, 30});
  const Rigid origin_from_scan = origin.EnuFromOther(frame) * enu_from_scan_;
  EXPECT_NEAR(origin_from_scan.translation.x(), -107.8, 0.5);
  EXPECT_LT(WorstPosition(output_ / "aligned/geo", origin_from_scan), 0.003);
  // Latitude, longitude and height of the cameras are those of the model beside them.
  const SparseModel model = ReadSparseModel(output_ / "aligned/geo");
  std::ifstream csv(output_ / "aligned/geo/cameras.csv");
  std::string line;
  std::getline(csv, line);
  int num_lines = 0;
  for (; std::getline(csv, line); ++num_lines) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::string name;
    GeoPosition place;
    ASSERT_TRUE(words >> name >> place.latitude_deg >> place.longitude_deg >> place.height);
    EXPECT_THAT(origin.EnuFromGeo(place),
                IsNearMatrix(model.FindImage(name)->cam_from_model.TargetOriginInSource(), 1e-6));
  }
  EXPECT_EQ(num_lines, 16);
  const Json report = ReadReport(), geo = report["geo"];
  EXPECT_EQ(geo["origin"]["latitude"], -16.501);
  EXPECT_EQ(geo["origin"]["height"], 30);
  EXPECT_EQ(geo["utm"]["zone"], "1S");
  EXPECT_EQ(geo["gps"]["num_photos"], 10);
  EXPECT_NEAR(geo["gps"]["median_horizontal_m"], 5, 0.01);
  EXPECT_EQ(geo["gps"]["agrees"], true);
  EXPECT_EQ(report["warnings"].dump().find("GPS"), std::string::npos);
  EXPECT_EQ(report, Json::parse(ReadBytes(output_ / "report.json")));

  // Forty metres off is worth a warning, but the alignment stays trusted.
  write_gps(40);
  const CommandResult far = AlignSurveyed(options);
  ASSERT_EQ(far.exit_code, 0) << far.err;
  EXPECT_EQ(ReadReport()["trusted"], true);
  EXPECT_EQ(ReadReport()["geo"]["gps"]["agrees"], false);
  EXPECT_THAT(ReadReport()["warnings"].dump(), HasSubstr("the GPS of the photos lies 40 m"));
  // A later run without the origin says that geo/ is old.
  ASSERT_EQ(AlignSurveyed().exit_code, 0);
  EXPECT_THAT(ReadReport()["warnings"].dump(), HasSubstr("aligned/geo is from an earlier run"));
}

TEST_F(TwoStations, WithoutSurveyTheScanFrameStandsAtTheOrigin) {
  const CommandResult result =
      Align(Capture("scan_poses.txt"), "--geo_origin=-16.5,179.99999,41.25,217.5");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_LT(WorstPosition(output_ / "aligned", Rigid()), 0.003);
  const Rigid enu_from_scan =
      GeoFrame(kFirst).EnuFromStation({kFirst, 217.5}, Eigen::Vector3d::UnitY());
  EXPECT_LT(WorstPosition(output_ / "aligned/geo", enu_from_scan), 0.003);
  EXPECT_EQ(ReadReport()["geo"]["surveyed"], false);
}

// A station 13 mm off puts an answer in doubt that claims to be nearer, and no other.
TEST_F(TwoStations, ThatAreFartherOffThanIsExpectedAreNotTrusted) {
  const CommandResult exact = Align(StationOff(1));
  EXPECT_EQ(exact.exit_code, 4) << exact.err;
  EXPECT_THAT(exact.err, HasSubstr("The scans do not fit together"));
  EXPECT_LT(ReadReport()["expected_error"]["at_cameras_mm"], 8);

  WriteSparseModel(room_->MakeSparseModel(300, 8), output_ / "noisy");
  sparse_ = output_ / "noisy";
  const CommandResult noisy = Align(StationOff(1));
  EXPECT_EQ(noisy.exit_code, 0) << noisy.err;
  EXPECT_THAT(ReadReport()["warnings"].dump(), HasSubstr("The expected error is larger"));
  EXPECT_GT(ReadReport()["expected_error"]["at_cameras_mm"], 8);

  // Twice as far off it is misplaced, whatever is expected.
  EXPECT_EQ(Align(StationOff(2)).exit_code, 4);
}

TEST_F(TwoStations, NeedGoodPoses) {
  const std::string pose = " 1 0 0 0 0 0 0\n";
  ExpectRefusal("scan.rtpi" + pose,
                "poses.txt: gives no pose for scan_1.rtpi, one of 2 scans; it names scan.rtpi. "
                "Add a line that begins with scan_1.rtpi.");
  ExpectRefusal("scan.rtpi" + pose + "scan_1.rtpi" + pose + "scan.rtpi" + pose,
                "poses.txt: line 3: gives a second pose for scan.rtpi, the first is in line 1. "
                "Remove one of them.");
  ExpectRefusal("scan.rtpi" + pose + "scan_2.rtpi" + pose,
                "poses.txt: line 2: scan_2.rtpi is none of the scans given (scan.rtpi, "
                "scan_1.rtpi). Write the scan's path or file name");
  ExpectRefusal("scan.rtpi" + pose + "scan_1.rtpi geo 47 8 500 0\n",
                "line 2: is a surveyed station, but line 1 is a pose");
  ExpectRefusal("scan.rtpi geo 147 8 500 0\n",
                "line 1: is \"scan.rtpi geo 147 8 500 0\", but the "
                "latitude must lie within");
  const CommandResult none = Align("");
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("Give each scan's pose with --scan_poses"));
}

TEST_F(TwoStations, NeedAnOriginOnTheEarth) {
  const std::pair<const char*, const char*> cases[] = {
      {"--geo_origin 103,1,15", "latitude and longitude exchanged?"},
      {"--geo_origin 1,103", "expected LATITUDE,LONGITUDE,HEIGHT"},
      {"--geo_origin -16.5,180,30,5", "Leave it out"}};
  for (const auto& [option, message] : cases) {
    const CommandResult result = AlignSurveyed(option);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(output_ / "aligned"));
  }
}

}  // namespace
}  // namespace roomtex
