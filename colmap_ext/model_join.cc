#include "colmap_ext/model_join.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace roomtex {
namespace {

// In a map by id: the one that is wanted, or one behind all that are taken.
template <typename Map>
auto FreeId(const Map& taken, typename Map::key_type wanted) {
  return taken.count(wanted) == 0 ? wanted : taken.rbegin()->first + 1;
}

class Join {
 public:
  void Add(const SparseModel& model) {
    std::map<uint32_t, uint32_t> new_image_of, new_frame_of, new_camera_of;
    for (const auto& [id, image] : model.images) {
      if (!names_.insert(image.name).second) continue;
      SparseImage added = image;
      added.image_id = FreeId(joined_.images, id);
      added.camera_id = CameraOf(model.cameras.at(image.camera_id), &new_camera_of);
      if (image.frame_id != kNoFrame) added.frame_id = FrameOf(image.frame_id, &new_frame_of);
      std::fill(added.point3d_ids.begin(), added.point3d_ids.end(), kInvalidPoint3dId);
      new_image_of[id] = added.image_id;
      joined_.images.emplace(added.image_id, std::move(added));
    }
    for (const auto& [id, point] : model.points) AddPoint(id, point, new_image_of);
  }
  SparseModel Take() { return std::move(joined_); }

 private:
  // own: of the model's cameras their ids here.
  uint32_t CameraOf(Camera camera, std::map<uint32_t, uint32_t>* own) {
    const uint32_t wanted = camera.camera_id;
    const auto known = own->find(wanted);
    if (known != own->end()) return known->second;
    const auto there =
        std::find_if(joined_.cameras.begin(), joined_.cameras.end(), [&camera](const auto& one) {
          return one.second.model == camera.model && one.second.width == camera.width &&
                 one.second.height == camera.height && one.second.params == camera.params;
        });
    const bool is_same = there != joined_.cameras.end();
    const uint32_t id = is_same ? there->first : FreeId(joined_.cameras, wanted);
    own->emplace(wanted, id);
    if (is_same) return id;
    camera.camera_id = id;
    joined_.cameras.emplace(id, std::move(camera));
    return id;
  }

  void AddPoint(uint64_t wanted, const SparsePoint& point,
                const std::map<uint32_t, uint32_t>& new_image_of) {
    SparsePoint added = point;
    added.track.clear();
    for (const TrackElement& element : point.track) {
      const auto image = new_image_of.find(element.image_id);
      if (image != new_image_of.end())
        added.track.push_back({image->second, element.point2d_index});
    }
    if (added.track.size() < std::min<size_t>(2, point.track.size())) return;
    const uint64_t id = FreeId(joined_.points, wanted);
    for (const TrackElement& element : added.track) {
      joined_.images.at(element.image_id).point3d_ids[element.point2d_index] = id;
    }
    joined_.points.emplace(id, std::move(added));
  }

  uint32_t FrameOf(uint32_t wanted, std::map<uint32_t, uint32_t>* own) {
    const auto known = own->find(wanted);
    if (known != own->end()) return known->second;
    const uint32_t id = FreeId(frames_, wanted);
    frames_.emplace(id, wanted);
    own->emplace(wanted, id);
    return id;
  }

  SparseModel joined_;
  std::set<std::string> names_;
  std::map<uint32_t, uint32_t> frames_;  // ids that are taken
};

}  // namespace

SparseModel JoinModels(const std::vector<const SparseModel*>& models) {
  Join join;
  for (const SparseModel* model : models) join.Add(*model);
  return join.Take();
}

}  // namespace roomtex
