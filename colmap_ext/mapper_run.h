#pragma once
// A seed through COLMAP: triangulated, continued by `colmap mapper`, triangulated and adjusted once
// more.

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/initializer.h"
#include "colmap_ext/sparse_model.h"
#include "core/colmap_program.h"

namespace roomtex {

struct MapperOptions {
  // --Mapper.* options of the user: {"--Mapper.min_num_matches", "20", ...}.
  std::vector<std::string> mapper_arguments;
  bool refine_intrinsics = false;  // focal length and distortion, never the principal point
  // Cameras that are held all the same, by camera_id. COLMAP refines all or none: its models are
  // adjusted once more by ours, with these as they are here.
  std::map<uint32_t, Camera> held_cameras;
  int num_threads = -1;  // -1 = all
  int random_seed = 0;
};

struct MapperResult {
  std::string folder;  // the finished model; "" if there is none
  SparseModel model;
  double mean_reprojection_error_px = 0;  // mean over points, as model_analyzer
  bool grew = false;                      // images beyond the seed's were registered
  bool could_not_hold = false;            // MapperOptions::held_cameras are as COLMAP refined them
  std::string problem;                    // what went wrong; "" if nothing
};

// As `colmap model_analyzer` counts: the mean over the points of their mean error. Updates those.
double MeanPointError(SparseModel* model);

class MapperRun {
 public:
  // database_path: a copy that COLMAP may write to. scratch: an existing folder for models on the
  // way. Throws UsageError for options that the program does not know or that contradict this way
  // of mapping.
  MapperRun(ColmapProgram* colmap, const std::string& database_path, const std::string& image_path,
            const std::string& scratch, const MapperOptions& options);

  // on_registered is called whenever COLMAP has registered another image. A run that fails is told
  // in `problem`; COLMAP's refusal of an option's value is thrown as UsageError.
  MapperResult Run(const Seed& seed, int num_images, const std::function<void()>& on_registered);

  // The last two steps for a model of poses: triangulates, also points that two views see, and
  // adjusts. `problem` tells of a failure, as in Run.
  MapperResult Adjust(const SparseModel& poses);

  // Triangulation alone: the poses stay as they are.
  MapperResult Triangulate(const SparseModel& poses);

  // Bundle adjustment alone, of poses, points and, if asked, focal length and distortion. Gives the
  // model as it came if COLMAP fails.
  SparseModel BundleAdjust(const SparseModel& model, bool refine_intrinsics);

 private:
  std::string Folder(const std::string& name) const;
  // `options` that `command` knows, with the user's --Mapper.* on top.
  ColmapOptions WithMapperOptions(const std::string& command, ColmapOptions options) const;
  ColmapOptions Paths(const std::string& input, const std::string& output) const;
  bool OrderedSums() const;
  void AddGlobals(const std::string& command, ColmapOptions* options) const;
  std::string Call(const std::string& command, const ColmapOptions& options,
                   const std::function<void(const std::string&)>& on_line);
  ColmapOptions TriangulatorOptions(const std::string& input, const std::string& output,
                                    bool two_view_tracks) const;
  // "" or what went wrong.
  std::string CallBundleAdjuster(const std::string& input, const std::string& output,
                                 const std::string& refine_focal, const std::string& refine_extra,
                                 const std::string& refine_principal_point);
  // Triangulates and adjusts the model in a folder.
  MapperResult Close(const std::string& folder, bool two_view_tracks);
  std::string MapperValue(const std::string& name, const std::string& fallback) const;

  ColmapProgram* colmap_;
  std::string database_path_, image_path_, scratch_;
  MapperOptions options_;
  int num_runs_ = 0;
};

}  // namespace roomtex
