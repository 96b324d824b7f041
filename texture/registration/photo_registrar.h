#pragma once
// Photos that are being brought to agree: small grey pictures of all of them, what they show of the
// same surface, and where they stand. One level is measured at a time, the next one has half the
// size. Frames: `scan`, `cam`, `img`.

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/similarity.h"
#include "texture/registration/registration_options.h"
#include "texture/registration/registration_trial.h"
#include "texture/registration/shared_samples.h"
#include "texture/registration/shift_patch.h"
#include "texture/registration/shift_solver.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// What was found of one photo. Pixels of the photo.
struct PhotoRegistration {
  static constexpr int kMapColumns = 8, kMapRows = 6;

  // Median shift against the other photos over the surface that it sees: as it came, and in the
  // end.
  double shift_before_px = 0, shift_after_px = 0;
  double shift_before = 0;  // on the surface, metres
  // The shifts as it came, medians of kMapRows x kMapColumns parts of the photo, row by row; NaN =
  // nothing could be compared there.
  std::vector<double> map_px;
  double share_measured = 0;  // of the places that were compared, how many had an answer
  bool corrected = false;
  double turned_deg = 0, moved = 0;  // of the pose; metres
  double row_turned_deg = 0;         // while its rows were read
  double warp_px = 0;                // largest shift of the warp, without that
};

class PhotoRegistrar {
 public:
  static constexpr int kNumLevels = 3;

  // All must outlive it. Reads the photos. gains: of each photo, in linear light.
  PhotoRegistrar(SharedSamples* samples, const std::vector<Eigen::Vector3f>& gains,
                 const RegistrationOptions& options, int num_threads,
                 std::vector<PhotoView>* photos);

  // Mean difference between what a photo shows and what the others say, in the finest pictures: per
  // photo, and last of all of them.
  std::vector<double> Disagreement();

  // Compares at one level; the shift is searched for within +- radius pixels of it. Sets the median
  // shifts.
  void Measure(int level, int radius);

  bool is_free() const { return is_free_; }
  int num_photos() const { return static_cast<int>(photos_.size()); }

  // Whether the photos are off by more than noise, on the whole or one of them by much.
  bool AreOff() const;
  // If so, from then on all of them may move: what holds still is a measure of the others, and
  // would bend them.
  bool FreeIfOff();

  // Moves all photos that may at once, by what was measured last and, if asked for, by the scan,
  // which is searched within as many pixels.
  void Correct(bool by_scan, bool with_warps);

  // Where all photos stand.
  struct Stand {
    std::vector<Rigid> poses;
    std::vector<std::shared_ptr<const PhotoWarp>> shown;
    std::vector<Eigen::Vector3d> row_turns;
    std::vector<PhotoWarp> warps;
  };
  Stand Here() const;
  void Return(const Stand& stand);

  // How far the pixels of the photos have moved from there, median, pixels of the pictures.
  double MotionFrom(const Stand& stand) const;

  // A part of the surface is kept aside from Measure() and Correct().
  void KeepAside();
  void KeepNothingAside() { samples_.KeepAside(0); }

  // How alike photos are there, in the finest pictures.
  KeptAsideLikeness Judge();

  std::vector<PhotoRegistration> Report();

 private:
  // A photo in grey, and how it has been moved.
  struct RegisteredPhoto {
    std::vector<cv::Mat1b> levels;                   // the next one has half the size
    Eigen::Array2f scales = Eigen::Array2f::Ones();  // `scale` along x and y, to whole pixels
    LevelPicture At(int level) const { return {levels[level], level, scales}; }
    double scale = 1;  // pixels of the first level per pixel of the photo
    float gain = 1;
    std::optional<CameraProjection> camera;
    Rigid first_pose;
    Eigen::Vector3d row_turn = Eigen::Vector3d::Zero();  // from the first row to the last one
    PhotoWarp warp{1, 1, 1};                             // what else is left
    PhotoWarp shown{1, 1, 1};                            // both together
  };
  // A place at which a photo was compared with the others.
  struct Patch {
    int middle = 0;  // sighting
    PatchShift shift;
  };

  double MeanScale() const;

  void Look(int level);

  // The others say something about it, and not next to nothing.
  bool IsCompared(const Sighting& s) const;

  bool IsFree(int i) const;

  void Load(int i, const Eigen::Vector3f& gain);

  // Sightings around every node of the lattice, those within the cells that meet there; at a coarse
  // level of every second or fourth node.
  std::vector<std::vector<int>> GatherPatches(int i, bool kept_aside = false) const;

  // What is expected of a sighting, 0..255.
  using GreyOf = std::function<float(const Sighting&)>;
  // What `grey_of` says that the photo shows around a node, and the middle of that.
  std::vector<ExpectedPixel> Expect(int i, const std::vector<int>& members, const GreyOf& grey_of,
                                    Eigen::Vector2f* middle) const;
  std::optional<Patch> Compare(int i, const std::vector<int>& members, int radius,
                               const GreyOf& grey_of) const;

  // What the scanner measured stays where it is, and so holds what all photos might do together.
  // Counted only where photo and scan show the same: intensity is not brightness.
  void AddShiftsAgainstScan(int i, std::vector<MeasuredShift>* shifts) const;

  void SetShift(int i, const Patch& patch, MeasuredShift* shift) const;

  void JudgePhoto(int i, KeptAsideLikeness* likeness) const;

  void MeasurePhoto(int i, int radius);

  // How a photo's pixels move with a point of the surface, and with the photo.
  struct Seen {
    PlaceInPhoto place;
    Eigen::Matrix<double, 2, 3> by_point;  // in `scan`
  };
  std::optional<Seen> See(int i, const Sighting& sighting) const;

  std::optional<MeasuredShift> ShiftAt(int i, const Patch& patch) const;

  PhotoPrior PriorOf(int i, bool with_warp) const;

  void Move(int i, const PhotoStep& step);

  // A camera that turns about itself moves what it shows by as much at any distance.
  static void AddRowTurn(const Camera& camera, RegisteredPhoto* photo);

  // From where the photo showed a place when it came to where it shows it now, and what was still
  // measured there, over the places that were compared.
  void FindShiftBefore(int i);

  static size_t MapCell(const Camera& camera, const Eigen::Vector2f& place);

  SharedSamples& samples_;
  const RegistrationOptions& options_;
  int num_threads_;
  std::vector<PhotoView>& photos_;
  std::vector<RegisteredPhoto> registered_;
  std::vector<PhotoRegistration> found_;
  bool is_free_ = false;
  int level_ = 0, radius_ = 0;               // measured last
  std::vector<std::vector<Patch>> patches_;  // per photo
  std::vector<double> median_px_;
};

}  // namespace roomtex
