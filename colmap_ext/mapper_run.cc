#include "colmap_ext/mapper_run.h"

#include <algorithm>
#include <limits>

#include "colmap_ext/photo_bundle.h"
#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr char kMultiThreading38[] = "--Mapper.ba_min_num_residuals_for_multi_threading";
constexpr char kMultiThreading4[] = "--Mapper.ba_min_num_residuals_for_cpu_multi_threading";

void Set(const std::string& name, const std::string& value, ColmapOptions* options) {
  for (auto& [known, old_value] : *options) {
    if (known != name) continue;
    old_value = value;
    return;
  }
  options->emplace_back(name, value);
}

// What COLMAP says when it refuses an option; "" if it does not.
std::string OptionRefusal(const ColmapRun& run) {
  std::string reason;  // the first: others only follow from it
  for (const std::string& line : run.last) {
    const size_t check = line.find("Check failed: ");
    if (reason.empty() && check != std::string::npos) reason = line.substr(check);
    // Which one it is stands in a line before.
    if (line.find("nvalid option") != std::string::npos) return reason.empty() ? line : reason;
    if (line.find("Failed to parse options") != std::string::npos ||
        line.find("unrecognised option") != std::string::npos ||
        line.find("Check failed: options") != std::string::npos ||
        line.find("Check failed: mapper") != std::string::npos) {
      return line;
    }
  }
  return "";
}

bool HasRigs(const SparseModel& model) {
  return std::any_of(model.images.begin(), model.images.end(),
                     [](const auto& image) { return image.second.frame_id != kNoFrame; });
}

enum class Holding { kNotNeeded, kDone, kFailed };

// Adjusts the model with these cameras as they are given, the others refined. Only kDone changes
// it; kNotNeeded: it has none of them.
Holding HoldCameras(const std::map<uint32_t, Camera>& held, SparseModel* model) {
  LensSet lenses = LensesOf(*model);
  bool any = false;
  for (Lens& lens : lenses.lenses) {
    const auto one = held.find(lens.camera.camera_id);
    lens.free = one == held.end();
    if (lens.free) continue;
    lens.camera = lens.told = one->second;
    any = true;
  }
  if (!any) return Holding::kNotNeeded;
  if (HasRigs(*model)) return Holding::kFailed;  // single photos would take them apart
  PhotoBundle bundle = AdjustPhotos(*model, lenses, KeypointNoise(*model));
  if (!bundle.usable) return Holding::kFailed;
  *model = PutBack(WithLenses(bundle.model, bundle.lenses), *model);
  return Holding::kDone;
}

}  // namespace

double MeanPointError(SparseModel* model) {
  UpdateReprojectionErrors(model);
  double sum = 0;
  for (const auto& [point_id, point] : model->points) sum += point.error;
  return model->points.empty() ? 0 : sum / static_cast<double>(model->points.size());
}

MapperRun::MapperRun(ColmapProgram* colmap, const std::string& database_path,
                     const std::string& image_path, const std::string& scratch,
                     const MapperOptions& options)
    : colmap_(colmap),
      database_path_(database_path),
      image_path_(image_path),
      scratch_(scratch),
      options_(options) {
  const std::set<std::string>& known = colmap_->Options("mapper");
  colmap_->Options("point_triangulator");
  colmap_->Options("bundle_adjuster");
  std::vector<std::string> problems;
  for (size_t i = 0; i + 1 < options_.mapper_arguments.size(); i += 2) {
    const std::string& name = options_.mapper_arguments[i];
    if (known.count(name) == 0) {
      problems.push_back(name + " is not an option of colmap mapper (" + colmap_->version() +
                         "); see " + colmap_->path() + " mapper -h");
    } else if (name == "--Mapper.multiple_models" && options_.mapper_arguments[i + 1] != "0") {
      problems.push_back(
          "--Mapper.multiple_models must be 0: with several models COLMAP would throw the seed "
          "away "
          "and initialise by itself");
    }
  }
  ThrowIfProblems(problems);
}

std::string MapperRun::Folder(const std::string& name) const {
  const std::string folder = scratch_ + "/" + name + "_" + std::to_string(num_runs_);
  MakeFolder(folder);
  return folder;
}

std::string MapperRun::MapperValue(const std::string& name, const std::string& fallback) const {
  std::string value = fallback;
  for (size_t i = 0; i + 1 < options_.mapper_arguments.size(); i += 2) {
    if (options_.mapper_arguments[i] == name) value = options_.mapper_arguments[i + 1];
  }
  return value;
}

// Ceres adds up in the order its threads finish, and RANSAC makes much of the last digits: the same
// input would give another model. COLMAP lets Ceres use threads from a number of residuals on: out
// of reach, unless the user sets it. (`bundle_adjuster` has no such option; it comes last, where
// last digits stay last digits.)
bool MapperRun::OrderedSums() const {
  return MapperValue(kMultiThreading38, "").empty() && MapperValue(kMultiThreading4, "").empty();
}

void MapperRun::AddGlobals(const std::string& command, ColmapOptions* options) const {
  const std::set<std::string>& known = colmap_->Options(command);
  const auto set_if_known = [&](const std::string& name, int value) {
    if (known.count(name) > 0) Set(name, std::to_string(value), options);
  };
  set_if_known("--random_seed", options_.random_seed);
  set_if_known("--Mapper.random_seed", options_.random_seed);
  set_if_known("--Mapper.num_threads", options_.num_threads);
  if (OrderedSums()) {
    set_if_known(kMultiThreading38, std::numeric_limits<int>::max());
    set_if_known(kMultiThreading4, std::numeric_limits<int>::max());
  }
}

ColmapOptions MapperRun::WithMapperOptions(const std::string& command,
                                           ColmapOptions options) const {
  const std::string refine = options_.refine_intrinsics ? "1" : "0";
  Set("--Mapper.ba_refine_focal_length", refine, &options);
  Set("--Mapper.ba_refine_extra_params", refine, &options);
  Set("--Mapper.ba_refine_principal_point", "0", &options);
  AddGlobals(command, &options);
  for (size_t i = 0; i + 1 < options_.mapper_arguments.size(); i += 2) {
    Set(options_.mapper_arguments[i], options_.mapper_arguments[i + 1], &options);
  }
  const std::set<std::string>& known = colmap_->Options(command);
  options.erase(std::remove_if(options.begin(), options.end(),
                               [&](const auto& option) { return known.count(option.first) == 0; }),
                options.end());
  return options;
}

ColmapOptions MapperRun::Paths(const std::string& input, const std::string& output) const {
  return {{"--database_path", database_path_},
          {"--image_path", image_path_},
          {"--input_path", input},
          {"--output_path", output}};
}

// "" or what went wrong.
std::string MapperRun::Call(const std::string& command, const ColmapOptions& options,
                            const std::function<void(const std::string&)>& on_line) {
  const ColmapRun run = colmap_->Run(command, options, options_.num_threads, on_line);
  if (run.success) return "";
  const std::string refusal = OptionRefusal(run);
  if (!refusal.empty()) throw UsageError("colmap " + command + " refuses: " + refusal);
  return "colmap " + command + " " + run.failure + "; its last lines: " + run.LastLines() +
         " (all of them in " + colmap_->log_path() + ")";
}

// Two views make tracks of two views only, which COLMAP ignores unless told otherwise.
ColmapOptions MapperRun::TriangulatorOptions(const std::string& input, const std::string& output,
                                             bool two_view_tracks) const {
  ColmapOptions options = Paths(input, output);
  if (two_view_tracks) options.emplace_back("--Mapper.tri_ignore_two_view_tracks", "0");
  return WithMapperOptions("point_triangulator", options);
}

MapperResult MapperRun::Run(const Seed& seed, int num_images,
                            const std::function<void()>& on_registered) {
  ++num_runs_;
  MapperResult result;
  const bool only_seed = static_cast<int>(seed.poses.images.size()) >= num_images;
  const std::string start = Folder("seed"), seeded = Folder("seeded"), mapped = Folder("mapped");
  WriteSparseModel(seed.poses, start);
  result.problem = Call("point_triangulator", TriangulatorOptions(start, seeded, true), nullptr);
  if (!result.problem.empty()) return result;
  if (!only_seed) {
    ColmapOptions mapper = Paths(seeded, mapped);
    mapper.emplace_back("--Mapper.multiple_models", "0");
    result.problem =
        Call("mapper", WithMapperOptions("mapper", mapper), [&](const std::string& line) {
          if (line.find("Registering image #") != std::string::npos) {
            on_registered();
          }
        });
    if (!result.problem.empty()) return result;
  }
  result = Close(only_seed ? seeded : mapped, only_seed);
  result.grew = result.model.images.size() > seed.poses.images.size();
  return result;
}

MapperResult MapperRun::Adjust(const SparseModel& poses) {
  ++num_runs_;
  const std::string start = Folder("chained");
  WriteSparseModel(poses, start);
  return Close(start, true);
}

MapperResult MapperRun::Triangulate(const SparseModel& poses) {
  ++num_runs_;
  MapperResult result;
  const std::string start = Folder("posed");
  result.folder = Folder("triangulated");
  WriteSparseModel(poses, start);
  result.problem =
      Call("point_triangulator", TriangulatorOptions(start, result.folder, true), nullptr);
  if (!result.problem.empty()) return result;
  result.model = ReadSparseModel(result.folder);
  result.mean_reprojection_error_px = MeanPointError(&result.model);
  return result;
}

std::string MapperRun::CallBundleAdjuster(const std::string& input, const std::string& output,
                                          const std::string& refine_focal,
                                          const std::string& refine_extra,
                                          const std::string& refine_principal_point) {
  ColmapOptions bundle = {{"--input_path", input},
                          {"--output_path", output},
                          {"--BundleAdjustment.refine_focal_length", refine_focal},
                          {"--BundleAdjustment.refine_extra_params", refine_extra},
                          {"--BundleAdjustment.refine_principal_point", refine_principal_point}};
  AddGlobals("bundle_adjuster", &bundle);
  return Call("bundle_adjuster", bundle, nullptr);
}

SparseModel MapperRun::BundleAdjust(const SparseModel& model, bool refine_intrinsics) {
  ++num_runs_;
  const std::string start = Folder("start"), adjusted = Folder("adjusted");
  WriteSparseModel(model, start);
  const std::string refine = refine_intrinsics ? "1" : "0";
  const std::string problem = CallBundleAdjuster(start, adjusted, refine, refine, "0");
  return problem.empty() ? ReadSparseModel(adjusted) : model;
}

MapperResult MapperRun::Close(const std::string& folder, bool two_view_tracks) {
  MapperResult result;
  const std::string closed = Folder("closed"), adjusted = Folder("adjusted");
  result.problem =
      Call("point_triangulator", TriangulatorOptions(folder, closed, two_view_tracks), nullptr);
  if (!result.problem.empty()) return result;

  const std::string refine = options_.refine_intrinsics ? "1" : "0";
  result.problem =
      CallBundleAdjuster(closed, adjusted, MapperValue("--Mapper.ba_refine_focal_length", refine),
                         MapperValue("--Mapper.ba_refine_extra_params", refine),
                         MapperValue("--Mapper.ba_refine_principal_point", "0"));
  if (!result.problem.empty()) return result;

  result.folder = adjusted;
  result.model = ReadSparseModel(adjusted);
  if (options_.refine_intrinsics) {
    const Holding holding = HoldCameras(options_.held_cameras, &result.model);
    result.could_not_hold = holding == Holding::kFailed;
    if (holding == Holding::kDone) {
      // Not over COLMAP's: 4.x has put rigs and frames there that would be another model's.
      result.folder = Folder("held");
      WriteSparseModel(result.model, result.folder);
    }
  }
  result.mean_reprojection_error_px = MeanPointError(&result.model);
  return result;
}

}  // namespace roomtex
