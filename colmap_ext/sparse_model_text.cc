// cameras.txt, images.txt, points3D.txt: lines of words, `#` starts a comment line.

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <system_error>

#include "colmap_ext/sparse_model_files.h"
#include "core/error.h"

namespace roomtex {
namespace {

constexpr std::string_view kSpaces = " \t\r\v\f";

// The lines of a file, without the spaces around them; knows where it is.
class LineReader {
 public:
  LineReader(const std::string& bytes, const std::string& path) : rest_(bytes), path_(path) {
    if (rest_.substr(0, 3) == "\xEF\xBB\xBF") rest_.remove_prefix(3);  // as editors of Windows
  }

  long line() const { return line_; }

  // The next line that is not a comment; blank ones too. False at the end.
  bool Next(std::string_view* text) {
    while (!rest_.empty()) {
      const size_t length = std::min(rest_.find('\n'), rest_.size());
      std::string_view line = rest_.substr(0, length);
      rest_.remove_prefix(std::min(length + 1, rest_.size()));
      ++line_;
      line.remove_prefix(std::min(line.find_first_not_of(kSpaces), line.size()));
      line.remove_suffix(line.size() - (line.find_last_not_of(kSpaces) + 1));
      if (!line.empty() && line[0] == '#') continue;
      *text = line;
      return true;
    }
    return false;
  }

  bool NextNotBlank(std::string_view* text) {
    while (Next(text)) {
      if (!text->empty()) return true;
    }
    return false;
  }

  [[noreturn]] void Fail(const std::string& finding, const std::string& expected) const {
    throw InputError(path_, LinePosition(line_), finding, "Expected " + expected);
  }

 private:
  std::string_view rest_;
  const std::string& path_;
  long line_ = 0;
};

// The words of one line. `expected` says what the line should hold, for messages.
class Words {
 public:
  Words(std::string_view text, const LineReader& reader, const char* expected)
      : rest_(text), reader_(reader), expected_(expected) {}

  bool AtEnd() const { return rest_.empty(); }

  std::string_view Rest() {
    if (rest_.empty()) reader_.Fail("the line ends too early", expected_);
    return rest_;
  }

  std::string_view Word() {
    if (rest_.empty()) reader_.Fail("the line ends too early", expected_);
    const size_t length = std::min(rest_.find_first_of(kSpaces), rest_.size());
    const std::string_view word = rest_.substr(0, length);
    rest_.remove_prefix(length);
    rest_.remove_prefix(std::min(rest_.find_first_not_of(kSpaces), rest_.size()));
    return word;
  }

  template <typename Integer>
  Integer Whole(Integer largest) {
    const std::string_view word = Word();
    Integer value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || value > largest) {
      FailAt(word, "a whole number from 0 to " + std::to_string(largest));
    }
    return value;
  }
  uint32_t Id() { return Whole<uint32_t>(UINT32_MAX); }

  // "-1" means none.
  uint64_t PointId() {
    const std::string_view before = rest_;
    if (before.substr(0, 1) != "-") return Whole<uint64_t>(UINT64_MAX);
    const std::string_view word = Word();
    if (word != "-1") FailAt(word, "a point's id or -1");
    return kInvalidPoint3dId;
  }

  // Any number, also one that is not finite.
  double Number() {
    const std::string_view word = Word();
    const char* begin = word.data();
    const char* const end = word.data() + word.size();
    if (*begin == '+') ++begin;
    double value = 0;
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (error == std::errc::result_out_of_range) {
      value = std::strtod(std::string(word).c_str(), nullptr);  // 0 or infinite
    } else if (error != std::errc() || stop != end) {
      FailAt(word, "a number");
    }
    return value;
  }

  double FiniteNumber() {
    const std::string_view before = rest_;
    const double value = Number();
    if (!std::isfinite(value)) {
      FailAt(before.substr(0, std::min(before.find_first_of(kSpaces), before.size())),
             "a finite number");
    }
    return value;
  }

  void ExpectEnd() {
    if (!rest_.empty()) {
      reader_.Fail("\"" + Shortened(rest_) + "\" follows the last value", expected_);
    }
  }

 private:
  static std::string Shortened(std::string_view word) {
    return word.size() <= 40 ? std::string(word) : std::string(word.substr(0, 37)) + "...";
  }
  [[noreturn]] void FailAt(std::string_view word, const std::string& wanted) const {
    reader_.Fail("\"" + Shortened(word) + "\" is not " + wanted, expected_);
  }

  std::string_view rest_;
  const LineReader& reader_;
  const char* expected_;
};

PlacedList<Camera> ParseTextCameras(const std::string& bytes, const std::string& path) {
  constexpr char kExpected[] = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]";
  PlacedList<Camera> cameras;
  LineReader reader(bytes, path);
  std::string_view line;
  while (reader.NextNotBlank(&line)) {
    Words words(line, reader, kExpected);
    Placed<Camera> placed;
    placed.position = reader.line();
    Camera& camera = placed.entry;
    placed.id = camera.camera_id = words.Id();
    const std::string model_name(words.Word());
    const std::optional<CameraModel> model = CameraModelFromName(model_name);
    if (!model) {
      reader.Fail("camera " + std::to_string(camera.camera_id) + " has the unknown model \"" +
                      model_name.substr(0, 40) + "\"",
                  "one of COLMAP's camera models SIMPLE_PINHOLE to EQUIRECTANGULAR");
    }
    camera.model = *model;
    camera.width = static_cast<int>(words.Whole<uint32_t>(INT32_MAX));
    camera.height = static_cast<int>(words.Whole<uint32_t>(INT32_MAX));
    while (!words.AtEnd()) camera.params.push_back(words.FiniteNumber());
    const size_t num_params = NumCameraParams(static_cast<int>(*model));
    if (camera.params.size() != num_params) {
      reader.Fail(model_name + " with " + std::to_string(camera.params.size()) + " parameters",
                  std::to_string(num_params));
    }
    cameras.push_back(std::move(placed));
  }
  return cameras;
}

// A line of keypoints; blank when the image has none.
void ParsePoints2d(std::string_view line, const LineReader& reader, SparseImage* image) {
  Words words(line, reader,
              "triples X Y POINT3D_ID below the line of the image, or an empty line when it has "
              "no keypoints");
  while (!words.AtEnd()) {
    const double x = words.FiniteNumber();
    const double y = words.FiniteNumber();
    image->points2d.emplace_back(x, y);
    image->point3d_ids.push_back(words.PointId());
  }
}

PlacedList<SparseImage> ParseTextImages(const std::string& bytes, const std::string& path) {
  constexpr char kExpected[] = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
  PlacedList<SparseImage> images;
  LineReader reader(bytes, path);
  std::string_view line;
  while (reader.NextNotBlank(&line)) {
    Words words(line, reader, kExpected);
    Placed<SparseImage> placed;
    placed.position = reader.line();
    SparseImage& image = placed.entry;
    placed.id = image.image_id = words.Id();
    double qvec[4], tvec[3];
    for (double& value : qvec) value = words.FiniteNumber();
    for (double& value : tvec) value = words.FiniteNumber();
    image.cam_from_model = PoseFromNumbers(qvec, tvec, path, LinePosition(reader.line()));
    image.camera_id = words.Id();
    image.name = words.Rest();  // may hold spaces
    // The last line of a file is often lost by editors when it is blank: no keypoints then.
    if (reader.Next(&line)) ParsePoints2d(line, reader, &image);
    images.push_back(std::move(placed));
  }
  return images;
}

PlacedList<SparsePoint> ParseTextPoints(const std::string& bytes, const std::string& path) {
  constexpr char kExpected[] = "POINT3D_ID X Y Z R G B ERROR and pairs IMAGE_ID POINT2D_IDX";
  PlacedList<SparsePoint> points;
  LineReader reader(bytes, path);
  std::string_view line;
  std::vector<TrackElement> track;
  while (reader.NextNotBlank(&line)) {
    Words words(line, reader, kExpected);
    Placed<SparsePoint>& placed = points.emplace_back();
    placed.position = reader.line();
    SparsePoint& point = placed.entry;
    placed.id = words.Whole<uint64_t>(UINT64_MAX);
    for (int k = 0; k < 3; ++k) point.x_in_model[k] = words.FiniteNumber();
    for (int k = 0; k < 3; ++k) point.color[k] = static_cast<uint8_t>(words.Whole<uint32_t>(255));
    point.error = words.Number();
    if (!std::isfinite(point.error)) point.error = -1;
    track.clear();
    while (!words.AtEnd()) {
      const uint32_t image_id = words.Id();
      track.push_back({image_id, words.Id()});
    }
    point.track = track;
  }
  return points;
}

// Collects text with single spaces and hands it on in pieces of about a megabyte. Numbers are the
// shortest that read back to the same bits.
class TextWriter {
 public:
  explicit TextWriter(const SparseModelFormat::Write& write) : write_(write) {}

  void Comment(const std::string& text) { piece_ += "# " + text + "\n"; }
  template <typename Number>
  void Put(Number value) {
    char digits[40];
    const auto result = std::to_chars(digits, digits + sizeof(digits), value);
    PutWord(std::string_view(digits, result.ptr - digits));
  }
  void PutWord(std::string_view word) {
    if (!at_line_start_) piece_ += ' ';
    piece_ += word;
    at_line_start_ = false;
  }
  void EndLine() {
    piece_ += '\n';
    at_line_start_ = true;
    if (piece_.size() >= (1u << 20)) Flush();
  }
  void Flush() {
    write_(piece_);
    piece_.clear();
  }

 private:
  const SparseModelFormat::Write& write_;
  std::string piece_;
  bool at_line_start_ = true;
};

void WriteTextCameras(const SparseModel& model, const SparseModelFormat::Write& write) {
  TextWriter writer(write);
  writer.Comment("CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]");
  for (const auto& [id, camera] : model.cameras) {
    writer.Put(id);
    writer.PutWord(CameraModelName(camera.model));
    writer.Put(camera.width);
    writer.Put(camera.height);
    for (const double param : camera.params) writer.Put(param);
    writer.EndLine();
  }
  writer.Flush();
}

void WriteTextImages(const SparseModel& model, const SparseModelFormat::Write& write) {
  TextWriter writer(write);
  writer.Comment("IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME");
  writer.Comment("POINTS2D[] as (X, Y, POINT3D_ID)");
  for (const auto& [id, image] : model.images) {
    writer.Put(id);
    const Rigid& pose = image.cam_from_model;
    writer.Put(pose.rotation.w());
    writer.Put(pose.rotation.x());
    writer.Put(pose.rotation.y());
    writer.Put(pose.rotation.z());
    for (int k = 0; k < 3; ++k) writer.Put(pose.translation[k]);
    writer.Put(image.camera_id);
    writer.PutWord(image.name);
    writer.EndLine();
    for (size_t i = 0; i < image.points2d.size(); ++i) {
      writer.Put(image.points2d[i].x());
      writer.Put(image.points2d[i].y());
      if (image.point3d_ids[i] == kInvalidPoint3dId) {
        writer.Put(-1);
      } else {
        writer.Put(image.point3d_ids[i]);
      }
    }
    writer.EndLine();
  }
  writer.Flush();
}

void WriteTextPoints(const SparseModel& model, const SparseModelFormat::Write& write) {
  TextWriter writer(write);
  writer.Comment("POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)");
  for (const auto& [id, point] : model.points) {
    writer.Put(id);
    for (int k = 0; k < 3; ++k) writer.Put(point.x_in_model[k]);
    for (int k = 0; k < 3; ++k) writer.Put(static_cast<int>(point.color[k]));
    writer.Put(point.error);
    for (const TrackElement& element : point.track) {
      writer.Put(element.image_id);
      writer.Put(element.point2d_index);
    }
    writer.EndLine();
  }
  writer.Flush();
}

FrameOfImage ParseTextFrames(const std::string& bytes, const std::string& path) {
  constexpr char kExpected[] =
      "FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA_IDS and (SENSOR_TYPE SENSOR_ID DATA_ID) each";
  FrameOfImage frame_of_image;
  LineReader reader(bytes, path);
  std::string_view line;
  while (reader.NextNotBlank(&line)) {
    Words words(line, reader, kExpected);
    const uint32_t frame_id = words.Id();
    words.Id();
    for (int k = 0; k < 7; ++k) words.Number();
    const uint32_t num_images = words.Id();
    for (uint32_t k = 0; k < num_images; ++k) {
      const std::string_view sensor = words.Word();
      words.Id();
      const uint32_t image_id = words.Id();
      if (sensor == "CAMERA") frame_of_image[image_id] = frame_id;
    }
    words.ExpectEnd();
  }
  return frame_of_image;
}

std::string PositionOfLine(long long line) { return LinePosition(static_cast<long>(line)); }

}  // namespace

const SparseModelFormat& SparseModelText() {
  static const SparseModelFormat format = {".txt",           PositionOfLine,  ParseTextCameras,
                                           ParseTextImages,  ParseTextPoints, ParseTextFrames,
                                           WriteTextCameras, WriteTextImages, WriteTextPoints};
  return format;
}

}  // namespace roomtex
