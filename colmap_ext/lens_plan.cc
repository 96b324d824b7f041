#include "colmap_ext/lens_plan.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <tuple>
#include <utility>

#include "core/camera_formulas.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Photos of one camera by their labels, the most frequent first. Those without go with it.
struct Group {
  LensLabel label;
  std::vector<uint32_t> images;
};

std::vector<Group> GroupByLabel(const std::vector<uint32_t>& images, const LensLabels& labels) {
  std::map<std::string, Group> groups;
  std::vector<uint32_t> unlabelled;
  for (const uint32_t id : images) {
    const auto label = labels.find(id);
    if (label == labels.end() || !(label->second.focal_length_mm > 0)) {
      unlabelled.push_back(id);
      continue;
    }
    Group& group = groups[label->second.text];
    group.label = label->second;
    group.images.push_back(id);
  }
  std::vector<Group> sorted;
  for (auto& [text, group] : groups) sorted.push_back(std::move(group));
  std::stable_sort(sorted.begin(), sorted.end(), [](const Group& a, const Group& b) {
    return a.images.size() > b.images.size();
  });
  if (sorted.empty()) sorted.push_back({});
  std::vector<uint32_t>& first = sorted[0].images;
  first.insert(first.end(), unlabelled.begin(), unlabelled.end());
  return sorted;
}

void ScaleFocalLength(double factor, Camera* camera) {
  const int num_focal = camera_formulas::HasOneFocalLength(camera->model) ? 1 : 2;
  for (int k = 0; k < num_focal; ++k) camera->params[static_cast<size_t>(k)] *= factor;
}

// An id that neither has.
uint32_t NextId(const std::map<uint32_t, Camera>& a, const std::map<uint32_t, Camera>& b) {
  uint32_t last = 0;
  for (const auto* cameras : {&a, &b}) {
    if (!cameras->empty()) last = std::max(last, cameras->rbegin()->first);
  }
  return last + 1;
}

}  // namespace

LensPlan::LensPlan(const std::map<uint32_t, Camera>& cameras,
                   const std::map<uint32_t, DatabaseImage>& images, const LensLabels& labels)
    : database_cameras_(cameras), cameras_(cameras), database_images_(images), images_(images) {
  std::map<uint32_t, std::vector<uint32_t>> of_camera;
  for (const auto& [id, image] : images) of_camera[image.camera_id].push_back(id);
  using Kind = std::tuple<CameraModel, int, int, std::vector<double>, bool, std::string>;
  std::map<Kind, uint32_t> shared;
  for (const auto& [camera_id, ids] : of_camera) {
    const Camera own = cameras.at(camera_id);
    const std::vector<Group> groups = GroupByLabel(ids, labels);
    for (size_t i = 0; i < groups.size(); ++i) {
      Camera camera = own;
      if (i > 0) {
        ScaleFocalLength(groups[i].label.TimesLongerThan(groups[0].label), &camera);
        camera.has_prior_focal_length = false;
        notes_.push_back("Camera " + std::to_string(camera_id) + " is several: EXIF says " +
                         groups[i].label.text + " of " + std::to_string(groups[i].images.size()) +
                         " of its photos and " + groups[0].label.text +
                         " of most. They are mapped with a camera of their own.");
      }
      const Kind kind{camera.model,
                      camera.width,
                      camera.height,
                      camera.params,
                      camera.has_prior_focal_length,
                      groups[i].label.text};
      auto at = shared.find(kind);
      if (at == shared.end()) {
        camera.camera_id = i == 0 ? camera_id : NextId(cameras_, database_cameras_);
        at = shared.emplace(kind, camera.camera_id).first;
        cameras_[camera.camera_id] = camera;
      }
      for (const uint32_t id : groups[i].images) images_.at(id).camera_id = at->second;
    }
  }
  EraseUnused();  // those that another camera stands for
}

bool LensPlan::IsAsInDatabase() const {
  return std::all_of(images_.begin(), images_.end(), [&](const auto& one) {
    const DatabaseImage& image = database_images_.at(one.first);
    if (one.second.camera_id != image.camera_id) return false;
    const Camera &planned = cameras_.at(image.camera_id),
                 &told = database_cameras_.at(image.camera_id);
    return planned.params == told.params && planned.model == told.model;
  });
}

std::vector<LensFinding> LensPlan::Take(const LensCheck& found, const SparseModel& model) {
  std::vector<LensFinding> taken;
  const bool any_main =
      std::any_of(found.lenses.begin(), found.lenses.end(),
                  [](const LensFinding& lens) { return lens.used && !lens.apart; });
  for (const LensFinding& lens : found.lenses) {
    if (!lens.used || (lens.apart && any_main)) continue;
    taken.push_back(lens);
    uint32_t camera_id = lens.camera_ids.front();
    if (lens.apart) {
      camera_id = NextId(cameras_, database_cameras_);
      for (const std::string& name : lens.photos) {
        images_.at(model.FindImage(name)->image_id).camera_id = camera_id;
      }
    }
    const std::vector<uint32_t> camera_ids =
        lens.apart ? std::vector<uint32_t>{camera_id} : lens.camera_ids;
    for (const uint32_t id : camera_ids) {
      Camera camera = lens.found;
      camera.camera_id = id;
      const auto before = cameras_.find(id);
      camera.has_prior_focal_length =
          before != cameras_.end() && before->second.has_prior_focal_length;
      cameras_[id] = std::move(camera);
    }
  }
  return taken;
}

void LensPlan::Calibrate(const SparseModel& model) {
  for (const auto& [id, camera] : model.cameras) {
    const auto planned = cameras_.find(id);
    if (planned == cameras_.end()) continue;
    planned->second = camera;
    planned->second.has_prior_focal_length = true;
  }
}

void LensPlan::Tell(const std::vector<uint32_t>& image_ids, Camera camera) {
  camera.camera_id = NextId(cameras_, database_cameras_);
  for (const uint32_t id : image_ids) images_.at(id).camera_id = camera.camera_id;
  cameras_[camera.camera_id] = std::move(camera);
  EraseUnused();
}

void LensPlan::EraseUnused() {
  std::set<uint32_t> used;
  for (const auto& [id, image] : images_) used.insert(image.camera_id);
  for (auto at = cameras_.begin(); at != cameras_.end();) {
    at = used.count(at->first) > 0 ? std::next(at) : cameras_.erase(at);
  }
}

void LensPlan::Restore(SparseModel* model) const {
  std::map<uint32_t, Camera> restored;
  for (auto& [id, image] : model->images) {
    const uint32_t planned = image.camera_id;
    const bool is_new = database_cameras_.count(planned) == 0;
    if (!is_new) image.camera_id = database_images_.at(id).camera_id;
    Camera camera = model->cameras.at(planned);
    camera.camera_id = image.camera_id;
    restored[image.camera_id] = std::move(camera);
  }
  model->cameras = std::move(restored);
}

}  // namespace roomtex
