// roomtex-render: pictures of the coloured scan, to look at results without a display.
//   one picture: from the pose of a photo of a COLMAP model, the photo beside it
//   --folder_path: a set of them from photos' poses, from new viewpoints in the room and from
//   outside, and a contact sheet of all
// A PLY's triangles carry the colours of their corners, a GLB's its texture images.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_set.h"
#include "core/photo.h"
#include "core/photo_fit.h"
#include "core/picture_file.h"
#include "core/statistics.h"
#include "texture/render/mesh_renderer.h"

namespace roomtex {
namespace {

constexpr int kMaxPictures = 1000, kMaxWidth = 16384;

struct RenderOptions {
  std::string ply_path, glb_path, input_path, image_path, output_path, folder_path, image_name;
  double turn_deg = 0, back = 0, up = 0;
  int width = 0;
  int num_photos = 4, num_ring = 4;
};

// The photo as its camera has it. Throws InputError if it cannot be shown.
cv::Mat ReadPhotoOf(const std::string& image_path, const std::string& name, const Camera& camera) {
  const std::string path = image_path + "/" + name;
  const PhotoFit fit = FitPhotoToCamera(path, name, camera.width, camera.height);
  if (!fit.usable()) {
    throw InputError(path, "", "cannot be shown. " + AsClause(fit.problem), "");
  }
  return ReadPhoto(path, fit.pixels);
}

// The photo to the left of the picture.
cv::Mat Beside(const cv::Mat& photo, const cv::Mat& picture) {
  cv::Mat left, both;
  cv::resize(photo, left, picture.size(), 0, 0, cv::INTER_AREA);
  cv::hconcat(left, picture, both);
  return both;
}

void RenderOne(const RenderOptions& options, const SparseModel& model, const ColoredMesh& mesh,
               const Command::Context& context) {
  const SparseImage* const image = options.image_name.empty() ? &model.images.begin()->second
                                                              : model.FindImage(options.image_name);
  if (image == nullptr)
    throw UsageError("--image_name " + options.image_name + " is not in the model");
  Rigid new_from_cam;  // a viewpoint of its own: turned, and moved in the camera's frame
  new_from_cam.rotation = Eigen::AngleAxisd(RadFromDeg(options.turn_deg), Eigen::Vector3d::UnitY());
  new_from_cam.translation = Eigen::Vector3d(0, options.up, options.back);
  RenderSettings settings;
  settings.width = options.width;
  settings.num_threads = context.options.num_threads;
  settings.empty = {255, 0, 255};
  context.progress.Stage("render");
  const Camera& camera = model.cameras.at(image->camera_id);
  cv::Mat picture =
      MeshRenderer(mesh).Render(camera, new_from_cam * image->cam_from_model, settings);
  if (!options.image_path.empty()) {
    picture = Beside(ReadPhotoOf(options.image_path, image->name, camera), picture);
  }
  WritePictureFile(options.output_path, picture);
  std::printf("%s\n", options.output_path.c_str());
}

// The axis of the scan frame that is up: what the mesh says, else the way photos are held.
Eigen::Vector3d FindUp(const SparseModel& model, const ColoredMesh& mesh) {
  Eigen::Vector3d sum = mesh.up;
  if (sum.isZero()) {
    for (const auto& [id, image] : model.images) {
      sum += image.cam_from_model.rotation.conjugate() * -Eigen::Vector3d::UnitY();
    }
  }
  int axis = 0;
  sum.cwiseAbs().maxCoeff(&axis);
  return (sum[axis] < 0 ? -1 : 1) * Eigen::Vector3d::Unit(axis);
}

// Median height of the photos along `up`.
double EyeHeight(const SparseModel& model, const Eigen::Vector3d& up) {
  std::vector<double> heights;
  for (const auto& [id, image] : model.images) {
    heights.push_back(up.dot(image.cam_from_model.TargetOriginInSource()));
  }
  return Median(&heights);
}

Camera PlainCamera(int width, int height, double field_of_view_deg) {
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = width;
  camera.height = height;
  const double focal_length = width / 2.0 / std::tan(RadFromDeg(field_of_view_deg) / 2);
  camera.params = {focal_length, width / 2.0, height / 2.0};
  return camera;
}

// The pictures of one contact sheet.
class PictureSet {
  static constexpr int kCellWidth = 480, kCellHeight = 320, kCaption = 26;

 public:
  PictureSet(const RenderOptions& options, const Command::Context& context)
      : options_(options), context_(context), outputs_(options.folder_path) {
    settings_.num_threads = context.options.num_threads;
    settings_.width = options.width > 0 ? options.width : 960;
  }

  void FromPhotos(const SparseModel& model, const MeshRenderer& renderer) {
    std::vector<const SparseImage*> images;
    for (const auto& [id, image] : model.images) images.push_back(&image);
    std::sort(images.begin(), images.end(),
              [](const SparseImage* a, const SparseImage* b) { return a->name < b->name; });
    const size_t count = std::min<size_t>(options_.num_photos, images.size());
    size_t next = 0, number = 0;
    for (size_t i = 0; i < count; ++i) {
      next = std::max(next, i * images.size() / count);
      bool is_shown = false;  // the next one where this one cannot be
      while (!is_shown && next < images.size()) {
        is_shown = FromPhoto(model, *images[next++], number + 1, renderer);
      }
      number += is_shown;
    }
    if (!options_.image_path.empty()) ReportPhotosLeftOut(left_out_, context_);
  }

  // Viewpoints on a ring in the room, as high as the photos, that look over the middle at the other
  // side; nearer to the middle where that shows more. A scan that is no room around them is looked
  // at from beside the photos.
  void FromRing(const SparseModel& model, const RoomBox& box, const Eigen::Vector3d& up,
                const MeshRenderer& renderer) {
    const Camera camera = PlainCamera(settings_.width, settings_.width * 2 / 3, 75);
    const Eigen::Vector3d side = up.unitOrthogonal(), other = up.cross(side);
    const Eigen::Vector3d half = (box.high - box.low) / 2;
    const Eigen::Vector3d middle =
        box.Centre() + up * (EyeHeight(model, up) - up.dot(box.Centre()));
    for (int i = 0; i < options_.num_ring; ++i) {
      const double angle = 2 * kPi * (i + 0.5) / options_.num_ring;
      const Eigen::Vector3d out = std::cos(angle) * side + std::sin(angle) * other;
      const Eigen::Vector3d to_wall = out.cwiseProduct(half);
      Rigid best;
      double most = -1;
      for (const double share : {0.6, 0.4, 0.2, 0.0, -0.2}) {
        const Rigid pose = LookAt(middle + share * to_wall, middle - to_wall - 0.4 * up, up);
        const double in_sight = renderer.ShareInSight(camera, pose);
        if (in_sight > most + 0.1) {
          most = in_sight;
          best = pose;
        }
      }
      constexpr double kRoomAround = 0.8;
      if (most < kRoomAround) best = BesideAPhoto(model, i, up);
      Add("ring_" + std::to_string(i + 1), "new viewpoint " + std::to_string(i + 1),
          renderer.Render(camera, best, settings_));
    }
  }

  // Half a metre above a photo's place and aside, looking at what the photo shows.
  Rigid BesideAPhoto(const SparseModel& model, int number, const Eigen::Vector3d& up) const {
    auto image = model.images.begin();
    std::advance(image, number * model.images.size() / options_.num_ring);
    const Rigid scan_from_cam = image->second.cam_from_model.Inverse();
    const Eigen::Vector3d aside(number % 2 == 0 ? 0.4 : -0.4, 0, 0);
    return LookAt(scan_from_cam * aside + 0.35 * up, scan_from_cam * Eigen::Vector3d(0, 0, 2), up);
  }

  // Without the ceiling: straight from above, and from two corners at a slant, through the walls
  // that turn their back.
  void FromOutside(const RoomBox& box, const Eigen::Vector3d& up, const ColoredMesh& mesh) {
    const double height = (box.high - box.low).dot(up.cwiseAbs());
    const Eigen::Vector3d centre = box.Centre();
    const ColoredMesh open = CutBeyond(mesh, up, centre.dot(up) + 0.38 * height);
    const MeshRenderer renderer(open);
    RenderSettings settings = settings_;
    settings.front_only = true;
    constexpr double kFieldOfView = 50;
    const Camera camera = PlainCamera(settings.width, settings.width * 2 / 3, kFieldOfView);
    const Eigen::Vector3d extent = box.high - box.low - up.cwiseAbs() * height;
    const double radius = extent.norm() / 2;
    int long_axis = 0;
    extent.maxCoeff(&long_axis);
    const Eigen::Vector3d away = up.cross(Eigen::Vector3d::Unit(long_axis));
    const double distance = 0.8 * radius / std::tan(RadFromDeg(kFieldOfView) / 2) + height / 2;
    Add("above", "from above",
        renderer.Render(camera, LookAt(centre + distance * up, centre, away), settings));
    const Eigen::Vector3d side = up.cross(away);
    Rigid poses[4];
    double shown[4];
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector3d direction =
          (up + (i % 2 == 0 ? 1 : -1) * (0.9 * away + (i < 2 ? 0.5 : -0.5) * side)).normalized();
      poses[i] = LookAt(centre + 1.1 * distance * direction, centre, up);
      shown[i] = renderer.ShareInSight(camera, poses[i]);
    }
    // Of a scan of some of the walls opposite corners may see little but their backs.
    int order[4] = {0, 1, 2, 3};
    if (2 * std::min(shown[0], shown[1]) < *std::max_element(shown, shown + 4)) {
      std::stable_sort(order, order + 4, [&](int x, int y) { return shown[x] > shown[y]; });
    }
    for (int i = 0; i < 2; ++i) {
      const std::string number = std::to_string(i + 1);
      Add("open_" + number, "open room " + number,
          renderer.Render(camera, poses[order[i]], settings));
    }
  }

  void Finish() {  // with a contact sheet
    constexpr int kColumns = 4;
    while (cells_.size() % kColumns != 0) cells_.push_back(EmptyCell());
    std::vector<cv::Mat> rows;
    for (size_t i = 0; i < cells_.size(); i += kColumns) {
      cv::Mat row;
      cv::hconcat(&cells_[i], kColumns, row);
      rows.push_back(row);
    }
    cv::Mat sheet;
    cv::vconcat(rows, sheet);
    WritePictureFile(outputs_.Path("contact_sheet.png"), sheet);
    outputs_.Commit();
  }

 private:
  // False: the photo cannot be shown.
  bool FromPhoto(const SparseModel& model, const SparseImage& image, size_t number,
                 const MeshRenderer& renderer) {
    const Camera& camera = model.cameras.at(image.camera_id);
    cv::Mat photo;
    if (!options_.image_path.empty()) {
      try {
        photo = ReadPhotoOf(options_.image_path, image.name, camera);
      } catch (const InputError& error) {
        left_out_.push_back({image.name, error.what()});
        return false;
      }
    }
    const cv::Mat picture = renderer.Render(camera, image.cam_from_model, settings_);
    const std::string file = "photo_" + std::to_string(number);
    if (photo.empty()) {
      Add(file, "from " + image.name, picture);
      return true;
    }
    const cv::Mat both = Beside(photo, picture);
    AddCell(image.name, both.colRange(0, picture.cols));
    Write(file, image.name, both);
    AddCell("the scan from there", picture);
    return true;
  }

  void Add(const std::string& file, const std::string& caption, const cv::Mat& picture) {
    Write(file, caption, picture);
    AddCell(caption, picture);
  }
  static cv::Mat EmptyCell() {
    return cv::Mat(kCellHeight + kCaption, kCellWidth, CV_8UC3, cv::Scalar::all(24));
  }
  // Of the contact sheet: small at once, so that pictures need no memory once they are written.
  void AddCell(const std::string& caption, const cv::Mat& picture) {
    const double scale = std::min(static_cast<double>(kCellWidth) / picture.cols,
                                  static_cast<double>(kCellHeight) / picture.rows);
    cv::Mat small, cell = EmptyCell();
    cv::resize(picture, small, {}, scale, scale, cv::INTER_AREA);
    small.copyTo(cell(cv::Rect((kCellWidth - small.cols) / 2, (kCellHeight - small.rows) / 2,
                               small.cols, small.rows)));
    cv::putText(cell, caption, {8, kCellHeight + 18}, cv::FONT_HERSHEY_SIMPLEX, 0.5,
                cv::Scalar::all(220), 1, cv::LINE_AA);
    cells_.push_back(cell);
  }
  void Write(const std::string& file, const std::string& caption, const cv::Mat& picture) {
    WritePictureFile(outputs_.Path(file + ".png"), picture);
    context_.report["pictures"].push_back({{"file", file + ".png"}, {"shows", caption}});
    context_.progress.Tick();
  }

  const RenderOptions& options_;
  const Command::Context& context_;
  OutputSet outputs_;  // all pictures appear together
  RenderSettings settings_;
  std::vector<cv::Mat> cells_;
  std::vector<PhotoLeftOut> left_out_;
};

Json CameraToJson(const SparseImage& image, const Camera& camera) {
  Json json;
  json["name"] = image.name;
  json["centre"] = ToJson(image.cam_from_model.TargetOriginInSource());
  json["rotation_wxyz"] = ToJson(WxyzFromQuaternion(image.cam_from_model.rotation));
  json["width"] = camera.width;
  json["height"] = camera.height;
  json["focal_px"] = camera.MeanFocalLength();
  return json;
}

// What a plan of the room needs.
void DescribeRoom(const SparseModel& model, const RoomBox& box, const Eigen::Vector3d& up,
                  Report* report) {
  (*report)["up"] = ToJson(up);
  (*report)["room"] = {{"low", ToJson(box.low)}, {"high", ToJson(box.high)}};
  Json cameras = Json::array();
  for (const auto& [id, image] : model.images) {
    cameras.push_back(CameraToJson(image, model.cameras.at(image.camera_id)));
  }
  (*report)["cameras"] = cameras;
}

void RenderSet(const RenderOptions& options, const SparseModel& model, const ColoredMesh& mesh,
               const Command::Context& context) {
  context.progress.Stage("render", options.num_photos + options.num_ring + 3);
  const RoomBox box = FindRoomBox(mesh);
  const Eigen::Vector3d up = FindUp(model, mesh);
  DescribeRoom(model, box, up, &context.report);
  PictureSet set(options, context);
  {
    const MeshRenderer renderer(mesh);
    set.FromPhotos(model, renderer);
    set.FromRing(model, box, up, renderer);
  }
  set.FromOutside(box, up, mesh);
  set.Finish();
  std::printf("%s\n", (options.folder_path + "/contact_sheet.png").c_str());
}

void RenderModel(const RenderOptions& options, const Command::Context& context) {
  if (options.ply_path.empty() == options.glb_path.empty()) {
    throw UsageError("give --ply_path or --glb_path");
  }
  if (options.output_path.empty() == options.folder_path.empty()) {
    throw UsageError("give --output_path for one picture or --folder_path for a set of them");
  }
  if (options.num_photos < 0 || options.num_ring < 0 || options.num_photos > kMaxPictures ||
      options.num_ring > kMaxPictures) {
    throw UsageError("--num_photos and --num_ring must be 0 to " + std::to_string(kMaxPictures));
  }
  if (options.width < 0 || options.width > kMaxWidth) {
    throw UsageError("--width must be 0 to " + std::to_string(kMaxWidth) + " pixels");
  }
  context.progress.Stage("read");
  const SparseModel model = ReadSparseModel(options.input_path);
  if (model.images.empty()) {
    throw InputError(options.input_path, "", "holds no registered photo", "Give an aligned model");
  }
  const ColoredMesh mesh = options.glb_path.empty() ? ReadColoredMesh(options.ply_path)
                                                    : ReadTexturedMesh(options.glb_path);
  if (options.folder_path.empty()) {
    RenderOne(options, model, mesh, context);
  } else {
    RenderSet(options, model, mesh, context);
  }
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  RenderOptions o;
  Command command("roomtex-render", "Pictures of the coloured scan, without a display.",
                  "roomtex-render --ply_path textured/model.ply --input_path aligned --image_path "
                  "images --folder_path pictures");
  command.AddInputPath("ply_path", &o.ply_path, "model.ply: the colours of the vertices",
                       Command::Kind::kOptional);
  command.AddInputPath("glb_path", &o.glb_path,
                       "model.glb or model_web.glb instead: with its texture images",
                       Command::Kind::kOptional);
  command.AddInputPath("input_path", &o.input_path, "COLMAP model in the scan frame");
  command.AddOutputPath("folder_path", &o.folder_path,
                        "folder for a set of pictures and contact_sheet.png",
                        Command::Kind::kOptional);
  command.AddInt("num_photos", &o.num_photos, "of the set: pictures from photos' poses");
  command.AddInt("num_ring", &o.num_ring, "of the set: pictures from new viewpoints in the room");
  command.AddOutputPath("output_path", &o.output_path,
                        "one picture to write instead; magenta = no surface",
                        Command::Kind::kOptional);
  command.AddString("image_name", &o.image_name, "photo whose pose is taken; first one by default");
  command.AddInputPath("image_path", &o.image_path, "folder of the photos: puts the photo beside",
                       Command::Kind::kOptional);
  command.AddInt("width", &o.width,
                 "width of a picture in pixels; 0 = the camera's, 960 for a set");
  command.AddDouble("turn_deg", &o.turn_deg, "one picture: turns the view to the left, degrees");
  command.AddDouble("back", &o.back, "one picture: moves the view back, metres");
  command.AddDouble("up", &o.up, "one picture: moves the view up, metres");
  return command.Run(argc, argv,
                     [&o](const Command::Context& context) { RenderModel(o, context); });
}
