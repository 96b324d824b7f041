#pragma once
// Whether the lenses of a sparse model are what its photos say, and what they are instead. With a
// wrong lens a room looks bent: poses and points take up most of what the lens leaves over, and the
// errors grow by a few per cent only. So the lens is freed and compared with what was told, in
// standard deviations.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "colmap_ext/lens_labels.h"
#include "colmap_ext/photo_bundle.h"
#include "colmap_ext/sparse_model.h"
#include "core/report.h"

namespace roomtex {

// --refine_intrinsics of all commands.
enum class RefineIntrinsics { kAuto, kAlways, kNever };
inline const std::vector<std::string> kRefineIntrinsicsWords = {"auto", "1", "0"};
// One of kRefineIntrinsicsWords.
RefineIntrinsics RefineIntrinsicsFromWord(const std::string& word);

struct LensFinding {
  std::vector<uint32_t> camera_ids;  // of the input model
  std::vector<std::string> photos;   // names; of all its cameras' photos unless `apart`
  // The photos are some of a camera's, with a lens of their own: a zoom, another focus.
  bool apart = false;
  // What was told (RicherCamera): of cameras with different intrinsics the parameters' medians.
  Camera told;
  bool told_alike = true;
  Camera found;                // as told where the photos say nothing
  Eigen::MatrixXd covariance;  // of found's parameters; 0 x 0 = not determined
  Eigen::VectorXd sigmas;      // their standard deviations; empty = not determined
  double focal_sigma = 0;      // of the mean focal length, pixels; infinite = not determined
  // How far found is from told, all parameters together: the root of the squared distance in their
  // covariance (Mahalanobis 1936).
  double deviations = 0;
  bool used = false;  // found takes told's place
  // Told and found differ by more than keypoints do, photo by photo.
  bool Contradicts() const;

  // Sets sigmas, focal_sigma and deviations, too.
  void SetCovariance(const Eigen::MatrixXd& of_found);
  // Sets told, told_alike and deviations by the cameras that were told. Nothing is done if `found`
  // is of another camera model than RicherCamera makes of them.
  void Tell(const std::vector<Camera>& cameras);
  double FocalDeviations() const;
  std::string Sentence() const;  // what is said of a lens that is used
};

struct LensCheck {
  std::vector<LensFinding> lenses;
  // The input with the lenses that are used, adjusted by its photos alone, where the input lay.
  // None where all lenses stay as told.
  std::optional<SparseModel> mended;
  // Of the mended model: cameras that are one lens have the same number.
  std::map<uint32_t, int> lens_of_camera;
  // The model has panoramas or rigs, which a bundle adjustment of single photos cannot mend: its
  // lenses stay as told whatever was found.
  bool only_looked_at = false;

  // Of the mended model (or the input): what was told of each of its cameras.
  std::map<uint32_t, Camera> ToldCameras(const SparseModel& model) const;
};

// The report's `cameras`, one lens.
Json LensToJson(const LensFinding& finding);

// Cameras of the same model and photo size whose photos have the same label (what EXIF says of
// their camera and focal length, by image_id; may lack any) are one lens, as far as the photos
// allow that: those that obey another focal length (by 1 %, and significantly) have their own. A
// lens is used if its photos contradict what was told (auto), in any case (always), or in none
// (never). Models with panoramas or rigs keep theirs: the photos among them that have a lens are
// looked at as if each stood by itself.
LensCheck CheckLenses(const SparseModel& model, const LensLabels& labels, RefineIntrinsics refine);

}  // namespace roomtex
