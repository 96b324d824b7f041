#include "colmap_ext/duplicate_photos.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace roomtex {
namespace {

constexpr size_t kMaxPointsCompared = 20000;
constexpr size_t kMaxTrackCompared = 60;  // longer tracks are compared over a part of their photos
constexpr int kMinCommon = 30;            // points
constexpr double kLeastCommonShare = 0.5, kLeastSamePlaceShare = 0.9;
constexpr double kPixelsOfRow = 1500;  // one of so many is the same position

struct Common {
  int num_points = 0, num_same_place = 0;
};

bool AreOfOneShape(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height;
}

}  // namespace

std::map<uint32_t, uint32_t> FindDuplicates(const SparseModel& model,
                                            const std::set<std::string>& kept) {
  std::map<std::pair<uint32_t, uint32_t>, Common> pairs;
  std::map<uint32_t, int> num_points;
  const size_t stride = model.points.size() / kMaxPointsCompared + 1;
  size_t next = 0;
  for (const auto& [id, point] : model.points) {
    if (next++ % stride != 0) continue;
    const size_t count = std::min(point.track.size(), kMaxTrackCompared);
    for (size_t i = 0; i < point.track.size(); ++i) ++num_points[point.track[i].image_id];
    for (size_t i = 0; i < count; ++i) {
      const SparseImage& a = model.images.at(point.track[i].image_id);
      const Eigen::Vector2d& x_in_a = a.points2d[point.track[i].point2d_index];
      const Camera& camera = model.cameras.at(a.camera_id);
      for (size_t k = 0; k < i; ++k) {
        const SparseImage& b = model.images.at(point.track[k].image_id);
        if (a.image_id == b.image_id) continue;
        Common& common = pairs[std::minmax(a.image_id, b.image_id)];
        ++common.num_points;
        const double off = (x_in_a - b.points2d[point.track[k].point2d_index]).norm();
        common.num_same_place += off < std::max(1.0, camera.width / kPixelsOfRow);
      }
    }
  }
  std::map<uint32_t, std::vector<uint32_t>> alike;
  for (const auto& [ids, common] : pairs) {
    const SparseImage& a = model.images.at(ids.first);
    const SparseImage& b = model.images.at(ids.second);
    // Of both: a photo of another room may stand at the same place of it and have few points.
    const int more = std::max(num_points.at(ids.first), num_points.at(ids.second));
    if (common.num_points < kMinCommon || common.num_points < kLeastCommonShare * more ||
        common.num_same_place < kLeastSamePlaceShare * common.num_points ||
        a.frame_id != kNoFrame || b.frame_id != kNoFrame ||
        !AreOfOneShape(model.cameras.at(a.camera_id), model.cameras.at(b.camera_id))) {
      continue;
    }
    alike[ids.first].push_back(ids.second);
    alike[ids.second].push_back(ids.first);
  }
  std::vector<const SparseImage*> in_order;
  for (const auto& [id, others] : alike) in_order.push_back(&model.images.at(id));
  std::sort(in_order.begin(), in_order.end(), [&](const SparseImage* a, const SparseImage* b) {
    const bool a_stays = kept.count(a->name) > 0, b_stays = kept.count(b->name) > 0;
    return a_stays != b_stays ? a_stays : a->name < b->name;
  });
  std::map<uint32_t, uint32_t> duplicates;
  std::set<uint32_t> staying;
  for (const SparseImage* const image : in_order) {
    const uint32_t id = image->image_id;
    if (duplicates.count(id) > 0) continue;
    staying.insert(id);
    for (const uint32_t other : alike.at(id)) {
      if (staying.count(other) > 0 || kept.count(model.images.at(other).name) > 0) continue;
      duplicates.emplace(other, id);
    }
  }
  return duplicates;
}

void PutDuplicatesBack(const SparseModel& input, const std::map<uint32_t, uint32_t>& duplicates,
                       double scale, SparseModel* model) {
  for (const auto& [id, of] : duplicates) {
    const SparseImage& told = input.images.at(of);
    const SparseImage& found = model->images.at(of);
    SparseImage image = input.images.at(id);
    Rigid from_photo = image.cam_from_model * told.cam_from_model.Inverse();
    from_photo.translation *= scale;
    image.cam_from_model = from_photo * found.cam_from_model;
    const Camera& camera = input.cameras.at(image.camera_id);
    if (camera.params == input.cameras.at(told.camera_id).params) {
      image.camera_id = found.camera_id;
    } else {
      model->cameras.emplace(image.camera_id, camera);
    }
    for (size_t k = 0; k < image.point3d_ids.size(); ++k) {
      uint64_t& point_id = image.point3d_ids[k];
      if (point_id == kInvalidPoint3dId) continue;
      const auto point = model->points.find(point_id);
      if (point == model->points.end()) {
        point_id = kInvalidPoint3dId;
      } else {
        point->second.track.push_back({id, static_cast<uint32_t>(k)});
      }
    }
    model->images.emplace(id, std::move(image));
  }
}

}  // namespace roomtex
