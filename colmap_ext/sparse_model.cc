#include "colmap_ext/sparse_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <unordered_map>

#include "colmap_ext/sparse_model_files.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/output_file.h"
#include "core/projections.h"
#include "core/resource_limits.h"
#include "core/statistics.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr std::array<const char*, 3> kFiles = {"cameras", "images", "points3D"};

std::string FilePath(const std::string& folder, const char* file, const SparseModelFormat& format) {
  return (fs::path(folder) / (std::string(file) + format.extension)).string();
}

std::vector<std::string> MissingFiles(const std::string& folder, const SparseModelFormat& format) {
  std::vector<std::string> missing;
  for (const char* file : kFiles) {
    std::error_code error;
    if (!fs::is_regular_file(FilePath(folder, file, format), error)) {
      missing.push_back(std::string(file) + format.extension);
    }
  }
  return missing;
}

// The format in which all three files are there, the binary one first; InputError if there is none.
const SparseModelFormat& FindFormat(const std::string& folder) {
  RequireFolder(folder, "Give the folder with the model, e.g. sparse/0");
  const std::vector<std::string> no_bin = MissingFiles(folder, SparseModelBinary());
  if (no_bin.empty()) return SparseModelBinary();
  const std::vector<std::string> no_txt = MissingFiles(folder, SparseModelText());
  if (no_txt.empty()) return SparseModelText();
  const std::vector<std::string>& missing = no_bin.size() <= no_txt.size() ? no_bin : no_txt;
  if (missing.size() < kFiles.size()) {
    std::string list;
    for (const std::string& file : missing) list += (list.empty() ? "" : " and ") + file;
    throw InputError(folder, "", "holds a COLMAP model without " + list,
                     "Write the model again: it needs cameras, images and points3D, all .bin or "
                     "all .txt");
  }
  const std::string below = (fs::path(folder) / "0").string();
  std::error_code error;
  const bool is_parent =
      fs::is_directory(below, error) && (MissingFiles(below, SparseModelBinary()).empty() ||
                                         MissingFiles(below, SparseModelText()).empty());
  throw InputError(folder, "", "holds no COLMAP model (cameras, images and points3D, .bin or .txt)",
                   is_parent ? "There is one in " + below + ": give that folder"
                             : "Give the folder with the model, e.g. sparse/0");
}

std::string ReadAll(const std::string& path) {
  RequireFile(path, "Write the model again with COLMAP");
  NoteInput(path);
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream ? static_cast<std::streamoff>(stream.tellg()) : -1;
  std::string bytes;
  if (size >= 0) {
    RequireMemory(path, "reading it", static_cast<double>(size), "Check that this is the model");
    bytes.resize(static_cast<size_t>(size));
    stream.seekg(0);
    stream.read(bytes.data(), size);
  }
  if (!stream) throw InputError(path, "", "cannot be read to its end", "Check the disk");
  return bytes;
}

// Checks that need more than one file; says where the contradiction stands.
class Assembler {
 public:
  Assembler(const SparseModelFormat& format, const std::string& folder)
      : format_(format), folder_(folder) {}

  void TakeCameras(PlacedList<Camera> cameras) {
    SortById(&cameras, kFiles[0], "camera");
    for (Placed<Camera>& placed : cameras) {
      const std::vector<std::string> problems = placed.entry.Problems();
      if (!problems.empty()) {
        Fail(kFiles[0], placed.position, problems[0], "Correct the camera in COLMAP");
      }
      model_.cameras.emplace_hint(model_.cameras.end(), placed.entry.camera_id,
                                  std::move(placed.entry));
    }
  }

  void TakeImages(PlacedList<SparseImage> images) {
    SortById(&images, kFiles[1], "image");
    std::set<std::string> names;
    for (Placed<SparseImage>& placed : images) {
      SparseImage& image = placed.entry;
      const std::string who = "image " + std::to_string(image.image_id);
      if (image.name.empty()) {
        Fail(kFiles[1], placed.position, who + " has no name", "Write the model again with COLMAP");
      }
      if (!names.insert(image.name).second) {
        Fail(kFiles[1], placed.position, who + " has the name " + image.name + " of another image",
             "Remove one of the two");
      }
      if (model_.cameras.count(image.camera_id) == 0) {
        Fail(kFiles[1], placed.position,
             who + " names camera " + std::to_string(image.camera_id) + ", which " +
                 FilePath(folder_, kFiles[0], format_) + " does not hold",
             "Take all files from the same model");
      }
      image_positions_[image.image_id] = placed.position;
      const auto entry =
          model_.images.emplace_hint(model_.images.end(), image.image_id, std::move(image));
      images_[entry->first] = &entry->second;
    }
  }

  void TakePoints(PlacedList<SparsePoint> points) {
    SortById(&points, kFiles[2], "point");
    for (Placed<SparsePoint>& placed : points) {
      if (placed.id == kInvalidPoint3dId) {
        Fail(kFiles[2], placed.position, "a point has the id that means \"no point\"",
             "Write the model again with COLMAP");
      }
      for (const TrackElement& element : placed.entry.track) CheckElement(placed, element);
      num_track_elements_ += placed.entry.track.size();
      model_.points.emplace_hint(model_.points.end(), placed.id, std::move(placed.entry));
    }
    CheckObservations();
  }

  SparseModel Take() { return std::move(model_); }

 private:
  [[noreturn]] void Fail(const char* file, long long position, const std::string& finding,
                         const std::string& remedy) const {
    throw InputError(FilePath(folder_, file, format_), format_.position(position), finding, remedy);
  }

  template <typename Entry>
  void SortById(PlacedList<Entry>* entries, const char* file, const char* what) const {
    const auto before = [](const Placed<Entry>& a, const Placed<Entry>& b) { return a.id < b.id; };
    if (!std::is_sorted(entries->begin(), entries->end(), before)) {
      std::stable_sort(entries->begin(), entries->end(), before);
    }
    for (size_t i = 1; i < entries->size(); ++i) {
      if ((*entries)[i].id != (*entries)[i - 1].id) continue;
      Fail(file, (*entries)[i].position,
           std::string(what) + " " + std::to_string((*entries)[i].id) +
               " is there twice, first at " + format_.position((*entries)[i - 1].position),
           "Write the model again with COLMAP");
    }
  }

  // The image of a track element must hold the keypoint, and the keypoint must name the point.
  void CheckElement(const Placed<SparsePoint>& point, const TrackElement& element) const {
    const auto found = images_.find(element.image_id);
    const std::string who = "point " + std::to_string(point.id);
    if (found == images_.end()) {
      Fail(kFiles[2], point.position,
           who + " is seen in image " + std::to_string(element.image_id) + ", which " +
               FilePath(folder_, kFiles[1], format_) + " does not hold",
           "Take all files from the same model");
    }
    const std::vector<uint64_t>& ids = found->second->point3d_ids;
    if (element.point2d_index >= ids.size()) {
      Fail(kFiles[2], point.position,
           who + " is keypoint " + std::to_string(element.point2d_index) + " of image " +
               std::to_string(element.image_id) + ", which has " + std::to_string(ids.size()),
           "Take all files from the same model");
    }
    if (ids[element.point2d_index] != point.id) {
      Fail(kFiles[2], point.position,
           who + " is keypoint " + std::to_string(element.point2d_index) + " of image " +
               std::to_string(element.image_id) + ", but that one names " +
               (ids[element.point2d_index] == kInvalidPoint3dId
                    ? "no point"
                    : "point " + std::to_string(ids[element.point2d_index])),
           "Take all files from the same model");
    }
  }

  // Every keypoint with a point stands in exactly one track element. The elements were checked
  // already, so that equal counts say it unless an element is there twice.
  void CheckObservations() const {
    size_t num_observations = 0;
    for (const auto& [id, image] : model_.images) {
      num_observations +=
          image.point3d_ids.size() -
          std::count(image.point3d_ids.begin(), image.point3d_ids.end(), kInvalidPoint3dId);
    }
    if (num_observations == num_track_elements_) return;
    std::set<std::pair<uint32_t, uint32_t>> seen;
    for (const auto& [id, point] : model_.points) {
      for (const TrackElement& element : point.track) {
        if (seen.emplace(element.image_id, element.point2d_index).second) continue;
        throw InputError(FilePath(folder_, kFiles[2], format_), "point " + std::to_string(id),
                         "keypoint " + std::to_string(element.point2d_index) + " of image " +
                             std::to_string(element.image_id) + " stands in its track twice",
                         "Write the model again with COLMAP");
      }
    }
    for (const auto& [id, image] : model_.images) {
      for (size_t i = 0; i < image.point3d_ids.size(); ++i) {
        if (image.point3d_ids[i] == kInvalidPoint3dId) continue;
        if (seen.count({id, static_cast<uint32_t>(i)}) > 0) continue;
        Fail(kFiles[1], image_positions_.at(id),
             "keypoint " + std::to_string(i) + " of image " + std::to_string(id) + " names point " +
                 std::to_string(image.point3d_ids[i]) + ", but " +
                 FilePath(folder_, kFiles[2], format_) + " does not hold it with this keypoint",
             "Take all files from the same model");
      }
    }
  }

  const SparseModelFormat& format_;
  const std::string& folder_;
  SparseModel model_;
  std::unordered_map<uint32_t, const SparseImage*> images_;
  std::unordered_map<uint32_t, long long> image_positions_;
  size_t num_track_elements_ = 0;
};

void WriteFiles(const SparseModel& model, const std::string& folder,
                const SparseModelFormat& format) {
  MakeFolder(folder);
  for (const char* file : {"rigs", "frames"}) {
    const std::string path = FilePath(folder, file, format);
    std::error_code error;
    if (!fs::exists(path, error)) continue;
    throw InputError(path, "", "belongs to a COLMAP 4 model, which the new one would contradict",
                     "Give an empty --output_path");
  }
  // All three are written before the first one is renamed.
  std::array<std::unique_ptr<OutputFile>, 3> files;
  const std::array<void (*)(const SparseModel&, const SparseModelFormat::Write&), 3> writers = {
      format.write_cameras, format.write_images, format.write_points};
  for (size_t i = 0; i < files.size(); ++i) {
    files[i] = std::make_unique<OutputFile>(FilePath(folder, kFiles[i], format));
    writers[i](model, [&](const std::string& piece) { files[i]->stream() << piece; });
  }
  for (const std::unique_ptr<OutputFile>& file : files) file->Commit();
}

// A frame of one image is no frame.
void SetFrames(const FrameOfImage& frame_of_image, SparseModel* model) {
  std::map<uint32_t, int> sizes;
  for (const auto& [image_id, frame_id] : frame_of_image) {
    if (model->images.count(image_id) > 0) ++sizes[frame_id];
  }
  for (const auto& [image_id, frame_id] : frame_of_image) {
    if (sizes[frame_id] > 1 && model->images.count(image_id) > 0) {
      model->images.at(image_id).frame_id = frame_id;
    }
  }
}

}  // namespace

const SparseImage* SparseModel::FindImage(const std::string& name) const {
  for (const auto& [id, image] : images) {
    if (image.name == name) return &image;
  }
  return nullptr;
}

Rigid PoseFromNumbers(const double qvec_wxyz[4], const double tvec[3], const std::string& path,
                      const std::string& position) {
  Rigid pose;
  pose.rotation = {qvec_wxyz[0], qvec_wxyz[1], qvec_wxyz[2], qvec_wxyz[3]};
  pose.translation = {tvec[0], tvec[1], tvec[2]};
  const double norm = pose.rotation.norm();
  if (!pose.translation.allFinite() || !std::isfinite(norm) || !(norm > 1e-6)) {
    throw InputError(path, position, "the pose of the image is not a rotation and a translation",
                     "Write the model again with COLMAP, without images that have no pose");
  }
  // Kept bit by bit when it is a unit quaternion already, so that files go through unchanged.
  if (std::abs(norm - 1) > 1e-14) pose.rotation.normalize();
  return pose;
}

SparseModel AssembleSparseModel(const SparseModelFormat& format, const std::string& folder,
                                PlacedList<Camera> cameras, PlacedList<SparseImage> images,
                                PlacedList<SparsePoint> points) {
  Assembler assembler(format, folder);
  assembler.TakeCameras(std::move(cameras));
  assembler.TakeImages(std::move(images));
  assembler.TakePoints(std::move(points));
  return assembler.Take();
}

SparseModel ReadSparseModel(const std::string& folder) {
  const SparseModelFormat& format = FindFormat(folder);
  const auto parse = [&](auto parser, const char* file) {
    const std::string path = FilePath(folder, file, format);
    return parser(ReadAll(path), path);
  };
  auto cameras = parse(format.parse_cameras, kFiles[0]);
  auto images = parse(format.parse_images, kFiles[1]);
  auto points = parse(format.parse_points, kFiles[2]);
  SparseModel model =
      AssembleSparseModel(format, folder, std::move(cameras), std::move(images), std::move(points));
  const std::string frames_path = FilePath(folder, "frames", format);
  std::error_code error;
  if (fs::is_regular_file(frames_path, error)) {
    SetFrames(format.parse_frames(ReadAll(frames_path), frames_path), &model);
  }
  return model;
}

void WriteSparseModel(const SparseModel& model, const std::string& folder) {
  WriteFiles(model, folder, SparseModelBinary());
}

void WriteSparseModelText(const SparseModel& model, const std::string& folder) {
  WriteFiles(model, folder, SparseModelText());
}

void TransformModel(const Similarity& target_from_model, SparseModel* model) {
  for (auto& [id, image] : model->images) {
    image.cam_from_model = CamFromScan(image.cam_from_model, target_from_model);
  }
  for (auto& [id, point] : model->points) point.x_in_model = target_from_model * point.x_in_model;
}

double MedianDepth(const SparseModel& model, const SparseImage& image) {
  std::vector<double> depths;
  for (const uint64_t id : image.point3d_ids) {
    if (id == kInvalidPoint3dId) continue;
    depths.push_back((image.cam_from_model * model.points.at(id).x_in_model).norm());
  }
  return Median(&depths);
}

SparseModel WithoutPhotos(const SparseModel& model, const std::set<uint32_t>& image_ids) {
  SparseModel rest;
  rest.cameras = model.cameras;
  for (const auto& [id, image] : model.images) {
    if (image_ids.count(id) == 0) rest.images.emplace(id, image);
  }
  for (const auto& [id, point] : model.points) {
    SparsePoint thinned = point;
    std::set<uint32_t> photos;
    thinned.track.clear();
    for (const TrackElement& element : point.track) {
      if (image_ids.count(element.image_id) > 0) continue;
      thinned.track.push_back(element);
      photos.insert(element.image_id);
    }
    if (photos.size() > 1) {
      rest.points.emplace(id, std::move(thinned));
      continue;
    }
    for (const TrackElement& element : thinned.track) {
      rest.images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
    }
  }
  return rest;
}

ReprojectionErrors UpdateReprojectionErrors(SparseModel* model) {
  const auto projections = ProjectionsOf(model->cameras);
  struct View {
    const SparseImage* image;
    const CameraProjection* projection;
    double half_diagonal;  // pixels
  };
  std::unordered_map<uint32_t, View> views;
  for (const auto& [id, image] : model->images) {
    const CameraProjection& projection = projections.at(image.camera_id);
    const Camera& camera = projection.camera();
    views[id] = {&image, &projection, 0.5 * std::hypot(camera.width, camera.height)};
  }
  ReprojectionErrors errors;
  double sum = 0, sum_of_squares = 0;
  for (auto& [id, point] : model->points) {
    double point_sum = 0;
    for (const TrackElement& element : point.track) {
      const View& view = views.at(element.image_id);
      const std::optional<Eigen::Vector2d> difference =
          view.projection->ImgError(view.image->cam_from_model * point.x_in_model,
                                    view.image->points2d[element.point2d_index]);
      const double error = difference ? difference->norm() : view.half_diagonal;
      point_sum += error;
      sum_of_squares += error * error;
    }
    point.error = point.track.empty() ? -1 : point_sum / point.track.size();
    sum += point_sum;
    errors.num_observations += point.track.size();
  }
  if (errors.num_observations > 0) {
    errors.mean_px = sum / errors.num_observations;
    errors.rms_px = std::sqrt(sum_of_squares / errors.num_observations);
  }
  return errors;
}

}  // namespace roomtex
