#pragma once
// What the photos see of the scan under a solution: edges to draw over a photo, and how much.

#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <vector>

#include "align/pick/pick_solution.h"
#include "core/report.h"

namespace roomtex {

// Safe from several threads.
class PhotoSights {
 public:
  explicit PhotoSights(const PickScene& scene) : scene_(scene) {}

  // The scan's edges in the photo as the page takes them, lines simplified to half a pixel.
  // Null when give_up() became true before the edges stood.
  std::shared_ptr<const Json> Edges(const PickPhoto& photo, const PhotoState& state,
                                    int solution_number, const std::function<bool()>& give_up);

  // Share of all scans' samples that each photo sees, in the order of PickScene::photos(); NaN of
  // photos whose model has no place yet, and empty where none has one. From a few thousand
  // samples, one computation per solution.
  std::vector<double> ScanShares(const PickSolution& solution, int solution_number);

 private:
  struct Seen {
    int photo = 0, solution_number = 0;
    std::shared_ptr<const Json> edges;
  };

  const PickScene& scene_;
  std::mutex mutex_;  // of what is kept
  std::list<Seen> seen_;
  int shares_number_ = -1;
  std::vector<double> shares_;
};

}  // namespace roomtex
