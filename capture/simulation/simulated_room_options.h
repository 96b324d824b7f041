#pragma once
// What the simulated room (simulated_room.h) is made of. Everything follows from the options and
// the seed.

#include <functional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/similarity.h"

namespace roomtex {

inline constexpr int kMaxProjectors = 8;
// Of photos that are zoomed: a finger on the ring.
inline constexpr double kZoom = 1.3;
// Metres: of the door, and of the wall between two rooms.
inline constexpr double kDoorWidth = 0.88, kDoorHeight = 2.04, kPartitionThickness = 0.15;

class OptionFields;

// Whether a photo is one of those that something is for: a share of all, spread evenly over them.
bool IsOfShare(int photo, double share);

struct SimulatedRoomOptions {
  int random_seed = 0;
  // Room and what stands in it.
  double width = 5.0, depth = 4.0, height = 2.7;  // metres
  bool furnished = true;                          // table, shelf, chairs, pictures ...
  bool bare_walls = false;  // plain walls, floor and ceiling: nothing for features to hold on to
  // The same, and the furniture is little and in one colour a piece: what projectors are made for.
  bool bare = false;
  double finest_detail = 0.0015;  // metres: no surface has finer detail
  bool shading = false;           // Lambertian shading under ceiling lamps instead of plain albedo
  // Projectors that throw patterns (thesis 5.1.2); 0 = none. With them every place is photographed
  // twice without moving the camera: patterned, then plain.
  int projectors = 0;
  int projector_width = 1920, projector_height = 1080;  // pixels
  double projector_field_of_view_deg = 85;              // horizontal; short throw
  // White light at 1 m on the axis, room light = 1: 3500 lumens in a room of 150 lux.
  double projector_light = 15;
  double projector_focus = 3.2;  // metres from the lens to where the pattern is sharp
  bool same_pattern = false;     // a mistake: all projectors throw the pattern of the first
  // The 8-bit grey picture that projector k throws, with seed k + 1; needed if there are
  // projectors.
  std::function<cv::Mat1b(int width, int height, int seed)> pattern;
  // Varnish on the floor and on wood: the share of the light that it mirrors seen from straight
  // above, more at flat angles. In the photos only: true colours are those below the varnish.
  double gloss = 0;
  // Photos.
  int num_photos = 30;                          // places, if there are projectors
  int photo_width = 1936, photo_height = 1288;  // pixels
  double field_of_view_deg = 65;                // horizontal
  double roll_deg = 3;                          // photos lean to either side by up to this
  std::string camera_model = "OPENCV";          // any COLMAP model; distortion of an ordinary lens
  bool distortion = true;
  double exposure_range_ev = 1.0;  // exposure steps within +- this, in thirds of an EV
  bool exif = true;                // exposure time, aperture, ISO
  bool exif_lens = false;          // and the focal length on 35 mm film, to whole millimetres
  double photo_noise = 1.5;        // grey levels (of 255), standard deviation
  double blur_px = 0.0;            // Gaussian sigma
  double motion_px = 0.0;          // that the camera moves while it is exposed
  double blurred = 1;              // share of the photos that are blurred, either way
  std::string response = "srgb";   // or "film", see camera_faults.h
  double vignetting = 0;           // share of the light lost in the corners
  double white_balance_ev = 0;     // red and blue vary by up to +- this from photo to photo
  // "one": the EXIF of the middle (plain) photo notes a quarter of the time; "all": that of every
  // photo notes the same time.
  std::string wrong_exif = "none";
  // Time from reading the first row to the last one, in which the hand moves the camera on at these
  // speeds, each photo another way; 0 = all rows at once.
  double rolling_shutter_ms = 0;
  double hand_move = 0.1;     // metres per second
  double hand_turn_deg = 10;  // degrees per second
  double strangers = 0;       // share of the photos in which somebody stands who is not in the scan
  double zoomed = 0;          // share of the photos taken at kZoom times the focal length
  // So many more photos, without truth, of another room: the same plan, walls, floor and ceiling,
  // other pictures and cloths.
  int similar_room = 0;
  // Behind the door, which stands open: turned by 180 degrees, with walls, pictures, scans and
  // photos of its own, as many as the first; further photos are taken on the way through.
  bool second_room = false;
  // Of furniture, places of photos and scanners; -1 = as in all rooms of that size.
  int layout_seed = -1;
  int furniture_seed = -1;  // of what is not the room's shell; -1 = random_seed
  // Scans.
  int num_stations = 1;
  int scan_columns = 2000, scan_rows = 1000;  // grid over the full turn and -60..+75 degrees
  double range_noise = 0.002;                 // metres, standard deviation
  bool missing_samples = true;                // window and mirror give no echo; a few random ones
  // Per metre: the noise is range_noise * (1 + range_noise_growth * range).
  double range_noise_growth = 0;
  double bend = 0;  // ranges are too long or short by up to this fraction, smoothly changing
  double azimuth_drift_deg = 0;  // error of the azimuth that grows from 0 over the full turn
  // The scan is put together of a depth camera's pictures (depth_camera.h); its noise is
  // range_noise * range^2.
  bool depth_camera = false;
  double depth_drift = 0.02;  // metres per coordinate, rms: how far its tracking drifts
  // Picks.
  int num_picks = 6;
  double click_noise_px = 1.5;  // standard deviation per coordinate
  int num_threads = -1;         // -1 = all; changes nothing in the results

  bool IsZoomed(int place) const { return IsOfShare(place, zoomed); }
  double DoorX() const { return width - 0.75; }  // its middle, in the wall at y = 0
  // What the second room is made of, in a frame as that of the first.
  SimulatedRoomOptions SecondRoom() const;
  Rigid RoomFromSecondRoom() const;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;

 private:
  void DeclareRoom(OptionFields* fields);
  void DeclareProjectors(OptionFields* fields);
  void DeclareSurfaces(OptionFields* fields);
  void DeclareCamera(OptionFields* fields);
  void DeclareLight(OptionFields* fields);
  void DeclareMotion(OptionFields* fields);
  void DeclareOddPhotos(OptionFields* fields);
  void DeclareScans(OptionFields* fields);
};

}  // namespace roomtex
