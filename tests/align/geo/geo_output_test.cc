#include "align/geo/geo_output.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <exiv2/exiv2.hpp>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/frames.h"
#include "tests/align/geo/gps_photo.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// Photos and points over half a kilometre, with names that a CSV has to quote.
SparseModel SiteModel() {
  SparseModel model;
  model.cameras[1] = {1, CameraModel::kPinhole, 640, 480, {500, 500, 320, 240}};
  const char* const names[] = {"a.jpg", "sub/b.jpg", "c,\"quoted\".jpg"};
  const Eigen::Vector3d centres[] = {{0.123456789, -1.25, 1.5}, {480, 140, 3}, {-499.75, 20, -7}};
  for (uint32_t i = 0; i < 3; ++i) {
    SparseImage& image = model.images[i + 1];
    image.image_id = i + 1;
    image.camera_id = 1;
    image.name = names[i];
    image.cam_from_model.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(0.4 * i, Eigen::Vector3d(1, 2, 3).normalized()));
    image.cam_from_model.translation = -(image.cam_from_model.rotation * centres[i]);
  }
  for (uint64_t id = 1; id <= 2; ++id) {
    SparsePoint& point = model.points[id];
    point.x_in_model = Eigen::Vector3d(100.0 * id + 1e-7, 7.0 / 3, -2);
    for (uint32_t i = 1; i <= 2; ++i) {
      model.images[i].points2d.emplace_back(10.5 * id, 20);
      model.images[i].point3d_ids.push_back(id);
      point.track.push_back({i, static_cast<uint32_t>(id - 1)});
    }
  }
  return model;
}

// One y-up scan at a surveyed station, or without one.
PlacedScans OneScan(const std::optional<SurveyedStation>& station) {
  PlacedScans placed;
  placed.scans.resize(1);
  placed.scans[0].path = "scans/room.rtpi";
  if (!station) return placed;
  placed.enu.emplace(station->position);
  placed.stations = {*station};
  return placed;
}

// Fields of a line without quotes in them.
std::vector<std::string> Fields(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
  return fields;
}

TEST(ParseGeoOrigin, TakesThreeNumbersOrFour) {
  EXPECT_FALSE(ParseGeoOrigin(""));
  const std::optional<GeoOrigin> three = ParseGeoOrigin("-33.8568,151.2153,41.5");
  ASSERT_TRUE(three);
  EXPECT_EQ(three->position.latitude_deg, -33.8568);
  EXPECT_EQ(three->position.longitude_deg, 151.2153);
  EXPECT_EQ(three->position.height, 41.5);
  EXPECT_FALSE(three->heading_deg);
  EXPECT_EQ(ParseGeoOrigin(" +1.5, 103.8 , -2 , 90")->heading_deg, 90);
}

TEST(ParseGeoOrigin, RefusesWhatIsNoPlace) {
  for (const char* const text :
       {"1,2", "1,2,3,4,5", "1,2,", "1,2,3,", ",1,2", "a,b,c", "1;2;3", "1,2,nan", "1,2,inf",
        "91,0,0", "0,361,0", "0,0,1e6", "0,0,0,361", "1 2 3", "47N,8E,3", ","}) {
    EXPECT_THROW(ParseGeoOrigin(text), UsageError) << text;
  }
  try {
    ParseGeoOrigin("103.8,1.3,15");
    ADD_FAILURE();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("exchanged"));
  }
}

class EveryOrigin : public testing::TestWithParam<std::pair<const char*, GeoPosition>> {};
INSTANTIATE_TEST_SUITE_P(
    All, EveryOrigin,
    testing::Values(std::pair{"48N", GeoPosition{1.2966, 103.7764, 23.5}},
                    std::pair{"56S", GeoPosition{-33.8568, 151.2153, 41}},
                    std::pair{"32N", GeoPosition{48.2, 11.9985, 520}},  // border in the site
                    std::pair{"60S", GeoPosition{-16.5, 179.999, 5}},   // date line in the site
                    std::pair{"32N", GeoPosition{0.0005, 9, 350}},      // equator in the site
                    std::pair{"UPS N", GeoPosition{89.999, 30, 2}},
                    std::pair{"UPS S", GeoPosition{-89.999, 30, 2800}}));

// The site is surveyed at the place, the origin of the output lies half a kilometre beside it.
TEST_P(EveryOrigin, TheWrittenModelAndItsCamerasAreOnePlaceToAMicrometre) {
  const auto& [zone, place] = GetParam();
  const GeoFrame surveyed(place);
  const PlacedScans placed = OneScan(SurveyedStation{place, 0});
  GeoOrigin origin;
  origin.position = surveyed.GeoFromEnu({-300, -400, 12});
  const std::optional<GeoReference> geo = FindGeoReference(placed, origin);
  ASSERT_TRUE(geo);
  const SparseModel aligned = SiteModel();
  const TempFolder folder;
  WriteGeoModel(aligned, *geo, folder / "aligned/geo");

  // The binary model: every centre and point at the place that geodesy gives it.
  const SparseModel written = ReadSparseModel(folder / "aligned/geo");
  const GeoFrame frame(origin.position);
  const auto moved = [&](const Eigen::Vector3d& x_in_scan) {
    return frame.EnuFromGeo(surveyed.GeoFromEnu(x_in_scan));
  };
  ASSERT_EQ(written.images.size(), 3u);
  for (const auto& [id, image] : written.images) {
    const Eigen::Vector3d centre = aligned.images.at(id).cam_from_model.TargetOriginInSource();
    EXPECT_THAT(image.cam_from_model.TargetOriginInSource(), IsNearMatrix(moved(centre), 1e-6));
  }
  for (const auto& [id, point] : written.points) {
    EXPECT_THAT(point.x_in_model, IsNearMatrix(moved(aligned.points.at(id).x_in_model), 1e-6));
  }
  SparseModel same_pixels = written;
  SparseModel before = aligned;
  EXPECT_NEAR(UpdateReprojectionErrors(&same_pixels).rms_px,
              UpdateReprojectionErrors(&before).rms_px, 1e-6);

  // geo.json leads from there to ECEF and to the grid.
  const Json json = Json::parse(ReadBytes(folder / "aligned/geo/geo.json"));
  EXPECT_EQ(json["utm"]["zone"], frame.GridOfOrigin().ZoneName());
  EXPECT_EQ(json["origin"]["latitude"], origin.position.latitude_deg);
  EXPECT_EQ(json["trusted"], true);
  Eigen::Matrix<double, 3, 4> ecef_from_enu;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      ecef_from_enu(row, column) = json["ecef_from_enu_matrix"][row][column];
    }
  }

  // cameras.csv says the same three times.
  std::ifstream csv(folder / "aligned/geo/cameras.csv");
  std::string line;
  ASSERT_TRUE(std::getline(csv, line));
  EXPECT_EQ(line,
            "image_name,latitude,longitude,height,ecef_x,ecef_y,ecef_z,utm_zone,utm_easting,"
            "utm_northing");
  for (const auto& [id, image] : written.images) {
    const Eigen::Vector3d x_in_enu = image.cam_from_model.TargetOriginInSource();
    ASSERT_TRUE(std::getline(csv, line));
    if (id == 3) {
      EXPECT_EQ(line.rfind("\"c,\"\"quoted\"\".jpg\",", 0), 0u) << line;
      line = "c" + line.substr(line.find("jpg\",") + 4);
    }
    const std::vector<std::string> fields = Fields(line);
    ASSERT_THAT(fields, SizeIs(10));
    EXPECT_EQ(fields[0], id == 3 ? "c" : image.name);
    const auto number = [&](int i) { return std::stod(fields[i]); };
    EXPECT_THAT(frame.EnuFromGeo({number(1), number(2), number(3)}), IsNearMatrix(x_in_enu, 1e-6));
    EXPECT_THAT((Eigen::Vector3d{number(4), number(5), number(6)}),
                IsNearMatrix(ecef_from_enu * x_in_enu.homogeneous(), 1e-6));
    EXPECT_EQ(fields[7], frame.GridOfOrigin().ZoneName());
    EXPECT_THAT(frame.EnuFromGrid(number(8), number(9), number(3)), IsNearMatrix(x_in_enu, 1e-6));
  }
  EXPECT_FALSE(std::getline(csv, line));
  EXPECT_EQ(surveyed.GridOfOrigin().ZoneName(), zone);
}

TEST(GeoReference, WithoutStationsTheScanFrameStandsAtTheOrigin) {
  EXPECT_FALSE(FindGeoReference(OneScan(std::nullopt), std::nullopt));
  const std::optional<GeoReference> geo =
      FindGeoReference(OneScan(std::nullopt), ParseGeoOrigin("47,8,500,90"));
  ASSERT_TRUE(geo);
  EXPECT_FALSE(geo->surveyed);
  // y up, -z to the east.
  EXPECT_THAT(geo->enu_from_scan * Eigen::Vector3d(1, 2, -3),
              IsNearMatrix(Eigen::Vector3d(3, -1, 2), 1e-8));
  EXPECT_THAT(GeoWarnings(SiteModel(), *geo, {}), IsEmpty());
  const std::optional<GeoReference> north =
      FindGeoReference(OneScan(std::nullopt), ParseGeoOrigin("47,8,500"));
  EXPECT_THAT(GeoWarnings(SiteModel(), *north, {}), ElementsAre(HasSubstr("to face north")));
  // Who goes on from the written model hears of both.
  const TempFolder folder;
  WriteGeoModel(SiteModel(), *north, folder / "geo", "picks contradict");
  const Json json = Json::parse(ReadBytes(folder / "geo/geo.json"));
  EXPECT_EQ(json["heading_assumed"], true);
  EXPECT_EQ(json["surveyed"], false);
  EXPECT_EQ(json["trusted"], false);
  EXPECT_EQ(json["reason"], "picks contradict");
  EXPECT_EQ(GeoToJson(*geo, OneScan(std::nullopt), {})["heading_assumed"], false);
  // A z-up scan that is east-north-up already keeps its axes.
  PlacedScans z_up = OneScan(std::nullopt);
  z_up.scans[0].up = Eigen::Vector3d::UnitZ();
  EXPECT_THAT(FindGeoReference(z_up, ParseGeoOrigin("47,8,500"))->enu_from_scan,
              IsNearRigid(Rigid(), 1e-7, 1e-8));
}

TEST(GeoReference, SurveyedStationsNeedNoOriginAndTakeNoHeading) {
  const PlacedScans placed = OneScan(SurveyedStation{{47, 8, 500}, 30});
  const std::optional<GeoReference> geo = FindGeoReference(placed, std::nullopt);
  ASSERT_TRUE(geo);
  EXPECT_TRUE(geo->surveyed);
  EXPECT_THAT(geo->enu_from_scan, IsNearRigid(Rigid(), 0, 0));
  EXPECT_THROW(FindGeoReference(placed, ParseGeoOrigin("47,8,500,30")), UsageError);
  const Json json = GeoToJson(*geo, placed, {});
  EXPECT_EQ(json["stations"][0]["scan"], "room.rtpi");
  EXPECT_EQ(json["stations"][0]["heading"], 30);
  EXPECT_EQ(json["utm"]["zone"], "32N");
  EXPECT_TRUE(json["gps"].is_null());
}

TEST(GeoReference, AFarOriginIsWarnedAbout) {
  const PlacedScans placed = OneScan(SurveyedStation{{47, 8, 500}, 30});
  const auto geo = FindGeoReference(placed, ParseGeoOrigin("47,18,500"));
  EXPECT_THAT(GeoWarnings(SiteModel(), *geo, {}),
              ElementsAre(HasSubstr("km from the geographic origin")));
  // Cameras out of the reach of the grid leave their fields empty.
  SparseModel model = SiteModel();
  model.images[1].cam_from_model.translation *= 1e8;
  const TempFolder folder;
  WriteGeoModel(model, *geo, folder / "geo");
  EXPECT_THAT(ReadBytes(folder / "geo/cameras.csv"), HasSubstr(",,,\n"));
}

// GPS.

class PhotoGps : public testing::Test {
 protected:
  // Photos of the model with their true position, moved by metres to the east.
  void WritePhotos(double east, const std::string& stated_error, int count = 3) {
    std::filesystem::create_directories(folder_ / "sub");
    for (const auto& [id, image] : model_.images) {
      cv::imwrite(folder_ / image.name, cv::Mat(8, 8, CV_8UC3, cv::Scalar(9, 9, 9)));
      if (static_cast<int>(id) > count) continue;
      const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
      WriteGpsPosition(folder_ / image.name,
                       geo_.frame.GeoFromEnu(centre + Eigen::Vector3d(east, 0, 0)), stated_error);
    }
  }
  GpsCheck Check() const { return CheckGps(model_, geo_, folder_.path()); }

  TempFolder folder_;
  SparseModel model_ = SiteModel();
  const PlacedScans placed_ = OneScan(SurveyedStation{{-16.5, 180, 5}, 0});
  const GeoReference geo_ = *FindGeoReference(placed_, std::nullopt);
};

TEST_F(PhotoGps, DistanceIsThatOfThePhotos) {
  WritePhotos(12, "");
  const GpsCheck check = Check();
  ASSERT_THAT(check.photos, SizeIs(3));
  for (const GpsCheck::Photo& photo : check.photos) EXPECT_NEAR(photo.horizontal, 12, 0.01);
  EXPECT_NEAR(check.median_horizontal, 12, 0.01);
  EXPECT_TRUE(check.Agrees());
  EXPECT_THAT(GeoWarnings(model_, geo_, check), IsEmpty());
  const Json json = GeoToJson(geo_, placed_, check)["gps"];
  EXPECT_EQ(json["num_photos"], 3);
  EXPECT_EQ(json["agrees"], true);
  EXPECT_EQ(json["per_photo"][1]["image_name"], "sub/b.jpg");
  EXPECT_TRUE(json["per_photo"][1]["stated_error_m"].is_null());
}

TEST_F(PhotoGps, UnstatedErrorsMayBeFifteenMetres) {
  WritePhotos(14.9, "");
  EXPECT_TRUE(Check().Agrees());
  WritePhotos(15.1, "");
  EXPECT_FALSE(Check().Agrees());
  EXPECT_THAT(GeoWarnings(model_, geo_, Check()),
              ElementsAre(HasSubstr("lies 15.1 m (median of 3)")));
}

TEST_F(PhotoGps, StatedErrorsMayBeExceededThreeTimes) {
  WritePhotos(14.9, "5/1");
  EXPECT_TRUE(Check().Agrees());
  EXPECT_NEAR(Check().median_over_allowed, 14.9 / 15, 1e-3);
  WritePhotos(6.1, "2/1");
  EXPECT_FALSE(Check().Agrees());
  WritePhotos(60, "30/1");
  EXPECT_TRUE(Check().Agrees());
}

TEST_F(PhotoGps, OneBadPhotoOfThreeIsNoDisagreement) {
  WritePhotos(3, "");
  WriteGpsPosition(folder_ / "a.jpg", {48, 11, 0}, "");
  EXPECT_TRUE(Check().Agrees());
  EXPECT_GT(Check().photos[0].horizontal, 1e6);
}

TEST_F(PhotoGps, PhotosWithoutPositionAreNotCompared) {
  WritePhotos(3, "", 1);
  EXPECT_THAT(Check().photos, SizeIs(1));
  WritePhotos(3, "", 0);
  EXPECT_THAT(Check().photos, IsEmpty());
  EXPECT_TRUE(Check().Agrees());
  EXPECT_TRUE(GeoToJson(geo_, placed_, Check())["gps"].is_null());
  EXPECT_THAT(CheckGps(model_, geo_, "").photos, IsEmpty());
  EXPECT_THAT(CheckGps(model_, geo_, "/nonexistent").photos, IsEmpty());
}

TEST_F(PhotoGps, AnotherDatumIsNotCompared) {
  WritePhotos(400, "");
  for (const auto& [id, image] : model_.images) {
    auto file = Exiv2::ImageFactory::open(folder_ / image.name);
    file->readMetadata();
    file->exifData()["Exif.GPSInfo.GPSMapDatum"] = "TOKYO";
    file->writeMetadata();
  }
  EXPECT_THAT(Check().photos, IsEmpty());
  EXPECT_EQ(Check().num_other_datum, 3);
  EXPECT_TRUE(Check().Agrees());
  EXPECT_EQ(GeoToJson(geo_, placed_, Check())["gps"]["num_other_datum"], 3);
}

}  // namespace
}  // namespace roomtex
