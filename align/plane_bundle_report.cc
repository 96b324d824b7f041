#include "align/plane_bundle_report.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"

namespace roomtex {

void AddPlaneBundleOptions(PlaneBundleOptions* options, Command* command) {
  PlaneBundleOptions& o = *options;
  command->AddDouble("PlaneBA.beta", &o.beta,
                     "Pixels per metre; weight of a point's distance from its plane against its "
                     "reprojection errors, the thesis' beta; larger = nearer to the scan; 0 = from "
                     "the ratio of image noise and scan noise.");
  command->AddDouble("PlaneBA.max_distance", &o.max_distance,
                     "Metres; a sparse point farther from a surface never belongs to it; larger = "
                     "more tolerant.");
  command->AddBool("PlaneBA.surface", &o.surface,
                   "Points on no plane are held by flat patches of the scan; 0 = planes alone.");
  command->AddDouble("PlaneBA.surface_noise", &o.surface_noise,
                     "Metres; what stays unknown of a surface however many samples show it; larger "
                     "= farther from the scan.");
  command->AddInt("PlaneBA.min_track", &o.min_track,
                  "Observations that a sparse point needs to be held on a surface.");
  command->AddBool("PlaneBA.fix_clicked_view", &o.fix_clicked_view,
                   "The photo of the picks keeps the pose that they give, as in the thesis (and no "
                   "bend of the scan is looked for); 0 = its picks hold it as far as their noise "
                   "allows.");
  command->AddBool("PlaneBA.refine_intrinsics", &o.refine_intrinsics,
                   "Refine the cameras, too, each with one set of parameters for its photos.");
  command->AddBool(
      "PlaneBA.bend", &o.bend,
      "Look for a smooth bend of the scan (ranges, azimuths; one scan with a grid) and "
      "fit the photos to the bent scan.");
  command->AddDouble("PlaneBA.min_bend", &o.min_bend,
                     "Metres, rms over the sparse points; a smaller bend counts as none.");
  command->AddInt("PlaneBA.num_rounds", &o.num_rounds,
                  "Rounds in which points are given to surfaces anew; fewer if nothing changes.");
  command->AddInt("PlaneBA.max_iterations", &o.max_iterations, "Steps of each round.");
}

namespace {

Json BendToJson(const Alignment& alignment) {
  if (!alignment.bend) return nullptr;
  double range = 0, azimuth = 0;
  for (const SurfaceConstraint& c : alignment.bundle.constraints) {
    const Eigen::Vector2d at =
        alignment.bend->bend.At(alignment.bundle.model.points.at(c.point3d_id).x_in_model);
    range = std::max(range, std::abs(at[0]));
    azimuth = std::max(azimuth, std::abs(at[1]));
  }
  Json json;
  json["rms_m"] = alignment.bend->bend_rms;
  json["max_range_share"] = range;
  json["max_azimuth_deg"] = DegFromRad(azimuth);
  return json;
}

}  // namespace

Json PlaneBundleToJson(const Alignment& alignment) {
  const PlaneBundle& bundle = alignment.bundle;
  if (bundle.model.images.empty()) return nullptr;
  Json json;
  json["used"] = alignment.adjusted;
  json["reason"] = bundle.reason;
  json["num_points"] = bundle.constraints.size();
  json["num_on_patches"] = std::count_if(bundle.constraints.begin(), bundle.constraints.end(),
                                         [](const SurfaceConstraint& c) { return c.on_patch; });
  json["sigma_px"] = bundle.sigma_px;
  json["num_rounds"] = bundle.num_rounds;
  json["bending_m"] = bundle.max_bending;
  json["not_adjusted"] = Json::array();
  for (const uint32_t id : bundle.idle_images) {
    json["not_adjusted"].push_back(bundle.model.images.at(id).name);
  }
  json["scan_bend"] = BendToJson(alignment);
  return json;
}

void SetNumPointsOfPlanes(const Alignment& alignment, Json* planes) {
  const std::vector<int>& counts = alignment.bundle.num_points_of_plane;
  for (size_t i = 0; alignment.adjusted && i < counts.size() && i < planes->size(); ++i) {
    (*planes)[i]["num_points"] = counts[i];
  }
}

}  // namespace roomtex
