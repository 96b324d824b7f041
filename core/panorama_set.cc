#include "core/panorama_set.h"

#include <cmath>
#include <set>

#include "core/error.h"
#include "core/frames.h"
#include "core/json_text.h"
#include "core/output_file.h"
#include "core/report.h"

namespace roomtex {
namespace {

constexpr char kFormat[] = "roomtex panoramas 1";
constexpr char kRemedy[] = "Give the panoramas.json that roomtex-import wrote beside the faces";

Json ToJson(const CutPanorama& panorama) {
  Json faces = Json::array();
  for (const CutPanorama::Face& face : panorama.faces) {
    const Eigen::Vector4d q = WxyzFromQuaternion(face.face_from_panorama);
    faces.push_back({{"name", face.name}, {"face_from_panorama_wxyz", {q[0], q[1], q[2], q[3]}}});
  }
  const Camera& camera = panorama.face_camera;
  return {{"name", panorama.name},
          {"width", panorama.width},
          {"height", panorama.height},
          {"face_camera",
           {{"model", CameraModelName(camera.model)},
            {"width", camera.width},
            {"height", camera.height},
            {"params", camera.params}}},
          {"faces", faces}};
}

CutPanorama FromJson(const Json& json, const std::string& path) {
  CutPanorama panorama;
  panorama.name = json.at("name").get<std::string>();
  panorama.width = json.at("width").get<int>();
  panorama.height = json.at("height").get<int>();
  const Json& camera = json.at("face_camera");
  const auto model = CameraModelFromName(camera.at("model").get<std::string>());
  if (!model) {
    throw InputError(path, panorama.name, "names an unknown camera model", kRemedy);
  }
  panorama.face_camera.model = *model;
  panorama.face_camera.width = camera.at("width").get<int>();
  panorama.face_camera.height = camera.at("height").get<int>();
  panorama.face_camera.params = camera.at("params").get<std::vector<double>>();
  for (const Camera& one : {panorama.face_camera, panorama.PanoramaCamera()}) {
    const std::vector<std::string> problems = one.Problems();
    if (!problems.empty()) throw InputError(path, panorama.name, problems[0], kRemedy);
  }
  for (const Json& entry : json.at("faces")) {
    const auto wxyz = entry.at("face_from_panorama_wxyz").get<std::vector<double>>();
    CutPanorama::Face face;
    face.name = entry.at("name").get<std::string>();
    if (wxyz.size() == 4) {
      face.face_from_panorama = QuaternionFromWxyz({wxyz[0], wxyz[1], wxyz[2], wxyz[3]});
    }
    if (wxyz.size() != 4 || !(std::abs(face.face_from_panorama.norm() - 1) < 1e-3)) {
      throw InputError(path, face.name, "has no rotation of length 1", kRemedy);
    }
    face.face_from_panorama.normalize();
    panorama.faces.push_back(std::move(face));
  }
  return panorama;
}

}  // namespace

Camera CutPanorama::PanoramaCamera() const {
  Camera camera;
  camera.model = CameraModel::kEquirectangular;
  camera.width = width;
  camera.height = height;
  camera.params = {static_cast<double>(width), static_cast<double>(height)};
  camera.has_prior_focal_length = true;
  return camera;
}

std::vector<CutPanorama> ReadPanoramaSet(const std::string& path) {
  const Json json = ReadJson(path, kRemedy);
  std::vector<CutPanorama> panoramas;
  try {
    if (json.at("format") != kFormat) {
      throw InputError(path, "", std::string("is not of the format \"") + kFormat + "\"", kRemedy);
    }
    for (const Json& entry : json.at("panoramas")) panoramas.push_back(FromJson(entry, path));
  } catch (const Json::exception&) {
    throw InputError(path, "", "is not as roomtex-import writes it", kRemedy);
  }
  std::set<std::string> names;
  for (const CutPanorama& panorama : panoramas) {
    for (const CutPanorama::Face& face : panorama.faces) {
      if (names.insert(face.name).second) continue;
      throw InputError(path, panorama.name, "has the face " + face.name + " twice", kRemedy);
    }
  }
  return panoramas;
}

void WritePanoramaSet(const std::vector<CutPanorama>& panoramas, const std::string& path) {
  Json list = Json::array();
  for (const CutPanorama& panorama : panoramas) list.push_back(ToJson(panorama));
  OutputFile file(path);
  file.stream() << Json{{"format", kFormat}, {"panoramas", list}}.dump(1) << "\n";
  file.Commit();
}

}  // namespace roomtex
