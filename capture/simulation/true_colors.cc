#include "capture/simulation/true_colors.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "capture/simulation/camera_faults.h"
#include "core/output_file.h"
#include "core/photo.h"

namespace roomtex {
namespace {

using Bytes = Eigen::Matrix<uint8_t, 3, 1>;

Bytes SrgbBytes(const Eigen::Vector3f& linear) {
  return {SrgbByteFromLinear(linear.x()), SrgbByteFromLinear(linear.y()),
          SrgbByteFromLinear(linear.z())};
}

struct PhotoPixel {
  Eigen::Vector3f linear;  // r, g, b
  bool clipped;
};

// What the camera made of the light, to be taken back.
class PhotoTone {
 public:
  PhotoTone(const SimulatedRoom& room, int photo)
      : gain_(static_cast<float>(std::exp2(room.ExposureEv(photo))) * room.WhiteBalance(photo)),
        vignetting_(room.options().vignetting) {
    const Camera& camera = room.TrueCamera(photo);
    const Eigen::Vector2d size(camera.width, camera.height);
    centre_ = CameraProjection(camera).ImgFromCam(Eigen::Vector3d::UnitZ()).value_or(0.5 * size);
    half_diagonal2_ = size.squaredNorm() / 4;
  }
  // Factors on the light at a position in `img`.
  Eigen::Vector3f GainAt(const Eigen::Vector2f& position) const {
    const double radius2 = (position.cast<double>() - centre_).squaredNorm() / half_diagonal2_;
    return static_cast<float>(VignettingAt(radius2, vignetting_)) * gain_;
  }

 private:
  Eigen::Vector3f gain_;
  double vignetting_;
  Eigen::Vector2d centre_;
  double half_diagonal2_;
};

// Bilinear in linear light; position in `img`.
PhotoPixel LookUp(const cv::Mat& photo, const Eigen::Vector2f& position,
                  const std::array<float, 256>& linear) {
  constexpr int kClipped = 252;  // JPEG smears 255 a little
  const float x = std::clamp(position.x() - 0.5f, 0.0f, static_cast<float>(photo.cols - 1));
  const float y = std::clamp(position.y() - 0.5f, 0.0f, static_cast<float>(photo.rows - 1));
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float s = x - static_cast<float>(column), t = y - static_cast<float>(row);
  PhotoPixel pixel{Eigen::Vector3f::Zero(), false};
  for (int k = 0; k < 4; ++k) {
    const cv::Vec3b& bgr = photo.at<cv::Vec3b>(std::min(row + k / 2, photo.rows - 1),
                                               std::min(column + k % 2, photo.cols - 1));
    const float weight = (k % 2 == 0 ? 1 - s : s) * (k / 2 == 0 ? 1 - t : t);
    for (int channel = 0; channel < 3; ++channel) {
      pixel.linear[channel] += weight * linear[bgr[2 - channel]];
      pixel.clipped = pixel.clipped || bgr[channel] >= kClipped;
    }
  }
  return pixel;
}

// What the photos say of each sample.
struct Sightings {
  std::vector<uint8_t> views;
  std::vector<Eigen::Vector3f> means;  // linear light, EV 0; empty unless asked for
};

Sightings CollectSightings(const SimulatedRoom& room, const TrueSamples& samples,
                           const std::string& photo_folder, bool reachable, Progress* progress) {
  constexpr float kHardlyAnything = 1e-4f;  // weight of a clipped lookup
  const size_t count = samples.points.size();
  Sightings result;
  result.views.assign(count, 0);
  std::vector<Eigen::Vector4f> sums(reachable ? count : 0, Eigen::Vector4f::Zero());
  const auto linear = ResponseTable::LinearFromByte(room.options().response);
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    progress->Tick();
    // The colours are the plain photos' business.
    if (room.IsPatterned(photo)) continue;
    const std::vector<Eigen::Vector2f> positions = room.TrueSightings(samples, photo);
    cv::Mat image;
    if (reachable) image = ReadPhoto(photo_folder + "/" + room.PhotoName(photo));
    const PhotoTone tone(room, photo);
    for (size_t i = 0; i < count; ++i) {
      if (!(positions[i].x() == positions[i].x())) continue;
      if (result.views[i] < 255) ++result.views[i];
      if (!reachable) continue;
      const PhotoPixel pixel = LookUp(image, positions[i], linear);
      const float weight = pixel.clipped ? kHardlyAnything : 1;
      sums[i].head<3>() += weight * pixel.linear.cwiseQuotient(tone.GainAt(positions[i]));
      sums[i][3] += weight;
    }
  }
  for (const Eigen::Vector4f& sum : sums) {
    result.means.push_back(sum[3] > 0 ? Eigen::Vector3f(sum.head<3>() / sum[3])
                                      : Eigen::Vector3f::Zero());
  }
  return result;
}

class PlyFile {
 public:
  PlyFile(const std::string& path, const std::string& comment, size_t num_vertices, bool cells)
      : file_(path) {
    file_.stream() << "ply\nformat binary_little_endian 1.0\ncomment " << comment
                   << "\nelement vertex " << num_vertices << "\n"
                   << "property float x\nproperty float y\nproperty float z\n"
                      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                   << (cells ? "property uchar cell_red\nproperty uchar cell_green\n"
                               "property uchar cell_blue\n"
                             : "")
                   << "property uchar views\nend_header\n";
  }
  template <typename Column>
  void Write(const Column& column) {
    file_.stream().write(
        reinterpret_cast<const char*>(column.data()),
        static_cast<std::streamsize>(column.size() * sizeof(typename Column::Scalar)));
  }
  void Write(uint8_t value) { file_.stream().put(static_cast<char>(value)); }
  void Commit() { file_.Commit(); }

 private:
  OutputFile file_;
};

}  // namespace

void WriteTrueColors(const SimulatedRoom& room, const std::string& photo_folder, bool reachable,
                     const std::string& folder, Progress* progress) {
  const int num_stations = room.NumStations();
  progress->Stage("truth", num_stations * room.NumPhotos());
  std::vector<Scan> scans;
  size_t num_vertices = 0;
  for (int station = 0; station < num_stations; ++station) {
    scans.push_back(room.MakeScan(station));
    num_vertices += scans.back().points.size() - scans.back().NumMissing();
  }
  PlyFile truth(folder + "/true_colors.ply",
                "the scan points in grid order with their true colour (sRGB, EV 0)", num_vertices,
                true);
  std::optional<PlyFile> means;
  if (reachable) {
    means.emplace(folder + "/reachable.ply",
                  "plain mean of the photos with true places, visibility and tone", num_vertices,
                  false);
  }
  for (int station = 0; station < num_stations; ++station) {
    const Scan& scan = scans[station];
    const TrueSamples samples = room.MakeTrueSamples(station);
    const std::vector<Eigen::Vector3f> colors = room.TrueColors(station);
    const Sightings sightings = CollectSightings(room, samples, photo_folder, reachable, progress);
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      const Eigen::Vector3f point = scan.points[i].cast<float>();
      truth.Write(point);
      truth.Write(SrgbBytes(colors[i]));
      truth.Write(SrgbBytes(samples.cell_colors[i]));
      truth.Write(sightings.views[i]);
      if (!reachable) continue;
      means->Write(point);
      means->Write(SrgbBytes(sightings.means[i]));
      means->Write(sightings.views[i]);
    }
  }
  truth.Commit();
  if (reachable) means->Commit();
}

}  // namespace roomtex
