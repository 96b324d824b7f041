#pragma once
// Registers the views that COLMAP's mapper leaves out (thesis 6.2), round after round: what is
// placed makes others placeable, and is taken back where the adjusted model does not confirm it.
// Furniture of which a room has two puts the views of one, which match each other, before the
// other; what stands round the other they do not show.

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/mapper_run.h"
#include "colmap_ext/matched_images.h"
#include "colmap_ext/sparse_model.h"
#include "colmap_ext/view_placement.h"

namespace roomtex {

struct ChainResult {
  MapperResult result;                      // with the chained views
  std::map<uint32_t, ChainedView> chained;  // registered here
  std::map<uint32_t, std::string> reasons;  // why the others were not
};

class ViewChainer {
 public:
  // `images` must outlive this; its cameras are those of the model. pair: noise and thresholds of
  // the hypotheses. num_threads changes the speed only.
  ViewChainer(MatchedImages* images, const ChainOptions& options, const HypothesisOptions& pair,
              int num_threads);

  // Every image that `model` lacks and `skip` does not hold, by image id.
  std::vector<ChainedView> Place(const SparseModel& model,
                                 const std::map<uint32_t, std::string>& skip);

  // Whether `after`, which is `before` with `views` added, triangulated and adjusted, confirms
  // them: problems by image id, none if it does. The view must still obey its pair and hold points,
  // and the views it was chained to must fit among each other as before.
  std::map<uint32_t, std::string> Check(const SparseModel& before, const SparseModel& after,
                                        const std::vector<ChainedView>& views);

  // Whether `after` confirms them by what they show: problems by image id. Of the points that they
  // and the photos before them have in common, or ought to, they must have the share that
  // ChainOptions::min_sight_share says.
  std::map<uint32_t, std::string> CheckSights(const SparseModel& after,
                                              const std::vector<ChainedView>& views) const;

  // Round after round until no view is left that can be placed. adjust: triangulates and adjusts a
  // model of poses (MapperRun::Adjust). A round that does not hold is taken back, its views are
  // tried one by one, and those that do not hold alone are rejected; those that do not show what
  // they ought to, at once.
  ChainResult Run(MapperResult start,
                  const std::function<MapperResult(const SparseModel&)>& adjust);

 private:
  MatchedImages* images_;
  double min_sight_share_;
  ViewPlacer placer_;
};

}  // namespace roomtex
