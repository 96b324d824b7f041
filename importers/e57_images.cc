#include "importers/e57_images.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/text.h"
#include "core/utf8.h"
#include "importers/e57_document.h"

namespace fs = std::filesystem;
namespace roomtex {
namespace {

constexpr int64_t kBlobHeaderSize = 16;  // bytes
constexpr int64_t kCopyAtOnce = 1 << 20;
constexpr size_t kLongestName = 100;  // bytes of a file name
constexpr int kFaceQuality = 96;
// A picture all around is twice as wide as high, but for this share.
constexpr double kMaxPanoramaError = 0.01;

// COLMAP's camera (y down, looks along z) from the standard's (y up, looks along -z).
const Eigen::Quaterniond kCamFromPinhole(0, 1, 0, 0);

// COLMAP's panorama (z in the middle, x right, y down) from the standard's: the middle looks along
// x, azimuths grow to the left, z is up.
Eigen::Quaterniond CamFromSphere() {
  Eigen::Matrix3d rotation;
  rotation << 0, -1, 0,  //
      0, 0, -1,          //
      1, 0, 0;
  return Eigen::Quaterniond(rotation);
}

std::string KindName(E57Image::Kind kind) {
  switch (kind) {
    case E57Image::Kind::kPinhole:
      return "pinhole";
    case E57Image::Kind::kSpherical:
      return "spherical";
    case E57Image::Kind::kCylindrical:
      return "cylindrical";
    case E57Image::Kind::kVisual:
      break;
  }
  return "visual";
}

// The name without folders, endings of pictures and what file systems do not take.
std::string FileStem(const std::string& name) {
  std::string stem;
  for (size_t i = 0; i < name.size();) {
    const size_t count = Utf8Bytes(name, i);
    if (i + std::max<size_t>(count, 1) > kLongestName) break;
    const bool fits = count > 1 || std::isalnum(static_cast<unsigned char>(name[i])) ||
                      std::string_view("-_.+").find(name[i]) != std::string_view::npos;
    stem += count > 0 && fits ? name.substr(i, count) : "_";
    i += std::max<size_t>(count, 1);
  }
  for (const char* ending : {".jpg", ".jpeg", ".png", ".JPG", ".PNG"}) {
    const size_t size = std::string_view(ending).size();
    if (stem.size() > size && stem.compare(stem.size() - size, size, ending) == 0) {
      stem.resize(stem.size() - size);
    }
  }
  while (!stem.empty() && (stem.front() == '.' || stem.front() == ' ' || stem.front() == '-')) {
    stem.erase(0, 1);
  }
  while (!stem.empty() && (stem.back() == ' ' || stem.back() == '.')) stem.pop_back();
  return stem.empty() ? "image" : stem;
}

// A name that none of `taken` has, and adds it there. Capitals count as small letters, as some file
// systems have it.
std::string TakeName(const std::string& stem, const std::string& ending,
                     std::set<std::string>* taken) {
  for (int number = 1;; ++number) {
    const std::string name = stem + (number > 1 ? "_" + std::to_string(number) : "");
    if (taken->insert(LowerCase(name)).second) return name + ending;
  }
}

// Calls take(bytes, count) for all of the blob, piece by piece. what: "a picture".
template <typename Take>
void ReadBlob(const E57Pages& pages, int64_t section, int64_t num_bytes, const std::string& what,
              const Take& take) {
  char header[kBlobHeaderSize];
  pages.Read(section, header, kBlobHeaderSize);
  const auto size = LittleEndian<uint64_t>(header + 8);
  // Some count the padding or leave out the header: at least the picture is there.
  if (header[0] != 0 || size < static_cast<uint64_t>(num_bytes)) {
    throw InputError(pages.path(), pages.Position(section),
                     "begins with " + std::to_string(static_cast<unsigned char>(header[0])) +
                         " and " + std::to_string(size) + " bytes, expected a blob (0) of " +
                         std::to_string(num_bytes) + " bytes and more",
                     kDamaged);
  }
  if (num_bytes > pages.logical_size() - section - kBlobHeaderSize) {
    throw InputError(pages.path(), pages.Position(section),
                     "says " + what + " of " + std::to_string(num_bytes) +
                         " bytes, which the file does not have",
                     kDamaged);
  }
  std::vector<char> bytes(static_cast<size_t>(std::min(kCopyAtOnce, num_bytes)));
  for (int64_t at = 0; at < num_bytes; at += kCopyAtOnce) {
    const int64_t count = std::min(kCopyAtOnce, num_bytes - at);
    pages.Read(section + kBlobHeaderSize + at, bytes.data(), count);
    take(bytes.data(), static_cast<std::streamsize>(count));
  }
}

void CopyPicture(const E57Pages& pages, const E57Image& image, const std::string& path) {
  OutputFile output(path);
  ReadBlob(
      pages, image.section, image.num_bytes, "a picture",
      [&output](const char* bytes, std::streamsize count) { output.stream().write(bytes, count); });
  output.Commit();
}

std::vector<char> BytesOfBlob(const E57Pages& pages, int64_t section, int64_t num_bytes,
                              const std::string& what) {
  std::vector<char> bytes;
  ReadBlob(pages, section, num_bytes, what, [&bytes](const char* more, std::streamsize count) {
    bytes.insert(bytes.end(), more, more + count);
  });
  return bytes;
}

// Empty if that is no picture.
cv::Mat Decoded(const std::vector<char>& bytes, int flags) {
  try {
    return cv::imdecode(bytes, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    return {};
  }
}

// bytes: of the picture's file. 8-bit BGR and alpha, which is 0 where the mask says that the
// picture shows nothing; empty where no mask says so. fits: false if picture or mask cannot be
// decoded, or differ in size.
cv::Mat MaskedPicture(const std::vector<char>& bytes, const E57Pages& pages, const E57Image& image,
                      bool* fits) {
  const cv::Mat picture = Decoded(bytes, cv::IMREAD_COLOR);
  const cv::Mat mask = Decoded(
      BytesOfBlob(pages, image.mask_section, image.num_mask_bytes, "a mask"), cv::IMREAD_GRAYSCALE);
  *fits = !picture.empty() && mask.size() == picture.size();
  if (!*fits || cv::countNonZero(mask == 0) == 0) return {};
  cv::Mat with_alpha;
  cv::cvtColor(picture, with_alpha, cv::COLOR_BGR2BGRA);
  cv::insertChannel(mask > 0, with_alpha, 3);
  return with_alpha;
}

void WritePicture(const cv::Mat& picture, const std::string& path) {
  std::vector<uchar> bytes;
  cv::imencode(fs::path(path).extension().string(), picture, bytes,
               {cv::IMWRITE_JPEG_QUALITY, kFaceQuality});
  OutputFile output(path);
  output.stream().write(reinterpret_cast<const char*>(bytes.data()),
                        static_cast<std::streamsize>(bytes.size()));
  output.Commit();
}

class ImageExtractor {
 public:
  ImageExtractor(const std::string& path, const std::string& folder, const E57ImageOptions& options)
      : options_(options),
        folder_(folder),
        pages_(path, options.check),
        images_(ReadE57Document(pages_).images) {
    if (images_.empty()) {
      throw InputError(path, "", "holds no photos (images2D)",
                       "Export the scans with their photos, or leave out --images_path");
    }
  }

  E57Photos Run(Progress* progress) {
    MakeFolder(folder_);
    progress->Stage("write photos", static_cast<int>(images_.size()));
    for (const E57Image& image : images_) {
      Extract(image);
      progress->Tick();
    }
    if (!result_.posed.empty()) {
      WritePhotoModel(result_.posed, (fs::path(folder_) / "sparse").string());
    }
    return std::move(result_);
  }

 private:
  void Extract(const E57Image& image) {
    if (image.num_bytes == 0) {
      result_.notes.push_back("the photo " + Quoted(image.name) + " has no picture");
      return;
    }
    bool mask_fits = true;
    std::vector<char> bytes;
    cv::Mat masked;
    if (image.num_mask_bytes > 0) {
      bytes = BytesOfBlob(pages_, image.section, image.num_bytes, "a picture");
      masked = MaskedPicture(bytes, pages_, image, &mask_fits);
    }
    const std::string file =
        TakeName(FileStem(image.name), image.is_png || !masked.empty() ? ".png" : ".jpg", &taken_);
    const std::string path = (fs::path(folder_) / file).string();
    if (masked.empty()) {
      CopyPicture(pages_, image, path);
    } else {
      WritePicture(masked, path);
      CopyExif(bytes, path);
    }
    if (!mask_fits) {
      result_.notes.push_back(file + " has a mask that does not fit it, which is left out");
    }
    const auto [width, height] = ReadPhotoSize(path);
    const std::string why_not = AddToModel(image, file, width, height);
    result_.photos.push_back({file, image.name, KindName(image.kind), why_not.empty()});
    if (!why_not.empty()) result_.notes.push_back(file + " is not in the model: " + why_not);
  }

  // Why the photo cannot be in the model, "" if it is.
  std::string AddToModel(const E57Image& image, const std::string& file, int width, int height) {
    if (image.kind == E57Image::Kind::kVisual) return "nothing is said of its camera";
    if (image.kind == E57Image::Kind::kCylindrical) return "it is a cylinder";
    if (!image.file_from_camera) return "it has no pose";
    if (width <= 0 || height <= 0) return "its picture cannot be decoded";
    Rigid scan_from_camera = *image.file_from_camera;
    scan_from_camera.translation *= options_.meters_per_unit;
    const Rigid camera_from_scan = scan_from_camera.Inverse();
    if (image.kind == E57Image::Kind::kPinhole) {
      return AddPinhole(image, file, camera_from_scan, width, height);
    }
    if (!(std::abs(0.5 * width / height - 1) <= kMaxPanoramaError) || IsPartOfSphere(image)) {
      return "it is no panorama all around, twice as wide as high";
    }
    const Rigid cam_from_scan = Rigid{CamFromSphere(), Eigen::Vector3d::Zero()} * camera_from_scan;
    Camera camera;
    camera.model = CameraModel::kEquirectangular;
    camera.width = width;
    camera.height = height;
    camera.params = {static_cast<double>(width), static_cast<double>(height)};
    if (options_.cut_panoramas) return AddFaces({file, camera, cam_from_scan});
    result_.posed.push_back({file, camera, cam_from_scan});
    return "";
  }

  // Both angles say so: there are programs that write one of them wrong.
  static bool IsPartOfSphere(const E57Image& image) {
    constexpr double kWhole = 0.9;
    const double azimuths = image.pixel_width * static_cast<double>(image.width);
    const double elevations = image.pixel_height * static_cast<double>(image.height);
    return azimuths > 0 && azimuths < kWhole * 2 * kPi && elevations > 0 &&
           elevations < kWhole * kPi;
  }

  std::string AddPinhole(const E57Image& image, const std::string& file,
                         const Rigid& camera_from_scan, int width, int height) {
    Camera camera;
    camera.model = CameraModel::kPinhole;
    camera.width = static_cast<int>(std::clamp<int64_t>(image.width, 0, 1 << 30));
    camera.height = static_cast<int>(std::clamp<int64_t>(image.height, 0, 1 << 30));
    // The standard does not say where in its upper-left pixel the picture begins: (width - 1) / 2
    // is the middle of a picture whose first pixel has its centre at 0.
    const auto from_corner = [](double position, int size) {
      return position == 0.5 * (size - 1) ? position + 0.5 : position;
    };
    camera.params = {image.focal_length / image.pixel_width,
                     image.focal_length / image.pixel_height,
                     from_corner(image.principal_point_x, camera.width),
                     from_corner(image.principal_point_y, camera.height)};
    std::vector<std::string> problems = camera.Problems();
    const bool other_size = camera.width != width || camera.height != height;
    if (problems.empty() && other_size) {
      camera.Resize(width, height);
      problems = camera.Problems();
    }
    if (!problems.empty()) return "its camera cannot be used (" + problems[0] + ")";
    if (image.has_distortion) {
      result_.notes.push_back(file +
                              " has a lens distortion (an extension of E57), which is not read");
    }
    result_.posed.push_back(
        {file, camera, Rigid{kCamFromPinhole, Eigen::Vector3d::Zero()} * camera_from_scan});
    return "";
  }

  std::string AddFaces(const PosedPhoto& panorama) {
    const std::string path = (fs::path(folder_) / panorama.name).string();
    cv::Mat picture;
    cv::Mat1b transparent;
    try {
      picture = ReadPhoto(path);
      transparent = ReadTransparency(path, PhotoPixels::kAsStored);
    } catch (const InputError&) {
      return "its picture cannot be decoded";
    }
    const std::string stem = fs::path(panorama.name).stem().string();
    MakeFolder((fs::path(folder_) / stem).string());
    const Camera camera = FaceCamera(panorama.camera, options_.faces);
    int number = 0;
    for (const Eigen::Quaterniond& rotation : FaceRotations(options_.faces)) {
      const std::string name =
          stem + "/face_" + std::to_string(++number) + (transparent.empty() ? ".jpg" : ".png");
      cv::Mat face = CutFace(picture, camera, rotation);
      if (!transparent.empty()) {
        cv::cvtColor(face, face, cv::COLOR_BGR2BGRA);
        cv::insertChannel(CutFace(transparent, camera, rotation) == 0, face, 3);
      }
      WritePicture(face, (fs::path(folder_) / name).string());
      result_.posed.push_back(
          {name, camera, Rigid{rotation, Eigen::Vector3d::Zero()} * panorama.cam_from_scan});
    }
    return "";
  }

  E57ImageOptions options_;
  std::string folder_;
  E57Pages pages_;
  std::vector<E57Image> images_;
  std::set<std::string> taken_ = {"sparse"};
  E57Photos result_;
};

template <typename Number>
void Put(const Number& number, std::ostream* stream) {
  stream->write(reinterpret_cast<const char*>(&number), sizeof(number));
}

}  // namespace

E57Photos ExtractE57Images(const std::string& path, const std::string& folder,
                           const E57ImageOptions& options, Progress* progress) {
  return ImageExtractor(path, folder, options).Run(progress);
}

void WritePhotoModel(const std::vector<PosedPhoto>& photos, const std::string& folder) {
  MakeFolder(folder);
  std::vector<Camera> cameras;
  std::vector<uint32_t> camera_of_photo;  // from 1
  for (const PosedPhoto& photo : photos) {
    const auto same = std::find_if(cameras.begin(), cameras.end(), [&](const Camera& camera) {
      return camera.model == photo.camera.model && camera.width == photo.camera.width &&
             camera.height == photo.camera.height && camera.params == photo.camera.params;
    });
    camera_of_photo.push_back(static_cast<uint32_t>(same - cameras.begin()) + 1);
    if (same == cameras.end()) cameras.push_back(photo.camera);
  }
  // The layouts are those of COLMAP, colmap.github.io/format.html.
  OutputFile camera_file((fs::path(folder) / "cameras.bin").string());
  Put(static_cast<uint64_t>(cameras.size()), &camera_file.stream());
  for (size_t i = 0; i < cameras.size(); ++i) {
    Put(static_cast<uint32_t>(i + 1), &camera_file.stream());
    Put(static_cast<int32_t>(cameras[i].model), &camera_file.stream());
    Put(static_cast<uint64_t>(cameras[i].width), &camera_file.stream());
    Put(static_cast<uint64_t>(cameras[i].height), &camera_file.stream());
    for (const double param : cameras[i].params) Put(param, &camera_file.stream());
  }
  OutputFile image_file((fs::path(folder) / "images.bin").string());
  Put(static_cast<uint64_t>(photos.size()), &image_file.stream());
  for (size_t i = 0; i < photos.size(); ++i) {
    Put(static_cast<uint32_t>(i + 1), &image_file.stream());
    const Eigen::Vector4d wxyz = WxyzFromQuaternion(photos[i].cam_from_scan.rotation);
    for (int k = 0; k < 4; ++k) Put(wxyz[k], &image_file.stream());
    for (int k = 0; k < 3; ++k) Put(photos[i].cam_from_scan.translation[k], &image_file.stream());
    Put(camera_of_photo[i], &image_file.stream());
    image_file.stream() << photos[i].name << '\0';
    Put(uint64_t{0}, &image_file.stream());
  }
  OutputFile point_file((fs::path(folder) / "points3D.bin").string());
  Put(uint64_t{0}, &point_file.stream());
  camera_file.Commit();
  image_file.Commit();
  point_file.Commit();
}

}  // namespace roomtex
