#pragma once
// A furnished room with known truth: photos, range scans, poses and colours, for trying the
// commands (roomtex-simulate) and for the tests. Everything follows from the options and the seed.
//
// Frames: `room` (metres, z up, origin in a corner of the floor, x along the width, y along the
// depth) and, per station, `scan` (RTPI: y up, origin in the scanner).

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/scan.h"
#include "core/similarity.h"

namespace roomtex {

class OptionFields;
class Projector;

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
  // Photos.
  int num_photos = 30;                          // places, if there are projectors
  int photo_width = 1936, photo_height = 1288;  // pixels
  double field_of_view_deg = 65;                // horizontal
  std::string camera_model = "OPENCV";          // any COLMAP model; distortion of an ordinary lens
  bool distortion = true;
  double exposure_range_ev = 1.0;  // exposure steps within +- this, in thirds of an EV
  bool exif = true;                // exposure time, aperture, ISO
  double photo_noise = 1.5;        // grey levels (of 255), standard deviation
  double blur_px = 0.0;            // Gaussian sigma
  std::string response = "srgb";   // or "film", see camera_faults.h
  double vignetting = 0;           // share of the light lost in the corners
  double white_balance_ev = 0;     // red and blue vary by up to +- this from photo to photo
  // "one": the middle photo's EXIF notes a quarter of the time; "all": every photo's notes the same
  // time.
  std::string wrong_exif = "none";
  double strangers = 0;  // share of the photos in which somebody stands who is not in the scan
  // Scans.
  int num_stations = 1;
  int scan_columns = 2000, scan_rows = 1000;  // grid over the full turn and -60..+75 degrees
  double range_noise = 0.002;                 // metres, standard deviation
  bool missing_samples = true;                // window and mirror give no echo; a few random ones
  // Per metre: the noise is range_noise * (1 + range_noise_growth * range).
  double range_noise_growth = 0;
  double bend = 0;  // ranges are too long or short by up to this fraction, smoothly changing
  double azimuth_drift_deg = 0;  // error of the azimuth that grows from 0 over the full turn
  // Picks.
  int num_picks = 6;
  double click_noise_px = 1.5;  // standard deviation per coordinate
  int num_threads = -1;         // -1 = all; changes nothing in the results

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// What is true of the samples of a scan, in grid order; missing ones are NaN in `points`.
struct TrueSamples {
  std::vector<Eigen::Vector3d> points;       // `room` frame, where the rays met it, without noise
  std::vector<Eigen::Vector3f> normals;      // `room` frame, unit, towards the scanner
  std::vector<Eigen::Vector3f> cell_colors;  // as TrueColors, averaged over the sample's cell
};

struct SimulatedPick {
  std::string image_name;
  Eigen::Vector2d x_in_img;
  Eigen::Vector3d x_in_scan;
};

class SimulatedRoom {
 public:
  explicit SimulatedRoom(const SimulatedRoomOptions& options);
  ~SimulatedRoom();

  const SimulatedRoomOptions& options() const;
  const Camera& camera() const;  // one for all photos, camera_id 1

  int NumPhotos() const;  // twice the places if there are projectors
  // "photo_000.jpg"; with projectors IMG_0001.jpg (patterned), IMG_0002.jpg (plain), IMG_0003.jpg
  std::string PhotoName(int photo) const;
  bool IsPatterned(int photo) const;     // taken in the projectors' light
  int PlaceOf(int photo) const;          // the camera has not moved between photos of one place
  Rigid CamFromRoom(int photo) const;    // truth
  Rigid CamFromScan(int photo) const;    // truth, frame of station 0 = THE scan frame
  double ExposureEv(int photo) const;    // truth, 0 = nominal
  double ExposureTime(int photo) const;  // seconds, truth
  double NotedTime(int photo) const;     // seconds, as in EXIF
  Eigen::Vector3f WhiteBalance(int photo) const;  // factors on red, green, blue
  // 8-bit BGR, sRGB-encoded, with distortion, exposure, blur and noise.
  cv::Mat RenderPhoto(int photo) const;
  bool HasStranger(int photo) const;
  const std::vector<Projector>& Projectors() const;

  // station >= 0. The scan in the frame of station 0 (scan_from_station says where station k
  // stood). Intensity is an infrared reflectance, not the photos' brightness; integers 0..4095.
  Scan MakeScan(int station = 0) const;
  Rigid ScanFromRoom() const;
  // Surface colour, linear light 0..1, RGB, with the exposure of EV 0 (and shading if on), of every
  // sample of MakeScan(station) in grid order, at the noise-free surface point; zero for missing
  // samples.
  std::vector<Eigen::Vector3f> TrueColors(int station = 0) const;

  // The samples without noise, and how a photo really sees them: positions in `img`, NaN for those
  // that it does not see (hidden, outside, from behind, flatter than 87 degrees).
  TrueSamples MakeTrueSamples(int station = 0) const;
  std::vector<Eigen::Vector2f> TrueSightings(const TrueSamples& samples, int photo) const;

  // True sparse model in the frame scan * S^-1 for a made-up similarity S = ScanFromSparse():
  // points on surfaces with tracks over the photos that really see them, keypoint noise of
  // noise_px. For tests that do not want to run COLMAP. With projectors: of the patterned photos.
  SparseModel MakeSparseModel(int num_points, double noise_px) const;
  Similarity ScanFromSparse() const;

  // Picks of one photo (scan samples that the photo sees, well spread, at corners of things), with
  // the click noise of the options.
  std::vector<SimulatedPick> MakePicks(int photo, int count) const;
  // The photo that sees the most of the scan, spread in depth: where a user would click. Never a
  // plain one, if there are projectors: COLMAP gets the patterned ones.
  int BestPhotoForPicks() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Everything in a folder: photos/, scan.rtpi (scan_1.rtpi ...), picks.csv, cameras.txt, truth/
// (poses as a COLMAP text model, scan_from_room, per-photo exposure, true_colors.ply) and
// README.txt. Deterministic. (Options of the command: roomtex_simulate.cc.)

}  // namespace roomtex
