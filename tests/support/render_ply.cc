// roomtex-render: a coloured model.ply as a photo of a COLMAP model sees it, to look at results.
// Not installed. Triangles carry the colours of their corners; with --image_path the photo stands
// to the left of the picture.

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/ray_caster.h"
#include "tests/support/ply_vertices.h"

namespace roomtex {
namespace {

struct RenderOptions {
  std::string ply_path, input_path, image_path, output_path, image_name;
  double turn_deg = 0, back = 0, up = 0;
  int width = 0;
};

struct ColoredMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> colors;
  std::vector<Triangle> triangles;
};

ColoredMesh ReadColoredMesh(const std::string& path) {
  RequireFile(path, "Give a model.ply of roomtex-texture");
  std::ifstream stream(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  PlyVertices vertices = ParsePlyVertices(bytes, path);
  if (vertices.colors.empty()) throw InputError(path, "", "has no colours", "");
  ColoredMesh mesh;
  for (const Eigen::Vector3f& point : vertices.points) mesh.points.push_back(point.cast<double>());
  mesh.colors = std::move(vertices.colors);
  // The faces are the last element: 1 + 3 * 4 bytes each.
  const size_t at = bytes.find("element face ");
  const size_t count = at == std::string::npos ? 0 : std::stoull(bytes.substr(at + 13, 20));
  if (count * 13 > bytes.size()) throw InputError(path, "", "is truncated", "");
  const char* face = bytes.data() + bytes.size() - count * 13;
  for (size_t i = 0; i < count; ++i, face += 13) {
    Triangle triangle;
    std::memcpy(triangle.data(), face + 1, 12);
    for (int corner : triangle) {
      if (corner < 0 || corner >= static_cast<int>(mesh.points.size())) {
        throw InputError(path, "", "has a face that names no vertex", "");
      }
    }
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

cv::Vec3b ColorAt(const ColoredMesh& mesh, const RayHit& hit) {
  const Triangle& t = mesh.triangles[hit.triangle];
  const Eigen::Vector3d a = mesh.points[t[0]], b = mesh.points[t[1]], c = mesh.points[t[2]];
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double area = normal.squaredNorm();
  double share[3] = {1, 0, 0};
  if (area > 0) {
    share[0] = normal.dot((c - b).cross(hit.point - b)) / area;
    share[1] = normal.dot((a - c).cross(hit.point - c)) / area;
    share[2] = 1 - share[0] - share[1];
  }
  cv::Vec3b bgr;
  for (int k = 0; k < 3; ++k) {
    double value = 0;
    for (int i = 0; i < 3; ++i) value += share[i] * mesh.colors[t[i]][2 - k];
    bgr[k] = cv::saturate_cast<uchar>(value);
  }
  return bgr;
}

cv::Mat Render(const ColoredMesh& mesh, const Camera& camera, const Rigid& cam_from_scan, int width,
               int num_threads) {
  const RayCaster caster(mesh.points, mesh.triangles);
  const CameraProjection projection(camera);
  const double scale = static_cast<double>(width) / camera.width;
  cv::Mat3b picture(static_cast<int>(std::lround(camera.height * scale)), width);
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  ParallelFor(num_threads, 0, picture.rows, [&](int y) {
    for (int x = 0; x < picture.cols; ++x) {
      picture(y, x) = {255, 0, 255};
      const auto ray = projection.CamFromImg({(x + 0.5) / scale, (y + 0.5) / scale});
      if (!ray) continue;
      const Eigen::Vector3d direction =
          (scan_from_cam.rotation * Eigen::Vector3d(ray->x(), ray->y(), 1)).normalized();
      const auto hit = caster.Cast(scan_from_cam.translation, direction, 0.01);
      if (hit) picture(y, x) = ColorAt(mesh, *hit);
    }
  });
  return picture;
}

void RenderModel(const RenderOptions& options, const Command::Context& context) {
  context.progress.Stage("read");
  const SparseModel model = ReadSparseModel(options.input_path);
  const SparseImage* const image = options.image_name.empty() && !model.images.empty()
                                       ? &model.images.begin()->second
                                       : model.FindImage(options.image_name);
  if (image == nullptr)
    throw UsageError("--image_name " + options.image_name + " is not in the model");
  const ColoredMesh mesh = ReadColoredMesh(options.ply_path);
  const Camera& camera = model.cameras.at(image->camera_id);
  Rigid new_from_cam;  // a viewpoint of its own: turned, and moved in the camera's frame
  new_from_cam.rotation = Eigen::AngleAxisd(RadFromDeg(options.turn_deg), Eigen::Vector3d::UnitY());
  new_from_cam.translation = Eigen::Vector3d(0, options.up, options.back);
  const int width = options.width > 0 ? options.width : camera.width;
  context.progress.Stage("render");
  cv::Mat picture = Render(mesh, camera, new_from_cam * image->cam_from_model, width,
                           context.options.num_threads);
  if (!options.image_path.empty()) {
    cv::Mat photo = ReadPhoto(options.image_path + "/" + image->name);
    cv::resize(photo, photo, picture.size(), 0, 0, cv::INTER_AREA);
    cv::hconcat(photo, picture, picture);
  }
  OutputFile file(options.output_path);
  if (!cv::imwrite(file.partial_path(), picture)) {
    throw InputError(options.output_path, "", "cannot be written", "Give a .png or .jpg");
  }
  file.Commit();
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  RenderOptions o;
  Command command("roomtex-render", "Renders a coloured model.ply from the pose of a photo.",
                  "roomtex-render --ply_path textured/model.ply --input_path aligned --image_path "
                  "images --image_name IMG_1.jpg --output_path beside.png");
  command.AddInputPath("ply_path", &o.ply_path, "coloured mesh");
  command.AddInputPath("input_path", &o.input_path, "COLMAP model in the scan frame");
  command.AddOutputPath("output_path", &o.output_path, "picture to write; magenta = no surface");
  command.AddString("image_name", &o.image_name, "photo whose pose is taken; first one by default");
  command.AddInputPath("image_path", &o.image_path, "folder of the photos: puts the photo beside",
                       Command::Kind::kOptional);
  command.AddInt("width", &o.width, "width of the picture in pixels; 0 = the camera's");
  command.AddDouble("turn_deg", &o.turn_deg, "turns the view to the left, degrees");
  command.AddDouble("back", &o.back, "moves the view back, metres");
  command.AddDouble("up", &o.up, "moves the view up, metres");
  return command.Run(argc, argv,
                     [&o](const Command::Context& context) { RenderModel(o, context); });
}
