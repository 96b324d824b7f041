#pragma once
// Brings photos to agree on the surface that they see: first by their poses, then by a smooth warp
// each, alternating with the colours (the idea of Zhou and Koltun 2014, with patches in place of
// single pixels and all photos solved for at once).

#include <string>
#include <vector>

#include <Eigen/Core>

#include "texture/registration/registration_trial.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

class OptionFields;

struct RegistrationOptions {
  // "none": photos are taken as they are. "measure": how far they are off is found, but not
  // corrected. "pose": their poses are corrected. "warp": and what poses leave, by a smooth field
  // of shifts per photo. "auto": first the poses, then warps, each kept only if photos agree better
  // on a part of the surface that was kept aside, and are no less like the scan there.
  std::string mode = "auto";
  // How far poses may be off, one standard deviation of each axis: what the photos say of each
  // other counts against that. Larger = held less by the alignment.
  double turn_deg = 0.03;
  double move = 0.002;  // metres
  // The same of how far a photo turned while its rows were read (rolling shutter), from the first
  // to the last; rows along its longer side. 0 = all at once. Larger = held less.
  double row_turn_deg = 0.1;
  // The same of a warp, pixels of a picture whose longer side has 1280 (or as many as the photo, if
  // those are fewer): shifts, and how they change over 1/28 of that side. Larger = bent more.
  double warp_px = 2;
  double warp_step_px = 0.5;
  // Photos are left as they are if they are off by less in the mean over all, and none by three
  // times that: so much is noise. Such pixels, each photo by the median over what it sees. Larger =
  // photos are left alone more often.
  double least_px = 0.25;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

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

struct Registration {
  std::vector<PhotoRegistration> photos;  // one per photo; none for "none"
  std::vector<RegistrationTrial> trials;  // of "auto", as they were made
};

// Moves the poses of the photos and gives them warps. Photos are decoded once more, each into a
// small grey picture; these take 256 MB at most.
// intensities: what the scanner measured at every cell of each grid, 0..255 (IntensityAsGrey).
// The result does not depend on num_threads.
Registration RegisterPhotos(const PhotoPassInput& input, const std::vector<GridOfSamples>& grids,
                            const std::vector<std::vector<uint8_t>>& intensities,
                            const ObservationStore& store,
                            const std::vector<Eigen::Vector3f>& gains,
                            const RegistrationOptions& options, int num_threads,
                            std::vector<PhotoView>* photos);

}  // namespace roomtex
