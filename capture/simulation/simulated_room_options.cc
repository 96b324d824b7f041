#include "capture/simulation/simulated_room_options.h"

#include <algorithm>
#include <cmath>

#include "capture/simulation/camera_faults.h"
#include "core/camera_formulas.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "core/option_fields.h"

namespace roomtex {

bool IsOfShare(int photo, double share) {
  return std::floor((photo + 1) * share) > std::floor(photo * share);
}

SimulatedRoomOptions SimulatedRoomOptions::SecondRoom() const {
  // Any that nobody is likely to ask for himself: the rooms have nothing in common.
  constexpr int kOtherSeeds = 100003;
  SimulatedRoomOptions second = *this;
  second.random_seed ^= kOtherSeeds;
  if (furniture_seed >= 0) second.furniture_seed ^= kOtherSeeds;
  if (layout_seed >= 0) second.layout_seed ^= kOtherSeeds;
  return second;
}

Rigid SimulatedRoomOptions::RoomFromSecondRoom() const {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(2 * DoorX(), -kPartitionThickness, 0)};
}

void SimulatedRoomOptions::DeclareRoom(OptionFields* fields) {
  fields->Number("room_width", &width, "size of the room along x, metres")
      .Within(4.6, 20, "m: the furniture has to fit in");
  fields->Number("room_depth", &depth, "size of the room along y, metres")
      .Within(3.8, 20, "m: the furniture has to fit in");
  fields->Number("room_height", &height, "height of the room, metres").Within(2.5, 6, "m");
  fields->Bool("furnished", &furnished, "table, shelf, sofa, pictures and so on");
  fields
      ->Int("layout_seed", &layout_seed,
            "0 or more: which furniture there is and where, where photos are taken from and "
            "scanners stand is drawn by this number; -1: as in all rooms of that size")
      .AtLeast(-1);
  fields->Bool("bare_walls", &bare_walls,
               "plain walls, floor and ceiling: nothing for features to hold on to");
}

void SimulatedRoomOptions::DeclareProjectors(OptionFields* fields) {
  fields
      ->Int("projectors", &projectors,
            "projectors that throw patterns; every place is then photographed twice, "
            "patterned and plain, and the room is bare unless --bare says otherwise")
      .Within(0, kMaxProjectors);
  fields->Require(projectors == 0 || pattern != nullptr, "projectors need a pattern to throw");
  fields->Int("projector_width", &projector_width, "pixels").Within(320, 16384, "pixels");
  fields->Int("projector_height", &projector_height, "pixels").Within(240, 16384, "pixels");
  fields
      ->Number("projector_field_of_view_deg", &projector_field_of_view_deg,
               "horizontal, degrees; smaller = finer pattern on less of the walls")
      .Within(10, 120);
  fields
      ->Number("projector_light", &projector_light,
               "light of a white pattern at 1 m, room light = 1")
      .Within(0, 1000);
  fields
      ->Number("projector_focus", &projector_focus,
               "metres from the projector to where its pattern is sharp")
      .Within(0.3, 100, "m");
  fields->Bool("same_pattern", &same_pattern,
               "a mistake to study: all projectors throw the same pattern");
}

void SimulatedRoomOptions::DeclareSurfaces(OptionFields* fields) {
  fields
      ->Number("finest_detail", &finest_detail,
               "metres: no surface has finer detail; larger = smoother pictures and prints")
      .Within(0, 0.1, "m");
  fields->Bool("shading", &shading, "light from a lamp and the window instead of even light");
  fields
      ->Number("gloss", &gloss,
               "varnish on floor and wood: share of the light that it mirrors seen from straight "
               "above, in the photos and not in the true colours; 0.05 = polished")
      .Within(0, 1);
}

void SimulatedRoomOptions::DeclareCamera(OptionFields* fields) {
  fields->Int("num_photos", &num_photos, "number of photos; with projectors: of places")
      .Within(1, 1000);
  fields->Int("photo_width", &photo_width, "pixels").Within(64, 20000, "pixels");
  fields->Int("photo_height", &photo_height, "pixels").Within(64, 20000, "pixels");
  fields
      ->Number("field_of_view_deg", &field_of_view_deg,
               "horizontal, degrees, of the lens without its distortion (65 are 66.5 with that of "
               "OPENCV); beyond 100 for fisheyes, which leave dark what their distortion does not "
               "reach; a panorama has 360 whatever this is")
      .Within(20, 240);
  fields->Number("roll_deg", &roll_deg, "photos lean to either side by up to this, degrees")
      .Within(0, 180);
  fields->Text("camera_model", &camera_model, "any of COLMAP's camera models");
  fields->Require(
      CameraModelFromName(camera_model).has_value(),
      "--camera_model \"" + camera_model + "\" is none of COLMAP's, e.g. OPENCV or SIMPLE_RADIAL");
  const auto model = CameraModelFromName(camera_model);
  fields->Require(!model || !camera_formulas::IsPerspective(*model) || field_of_view_deg <= 100,
                  "--field_of_view_deg above 100 needs a fisheye, e.g. --camera_model FISHEYE");
  fields->Require(model != CameraModel::kEquirectangular || photo_width == 2 * photo_height,
                  "--camera_model EQUIRECTANGULAR needs a --photo_width of twice --photo_height, "
                  "e.g. 4096 and 2048");
  fields->Bool("distortion", &distortion, "lens distortion (0 = all its parameters zero)");
}

void SimulatedRoomOptions::DeclareLight(OptionFields* fields) {
  fields
      ->Number("exposure_range_ev", &exposure_range_ev,
               "exposures vary by up to plus or minus this, in thirds of an EV")
      .Within(0, 4);
  fields->Bool("exif", &exif, "write exposure time, aperture and ISO into the photos");
  fields->Bool("exif_lens", &exif_lens,
               "also the focal length on 35 mm film, to whole millimetres, as phones do");
  fields
      ->Number("photo_noise", &photo_noise,
               "noise of the photos, standard deviation in grey levels of 255")
      .Within(0, 64, "grey levels");
  fields->Number("blur_px", &blur_px, "blur of the photos, Gaussian sigma in pixels").Within(0, 50);
  fields
      ->Number("motion_px", &motion_px,
               "motion blur: so many pixels does the camera move while it is exposed, in another "
               "direction for each photo")
      .Within(0, 100);
  fields
      ->Number("blurred", &blurred,
               "share of the photos that --blur_px and --motion_px are for, both of a place with "
               "projectors")
      .Within(0, 1, "(a share of the photos)");
  fields->Choice("response", &response, ResponseTable::Names(),
                 "how the camera turns light into bytes: sRGB, or a gamma of 1.8 with toe and "
                 "shoulder");
  fields->Number("vignetting", &vignetting, "share of the light that the lens loses in the corners")
      .Within(0, 0.9);
  fields
      ->Number("white_balance_ev", &white_balance_ev,
               "red and blue vary from photo to photo by up to plus or minus this, EV")
      .Within(0, 2);
  fields->Choice(
      "wrong_exif", &wrong_exif, {"none", "one", "all"},
      "one: the middle (plain) photo notes a quarter of its exposure time; all: every photo "
      "notes the same");
}

void SimulatedRoomOptions::DeclareMotion(OptionFields* fields) {
  fields
      ->Number("rolling_shutter_ms", &rolling_shutter_ms,
               "time from reading the first row of a photo to the last one, in which the hand "
               "moves the camera on; the true pose is that of the middle row. Rows lie along the "
               "longer side, as a sensor has them. 30 = a phone")
      .Within(0, 1000, "ms");
  fields
      ->Number("hand_move", &hand_move,
               "how fast the hand moves while a photo is read, metres per second, each photo "
               "another way")
      .Within(0, 10, "m/s");
  fields
      ->Number("hand_turn_deg", &hand_turn_deg,
               "how fast the hand turns while a photo is read, degrees per second, about another "
               "axis each photo")
      .Within(0, 360, "degrees per second");
  fields->Require(projectors == 0 || rolling_shutter_ms == 0,
                  "--rolling_shutter_ms needs a hand that moves, --projectors a camera that stands "
                  "still; give one of them");
}

void SimulatedRoomOptions::DeclareOddPhotos(OptionFields* fields) {
  const auto model = CameraModelFromName(camera_model);
  fields
      ->Number("strangers", &strangers,
               "share of the photos in which somebody stands who is not in the scan")
      .Within(0, 1, "(a share of the photos)");
  fields
      ->Number("zoomed", &zoomed,
               "share of the photos taken at 1.3 times the focal length, which nobody tells")
      .Within(0, 0.9, "(a share of the photos)");
  fields
      ->Int(
          "similar_room", &similar_room,
          "so many more photos, of another room with the same plan, walls, floor and ceiling, and "
          "other pictures and cloths; they have no truth")
      .Within(0, 1000);
  fields->Require(zoomed == 0 || model != CameraModel::kEquirectangular,
                  "--zoomed needs a lens, which --camera_model EQUIRECTANGULAR has not");
  fields->Require(similar_room == 0 || projectors == 0,
                  "--similar_room and --projectors cannot be had together; give one of them");
}

void SimulatedRoomOptions::DeclareScans(OptionFields* fields) {
  fields->Bool("second_room", &second_room,
               "behind the open door, with --num_photos and --num_stations of its own; further "
               "photos are taken on the way through the door");
  fields->Require(!second_room || (projectors == 0 && !depth_camera && similar_room == 0),
                  "--second_room cannot be had with --projectors, --depth_camera or "
                  "--similar_room; give one of them");
  fields->Int("num_stations", &num_stations, "number of scans").Within(1, 8);
  fields->Int("scan_columns", &scan_columns, "samples over the full turn").Within(16, 20000);
  fields->Int("scan_rows", &scan_rows, "samples from -60 to +75 degrees of elevation")
      .Within(16, 20000);
  fields->Number("range_noise", &range_noise, "noise of the ranges, standard deviation in metres")
      .Within(0, 0.5, "m");
  fields
      ->Number("range_noise_growth", &range_noise_growth,
               "the noise is range_noise * (1 + this * range), per metre")
      .Within(0, 10, "per metre");
  fields
      ->Number("bend", &bend,
               "smooth distortion of the scan, as of one that drifts: ranges wrong by up to this "
               "fraction; 0.008 = 2 cm at 2.5 m")
      .Within(-0.2, 0.2);
  fields
      ->Number("azimuth_drift_deg", &azimuth_drift_deg,
               "error of the azimuth that grows to this over the full turn, degrees")
      .Within(-10, 10);
  fields->Bool("depth_camera", &depth_camera,
               "the scan is put together of the pictures of a depth camera that is carried around: "
               "noise of range_noise * range^2, steps, holes, no thin things, drift");
  fields
      ->Number("depth_drift", &depth_drift,
               "how far the tracking of a depth camera drifts, metres (rms per coordinate)")
      .Within(0, 1, "m");
  fields->Bool("missing_samples", &missing_samples,
               "no echo from the window, the mirror and a few random samples");
}

void SimulatedRoomOptions::Declare(OptionFields* fields) {
  DeclareRoom(fields);
  DeclareProjectors(fields);
  DeclareSurfaces(fields);
  DeclareCamera(fields);
  DeclareLight(fields);
  DeclareMotion(fields);
  DeclareOddPhotos(fields);
  DeclareScans(fields);
  fields->Int("num_picks", &num_picks, "clicks in the photo that suits best").Within(0, 1000);
  fields
      ->Number("click_noise_px", &click_noise_px,
               "noise of the clicks, standard deviation per coordinate in pixels")
      .Within(0, 100);
}

std::vector<std::string> SimulatedRoomOptions::Problems() const { return ProblemsOf(*this); }

}  // namespace roomtex
