#pragma once
// What stands in the window: points, buildings, and the file that they are saved to.

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "building/window/outline_window.h"
#include "core/saved_file.h"

namespace roomtex {

// Every member may be called from several threads. What cannot be meant throws UsageError or
// InputError with a sentence for the page.
class OutlineSession {
 public:
  OutlineSession(const OutlineWindowInput& input, OutlineCloud cloud,
                 std::vector<PlaneSegment> segments);

  // Everything that the page begins with, but for the points.
  Json State();
  // Points as the page takes them: float x y z of each about State()'s `origin`, then bytes r g b.
  std::string Points();

  // Takes these buildings instead of those of the revision, and saves.
  Json Put(const Json& request);  // {revision, buildings}
  // Proposals, not taken yet. request: {area: [x0, y0, x1, y1]} or {}.
  Json Propose(const Json& request);
  // The building with floor and roof by the points.
  Json Heights(const Json& request);  // {building}
  // Turns everything so that this direction of the frame is up.
  Json SetUp(const Json& request);  // {revision, up: [x, y, z]}
  Json WriteModels();

  OutlineProposal Judged();

  // Sentences on buildings of the file that cannot be shown: they are left out, and the file is
  // kept as it was with .bak behind its name when the first change is saved.
  const std::vector<std::string>& left_out() const { return left_out_; }

 private:
  Json Buildings();
  void CheckRevision(const Json& request) const;
  OutlineBuilding BuildingOf(const Json& json) const;
  void Save(bool proposed);

  const OutlineWindowInput input_;
  SavedFile file_;
  std::mutex mutex_;
  OutlineCloud cloud_;
  std::vector<PlaneSegment> segments_;
  Outline outline_;
  std::vector<std::string> left_out_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  // of the points as they are sent
  int revision_ = 1, points_revision_ = 1;
  std::string save_error_;
};

}  // namespace roomtex
