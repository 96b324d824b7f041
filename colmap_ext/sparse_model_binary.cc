// cameras.bin, images.bin, points3D.bin: little-endian, packed, each a count (uint64) and its
// entries.

#include <cmath>
#include <cstring>

#include "colmap_ext/sparse_model_files.h"
#include "core/error.h"

namespace roomtex {
namespace {

constexpr char kDamagedRemedy[] = "The file is cut off or damaged: write it again with COLMAP";

// Takes numbers from the front of the bytes; an InputError where they end.
class ByteReader {
 public:
  ByteReader(const std::string& bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  long long position() const { return static_cast<long long>(position_); }
  size_t left() const { return bytes_.size() - position_; }

  template <typename T>
  T Take(const char* what) {
    Need(sizeof(T), what);
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }

  double TakeFinite(const char* what) {
    const double value = Take<double>(what);
    if (!std::isfinite(value)) Fail(position() - 8, std::string(what) + " is not a finite number");
    return value;
  }

  // A count of entries that take at least min_size bytes each, believed only if they fit.
  size_t TakeCount(const char* what, size_t min_size) {
    const uint64_t count = Take<uint64_t>(what);
    if (count > left() / min_size) {
      Fail(position() - 8, "promises " + std::to_string(count) + " " + what + ", but only " +
                               std::to_string(left()) + " bytes follow");
    }
    return static_cast<size_t>(count);
  }

  std::string TakeName() {
    const void* end = left() > 0 ? std::memchr(bytes_.data() + position_, 0, left()) : nullptr;
    if (end == nullptr) Fail(position(), "ends within the name of an image");
    const size_t length = static_cast<const char*>(end) - (bytes_.data() + position_);
    std::string name = bytes_.substr(position_, length);
    position_ += length + 1;
    return name;
  }

  void ExpectEnd() const {
    if (left() > 0) {
      Fail(position(), std::to_string(left()) + " bytes follow the last entry, expected none");
    }
  }

  [[noreturn]] void Fail(long long byte, const std::string& finding) const {
    throw InputError(path_, BytePosition(byte), finding, kDamagedRemedy);
  }

 private:
  void Need(size_t size, const char* what) const {
    if (left() < size) Fail(position(), std::string("ends where ") + what + " should follow");
  }

  const std::string& bytes_;
  const std::string& path_;
  size_t position_ = 0;
};

PlacedList<Camera> ParseCameras(const std::string& bytes, const std::string& path) {
  ByteReader reader(bytes, path);
  const size_t count = reader.TakeCount("cameras", 4 + 4 + 8 + 8 + 2 * 8);
  PlacedList<Camera> cameras(count);
  for (Placed<Camera>& placed : cameras) {
    placed.position = reader.position();
    Camera& camera = placed.entry;
    placed.id = camera.camera_id = reader.Take<uint32_t>("a camera's id");
    const int32_t model_id = reader.Take<int32_t>("a camera's model");
    const int num_params = NumCameraParams(model_id);
    if (num_params < 0) {
      throw InputError(path, BytePosition(placed.position),
                       "camera " + std::to_string(camera.camera_id) + " has the model id " +
                           std::to_string(model_id) + ", expected 0 to " +
                           std::to_string(kNumCameraModels - 1),
                       "Use one of COLMAP's camera models SIMPLE_PINHOLE to EQUIRECTANGULAR");
    }
    camera.model = static_cast<CameraModel>(model_id);
    const uint64_t width = reader.Take<uint64_t>("a camera's width");
    const uint64_t height = reader.Take<uint64_t>("a camera's height");
    if (width > INT32_MAX || height > INT32_MAX) {
      reader.Fail(placed.position, "camera " + std::to_string(camera.camera_id) +
                                       " has the image size " + std::to_string(width) + " x " +
                                       std::to_string(height));
    }
    camera.width = static_cast<int>(width);
    camera.height = static_cast<int>(height);
    camera.params.resize(num_params);
    for (double& param : camera.params) param = reader.TakeFinite("a camera's parameter");
  }
  reader.ExpectEnd();
  return cameras;
}

PlacedList<SparseImage> ParseImages(const std::string& bytes, const std::string& path) {
  ByteReader reader(bytes, path);
  const size_t count = reader.TakeCount("images", 4 + 7 * 8 + 4 + 1 + 8);
  PlacedList<SparseImage> images(count);
  for (Placed<SparseImage>& placed : images) {
    placed.position = reader.position();
    SparseImage& image = placed.entry;
    placed.id = image.image_id = reader.Take<uint32_t>("an image's id");
    double qvec[4], tvec[3];
    for (double& value : qvec) value = reader.Take<double>("an image's pose");
    for (double& value : tvec) value = reader.Take<double>("an image's pose");
    image.cam_from_model = PoseFromNumbers(qvec, tvec, path, BytePosition(placed.position));
    image.camera_id = reader.Take<uint32_t>("an image's camera");
    image.name = reader.TakeName();
    const size_t num_points2d = reader.TakeCount("keypoints of an image", 2 * 8 + 8);
    image.points2d.resize(num_points2d);
    image.point3d_ids.resize(num_points2d);
    for (size_t i = 0; i < num_points2d; ++i) {
      image.points2d[i].x() = reader.TakeFinite("a keypoint");
      image.points2d[i].y() = reader.TakeFinite("a keypoint");
      image.point3d_ids[i] = reader.Take<uint64_t>("the point of a keypoint");
    }
  }
  reader.ExpectEnd();
  return images;
}

PlacedList<SparsePoint> ParsePoints(const std::string& bytes, const std::string& path) {
  ByteReader reader(bytes, path);
  const size_t count = reader.TakeCount("points", 8 + 3 * 8 + 3 + 8 + 8);
  PlacedList<SparsePoint> points(count);
  for (Placed<SparsePoint>& placed : points) {
    placed.position = reader.position();
    SparsePoint& point = placed.entry;
    placed.id = reader.Take<uint64_t>("a point's id");
    for (int k = 0; k < 3; ++k) point.x_in_model[k] = reader.TakeFinite("a point's position");
    for (int k = 0; k < 3; ++k) point.color[k] = reader.Take<uint8_t>("a point's colour");
    point.error = reader.Take<double>("a point's error");
    if (!std::isfinite(point.error)) point.error = -1;
    point.track.resize(reader.TakeCount("track elements", 4 + 4));
    for (TrackElement& element : point.track) {
      element.image_id = reader.Take<uint32_t>("a track element");
      element.point2d_index = reader.Take<uint32_t>("a track element");
    }
  }
  reader.ExpectEnd();
  return points;
}

// Collects bytes and hands them on in pieces of about a megabyte.
class ByteWriter {
 public:
  explicit ByteWriter(const SparseModelFormat::Write& write) : write_(write) {}

  template <typename T>
  void Put(const T& value) {
    piece_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    if (piece_.size() >= (1u << 20)) Flush();
  }
  void PutName(const std::string& name) { piece_.append(name.c_str(), name.size() + 1); }
  void Flush() {
    write_(piece_);
    piece_.clear();
  }

 private:
  const SparseModelFormat::Write& write_;
  std::string piece_;
};

void WriteCameras(const SparseModel& model, const SparseModelFormat::Write& write) {
  ByteWriter writer(write);
  writer.Put<uint64_t>(model.cameras.size());
  for (const auto& [id, camera] : model.cameras) {
    writer.Put<uint32_t>(id);
    writer.Put<int32_t>(static_cast<int32_t>(camera.model));
    writer.Put<uint64_t>(camera.width);
    writer.Put<uint64_t>(camera.height);
    for (const double param : camera.params) writer.Put<double>(param);
  }
  writer.Flush();
}

void WriteImages(const SparseModel& model, const SparseModelFormat::Write& write) {
  ByteWriter writer(write);
  writer.Put<uint64_t>(model.images.size());
  for (const auto& [id, image] : model.images) {
    writer.Put<uint32_t>(id);
    const Rigid& pose = image.cam_from_model;
    writer.Put<double>(pose.rotation.w());
    writer.Put<double>(pose.rotation.x());
    writer.Put<double>(pose.rotation.y());
    writer.Put<double>(pose.rotation.z());
    for (int k = 0; k < 3; ++k) writer.Put<double>(pose.translation[k]);
    writer.Put<uint32_t>(image.camera_id);
    writer.PutName(image.name);
    writer.Put<uint64_t>(image.points2d.size());
    for (size_t i = 0; i < image.points2d.size(); ++i) {
      writer.Put<double>(image.points2d[i].x());
      writer.Put<double>(image.points2d[i].y());
      writer.Put<uint64_t>(image.point3d_ids[i]);
    }
  }
  writer.Flush();
}

void WritePoints(const SparseModel& model, const SparseModelFormat::Write& write) {
  ByteWriter writer(write);
  writer.Put<uint64_t>(model.points.size());
  for (const auto& [id, point] : model.points) {
    writer.Put<uint64_t>(id);
    for (int k = 0; k < 3; ++k) writer.Put<double>(point.x_in_model[k]);
    for (int k = 0; k < 3; ++k) writer.Put<uint8_t>(point.color[k]);
    writer.Put<double>(point.error);
    writer.Put<uint64_t>(point.track.size());
    for (const TrackElement& element : point.track) {
      writer.Put<uint32_t>(element.image_id);
      writer.Put<uint32_t>(element.point2d_index);
    }
  }
  writer.Flush();
}

FrameOfImage ParseFrames(const std::string& bytes, const std::string& path) {
  constexpr int32_t kCameraSensor = 0;
  ByteReader reader(bytes, path);
  const size_t count = reader.TakeCount("frames", 4 + 4 + 7 * 8 + 4);
  FrameOfImage frame_of_image;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t frame_id = reader.Take<uint32_t>("a frame's id");
    reader.Take<uint32_t>("a frame's rig");
    // COLMAP writes the pose of an image from this one: it stands there, too.
    for (int k = 0; k < 7; ++k) reader.Take<double>("a frame's pose");
    const uint32_t num_images = reader.Take<uint32_t>("a frame's number of images");
    for (uint32_t k = 0; k < num_images; ++k) {
      const int32_t sensor = reader.Take<int32_t>("a sensor of a frame");
      reader.Take<uint32_t>("a sensor of a frame");
      const uint64_t image_id = reader.Take<uint64_t>("an image of a frame");
      if (sensor == kCameraSensor) frame_of_image[static_cast<uint32_t>(image_id)] = frame_id;
    }
  }
  reader.ExpectEnd();
  return frame_of_image;
}

std::string Position(long long byte) { return BytePosition(byte); }

}  // namespace

const SparseModelFormat& SparseModelBinary() {
  static const SparseModelFormat format = {".bin",       Position,    ParseCameras,
                                           ParseImages,  ParsePoints, ParseFrames,
                                           WriteCameras, WriteImages, WritePoints};
  return format;
}

}  // namespace roomtex
