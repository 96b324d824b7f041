#include "align/pick_findings.h"

#include <algorithm>
#include <cmath>

#include "core/text.h"

namespace roomtex {
namespace {

// More are not needed to tell whether picks and scan belong together.
constexpr size_t kMaxPicksOnScan = 100;

// Where the picks would be on the scan if its x were mirrored.
std::vector<Eigen::Vector3d> Mirrored(const std::vector<Eigen::Vector3d>& points,
                                      const Rigid& scan_from_station) {
  std::vector<Eigen::Vector3d> mirrored;
  for (const Eigen::Vector3d& point : points) {
    mirrored.push_back(MirroredAt(scan_from_station, point));
  }
  return mirrored;
}

// The picks that count, and how far each lies off the surface, and off its mirror image.
struct PicksOnScan {
  std::vector<const Pick*> picks;
  std::vector<double> distance, mirrored_distance;  // metres
  size_t num_off = 0, num_mirrored_off = 0, farthest = 0;
};

PicksOnScan MeasurePicksOnScan(const AlignmentInput& input) {
  PicksOnScan on_scan;
  std::vector<Eigen::Vector3d> points;
  for (const Pick& pick : input.picks) {
    if (!(pick.weight > 0) || points.size() >= kMaxPicksOnScan) continue;
    on_scan.picks.push_back(&pick);
    points.push_back(pick.x_in_scan);
  }
  const size_t n = points.size();
  const std::vector<Eigen::Vector3d> mirrored =
      Mirrored(points, input.surveyed.scans()[0].scan_from_station);
  points.insert(points.end(), mirrored.begin(), mirrored.end());
  const std::vector<double> distance = input.surveyed.DistancesOf(points);
  on_scan.distance.assign(distance.begin(), distance.begin() + n);
  on_scan.mirrored_distance.assign(distance.begin() + n, distance.end());
  for (size_t i = 0; i < n; ++i) {
    on_scan.num_off += on_scan.distance[i] > kPickReach;
    on_scan.num_mirrored_off += on_scan.mirrored_distance[i] > kPickReach;
    if (on_scan.distance[i] > on_scan.distance[on_scan.farthest]) on_scan.farthest = i;
  }
  return on_scan;
}

std::string Miss(double rms_px) {
  if (!std::isfinite(rms_px)) return "fit no camera pose that has all of them in front";
  return "miss by " + Number(rms_px, 1) + " pixels (rms)";
}

void RefuseMirroredOrExchanged(const AlignmentInput& input, const PickView& view) {
  const PickReview& review = view.review;
  if (review.mirrored && !(review.exchanged && review.exchanged_rms_px < review.mirrored_rms_px)) {
    throw MirroredScan(input.surveyed.scans()[0].path,
                       "the scan is a mirror image of the room: the picks in " + view.image_name +
                           " " + Miss(review.RmsPx()) + ", but " + Miss(review.mirrored_rms_px) +
                           " when the scan is reflected",
                       MirrorRemedy(input), false);
  }
  if (!review.exchanged) return;
  const Pick& a = input.picks[view.picks[review.exchanged->first]];
  const Pick& b = input.picks[view.picks[review.exchanged->second]];
  throw Contradiction(input.picks_path, LinePosition(a.line),
                      "this pick and the one on line " + std::to_string(b.line) +
                          " look exchanged: the picks in " + view.image_name + " " +
                          Miss(review.RmsPx()) + ", but " + Miss(review.exchanged_rms_px) +
                          " when these two change places in the photo",
                      "Exchange their x,y, or pick them again");
}

// Why the picks of a photo give it no pose; empty if they do.
std::string PoseProblem(const PickView& view) {
  if (view.HasPose()) return "";
  return "in " + view.image_name + " " +
         (view.layout_problem.empty()
              ? "no camera pose has all picks in front of the camera and inside its lens' field"
              : view.layout_problem);
}

[[noreturn]] void RefuseWithoutPose(const AlignmentInput& input,
                                    const std::vector<PickView>& views) {
  const bool layout_problem = std::any_of(
      views.begin(), views.end(), [](const PickView& v) { return !v.layout_problem.empty(); });
  const std::string problem = views.empty() ? "no photo has enough picks" : PoseProblem(views[0]);
  if (layout_problem) {
    throw InputError(input.picks_path, "", problem,
                     "Pick points that are spread over the photo, in depth, and not on one line");
  }
  throw Contradiction(input.picks_path, "", problem,
                      "Check that the picks name the right photo, and pick again");
}

std::string LeftOut(const Pick& pick, const std::string& place, double distance_px) {
  return "The pick on " + LineOf(pick) + " (" + pick.image_name + place + ") was left out: it is " +
         Number(distance_px, 1) + " pixels away from where the other picks put it.";
}

// Picks that the reviews of their photos left out.
void WarnOfLeftOut(const AlignmentInput& input, const std::vector<PickView>& views,
                   std::vector<std::string>* warnings) {
  for (const PickView& view : views) {
    for (size_t k = 0; view.HasPose() && k < view.picks.size(); ++k) {
      if (view.review.used[k]) continue;
      const Pick& pick = input.picks[view.picks[k]];
      const std::string place =
          " at " + Number(pick.x_in_img.x(), 1) + ", " + Number(pick.x_in_img.y(), 1);
      warnings->push_back(LeftOut(pick, place, view.review.leave_one_out_px[static_cast<int>(k)]));
    }
  }
}

// Of picks that place the model together, no photo having enough of its own.
std::vector<std::string> CheckSpread(const AlignmentInput& input, const SpreadPickFit& spread) {
  if (!spread.layout_problem.empty()) {
    throw InputError(input.picks_path, "", spread.layout_problem,
                     "Pick points that are spread over the photos, in depth, and not on one line");
  }
  if (spread.mirrored) {
    throw MirroredScan(input.surveyed.scans()[0].path,
                       "the scan is a mirror image of the room: the picks of all photos together " +
                           Miss(spread.rms_px[0]) + ", but " + Miss(spread.mirrored_rms_px) +
                           " when the scan is reflected",
                       MirrorRemedy(input), false);
  }
  if (!spread.HasFit()) {
    throw Contradiction(input.picks_path, "",
                        "no place of the sparse model in the scan has the picks of all photos in "
                        "front of their cameras",
                        "Check that the picks name the right photos, and pick again, or six points "
                        "in one photo");
  }
  std::vector<std::string> warnings;
  for (size_t i = 0; i < input.picks.size(); ++i) {
    if (spread.used[i] || !(input.picks[i].weight > 0)) continue;
    warnings.push_back(LeftOut(input.picks[i], "", spread.leave_one_out_px[i]));
  }
  return warnings;
}

}  // namespace

std::string MirrorRemedy(const AlignmentInput& input) {
  const std::vector<Scan>& scans = input.surveyed.scans();
  const bool is_rtpi =
      std::any_of(scans.begin(), scans.end(), [](const Scan& scan) { return scan.is_rtpi; });
  if (!is_rtpi) return "Check the axes of the scan file: its coordinates seem to be left-handed";
  const std::string other = input.azimuth == "clockwise" ? "counterclockwise" : "clockwise";
  return "Read it with --azimuth " + other +
         " (in every command, and for picking: picks made on the mirrored scan have the wrong x)";
}

std::vector<std::string> CheckPicksOnScan(const AlignmentInput& input) {
  const std::string& scan_path = input.surveyed.scans()[0].path;
  const PicksOnScan on_scan = MeasurePicksOnScan(input);
  const size_t n = on_scan.picks.size(), off = on_scan.num_off, farthest = on_scan.farthest;
  const std::vector<double>& distance = on_scan.distance;
  if (n > 0 && !std::isfinite(distance[0])) {
    throw InputError(scan_path, "", "holds no measured sample",
                     "Check the file with roomtex-import");
  }
  const std::string of_all = " of " + std::to_string(n) + " picks";
  if (off >= 2 && 3 * on_scan.num_mirrored_off <= off) {
    throw MirroredScan(scan_path,
                       "the scan is a mirror image of the one that the picks were made on: " +
                           std::to_string(off) + of_all + " lie more than " +
                           Number(kPickReach, 2) + " m off its surface, up to " +
                           Number(distance[farthest], 2) + " m, but " +
                           std::to_string(on_scan.num_mirrored_off) + " when the scan is reflected",
                       MirrorRemedy(input), true);
  }
  if (n > 0 && 2 * off >= n) {
    throw Contradiction(
        input.picks_path, LinePosition(on_scan.picks[farthest]->line),
        std::to_string(off) + of_all + " lie more than " + Number(kPickReach, 2) +
            " m off every surface of the scan, this one by " + Number(distance[farthest], 2) + " m",
        "Pick on this scan, and give scan_x, scan_y, scan_z in metres in its frame");
  }
  std::vector<std::string> warnings;
  for (size_t i = 0; i < n; ++i) {
    if (!(distance[i] > kPickReach)) continue;
    warnings.push_back("The pick on " + LineOf(*on_scan.picks[i]) + " lies " +
                       Number(distance[i], 2) + " m off every surface of the scan.");
  }
  return warnings;
}

bool MirroredPicksLieOnScan(const AlignmentInput& input) {
  const PicksOnScan on_scan = MeasurePicksOnScan(input);
  return 3 * on_scan.num_mirrored_off <= on_scan.picks.size();
}

std::vector<std::string> CheckViews(const AlignmentInput& input,
                                    const std::vector<PickView>& views) {
  std::vector<std::string> warnings;
  for (const PickView& view : views) {
    if (view.layout_problem.empty()) RefuseMirroredOrExchanged(input, view);
    if (view.HasPose()) continue;
    warnings.push_back("The picks of this photo are used with those of the others only: " +
                       PoseProblem(view) + ".");
  }
  WarnOfLeftOut(input, views, &warnings);
  return warnings;
}

std::vector<std::string> CheckPhotoViews(const AlignmentInput& input,
                                         const std::vector<PickView>& views) {
  if (views.empty()) {
    throw InputError(
        input.picks_path, "",
        "no photo has " + std::to_string(kMinPicksPerPhoto) +
            " picks that count; without a sparse model (--input_path) each photo needs "
            "so many of its own",
        "Add picks, well spread over the photo and in depth");
  }
  std::vector<std::string> warnings;
  for (const PickView& view : views) {
    if (view.layout_problem.empty()) RefuseMirroredOrExchanged(input, view);
    if (!view.HasPose()) warnings.push_back("A photo is left out: " + PoseProblem(view) + ".");
  }
  const bool any =
      std::any_of(views.begin(), views.end(), [](const PickView& view) { return view.HasPose(); });
  if (!any) RefuseWithoutPose(input, views);
  WarnOfLeftOut(input, views, &warnings);
  return warnings;
}

std::vector<std::string> CheckStart(const AlignmentInput& input, const std::vector<PickView>& views,
                                    const PickStart& found) {
  if (found.spread) return CheckSpread(input, *found.spread);
  if (found.view < 0) RefuseWithoutPose(input, views);
  const PickView& view = views[found.view];
  if (!found.start) {
    throw Contradiction(
        input.picks_path, "",
        "the picks in " + view.image_name + " " + Miss(view.review.RmsPx()) +
            ", and with the pose that they give, none of the photo's features with a "
            "sparse point (" +
            std::to_string(found.choice.scale.num_candidates) +
            " of them have the scan behind them) lies on smooth surface; so the scale "
            "between model and scan cannot be found",
        "Check the picks, or pick in a photo with more sparse points");
  }
  std::vector<std::string> warnings;
  if (!found.joint) return warnings;
  if (!found.joint->converged) {
    warnings.push_back("The picks of all photos together gave no solution; those of " +
                       view.image_name + " alone are used.");
  }
  for (size_t i = 0; i < input.picks.size(); ++i) {
    if (std::isnan(found.joint->left_out_px[i])) continue;
    warnings.push_back(LeftOut(input.picks[i], "", found.joint->left_out_px[i]));
  }
  return warnings;
}

}  // namespace roomtex
