#include "colmap_ext/view_chaining.h"

#include <algorithm>

namespace roomtex {
namespace {

// Poses and cameras only, the views added.
SparseModel WithViews(const SparseModel& model, const std::vector<ChainedView>& views,
                      const MatchedImages& images) {
  SparseModel result;
  result.cameras = model.cameras;
  for (const auto& [image_id, image] : model.images) {
    result.images[image_id] = {image_id, image.camera_id, image.name, image.cam_from_model, {}, {}};
  }
  for (const ChainedView& view : views) {
    const DatabaseImage& image = images.images().at(view.image_id);
    result.images[view.image_id] = {
        view.image_id, image.camera_id, image.name, view.cam_from_model, {}, {}};
    result.cameras.emplace(image.camera_id, images.cameras().at(image.camera_id));
  }
  return result;
}

// The most certain first.
bool SurerThan(const ChainedView& a, const ChainedView& b) {
  return a.num_common_points > b.num_common_points;
}

}  // namespace

ViewChainer::ViewChainer(MatchedImages* images, const ChainOptions& options,
                         const HypothesisOptions& pair, int num_threads)
    : images_(images), placer_(images, options, pair, num_threads) {}

std::vector<ChainedView> ViewChainer::Place(const SparseModel& model,
                                            const std::map<uint32_t, std::string>& skip) {
  std::vector<uint32_t> left_out;
  for (const auto& [image_id, image] : images_->images()) {
    if (model.images.count(image_id) == 0 && skip.count(image_id) == 0)
      left_out.push_back(image_id);
  }
  return placer_.Place(left_out, model);
}

std::map<uint32_t, std::string> ViewChainer::Check(const SparseModel& before,
                                                   const SparseModel& after,
                                                   const std::vector<ChainedView>& views) {
  std::map<uint32_t, std::string> problems;
  for (const ChainedView& view : views) {
    const std::string problem = placer_.ProblemOf(view, before, after);
    if (!problem.empty()) problems[view.image_id] = problem;
  }
  return problems;
}

ChainResult ViewChainer::Run(MapperResult start,
                             const std::function<MapperResult(const SparseModel&)>& adjust) {
  ChainResult chain;
  chain.result = std::move(start);
  std::map<uint32_t, std::string> rejected;
  bool one_by_one = false;
  for (;;) {
    std::vector<ChainedView> placed;
    chain.reasons = rejected;
    for (ChainedView& view : Place(chain.result.model, rejected)) {
      if (view.problem.empty()) {
        placed.push_back(std::move(view));
      } else {
        chain.reasons[view.image_id] = view.problem;
      }
    }
    if (placed.empty()) return chain;
    std::stable_sort(placed.begin(), placed.end(), SurerThan);
    if (one_by_one) placed.resize(1);
    MapperResult next = adjust(WithViews(chain.result.model, placed, *images_));
    std::map<uint32_t, std::string> problems;
    if (next.problem.empty()) {
      problems = Check(chain.result.model, next.model, placed);
    } else {
      for (const ChainedView& view : placed) problems[view.image_id] = next.problem;
    }
    if (problems.empty()) {
      chain.result = std::move(next);
      chain.result.grew = true;
      for (ChainedView& view : placed) chain.chained[view.image_id] = std::move(view);
      one_by_one = false;
    } else if (placed.size() > 1) {
      one_by_one = true;
    } else {
      rejected.insert(problems.begin(), problems.end());
    }
  }
}

}  // namespace roomtex
