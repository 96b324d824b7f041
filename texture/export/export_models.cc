#include <algorithm>
#include <filesystem>
#include <map>

#include <Eigen/Geometry>

#include "colmap_ext/dense_workspace.h"
#include "colmap_ext/sparse_model.h"
#include "core/decompositions.h"
#include "core/output_file.h"
#include "core/report.h"
#include "core/scan.h"
#include "texture/export/export_photos.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMinTrack = 2;  // photos: what COLMAP's own points have at least

// One camera for the photos that share all its numbers.
uint32_t CameraId(const Camera& camera, SparseModel* model) {
  for (const auto& [id, known] : model->cameras) {
    if (known.width == camera.width && known.height == camera.height &&
        known.params == camera.params) {
      return id;
    }
  }
  const auto id = static_cast<uint32_t>(model->cameras.size() + 1);
  Camera added = camera;
  added.camera_id = id;
  model->cameras[id] = added;
  return id;
}

SparseModel MakeModel(const ExportScene& scene, const std::vector<ExportedPhoto>& photos) {
  std::vector<size_t> num_photos(scene.points.size(), 0);
  for (const ExportedPhoto& photo : photos) {
    for (const ExportedPhoto::Sight& sight : photo.sights) ++num_photos[sight.point];
  }
  SparseModel model;
  for (size_t i = 0; i < photos.size(); ++i) {
    const ExportedPhoto& photo = photos[i];
    SparseImage image;
    image.image_id = static_cast<uint32_t>(i + 1);
    image.camera_id = CameraId(photo.camera, &model);
    image.name = photo.name;
    image.cam_from_model = photo.cam_from_scan;
    for (const ExportedPhoto::Sight& sight : photo.sights) {
      if (num_photos[sight.point] < kMinTrack) continue;
      const auto id = static_cast<uint64_t>(sight.point) + 1;
      SparsePoint& point = model.points[id];
      point.track.push_back({image.image_id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.emplace_back(sight.x_in_img.cast<double>());
      image.point3d_ids.push_back(id);
    }
    model.images[image.image_id] = std::move(image);
  }
  for (auto& [id, point] : model.points) {
    const ExportScene::Point& of_scan = scene.points[id - 1];
    point.x_in_model = of_scan.x_in_scan;
    for (int k = 0; k < 3; ++k) point.color[k] = of_scan.color[k];
  }
  UpdateReprojectionErrors(&model);
  return model;
}

// OpenGL's camera looks along -z, y up.
Eigen::Matrix4d WorldFromOpenGlCam(const Rigid& cam_from_scan, const Rigid& world_from_scan) {
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() =
      (world_from_scan.rotation * scan_from_cam.rotation).toRotationMatrix() *
      Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
  matrix.topRightCorner<3, 1>() = world_from_scan * scan_from_cam.translation;
  return matrix;
}

Json ToJsonRows(const Eigen::Matrix4d& matrix, int num_rows = 4) {
  Json rows = Json::array();
  for (int row = 0; row < num_rows; ++row) {
    rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
  }
  return rows;
}

// Of nerfstudio's world in `scan`, whole metres: points and poses become floats there, which far
// from the origin are too coarse.
Eigen::Vector3d WorldOrigin(const ExportScene& scene) {
  Eigen::AlignedBox3d box;
  for (const ExportScene::Point& point : scene.points) box.extend(point.x_in_scan);
  if (box.isEmpty() || box.center().norm() < kLargeCoordinate) return Eigen::Vector3d::Zero();
  return box.center().array().round();
}

void WritePointsPly(const ExportScene& scene, const Rigid& world_from_scan,
                    const std::string& path) {
  OutputFile file(path);
  file.stream() << "ply\nformat binary_little_endian 1.0\ncomment roomtex-export: metres, z up\n"
                << "element vertex " << scene.points.size()
                << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                   "property uchar green\nproperty uchar blue\nend_header\n";
  for (const ExportScene::Point& point : scene.points) {
    const Eigen::Vector3f x_in_world = (world_from_scan * point.x_in_scan).cast<float>();
    file.stream().write(reinterpret_cast<const char*>(x_in_world.data()), 12);
    file.stream().write(reinterpret_cast<const char*>(point.color.data()), 3);
  }
  file.Commit();
}

}  // namespace

size_t WriteColmapModel(const ExportScene& scene, const std::vector<ExportedPhoto>& photos,
                        const std::string& folder) {
  const SparseModel model = MakeModel(scene, photos);
  WriteSparseModel(model, folder + "/sparse/0");
  for (const char* name : kSparseModelFiles) {
    const fs::path from = fs::path(folder) / "sparse" / "0" / name;
    const fs::path to = fs::path(folder) / "sparse" / name;
    std::error_code error;
    fs::create_hard_link(from, to, error);
    if (error) fs::copy_file(from, to);
  }
  std::vector<std::string> names;
  for (const ExportedPhoto& photo : photos) names.push_back(photo.name);
  WriteStereoConfiguration(names, {folder});
  return model.points.size();
}

void WriteNerfstudioModel(const ExportScene& scene, const std::vector<ExportedPhoto>& photos,
                          const Eigen::Vector3d& up_in_scan, bool masks,
                          const std::string& folder) {
  Rigid world_from_scan;
  world_from_scan.rotation = RotationBetween(up_in_scan, Eigen::Vector3d::UnitZ());
  world_from_scan.translation = -(world_from_scan.rotation * WorldOrigin(scene));
  Json frames = Json::array();
  for (const ExportedPhoto& photo : photos) {
    const std::vector<double>& p = photo.camera.params;
    Json frame = {{"file_path", "images/" + photo.name},
                  {"depth_file_path", "depths/" + photo.name + ".png"}};
    if (masks) frame["mask_path"] = "masks/" + photo.name + ".png";
    frame.update({{"w", photo.camera.width},
                  {"h", photo.camera.height},
                  {"fl_x", p[0]},
                  {"fl_y", p[1]},
                  {"cx", p[2]},
                  {"cy", p[3]},
                  {"k1", 0},
                  {"k2", 0},
                  {"p1", 0},
                  {"p2", 0}});
    frame["transform_matrix"] =
        ToJsonRows(WorldFromOpenGlCam(photo.cam_from_scan, world_from_scan));
    frames.push_back(frame);
  }
  const Rigid back = world_from_scan.Inverse();
  Eigen::Matrix4d scan_from_world = Eigen::Matrix4d::Identity();
  scan_from_world.topLeftCorner<3, 3>() = back.rotation.toRotationMatrix();
  scan_from_world.topRightCorner<3, 1>() = back.translation;
  Json transforms = {{"camera_model", "OPENCV"},
                     {"ply_file_path", "points3D.ply"},
                     {"depth_unit_scale_factor", 0.001}};
  transforms["applied_transform"] = ToJsonRows(Eigen::Matrix4d::Identity(), 3);
  transforms["scan_from_world"] = ToJsonRows(scan_from_world);
  transforms["frames"] = frames;
  WriteJson(folder + "/transforms.json", transforms);
  WritePointsPly(scene, world_from_scan, folder + "/points3D.ply");
}

}  // namespace roomtex
