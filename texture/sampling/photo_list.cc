#include "texture/sampling/photo_list.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include <fmt/core.h>

#include "colmap_ext/database.h"
#include "core/csv.h"
#include "core/error.h"
#include "core/output_file.h"
#include "texture/sampling/observations.h"

namespace roomtex {
namespace {

// "a.jpg, b.jpg, c.jpg and 4 more".
std::string Enumerate(const std::vector<std::string>& names) {
  constexpr size_t kShown = 5;
  std::string text;
  for (size_t i = 0; i < names.size() && i < kShown; ++i) text += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kShown) text += " and " + std::to_string(names.size() - kShown) + " more";
  return text;
}

// Plain photo by patterned photo. A photo cannot be both: the pattern would be taken for colour.
std::map<std::string, std::string> ReadPlainOf(const std::string& path) {
  std::map<std::string, std::string> plain_of;
  std::set<std::string> plain;
  for (const AssociatedPhotos& pair : ReadAssociations(path)) {
    plain_of[pair.patterned_image] = pair.plain_image;
    if (!pair.plain_image.empty()) plain.insert(pair.plain_image);
  }
  for (const auto& [patterned, twin] : plain_of) {
    if (plain.count(patterned) > 0) {
      throw InputError(path, "", "names " + patterned + " as a patterned photo and as a plain one",
                       "Correct the table: the pattern would be taken for colour");
    }
  }
  return plain_of;
}

// Which file gives the colour for which registered photo: registered name -> file name.
std::map<std::string, std::string> ChooseFiles(const SparseModel& model,
                                               const PhotoSources& sources,
                                               std::vector<std::string>* warnings) {
  std::map<std::string, std::string> file_of;
  if (sources.associations_path.empty()) {
    for (const auto& [id, image] : model.images) file_of[image.name] = image.name;
    return file_of;
  }
  const auto plain_of = ReadPlainOf(sources.associations_path);
  std::set<std::string> plain, used;
  for (const auto& [patterned, twin] : plain_of) plain.insert(twin);
  std::vector<std::string> without_twin, missing;
  for (const auto& [id, image] : model.images) {
    const auto found = plain_of.find(image.name);
    if (found == plain_of.end()) continue;
    if (found->second.empty()) {
      without_twin.push_back(image.name);
    } else if (!std::filesystem::exists(sources.image_path + "/" + found->second)) {
      missing.push_back(found->second + " (twin of " + image.name + ")");
    } else if (used.insert(found->second).second) {
      file_of[image.name] = found->second;
    }
  }
  for (const auto& [id, image] : model.images) {
    if (plain_of.count(image.name) > 0) continue;
    if (plain.count(image.name) == 0) {
      without_twin.push_back(image.name);
    } else if (used.insert(image.name).second) {
      file_of[image.name] = image.name;
    }
  }
  if (!without_twin.empty()) {
    warnings->push_back(std::to_string(without_twin.size()) +
                        " registered photos have no plain twin in " + sources.associations_path +
                        " and give no colour: " + Enumerate(without_twin));
  }
  if (!missing.empty()) {
    warnings->push_back(std::to_string(missing.size()) + " plain photos of " +
                        sources.associations_path + " are not in " + sources.image_path +
                        " and give no colour: " + Enumerate(missing));
  }
  if (file_of.empty() && !missing.empty()) {
    throw InputError(sources.image_path, "",
                     "holds none of the plain photos that " + sources.associations_path + " names",
                     "Give the folder with the patterned and the plain photos");
  }
  if (file_of.empty()) {
    throw InputError(sources.associations_path, "",
                     "names no photo of the model, expected registered images in its column "
                     "patterned_image",
                     "Make it from the same photos");
  }
  return file_of;
}

bool SameLens(const Camera& a, const Camera& b) {
  constexpr double kRounding = 1e-9;
  if (a.model != b.model || a.width != b.width || a.height != b.height) return false;
  return std::equal(a.params.begin(), a.params.end(), b.params.begin(), b.params.end(),
                    [](double one, double other) {
                      return std::abs(one - other) <= kRounding * std::max(1.0, std::abs(one));
                    });
}

// Cameras by image name: from the database if there is one.
class CameraSource {
 public:
  CameraSource(const SparseModel& model, const PhotoSources& sources)
      : model_(model),
        database_path_(sources.database_path),
        aligned_model_(sources.aligned_model) {
    if (database_path_.empty()) return;
    const Database database(database_path_);
    cameras_ = database.ReadCameras();
    for (const auto& [id, image] : database.ReadImages()) camera_of_[image.name] = image.camera_id;
  }

  const Camera& Find(const SparseImage& image) {
    const Camera& of_model = model_.cameras.at(image.camera_id);
    if (database_path_.empty()) return of_model;
    const auto found = camera_of_.find(image.name);
    if (found == camera_of_.end()) {
      throw InputError(database_path_, "",
                       "has no image named " + image.name + ", which the model holds",
                       "Give the database that the model was made from");
    }
    const Camera& of_database = cameras_.at(found->second);
    if (!aligned_model_ || SameLens(of_model, of_database)) return of_database;
    others_.push_back(image.name);
    return of_model;
  }

  // "" if the database had every photo's lens as the model has it, or was followed.
  std::string Warning() const {
    if (others_.empty()) return "";
    return database_path_ + " has another lens than the aligned model for " + Enumerate(others_) +
           ": the model's is used, which its poses were found with.";
  }

 private:
  const SparseModel& model_;
  std::string database_path_;
  bool aligned_model_;
  std::vector<std::string> others_;  // photos whose lens differs
  std::map<uint32_t, Camera> cameras_;
  std::map<std::string, uint32_t> camera_of_;
};

// What cannot be read is said where the colours are.
cv::Mat1b TransparencyOf(const PhotoView& view) {
  try {
    return ReadTransparency(view.path, view.pixels);
  } catch (const InputError&) {
    return {};
  }
}

}  // namespace

std::vector<AssociatedPhotos> ReadAssociations(const std::string& path) {
  const char* const expected = "Expected a CSV with the header patterned_image,plain_image";
  CsvReader table(path, "Check --associations_path", expected);
  int patterned = -1, plain = -1;
  std::vector<AssociatedPhotos> pairs;
  while (table.Next()) {
    const auto fields = table.Fields();
    if (!fields) {
      throw table.Error("a quoted name is not closed by a quote",
                        "A quote inside a quoted name is written twice");
    }
    if (patterned < 0) {
      for (int i = 0; i < static_cast<int>(fields->size()); ++i) {
        if ((*fields)[i] == "patterned_image") patterned = i;
        if ((*fields)[i] == "plain_image") plain = i;
      }
      if (patterned < 0 || plain < 0) {
        throw table.Error("is no header with the columns patterned_image and plain_image",
                          expected);
      }
      continue;
    }
    if (static_cast<int>(fields->size()) <= std::max(patterned, plain) ||
        (*fields)[patterned].empty()) {
      throw table.Error(fmt::format("has {} fields, expected a patterned_image and a plain_image",
                                    fields->size()),
                        "Correct the line or start it with #");
    }
    pairs.push_back({(*fields)[patterned], (*fields)[plain]});
  }
  if (patterned < 0) {
    throw InputError(path, "", "is empty, expected a header and pairs of photos",
                     "Expected lines patterned_image,plain_image");
  }
  return pairs;
}

Camera ScaleCamera(const Camera& camera, int width, int height) {
  Camera scaled = camera;
  scaled.Resize(width, height);
  return scaled;
}

PhotoList ListPhotos(const SparseModel& model_in_scan, const PhotoSources& sources) {
  RequireFolder(sources.image_path, "Check --image_path: it is the folder that COLMAP was given");
  PhotoList list;
  const auto file_of = ChooseFiles(model_in_scan, sources, &list.warnings);
  CameraSource cameras(model_in_scan, sources);
  std::vector<std::string> notes, transparent;
  for (const auto& [id, image] : model_in_scan.images) {
    const auto file = file_of.find(image.name);
    if (file == file_of.end()) continue;
    const auto doubt = sources.doubtful_photos.find(image.name);
    if (doubt != sources.doubtful_photos.end()) {
      list.left_out.push_back({file->second, doubt->second});
      continue;
    }
    const std::string path = sources.image_path + "/" + file->second;
    const Camera& camera = cameras.Find(image);
    const PhotoFit fit = FitPhotoToCamera(path, file->second, camera.width, camera.height);
    if (!fit.usable()) {
      list.left_out.push_back({file->second, fit.problem});
      continue;
    }
    PhotoView view;
    view.name = file->second;
    view.path = path;
    view.pixels = fit.pixels;
    view.camera = fit.scaled ? ScaleCamera(camera, fit.width, fit.height) : camera;
    view.cam_from_scan = image.cam_from_model;
    view.transparent = MaskOfTransparency(TransparencyOf(view));
    if (view.transparent) transparent.push_back(view.name);
    list.photos.push_back(std::move(view));
    if (!fit.note.empty()) notes.push_back(fit.note);
  }
  if (!transparent.empty()) {
    list.warnings.push_back(fmt::format("{} are transparent in part, and give no colour there.",
                                        Enumerate(transparent)));
  }
  for (const std::string& note : FirstNotes(notes)) list.warnings.push_back(note);
  if (!cameras.Warning().empty()) list.warnings.push_back(cameras.Warning());
  std::sort(list.photos.begin(), list.photos.end(),
            [](const PhotoView& a, const PhotoView& b) { return a.name < b.name; });
  std::sort(list.left_out.begin(), list.left_out.end(),
            [](const PhotoLeftOut& a, const PhotoLeftOut& b) { return a.name < b.name; });
  if (list.photos.empty() && !list.left_out.empty()) {
    throw InputError(
        sources.image_path, "",
        "holds no photo of the model that can be used. " + AsClause(list.left_out[0].reason), "");
  }
  return list;
}

PhotoList ListPhotosOf(const SparseModel& model, const AlignmentRecord& alignment,
                       PhotoSources sources, bool strict, const Command::Context& context) {
  sources.aligned_model = alignment.found;
  if (!sources.use_doubtful) sources.doubtful_photos = alignment.doubtful_photos;
  PhotoList list = ListPhotos(model, sources);
  if (strict) ThrowIfAnyLeftOut(list.left_out, sources.image_path);
  for (const std::string& warning : list.warnings) context.Warn(warning);
  if (list.photos.empty()) {
    throw InputError(alignment.folder, "", "holds no registered photo",
                     "Give the folder that roomtex-align wrote");
  }
  if (list.photos.size() >= kMaxPhotos) {
    throw InputError(alignment.folder, "", fmt::format("holds more photos than {}", kMaxPhotos - 1),
                     "Give a part of them");
  }
  return list;
}

}  // namespace roomtex
