#pragma once
// What roomtex-auto is told.

#include <string>
#include <vector>

namespace roomtex {

class OptionFields;

// Options that are handed on to the command of one step: {"--Mapper.x", "1", ...}.
struct PassedOptions {
  std::vector<std::string> features, pairs, matches, mapper, align, texture;
};

struct AutoOptions {
  // One of the first three; none where the scanner's own photos are all there are.
  std::string image_path, panoramas_path, video_path;
  std::vector<std::string> scan_paths;
  std::string scan_poses, azimuth = "auto", up_axis = "auto", units;
  double max_range = 0;
  bool e57_check = true;
  std::string output_path, picks_path, near;
  std::string camera_model, camera_params, cameras_path;
  std::string quality = "medium", patterned = "auto", use_gpu = "auto", sequence = "auto";
  std::string pairs = "auto", scanner_photos = "auto";
  std::string refine_intrinsics = "auto";
  int video_frames = 0;
  std::string from, until, only;
  bool register_stations = false, strict = false;
  bool accept_untrusted = false, dry_run = false;
  std::string colmap = "colmap";
  PassedOptions passed;
  int num_threads = -1, random_seed = 0;  // as for all commands

  void Declare(OptionFields* fields);  // those of one value that have no path
  std::vector<std::string> Problems() const;
};

}  // namespace roomtex
