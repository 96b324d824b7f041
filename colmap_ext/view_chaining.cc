#include "colmap_ext/view_chaining.h"

#include <algorithm>
#include <set>

#include <fmt/core.h>

#include "colmap_ext/expected_sightings.h"

namespace roomtex {
namespace {

// Fewer points that a view ought to show and does not say nothing of it. With many in common it is
// believed: they are known to a pair only, or COLMAP's mapper, which asks for 30, would have taken
// the view, and so they are not those of one piece of furniture, which all photos of it share.
constexpr double kMinMissed = 20;
constexpr int kManyShown = 100;

// Points of an image that photos outside of `others` see, too.
int NumInCommon(const SparseModel& model, const SparseImage& image,
                const std::set<uint32_t>& others) {
  return static_cast<int>(
      std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(), [&](uint64_t point_id) {
        if (point_id == kInvalidPoint3dId) return false;
        const std::vector<TrackElement>& track = model.points.at(point_id).track;
        return std::any_of(track.begin(), track.end(), [&](const TrackElement& element) {
          return others.count(element.image_id) == 0;
        });
      }));
}

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
    : images_(images),
      min_sight_share_(options.min_sight_share),
      placer_(images, options, pair, num_threads) {}

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

std::map<uint32_t, std::string> ViewChainer::CheckSights(
    const SparseModel& after, const std::vector<ChainedView>& views) const {
  std::map<uint32_t, std::string> problems;
  if (!(min_sight_share_ > 0)) return problems;
  std::set<uint32_t> placed;
  for (const ChainedView& view : views) placed.insert(view.image_id);
  for (const auto& [id, sightings] :
       FindExpectedSightings(after, HiddenByOwnPoints(after), placed, placed)) {
    double num_missed = 0;
    for (const ExpectedSighting& one : sightings) num_missed += one.is_found ? 0 : one.num_like;
    const int num_shown = NumInCommon(after, after.images.at(id), placed);
    if (num_missed < kMinMissed || num_shown >= kManyShown ||
        num_shown >= min_sight_share_ * (num_shown + num_missed)) {
      continue;
    }
    problems[id] = fmt::format(
        "where its matches put it, it shows {} points that others found, and misses {:.0f}",
        num_shown, num_missed);
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
      const auto unseen = CheckSights(next.model, placed);
      rejected.insert(unseen.begin(), unseen.end());
      if (!unseen.empty()) continue;
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
