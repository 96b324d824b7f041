#include "align/clicks/picks.h"

#include <algorithm>
#include <set>

#include <fmt/core.h>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {
namespace {

// The first that has a photo of this name; null if none has.
const SparseModel* ModelWithPhoto(const std::vector<const SparseModel*>& models,
                                  const std::string& name) {
  const auto at = std::find_if(models.begin(), models.end(), [&](const SparseModel* model) {
    return model->FindImage(name) != nullptr;
  });
  return at == models.end() ? nullptr : *at;
}

}  // namespace

void NamePicksAsInModels(const std::vector<const SparseModel*>& models, std::vector<Pick>* picks) {
  for (Pick& pick : *picks) {
    if (ModelWithPhoto(models, pick.image_name) != nullptr) continue;
    const std::string ending = "/" + pick.image_name;
    std::set<std::string> in_folders;
    for (const SparseModel* model : models) {
      for (const auto& [id, image] : model->images) {
        const std::string& name = image.name;
        const bool ends_so = name.size() > ending.size() &&
                             name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
        if (ends_so) in_folders.insert(name);
      }
    }
    if (in_folders.size() == 1) pick.image_name = *in_folders.begin();
  }
}

void CheckPickNames(const std::string& path, const std::vector<Pick>& picks,
                    const std::vector<const SparseModel*>& models, const std::string& among) {
  for (const Pick& pick : picks) {
    const SparseModel* model = ModelWithPhoto(models, pick.image_name);
    if (model == nullptr) {
      throw InputError(path, LinePosition(pick.line),
                       fmt::format("the photo {} is not {} (nearest name: {})", pick.image_name,
                                   among, NearestName(PhotoNames(models), pick.image_name)),
                       "Correct the name, or pick in a photo that COLMAP has registered");
    }
    const Camera& camera = model->cameras.at(model->FindImage(pick.image_name)->camera_id);
    const Eigen::Vector2d& x = pick.x_in_img;
    if (!(x.x() >= 0 && x.y() >= 0 && x.x() <= camera.width && x.y() <= camera.height)) {
      throw InputError(path, LinePosition(pick.line),
                       fmt::format("the pixel ({:.6g}, {:.6g}) lies outside {}, which has {} x {} "
                                   "pixels",
                                   x.x(), x.y(), pick.image_name, camera.width, camera.height),
                       "Give x and y in pixels of the photo as taken");
    }
  }
}

std::vector<std::string> PhotoNames(const std::vector<const SparseModel*>& models) {
  std::vector<std::string> names;
  for (const SparseModel* model : models) {
    for (const auto& [id, image] : model->images) names.push_back(image.name);
  }
  return names;
}

void CheckPhotoName(const std::string& option, const std::string& name,
                    const std::vector<std::string>& names, const std::string& among) {
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  throw InputError(option, "",
                   fmt::format("names the photo {}, which is not {} (nearest name: {})", name,
                               among, NearestName(names, name)),
                   "Correct the name, or leave the option out");
}

void CheckPicksAgainstModel(const std::string& path, const std::vector<Pick>& picks,
                            const SparseModel& model) {
  CheckPickNames(path, picks, {&model});
  const auto num_on =
      std::count_if(picks.begin(), picks.end(), [](const Pick& pick) { return pick.weight > 0; });
  if (num_on >= kMinPicksPerPhoto) return;
  const std::string off =
      num_on < static_cast<long>(picks.size())
          ? fmt::format(", of which {} count, the others being check points (weight 0)", num_on)
          : "";
  throw InputError(path, "",
                   fmt::format("holds {} picks{}; at least {} are needed, in one photo or spread "
                               "over several",
                               picks.size(), off, kMinPicksPerPhoto),
                   "Add picks, well spread over the photo and in depth, or give --image_path: the "
                   "place is searched for then, and these are a hint");
}

}  // namespace roomtex
