#include "importers/panorama_cutter.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include <opencv2/imgcodecs.hpp>

#include "core/camera_text.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/photo_files.h"
#include "core/result_names.h"
#include "core/stays_inside.h"
#include "core/text.h"

namespace fs = std::filesystem;
namespace roomtex {
namespace {

constexpr int kJpegQuality = 96;
// A picture all around is twice as wide as high, but for this share.
constexpr double kMaxShapeError = 0.01;

// Paths of the panoramas, by name.
std::vector<fs::path> FindPanoramas(const std::string& input_path) {
  std::error_code error;
  if (!fs::is_directory(input_path, error)) return {input_path};
  std::vector<fs::path> paths;
  for (const std::string& name : ListPhotoFiles(
           input_path, "Give the file of a scan, a panorama, or a folder of panoramas", false)) {
    paths.push_back(fs::path(input_path) / name);
  }
  return paths;
}

CutPanorama Describe(const fs::path& path, const FaceOptions& options) {
  CutPanorama panorama;
  panorama.name = path.filename().string();
  const auto [width, height] = ReadPhotoSize(path.string());
  panorama.width = width;
  panorama.height = height;
  if (width <= 0 || height <= 0) {
    throw InputError(path.string(), "", "is not a picture that can be read",
                     "Export it again, or leave it out");
  }
  if (!(std::abs(0.5 * width / height - 1) <= kMaxShapeError)) {
    throw InputError(path.string(), "",
                     "has " + std::to_string(width) + " x " + std::to_string(height) +
                         " pixels, expected a panorama all around (equirectangular), twice as wide "
                         "as high",
                     "Export the panorama whole from the camera's program, or leave it out");
  }
  panorama.face_camera = FaceCamera(panorama.PanoramaCamera(), options);
  int number = 0;
  for (const Eigen::Quaterniond& rotation : FaceRotations(options)) {
    panorama.faces.push_back(
        {path.stem().string() + "/face_" + std::to_string(++number) + ".jpg", rotation});
  }
  return panorama;
}

void WriteFaces(const fs::path& path, const CutPanorama& panorama, const fs::path& folder,
                int num_threads) {
  const cv::Mat picture = ReadPhoto(path.string());
  MakeFolder((folder / path.stem()).string());
  ParallelFor(num_threads, 0, static_cast<int>(panorama.faces.size()), [&](int i) {
    const CutPanorama::Face& face = panorama.faces[i];
    std::vector<uchar> bytes;
    cv::imencode(".jpg", CutFace(picture, panorama.face_camera, face.face_from_panorama), bytes,
                 {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
    OutputFile file((folder / face.name).string());
    file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                        static_cast<std::streamsize>(bytes.size()));
    file.Commit();
  });
}

void WriteCameraOptions(const Camera& camera, const std::string& path) {
  OutputFile file(path);
  file.stream() << FeatureExtractorOptions(camera) << "\n";
  file.Commit();
}

// Faces that an earlier run cut and this one does not: features and matches would come to lie on
// them.
void RemoveOlderFaces(const std::string& folder, const std::vector<CutPanorama>& panoramas,
                      OutputSet* outputs) {
  std::set<std::string> names;
  for (const CutPanorama& panorama : panoramas) {
    for (const CutPanorama::Face& face : panorama.faces) names.insert(face.name);
  }
  const std::string set = folder + "/" + kPanoramaSetName;
  if (!fs::exists(set)) return;
  try {
    for (const CutPanorama& panorama : ReadPanoramaSet(set)) {
      for (const CutPanorama::Face& face : panorama.faces) {
        // The file is data: it may name files that no run of ours has made.
        const bool is_face =
            StaysInside(face.name) && BeginsWith(fs::path(face.name).filename().string(), "face_");
        if (is_face && names.count(face.name) == 0) outputs->Remove(face.name);
      }
    }
  } catch (const InputError&) {
    // Of somebody else, or damaged: it is replaced, and says nothing of other files.
  }
}

}  // namespace

bool IsPanoramaInput(const std::string& input_path) {
  std::error_code error;
  return fs::is_directory(input_path, error) || IsPhotoName(input_path);
}

std::vector<CutPanorama> DescribePanoramas(const std::string& input_path,
                                           const FaceOptions& options) {
  std::vector<CutPanorama> panoramas;
  std::set<std::string> folders;
  for (const fs::path& path : FindPanoramas(input_path)) {
    panoramas.push_back(Describe(path, options));
    if (folders.insert(path.stem().string()).second) continue;
    throw InputError(path.string(), "", "has the name of another panorama, but for its ending",
                     "Give the panoramas names of their own");
  }
  return panoramas;
}

std::vector<CutPanorama> CutPanoramas(const std::string& input_path,
                                      const std::string& output_folder, const FaceOptions& options,
                                      int num_threads, Progress* progress) {
  const std::vector<fs::path> paths = FindPanoramas(input_path);
  const std::vector<CutPanorama> panoramas = DescribePanoramas(input_path, options);
  OutputSet outputs(output_folder);
  progress->Stage("cut panoramas", static_cast<int>(paths.size()));
  for (size_t i = 0; i < paths.size(); ++i) {
    WriteFaces(paths[i], panoramas[i], outputs.aside(), num_threads);
    progress->Tick();
  }
  const Camera& camera = panoramas[0].face_camera;
  const bool is_one = std::all_of(panoramas.begin(), panoramas.end(), [&](const CutPanorama& p) {
    return p.face_camera.width == camera.width && p.face_camera.params == camera.params;
  });
  const fs::path folder = outputs.aside();
  if (is_one) {
    WriteCameraOptions(camera, (folder / kCameraOptionsName).string());
  } else {
    outputs.Remove(kCameraOptionsName);
  }
  RemoveOlderFaces(output_folder, panoramas, &outputs);
  WritePanoramaSet(panoramas, (folder / kPanoramaSetName).string());
  outputs.Commit();
  return panoramas;
}

}  // namespace roomtex
