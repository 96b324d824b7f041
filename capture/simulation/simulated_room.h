#pragma once
// A furnished room with known truth: photos, range scans, poses and colours, for trying the
// commands (roomtex-simulate) and for the tests. Everything follows from the options and the seed.
//
// Frames: `room` (metres, z up, origin in a corner of the floor, x along the width, y along the
// depth) and, per station, `scan` (RTPI: y up, origin in the scanner).

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "capture/simulation/simulated_room_options.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/scan.h"
#include "core/similarity.h"

namespace roomtex {

class Projector;

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
  const Camera& camera() const;  // as told, one for all photos: camera_id 1
  // The same but for photos that are zoomed: of those camera_id is 2.
  const Camera& TrueCamera(int photo) const;

  int NumPhotos() const;  // of all rooms; twice the places if there are projectors
  int NumStations() const;
  // "photo_000.jpg"; with projectors IMG_0001.jpg (patterned), IMG_0002.jpg (plain), IMG_0003.jpg
  std::string PhotoName(int photo) const;
  bool IsPatterned(int photo) const;   // taken in the projectors' light
  int PlaceOf(int photo) const;        // the camera has not moved between photos of one place
  Rigid CamFromRoom(int photo) const;  // truth, of the middle row
  // Truth, when the photo's row at share s was read (core/row_motion.h); differs with a rolling
  // shutter.
  Rigid CamFromRoomAt(int photo, double row_share) const;
  Rigid CamFromScan(int photo) const;             // truth, frame of station 0 = THE scan frame
  double ExposureEv(int photo) const;             // truth, 0 = nominal
  double ExposureTime(int photo) const;           // seconds, truth
  double NotedTime(int photo) const;              // seconds, as in EXIF
  Eigen::Vector3f WhiteBalance(int photo) const;  // factors on red, green, blue
  // 8-bit BGR, sRGB-encoded, with distortion, exposure, blur and noise.
  cv::Mat RenderPhoto(int photo) const;
  bool IsBlurred(int photo) const;
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

  // Picks of one photo (samples of a station's scan that the photo sees, well spread, at corners of
  // things), with the click noise of the options, in the frame of that station.
  std::vector<SimulatedPick> MakePicks(int photo, int count, int station = 0) const;
  // The photo that sees the most of a station's scan, spread in depth: where a user would click.
  // Never a plain one, if there are projectors: COLMAP gets the patterned ones.
  int BestPhotoForPicks(int station = 0) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roomtex
