#include "capture/calibration/calibration_models.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "capture/calibration/calibration_trust.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Models are compared through photos left out; with fewer that is no measure.
constexpr size_t kMinPhotosToCompare = 5;

int NumUsed(const BoardView& view) {
  return static_cast<int>(std::count(view.used.begin(), view.used.end(), true));
}

// Root mean square over the corners of all views.
double OverAll(const std::vector<BoardView>& views, const std::vector<double>& rms) {
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    sum += rms[i] * rms[i] * NumUsed(views[i]);
    count += NumUsed(views[i]);
  }
  return std::sqrt(sum / std::max(count, 1));
}

// Growth of the held-out log-likelihood from a to b, in natural units; held-out squared errors are
// summed over photos with the noise and the scatter between photos that b finds.
double Gain(const std::vector<BoardView>& views, const CameraFit& a, const CameraFit& b) {
  double fall = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    const double before = a.held_out_rms_px[i], after = b.held_out_rms_px[i];
    if (!std::isfinite(after)) return -std::numeric_limits<double>::infinity();
    if (!std::isfinite(before)) return std::numeric_limits<double>::infinity();
    fall += views[i].weight * NumUsed(views[i]) * (before * before - after * after);
  }
  const double scatter = PhotoScatter(b, views);
  return fall / (2 * b.sigma_px * b.sigma_px * std::max(1.0, scatter * scatter));
}

double Bic(const std::vector<BoardView>& views, const CameraFit& fit) {
  double num_coordinates = 0;
  for (const BoardView& view : views) num_coordinates += 2 * NumUsed(view);
  const double num_unknowns = fit.lens.num_free + 6 * static_cast<double>(views.size());
  return num_coordinates * std::log(std::max(fit.cost / num_coordinates, 1e-30)) +
         num_unknowns * std::log(num_coordinates);
}

std::string Pixels(double value) { return Number(value, 4) + " px"; }

std::string WhyChosen(const std::vector<ModelComparison>& models, size_t chosen, size_t before) {
  std::string why = models[chosen].lens.Name() + " foretells photos left out to " +
                    Pixels(models[chosen].held_out_rms_px);
  if (before < chosen) {
    why += ", " + models[before].lens.Name() + " to " + Pixels(models[before].held_out_rms_px);
  }
  if (chosen + 1 == models.size()) return why;
  why += "; richer models do not better it:";
  for (size_t i = chosen + 1; i < models.size(); ++i) {
    why += (i > chosen + 1 ? ", " : " ") + models[i].lens.Name() + " " +
           Pixels(models[i].held_out_rms_px);
  }
  return why;
}

}  // namespace

CameraFit ChooseModel(const std::vector<BoardView>& views, const CameraFit& start,
                      const CalibrationOptions& options, std::vector<ModelComparison>* models,
                      std::string* why) {
  const bool is_auto = options.camera_model == "auto";
  std::vector<CameraFit> fits;
  for (const LensModel& lens : LensModels()) {
    const bool asked = is_auto || options.camera_model == CameraModelName(lens.model);
    if (!asked) continue;
    CameraFit first = start;
    // The rich start, cut down to what the simpler model holds, is as good as any.
    const std::vector<double>& p = start.camera.params;
    if (lens.model == CameraModel::kSimpleRadial || lens.model == CameraModel::kRadial) {
      first.camera.model = CameraModel::kSimpleRadial;
      first.camera.params = {(p[0] + p[1]) / 2, p[2], p[3], p[4]};
    } else if (lens.model == CameraModel::kOpenCv) {
      first.camera.model = CameraModel::kOpenCv;
      first.camera.params.resize(8);
    }
    fits.push_back(FitCamera(views, lens, first, 0));
    Finish(views, &fits.back());
  }
  size_t chosen = 0, before = 0;
  for (size_t i = 0; i < fits.size(); ++i) {
    ModelComparison one;
    one.lens = fits[i].lens;
    one.rms_px = OverAll(views, fits[i].view_rms_px);
    one.held_out_rms_px = OverAll(views, fits[i].held_out_rms_px);
    one.bic = Bic(views, fits[i]);
    const bool can_compare = views.size() >= kMinPhotosToCompare;
    one.gain = i > 0 && can_compare ? Gain(views, fits[chosen], fits[i]) : 0;
    if (i > 0 && can_compare && one.gain > options.min_gain) {
      before = chosen;
      chosen = i;
    }
    models->push_back(one);
  }
  // Too few photos to compare: the model that fits most lenses, tangential terms left out.
  if (is_auto && views.size() < kMinPhotosToCompare) chosen = 1;
  (*models)[chosen].chosen = true;
  if (!is_auto && fits.size() == 1) {
    *why = fits[0].lens.Name() + ": asked for by --camera_model";
  } else if (views.size() < kMinPhotosToCompare) {
    *why = fits[chosen].lens.Name() + ": fewer than " + std::to_string(kMinPhotosToCompare) +
           " photos cannot tell models apart";
  } else {
    *why = WhyChosen(*models, chosen, before);
  }
  return fits[chosen];
}

}  // namespace roomtex
