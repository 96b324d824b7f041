#include "core/photo_fit.h"

#include <algorithm>
#include <filesystem>

#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/stays_inside.h"

namespace roomtex {
namespace {

constexpr size_t kNamed = 5;  // photos with a warning of their own

std::string SizeText(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

// One factor takes the camera's width and height to those of the photo, each rounded up or down.
bool IsScaled(int width, int height, int camera_width, int camera_height) {
  const double low = std::max((width - 1.0) / camera_width, (height - 1.0) / camera_height);
  const double high = std::min((width + 1.0) / camera_width, (height + 1.0) / camera_height);
  return low < high;
}

std::string MissingFile(const std::string& path, const std::string& name) {
  if (!StaysInside(name)) {
    return "The name of the photo " + name +
           " leads out of --image_path. Names are those of files in this folder or below it.";
  }
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return "";
  return "There is no photo " + path + ", but the model names " + name +
         ". Give as --image_path the folder that COLMAP was given.";
}

// Sizes as stored; {0, 0} for what is no image, with the reason.
std::array<int, 2> SizeOf(const std::string& path, std::string* problem) {
  const std::array<int, 2> size = ReadPhotoSize(path);
  if (size[0] > 0 && size[1] > 0) return size;
  try {
    const cv::Mat photo = ReadPhoto(path);
    return {photo.cols, photo.rows};
  } catch (const InputError& error) {
    *problem = std::string(error.what());
  }
  return {0, 0};
}

std::string ShapeProblem(const std::string& name, int width, int height, int camera_width,
                         int camera_height) {
  const std::string sizes = name + " has " + SizeText(width, height) + " pixels, its camera " +
                            SizeText(camera_width, camera_height);
  if (IsScaled(height, width, camera_width, camera_height)) {
    return sizes +
           ": the file was turned after the model was made. Turn it back, or give the photos that "
           "COLMAP was given.";
  }
  return sizes +
         ": it was cropped, or another photo took its place. Give the photos that COLMAP was "
         "given, "
         "or resized ones of the same shape.";
}

}  // namespace

PhotoFit FitPhotoToCamera(const std::string& path, const std::string& name, int camera_width,
                          int camera_height) {
  PhotoFit fit;
  fit.problem = MissingFile(path, name);
  if (!fit.usable()) return fit;
  const auto [width, height] = SizeOf(path, &fit.problem);
  if (!fit.usable()) return fit;
  fit.width = width;
  fit.height = height;
  if (!IsScaled(width, height, camera_width, camera_height)) {
    const bool turned_fits =
        ExifExchangesSides(path) && IsScaled(height, width, camera_width, camera_height);
    if (!turned_fits) {
      fit.problem = ShapeProblem(name, width, height, camera_width, camera_height);
      return fit;
    }
    std::swap(fit.width, fit.height);
    fit.pixels = PhotoPixels::kTurnedByExif;
    fit.note = name + " is turned as its EXIF orientation says, because its camera is " +
               SizeText(camera_width, camera_height) + ". ";
  }
  fit.scaled = fit.width != camera_width || fit.height != camera_height;
  if (fit.scaled) {
    fit.note += name + " has " + SizeText(fit.width, fit.height) + " pixels, its camera " +
                SizeText(camera_width, camera_height) + "; the camera is scaled";
  } else if (!fit.note.empty()) {
    fit.note.pop_back();
  }
  return fit;
}

std::vector<std::string> FirstNotes(std::vector<std::string> notes) {
  if (notes.size() <= kNamed) return notes;
  const size_t num_more = notes.size() - kNamed;
  notes.resize(kNamed);
  notes.push_back(std::to_string(num_more) + " more photos are scaled or turned like that");
  return notes;
}

cv::Mat ReadFittedPhoto(const std::string& path, const PhotoFit& fit, int camera_width,
                        int camera_height) {
  cv::Mat photo = ReadPhoto(path, fit.pixels);
  const cv::Size size(camera_width, camera_height);
  if (photo.size() != size) {
    cv::resize(photo, photo, size, 0, 0,
               size.width < photo.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
  }
  return photo;
}

cv::Mat ReadFittedCells(const std::string& path, const PhotoFit& fit, int camera_width,
                        int camera_height, int cell_px) {
  // A cell has two pixels and more of what is decoded, in either direction: the whole cells end
  // half a pixel from where they ought to, at most.
  const double half_cell = 0.5 * cell_px * fit.width / camera_width;
  const int shrink = half_cell >= 8 ? 8 : half_cell >= 4 ? 4 : half_cell >= 2 ? 2 : 1;
  cv::Mat photo = fit.pixels == PhotoPixels::kAsStored ? ReadShrunkPhoto(path, shrink)
                                                       : ReadPhoto(path, fit.pixels);
  // What lies beyond the last whole cell is not squeezed into it.
  const cv::Size cells(camera_width / cell_px, camera_height / cell_px);
  const cv::Size whole(
      static_cast<int>(std::lround(1.0 * photo.cols * cells.width * cell_px / camera_width)),
      static_cast<int>(std::lround(1.0 * photo.rows * cells.height * cell_px / camera_height)));
  cv::Mat result;
  cv::resize(photo(cv::Rect({0, 0}, whole)), result, cells, 0, 0, cv::INTER_AREA);
  return result;
}

void ReportPhotosLeftOut(const std::vector<PhotoLeftOut>& photos, const Command::Context& context) {
  Json list = Json::array();
  for (size_t i = 0; i < photos.size(); ++i) {
    list.push_back({{"name", photos[i].name}, {"reason", photos[i].reason}});
    if (i < kNamed) context.Warn(photos[i].name + " is left out. " + photos[i].reason);
  }
  if (photos.size() > kNamed) {
    context.Warn(std::to_string(photos.size() - kNamed) +
                 " more photos are left out; the report's photos_left_out has them all");
  }
  context.report["photos_left_out"] = list;
}

std::string AsClause(std::string reason) {
  if (!reason.empty() && reason.back() == '.') reason.pop_back();
  return reason;
}

void ThrowIfAnyLeftOut(const std::vector<PhotoLeftOut>& photos, const std::string& image_path) {
  if (photos.empty()) return;
  const std::string count =
      photos.size() == 1 ? "one photo" : std::to_string(photos.size()) + " photos";
  throw InputError(image_path, "", count + " cannot be used. " + AsClause(photos[0].reason),
                   "--strict 0 leaves such photos out");
}

}  // namespace roomtex
