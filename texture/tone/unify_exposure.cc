#include "texture/tone/unify_exposure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <tuple>

#include "core/cpu_stages.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "texture/tone/response_bracket.h"
#include "texture/tone/tone_fit.h"

namespace roomtex {
namespace {

// Photos of one camera and one focal length share their lens.
std::vector<int> NumberLenses(const std::vector<PhotoView>& photos,
                              const std::vector<ExposureData>& exposures) {
  std::map<std::tuple<std::string, int, int, long>, int> numbers;
  std::vector<int> lens;
  for (size_t i = 0; i < photos.size(); ++i) {
    const Camera& camera = photos[i].camera;
    const auto key = std::make_tuple(exposures[i].camera, camera.width, camera.height,
                                     std::lround(20 * std::log(camera.MeanFocalLength())));
    lens.push_back(numbers.emplace(key, static_cast<int>(numbers.size())).first->second);
  }
  return lens;
}

// What was found after the photos had been looked at, for colours that are in the store already.
class StoreCorrector {
 public:
  // response: of photos that were taken for sRGB.
  StoreCorrector(const ResponseCurve& response, const std::vector<PhotoView>& photos)
      : has_response_(!response.is_srgb()) {
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i <= kSteps; ++i) {
        const float root = static_cast<float>(i) / kSteps;
        light_[k].push_back(response.LinearFromSrgbLinear(root * root, k));
      }
    }
    for (const PhotoView& photo : photos) {
      projectors_.emplace_back(photo);
      factors_.push_back(nullptr);
      if (photo.tone && !photo.tone->vignetting.is_none()) {
        factors_.back() =
            std::make_unique<VignettingFactor>(photo.tone->vignetting, projectors_.back().camera());
        has_vignetting_ = true;
      }
    }
  }

  void Correct(const SampleTile& tile, ObservationStore* store) const {
    // Which photos see something of the tile.
    std::vector<char> sees(projectors_.size(), 0);
    std::vector<ProjectedBlock> projected(projectors_.size());
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      Observation* observations = store->MutableBegin(slot);
      for (int k = 0; k < store->Count(slot); ++k) {
        const int photo = observations[k].photo;
        Eigen::Vector3f light = UnpackColor(observations[k].color);
        if (has_response_) light = Respond(light);
        if (has_vignetting_ && factors_[photo]) {
          if (sees[photo] == 0) projectors_[photo].Project(tile.points, &projected[photo]);
          sees[photo] = 1;
          light *= factors_[photo]->At(projected[photo].x[i], projected[photo].y[i]);
        }
        observations[k].color = PackColor(light);
      }
    }
  }

 private:
  static constexpr int kSteps = 2046;
  Eigen::Vector3f Respond(const Eigen::Vector3f& linear) const {
    Eigen::Vector3f light;
    for (int k = 0; k < 3; ++k) {
      const float x = kSteps * std::sqrt(linear[k]);
      const int step = std::min(static_cast<int>(x), kSteps - 1);
      light[k] = light_[k][step] +
                 (x - static_cast<float>(step)) * (light_[k][step + 1] - light_[k][step]);
    }
    return light;
  }

  bool has_response_, has_vignetting_ = false;
  std::array<std::vector<float>, 3> light_;  // of the square root of the sRGB light
  std::vector<PhotoProjector> projectors_;
  std::vector<std::unique_ptr<VignettingFactor>> factors_;
};

void SetTones(const ResponseCurve& response, const std::vector<Vignetting>& of_lens,
              const std::vector<int>& lens, std::vector<PhotoView>* photos) {
  for (size_t i = 0; i < photos->size(); ++i) {
    PhotoTone tone;
    if ((*photos)[i].tone) tone = *(*photos)[i].tone;
    if (!response.is_srgb()) tone.response = response;
    if (!of_lens.empty()) tone.vignetting = of_lens[lens[i]];
    (*photos)[i].tone = std::make_shared<const PhotoTone>(tone);
  }
}

// Finds response and vignetting as far as the options ask for them; corrects samples and store.
void FindTones(const std::vector<SampleTile>& tiles, const std::vector<ExposureData>& exposures,
               const ExposureOptions& options, int num_threads, ExposureSamples* samples,
               std::vector<PhotoView>* photos, ObservationStore* store,
               ExposureSolution* solution) {
  ResponseCurve response;
  if (options.response == "estimate") {
    const ResponseFit fit = FitResponse(*samples, exposures);
    solution->response = fit.determined ? "estimate" : "srgb";
    solution->response_problem = fit.reason;
    response = fit.curve;
    if (fit.determined) ApplyResponse(response, samples);
  }
  std::vector<Vignetting> of_lens;
  const std::vector<int> lens = NumberLenses(*photos, exposures);
  if (options.vignetting) {
    const ExposureSolution first = SolveExposure(exposures, FindOverlaps(*samples), options);
    std::vector<double> log_gains;
    for (const Eigen::Vector3f& gain : first.gains) log_gains.push_back(std::log(gain[1]));
    const int num_lenses = 1 + *std::max_element(lens.begin(), lens.end());
    of_lens = FitVignetting(*samples, lens, num_lenses, log_gains);
    for (size_t i = 0; i < photos->size(); ++i) {
      // Stitched from several lenses.
      if ((*photos)[i].camera.IsPanorama()) of_lens[lens[i]] = Vignetting();
    }
    ApplyVignetting(of_lens, lens, samples);
  }
  const bool any_vignetting =
      std::any_of(of_lens.begin(), of_lens.end(), [](const Vignetting& v) { return !v.is_none(); });
  if (response.is_srgb() && !any_vignetting) return;
  SetTones(response, of_lens, lens, photos);
  const StoreCorrector corrector(response, *photos);
  ParallelFor(num_threads, 0, static_cast<int>(tiles.size()),
              [&](int t) { corrector.Correct(tiles[t], store); });
}

}  // namespace

void SetResponse(const ExposureOptions& options, std::vector<PhotoView>* photos) {
  PhotoTone tone;
  if (!options.bracket_path.empty()) {
    tone.response = ResponseFromBracket(options.bracket_path);
  } else if (options.response != "srgb" && options.response != "estimate") {
    tone.response = ResponseCurve::Read(options.response);
  } else {
    return;
  }
  const auto shared = std::make_shared<const PhotoTone>(tone);
  for (PhotoView& photo : *photos) photo.tone = shared;
}

ExposureSolution UnifyExposure(const std::vector<SampleTile>& tiles, const ExposureOptions& options,
                               int num_threads, std::vector<PhotoView>* photos,
                               ObservationStore* store) {
  const CpuTimer timer(CpuStage::kExposure, CpuTimer::Scope::kProcess);
  std::vector<ExposureData> exposures;
  for (const PhotoView& photo : *photos) exposures.push_back(ReadExposureData(photo.path));
  ExposureSolution tones, solution;
  if (!options.bracket_path.empty()) {
    tones.response = "bracket";
  } else if (options.response != "srgb" && options.response != "estimate") {
    tones.response = "file";
  }
  if (options.mode == "none" || photos->empty()) {
    solution = SolveExposure(exposures, {}, options);
  } else {
    const bool find_tones = options.vignetting || options.response == "estimate";
    ExposureSamples samples = find_tones ? SelectSamples(*store, tiles, *photos, num_threads)
                                         : SelectSamples(*store, static_cast<int>(photos->size()));
    if (find_tones) {
      FindTones(tiles, exposures, options, num_threads, &samples, photos, store, &tones);
    }
    solution = SolveExposure(exposures, FindOverlaps(samples), options);
    const float scale = OutputScale(*store, solution.gains);
    for (Eigen::Vector3f& gain : solution.gains) gain *= scale;
  }
  solution.response = tones.response;
  solution.response_problem = tones.response_problem;
  for (const PhotoView& photo : *photos) solution.tones.push_back(photo.tone);
  return solution;
}

}  // namespace roomtex
