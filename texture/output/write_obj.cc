#include "texture/output/write_obj.h"

#include <charconv>

#include "core/output_file.h"
#include "texture/output/textured_parts.h"
#include "texture/output/write_texture.h"

namespace roomtex {
namespace {

// Gathers text and hands it on in large pieces.
class TextSink {
 public:
  explicit TextSink(std::ostream* stream) : stream_(stream) {}
  ~TextSink() { Flush(); }

  TextSink& operator<<(const std::string& text) {
    text_ += text;
    if (text_.size() > (1 << 20)) Flush();
    return *this;
  }
  TextSink& Number(double value, int digits) {
    char buffer[64];
    const auto end =
        std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed, digits);
    text_.append(buffer, end.ptr);
    return *this;
  }
  TextSink& Number(size_t value) {
    text_ += std::to_string(value);
    return *this;
  }

 private:
  void Flush() {
    stream_->write(text_.data(), static_cast<std::streamsize>(text_.size()));
    text_.clear();
  }
  std::ostream* stream_;
  std::string text_;
};

// Number of every sample's vertex, from 1 as OBJ counts; 0 = no part uses it. Advances *next.
std::vector<size_t> NumberVertices(size_t num_points, const std::vector<TexturedPart>& parts,
                                   size_t* next) {
  std::vector<size_t> numbers(num_points, 0);
  for (const TexturedPart& part : parts) {
    for (const int vertex : part.vertices) numbers[vertex] = 1;
  }
  for (size_t& number : numbers) {
    if (number > 0) number = (*next)++;
  }
  return numbers;
}

// The same of a cloud, which has no parts: every measured point.
std::vector<size_t> NumberPoints(const Scan& cloud, size_t* next) {
  std::vector<size_t> numbers(cloud.points.size(), 0);
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!cloud.IsMissing(static_cast<int>(i))) numbers[i] = (*next)++;
  }
  return numbers;
}

void WriteVertices(const Scan& scan, const ColoredScan& colored, const std::vector<size_t>& numbers,
                   bool with_colors, TextSink* sink) {
  constexpr int kMicrometres = 6;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (numbers[i] == 0) continue;
    *sink << "v";
    for (int k = 0; k < 3; ++k) (*sink << " ").Number(scan.points[i][k], kMicrometres);
    if (with_colors) {
      for (const uint8_t value : colored.samples.rgb[i]) (*sink << " ").Number(value / 255.0, 4);
    }
    *sink << "\n";
  }
}

void WriteFaces(const TexturedPart& part, const std::vector<size_t>& numbers, size_t first_uv,
                TextSink* sink) {
  for (size_t i = 0; i < part.corners.size(); i += 3) {
    *sink << "f";
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t corner = part.corners[i + k];
      (*sink << " ").Number(numbers[part.vertices[corner]]);
      if (!part.uv.empty()) (*sink << "/").Number(first_uv + corner);
    }
    *sink << "\n";
  }
}

void WriteImage(const cv::Mat& image, bool jpeg, const std::string& path) {
  jpeg ? WriteJpeg(image, path) : WritePng(image, path);
}

}  // namespace

void WriteColoredObj(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::vector<std::vector<TexturedPart>>& parts, bool jpeg,
                     const std::function<std::string(const std::string&)>& file_path) {
  OutputFile obj(file_path("model.obj")), mtl(file_path("model.mtl"));
  mtl.stream() << "# roomtex-texture: photos on the scan; they hold the light already\n";
  int num_images = 0;
  bool has_plain = false;
  {
    TextSink sink(&obj.stream());
    const Eigen::Vector3d& up = scans.at(0).up;
    sink << "# roomtex-texture: scan frame, metres; the up axis stays the scan's\n# roomtex up";
    for (int k = 0; k < 3; ++k) (sink << " ").Number(up[k], 6);
    sink << "\nmtllib model.mtl\n";
    size_t next_vertex = 1, next_uv = 1;
    for (size_t s = 0; s < scans.size(); ++s) {
      const bool textured = scans[s].organised || !colored[s].atlas.empty();
      (sink << "o scan_").Number(s) << "\n";
      const std::vector<size_t> numbers =
          scans[s].kind() == Scan::Kind::kCloud
              ? NumberPoints(scans[s], &next_vertex)
              : NumberVertices(scans[s].points.size(), parts[s], &next_vertex);
      WriteVertices(scans[s], colored[s], numbers, !textured, &sink);
      for (const TexturedPart& part : parts[s]) {
        if (textured) {
          const std::string name = "model_" + std::to_string(num_images++);
          const std::string image = name + (jpeg ? ".jpg" : ".png");
          WriteImage(PartImage(scans[s], colored[s], part), jpeg, file_path(image));
          mtl.stream() << "newmtl " << name << "\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd "
                       << image << "\n";
          sink << "usemtl " << name << "\n";
        } else {
          // A material holds on over the next object, textures and all.
          if (!has_plain)
            mtl.stream() << "newmtl vertex_colors\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 0\n";
          has_plain = true;
          sink << "usemtl vertex_colors\n";
        }
        for (const Eigen::Vector2f& uv : part.uv) {  // OBJ counts rows from below
          (sink << "vt ").Number(uv.x(), 7) << " ";
          sink.Number(1.0 - uv.y(), 7) << "\n";
        }
        WriteFaces(part, numbers, next_uv, &sink);
        next_uv += part.uv.size();
      }
    }
  }
  mtl.Commit();
  obj.Commit();
}

}  // namespace roomtex
