#include "align/start_photos.h"

#include <algorithm>
#include <string>

#include "align/start.h"
#include "align/trust/agreement.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Corners that photos show shifted alike, times those that they show where a start has them, from
// which on it is drawn.
constexpr double kClearlyMore = 1.5;
constexpr size_t kDrawingCorners = 400;
constexpr double kDrawingGate = 0.1;  // metres, as of the last fit of the search

GradientAgreement AskAt(const AlignmentInput& input, const Similarity& scan_from_sparse) {
  SparseModel aligned = input.model;
  TransformModel(scan_from_sparse, &aligned);
  std::vector<std::string> ignored;  // comes again when the result is compared
  return MeasureAgreement({aligned, input.image_path, input.row_motions}, input.surveyed.viewer(),
                          AgreementOptions(), input.num_threads, &ignored)
      .gradient;
}

}  // namespace

std::vector<Pick> PicksOf(const std::vector<FittingCorner>& corners, const SparseModel& model,
                          const Similarity& scan_from_sparse, size_t most) {
  std::vector<Pick> picks;
  const size_t stride = 1 + corners.size() / most;
  for (size_t i = 0; i < corners.size(); i += stride) {
    const auto image = model.images.find(corners[i].image_id);
    if (image == model.images.end()) continue;  // the face of a panorama
    const Rigid cam_from_scan = CamFromScan(image->second.cam_from_model, scan_from_sparse);
    picks.push_back(
        {image->second.name, corners[i].x_in_img, cam_from_scan.Inverse() * corners[i].x_in_cam});
  }
  return picks;
}

double CornerSigma(const std::vector<Pick>& corners, const SparseModel& model,
                   const Similarity& scan_from_sparse) {
  std::vector<double> distances = PickDistances(model, corners, scan_from_sparse);
  constexpr double kSigmaPerMedian = 0.85;  // of a distance in two dimensions
  return std::max(1.0, kSigmaPerMedian * Median(&distances));
}

namespace {

void AskPhotosOf(const AlignmentInput& input, const AlignmentOptions& options,
                 const StartPhotosOptions& photos, const SearchCloud& cloud, FittedStart* start) {
  start->photos = AskAt(input, start->scan_from_sparse);
  for (int draw = 0; draw < photos.max_draws; ++draw) {
    const GradientAgreement& seen = *start->photos;
    const size_t num_alike = seen.shifts.shifted_alike.size();
    if (start->rms <= kExactRms || num_alike < kClearlyMore * seen.shifts.corners.size()) break;
    const std::vector<Pick> corners =
        PicksOf(seen.shifts.shifted_alike, input.model, start->scan_from_sparse, kDrawingCorners);
    if (corners.empty()) break;
    FittedStart drawn = *start;
    FitStart(input, cloud, corners, CornerSigma(corners, input.model, start->scan_from_sparse),
             kDrawingGate, options.fit, &drawn);
    drawn.photos = AskAt(input, drawn.scan_from_sparse);
    *start = std::move(drawn);
  }
}

}  // namespace

void AskPhotosOfStarts(const AlignmentInput& input, const AlignmentOptions& options,
                       const StartPhotosOptions& photos, StartSearch* search) {
  if (input.image_path.empty() || search->starts.empty()) return;
  const double most = search->starts[0].sights.Score();
  for (int i = 0; i < static_cast<int>(search->starts.size()); ++i) {
    FittedStart* const start = &search->starts[i];
    const bool is_rival =
        i < photos.max_rivals && start->sights.Score() >= photos.rival_share * most;
    if (start->photos || !(is_rival || start->looks_alike)) continue;
    AskPhotosOf(input, options, photos, search->cloud, start);
  }
  // Drawn ones may have changed places, or come to one place.
  const int num_starts = static_cast<int>(search->starts.size());
  search->starts = DistinctStarts(search->cloud, std::move(search->starts), num_starts);
}

}  // namespace roomtex
