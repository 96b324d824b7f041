// roomtex-evaluate-texture: texture.png of a simulated room against the true colours between the
// samples, texel by texel. Not installed. The room is simulated again from its seed.
// Prints JSON on stdout, which is in the report, too; --output_path writes a cut-out, truth on the
// left.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/simulation/simulated_room.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/photo.h"
#include "core/picture_file.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

struct EvaluateOptions {
  std::string texture_path, output_path, crop;
  SimulatedRoomOptions room;
};

// Linear light, b, g, r.
cv::Mat3f Linear(const cv::Mat3b& image) {
  const auto& linear = LinearFromSrgbByte();
  cv::Mat3f result(image.size());
  std::transform(image.begin(), image.end(), result.begin(), [&](const cv::Vec3b& c) {
    return cv::Vec3f(linear[c[0]], linear[c[1]], linear[c[2]]);
  });
  return result;
}

float Sum(const cv::Vec3f& v) { return v[0] + v[1] + v[2]; }

// sRGB 0..1 after one gain for all: the median of the ratios of light.
void Compare(const cv::Mat3f& truth, const cv::Mat3f& texture, float* gain, double* psnr,
             double* wrong) {
  std::vector<float> ratios;
  for (int i = 0; i < static_cast<int>(truth.total()); i += 7) {
    const float have = Sum(texture(i / truth.cols, i % truth.cols));
    if (have > 0.05f) ratios.push_back(Sum(truth(i / truth.cols, i % truth.cols)) / have);
  }
  if (ratios.empty()) throw UsageError("the texture is black");
  *gain = Median(&ratios);
  double squares = 0, count = 0, num_wrong = 0;
  auto t = truth.begin();
  for (auto m = texture.begin(); m != texture.end(); ++m, ++t) {
    if (Sum(*m) == 0 || Sum(*t) == 0) continue;
    double largest = 0;
    for (int k = 0; k < 3; ++k) {
      const double difference =
          SrgbFromLinear(std::min(1.0f, *gain * (*m)[k])) - SrgbFromLinear((*t)[k]);
      squares += difference * difference;
      largest = std::max(largest, std::abs(difference));
    }
    num_wrong += largest > 0.1;
    ++count;
  }
  *psnr = -10 * std::log10(squares / (3 * count));
  *wrong = num_wrong / count;
}

void Evaluate(EvaluateOptions options, const Command::Context& context) {
  const cv::Mat3b image = ReadPhoto(options.texture_path);
  const int base = options.room.scan_columns;
  if (image.cols % base != 0) throw UsageError("--scan_columns does not fit the texture");
  options.room.scan_columns = image.cols;
  options.room.scan_rows = image.rows;
  options.room.missing_samples = false;
  const std::vector<Eigen::Vector3f> colors = SimulatedRoom(options.room).TrueColors();
  cv::Mat3f truth(image.size());
  for (size_t i = 0; i < colors.size(); ++i) {
    truth(static_cast<int>(i) / image.cols, static_cast<int>(i) % image.cols) =
        cv::Vec3f(colors[i][2], colors[i][1], colors[i][0]);
  }
  const cv::Mat3f texture = Linear(image);
  float gain;
  double psnr, wrong;
  Compare(truth, texture, &gain, &psnr, &wrong);
  Json& report = context.report.keys();
  report["scale"] = image.cols / base;
  report["gain"] = std::round(1e4 * gain) / 1e4;
  report["psnr_db"] = std::round(1e3 * psnr) / 1e3;
  report["share_wrong"] = std::round(1e5 * wrong) / 1e5;
  std::printf("%s\n", report.dump().c_str());
  if (options.output_path.empty()) return;
  cv::Rect crop(0, 0, image.cols, image.rows);
  if (!options.crop.empty() && std::sscanf(options.crop.c_str(), "%d,%d,%d,%d", &crop.x, &crop.y,
                                           &crop.width, &crop.height) != 4) {
    throw UsageError("--crop must be x,y,width,height");
  }
  crop &= cv::Rect(0, 0, image.cols, image.rows);
  cv::Mat3b picture(crop.height, 2 * crop.width + 8, cv::Vec3b(255, 0, 255));
  for (int y = 0; y < crop.height; ++y) {
    for (int x = 0; x < crop.width; ++x) {
      for (int k = 0; k < 3; ++k) {
        picture(y, x)[k] = SrgbByteFromLinear(truth(crop.y + y, crop.x + x)[k]);
        picture(y, x + crop.width + 8)[k] =
            SrgbByteFromLinear(std::min(1.0f, gain * texture(crop.y + y, crop.x + x)[k]));
      }
    }
  }
  WritePictureFile(options.output_path, picture);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  EvaluateOptions o;
  o.room.shading = true;
  Command command("roomtex-evaluate-texture",
                  "Compares a texture.png with the truth of a simulated room.",
                  "roomtex-evaluate-texture --texture_path textured/texture.png --seed 1");
  command.AddInputPath("texture_path", &o.texture_path,
                       "texture.png, made with --Texture.unseen black");
  command.AddInt("seed", &o.room.random_seed, "of roomtex-simulate");
  command.AddInt("scan_columns", &o.room.scan_columns, "of roomtex-simulate");
  command.AddBool("shading", &o.room.shading, "of roomtex-simulate");
  command.AddString("crop", &o.crop, "x,y,width,height of the cut-out, texels");
  command.AddOutputPath("output_path", &o.output_path, "picture: truth beside texture",
                        Command::Kind::kOptional);
  return command.Run(argc, argv, [&o](const Command::Context& context) { Evaluate(o, context); });
}
