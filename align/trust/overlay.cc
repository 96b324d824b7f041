#include "align/trust/overlay.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "align/trust/perspective_views.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kCropWidth = 160, kCropHeight = 120;  // pixels of the photo
constexpr int kCaption = 26;                        // pixels; height of a line of text
constexpr int kOverlayNodeCells = 4;                // cells between the rays that are cast
// A point is hidden if the scan's surface lies nearer by this share of its distance. The coarse
// mesh of FreeSpace cuts corners.
constexpr double kHiddenShare = 0.015;
constexpr int kJpegQuality = 92;

const cv::Scalar kBackground(70, 35, 20);

cv::Scalar ColorOf(ScanEdge::Kind kind) {
  switch (kind) {
    case ScanEdge::Kind::kDepth:
      return {255, 60, 255};
    case ScanEdge::Kind::kCrease:
      return {255, 230, 0};
    case ScanEdge::Kind::kIntensity:
      return {0, 235, 255};
  }
  return {};
}

// Draws the edges into a picture that shows the photo from `corner` (img) on, `scale` times as
// large.
void DrawEdges(const std::vector<ImgEdge>& edges, const Eigen::Vector2d& corner, double scale,
               cv::Mat* picture) {
  constexpr int kShift = 4;  // cv::line counts in 1/16 pixels
  const auto at = [&](const Eigen::Vector2d& x_in_img) {
    const Eigen::Vector2d x = 16 * OpenCvFromImg(scale * (x_in_img - corner));
    return cv::Point(static_cast<int>(std::lround(x.x())), static_cast<int>(std::lround(x.y())));
  };
  const cv::Rect2d seen(corner.x() - 50, corner.y() - 50, picture->cols / scale + 100,
                        picture->rows / scale + 100);
  for (const ImgEdge& edge : edges) {
    for (size_t i = 0; i + 1 < edge.points.size(); ++i) {
      const Eigen::Vector2d &a = edge.points[i], &b = edge.points[i + 1];
      if (!seen.contains(cv::Point2d(a.x(), a.y())) || !seen.contains(cv::Point2d(b.x(), b.y()))) {
        continue;
      }
      cv::line(*picture, at(a), at(b), ColorOf(edge.kind), 1, cv::LINE_AA, kShift);
    }
  }
}

const cv::Scalar kInPlace(255, 200, 0), kAmiss(60, 60, 255);

// Rings and crosses into a picture of the whole photo, `scale` times as large.
void DrawCorners(const GradientShifts& shifts, double scale, cv::Mat* picture) {
  constexpr int kRadius = 6, kThickness = 2;  // pixels of the picture
  const auto at = [scale](const Eigen::Vector2d& x_in_img) {
    const Eigen::Vector2d x = OpenCvFromImg(scale * x_in_img);
    return cv::Point(static_cast<int>(std::lround(x.x())), static_cast<int>(std::lround(x.y())));
  };
  for (const FittingCorner& corner : shifts.corners) {
    cv::circle(*picture, at(corner.x_in_img), kRadius, kInPlace, kThickness, cv::LINE_AA);
  }
  for (const Eigen::Vector2d& x_in_img : shifts.corners_amiss) {
    cv::drawMarker(*picture, at(x_in_img), kAmiss, cv::MARKER_TILTED_CROSS, 2 * kRadius, kThickness,
                   cv::LINE_AA);
  }
}

void Write(const std::string& text, int x, int y, const cv::Scalar& color, cv::Mat* picture) {
  cv::putText(*picture, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.55, color, 1, cv::LINE_AA);
}

int TextWidth(const std::string& text) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 0.55, 1, &baseline).width;
}

// The photo without colour and a little darker, so that lines stand out.
cv::Mat AsGround(const cv::Mat& photo) {
  cv::Mat grey, ground;
  cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(grey, ground, cv::COLOR_GRAY2BGR);
  return 0.8 * ground;
}

cv::Mat Resized(const cv::Mat& picture, const cv::Size& size) {
  cv::Mat result;
  cv::resize(picture, result, size, 0, 0,
             size.width < picture.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

cv::Mat IntensityPicture(const ScanView& view) {
  // The root of the intensity, as photos show light, from its darkest to its brightest hundredth.
  std::vector<float> values;
  for (int y = 0; y < view.grey.rows; y += 3) {
    for (int x = 0; x < view.grey.cols; x += 3) {
      if (view.valid(y, x)) values.push_back(view.grey(y, x));
    }
  }
  float black = 0, white = 255;
  if (!values.empty()) {
    std::sort(values.begin(), values.end());
    black = values[values.size() / 100];
    white = std::max(black + 1, values[values.size() - 1 - values.size() / 100]);
  }
  cv::Mat roots, grey, picture;
  cv::sqrt(cv::max((view.grey - black) / (white - black), 0), roots);
  roots.convertTo(grey, CV_8U, 255);
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2BGR);
  picture.setTo(kBackground, view.valid == 0);
  return picture;
}

// Upper-left corners, in pixels, of cut-outs with many edges in both directions, apart from each
// other.
std::vector<cv::Rect> ChooseCrops(const std::vector<ImgEdge>& edges, const cv::Size& photo,
                                  int count) {
  const int width = std::min(kCropWidth, photo.width), height = std::min(kCropHeight, photo.height);
  const int columns = 2 * photo.width / width, rows = 2 * photo.height / height;
  // Length of edges per half cut-out, by direction. Creases are the most exact, rims good to half a
  // sample only.
  std::vector<Eigen::Array2d> length(static_cast<size_t>(columns + 1) * (rows + 1),
                                     Eigen::Array2d::Zero());
  for (const ImgEdge& edge : edges) {
    const double weight = edge.kind == ScanEdge::Kind::kDepth    ? 0.2
                          : edge.kind == ScanEdge::Kind::kCrease ? 2
                                                                 : 1;
    for (size_t i = 0; i + 1 < edge.points.size(); ++i) {
      const Eigen::Vector2d middle = 0.5 * (edge.points[i] + edge.points[i + 1]);
      const int column = std::clamp(static_cast<int>(2 * middle.x() / width), 0, columns);
      const int row = std::clamp(static_cast<int>(2 * middle.y() / height), 0, rows);
      length[row * (columns + 1) + column] +=
          weight * (edge.points[i + 1] - edge.points[i]).array().abs();
    }
  }
  struct Candidate {
    double score;
    cv::Rect area;
  };
  std::vector<Candidate> candidates;
  for (int row = 0; row + 2 <= rows; ++row) {
    for (int column = 0; column + 2 <= columns; ++column) {
      Eigen::Array2d sum = Eigen::Array2d::Zero();
      for (int k = 0; k < 4; ++k) sum += length[(row + k / 2) * (columns + 1) + column + k % 2];
      const double score =
          std::min(sum.minCoeff(), 1.0 * height) + 0.3 * std::min(sum.maxCoeff(), 2.0 * height);
      candidates.push_back({score, {column * width / 2, row * height / 2, width, height}});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  std::vector<cv::Rect> chosen;
  for (double apart = 0.3; static_cast<int>(chosen.size()) < count && apart > 0.05; apart /= 2) {
    for (const Candidate& candidate : candidates) {
      if (static_cast<int>(chosen.size()) >= count || !(candidate.score > 0)) break;
      const bool is_near = std::any_of(chosen.begin(), chosen.end(), [&](const cv::Rect& other) {
        return std::hypot(other.x - candidate.area.x, other.y - candidate.area.y) <
               apart * std::hypot(photo.width, photo.height);
      });
      if (!is_near) chosen.push_back(candidate.area);
    }
  }
  std::sort(chosen.begin(), chosen.end(),
            [](const cv::Rect& a, const cv::Rect& b) { return a.x < b.x; });
  return chosen;
}

void DrawCaptions(const std::string& name, int panel_width, cv::Mat* sheet) {
  const cv::Scalar white(255, 255, 255);
  Write(name, 6, 18, white, sheet);
  using Legend = std::vector<std::pair<std::string, cv::Scalar>>;
  const auto write = [sheet](const Legend& legend, int x) {
    for (const auto& [text, color] : legend) {
      Write(text, x, 18, color, sheet);
      x += TextWidth(text) + 14;
    }
  };
  write({{"scan intensity from the photo's pose; its corners:", white},
         {"ring = in place", kInPlace},
         {"cross = not", kAmiss}},
        panel_width + 6);
  write({{"scan edges on the photo:", white},
         {"crease", ColorOf(ScanEdge::Kind::kCrease)},
         {"intensity", ColorOf(ScanEdge::Kind::kIntensity)},
         {"rim", ColorOf(ScanEdge::Kind::kDepth)},
         {"(these two: to a sample)", white}},
        2 * panel_width + 6);
}

std::vector<ScanEdge> EdgesOfGrids(const std::vector<Scan>& scans, const ScanEdgeOptions& options) {
  std::vector<ScanEdge> edges;
  for (const Scan& scan : scans) {
    for (ScanEdge& edge : FindScanEdges(scan, options)) edges.push_back(std::move(edge));
  }
  return edges;
}

}  // namespace

Scan ScanFromPhoto(const FreeSpace& free_space, const RayLattice& lattice, const Camera& camera,
                   const Rigid& cam_from_scan) {
  Scan scan;
  scan.num_columns = std::max(1, static_cast<int>(camera.width / lattice.step()));
  scan.num_rows = std::max(1, static_cast<int>(camera.height / lattice.step()));
  scan.scan_from_station = cam_from_scan.Inverse();
  const Eigen::Vector3d centre = scan.Station();
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const Eigen::Vector2d x_in_img = lattice.step() * Eigen::Vector2d(column + 0.5, row + 0.5);
      const Eigen::Vector3d ray = lattice.RayAt(x_in_img).homogeneous().normalized();
      const auto sight = ray.allFinite()
                             ? free_space.Look(centre, scan.scan_from_station.rotation * ray)
                             : std::nullopt;
      const bool on_mesh = sight && std::isnan(sight->column);
      scan.points.push_back(on_mesh ? sight->x_in_scan : Scan::MissingPoint());
      scan.intensity.push_back(on_mesh ? sight->grey : 0.0f);
    }
  }
  return scan;
}

std::vector<ImgEdge> SeeEdges(const std::vector<ScanEdge>& edges, const FreeSpace& free_space,
                              const CameraProjection& projection, const Rigid& cam_from_scan) {
  const Eigen::Vector3d centre = cam_from_scan.TargetOriginInSource();
  const auto see = [&](const Eigen::Vector3d& x_in_scan) -> std::optional<Eigen::Vector2d> {
    const auto x_in_img = projection.ImgFromCam(cam_from_scan * x_in_scan);
    if (!x_in_img || !projection.InImage(*x_in_img)) return std::nullopt;
    const Eigen::Vector3d ray = x_in_scan - centre;
    const double distance = ray.norm();
    const auto sight = free_space.Look(centre, ray / distance);
    const bool hidden =
        sight && (sight->x_in_scan - centre).norm() < (1 - kHiddenShare) * distance - 0.01;
    if (hidden) return std::nullopt;
    return x_in_img;
  };
  std::vector<ImgEdge> seen;
  for (const ScanEdge& edge : edges) {
    ImgEdge part{edge.kind, {}};
    const auto finish = [&] {
      if (part.points.size() >= 2) seen.push_back(part);
      part.points.clear();
    };
    for (const Eigen::Vector3d& x_in_scan : edge.points) {
      const auto x_in_img = see(x_in_scan);
      if (x_in_img) {
        part.points.push_back(*x_in_img);
      } else {
        finish();
      }
    }
    finish();
  }
  return seen;
}

cv::Mat DrawOverlay(const cv::Mat& photo, const ScanView& view, const std::vector<ImgEdge>& edges,
                    const GradientShifts& shifts, const std::string& name,
                    const OverlayOptions& options) {
  const double scale = static_cast<double>(options.panel_width) / photo.cols;
  const cv::Size panel(options.panel_width,
                       std::max(1, static_cast<int>(std::lround(scale * photo.rows))));
  const std::vector<cv::Rect> crops = ChooseCrops(edges, photo.size(), options.num_crops);
  // Two pictures per cut-out share the width of the three panels.
  const int crop_width = 3 * panel.width / (2 * std::max(1, options.num_crops));
  const int crop_height = crops.empty() ? 0 : options.crop_scale * crops[0].height;
  cv::Mat sheet(2 * kCaption + panel.height + crop_height, 3 * panel.width, CV_8UC3,
                cv::Scalar(30, 30, 30));
  DrawCaptions(name, panel.width, &sheet);

  const cv::Mat ground = AsGround(photo);
  const cv::Mat panels[3] = {Resized(photo, panel), Resized(IntensityPicture(view), panel),
                             Resized(ground, panel)};
  for (int k = 0; k < 3; ++k) {
    cv::Mat place = sheet(cv::Rect({k * panel.width, kCaption}, panel));
    panels[k].copyTo(place);
    if (k == 2) {
      DrawEdges(edges, Eigen::Vector2d::Zero(), scale, &place);
    } else {
      DrawCorners(shifts, scale, &place);
    }
    for (size_t c = 0; c < crops.size(); ++c) {
      const cv::Rect2d frame(scale * crops[c].x, scale * crops[c].y, scale * crops[c].width,
                             scale * crops[c].height);
      cv::rectangle(place, frame, cv::Scalar(0, 255, 0), 1);
      Write(std::string(1, static_cast<char>('A' + c)), static_cast<int>(frame.x) + 4,
            static_cast<int>(frame.y) + 18, cv::Scalar(0, 255, 0), &place);
    }
  }

  for (size_t c = 0; c < crops.size(); ++c) {
    const cv::Rect& crop = crops[c];
    const int left = 2 * static_cast<int>(c) * crop_width, top = 2 * kCaption + panel.height;
    std::string text(1, static_cast<char>('A' + c));
    text += ": x " + std::to_string(crop.x) + ", y " + std::to_string(crop.y) +
            "; one photo pixel is " + std::to_string(options.crop_scale) + " wide";
    Write(text, left + 6, top - 8, cv::Scalar(0, 255, 0), &sheet);
    for (int k = 0; k < 2; ++k) {
      cv::Mat enlarged;
      cv::resize((k == 0 ? photo : ground)(crop), enlarged, {}, options.crop_scale,
                 options.crop_scale, cv::INTER_NEAREST);
      if (k == 1) DrawEdges(edges, {crop.x, crop.y}, options.crop_scale, &enlarged);
      const cv::Rect part(0, 0, std::min(enlarged.cols, crop_width - 4), enlarged.rows);
      enlarged(part).copyTo(sheet(part + cv::Point(left + k * crop_width, top)));
    }
  }
  return sheet;
}

std::vector<std::string> WriteOverlays(const AlignedPhotos& aligned, const std::string& folder,
                                       const ScanViewer& viewer, int count,
                                       const OverlayOptions& options, int num_threads,
                                       std::vector<std::string>* warnings) {
  const std::vector<ScanEdge> grid_edges = EdgesOfGrids(viewer.scans(), options.edges);
  const PerspectiveViews views(aligned);
  const std::vector<const SparseImage*> images = SpreadImages(views.model(), count);
  struct Setup {
    CameraProjection projection;
    int cell_px;
    RayLattice lattice;
    LookSetup corners;  // as the alignment's agreement is measured
  };
  std::map<uint32_t, Setup> setups;
  std::set<std::string> taken;
  std::vector<std::string> paths;
  for (const SparseImage* image : images) {
    std::string name = image->name;
    std::replace(name.begin(), name.end(), '/', '_');
    std::replace(name.begin(), name.end(), '\\', '_');
    const size_t dot = name.rfind('.');
    if (dot != std::string::npos && dot > 0) name.resize(dot);
    while (!taken.insert(name).second) name += "_";
    paths.push_back(folder + "/" + name + ".jpg");
    if (setups.count(image->camera_id)) continue;
    const Camera& camera = views.model().cameras.at(image->camera_id);
    const double pixels = static_cast<double>(camera.width) * camera.height;
    int cell_px =
        std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / options.max_view_cells))));
    if (viewer.has_mesh()) cell_px = std::max(cell_px, (camera.width + 639) / 640);
    cell_px = std::min({cell_px, camera.width, camera.height});
    const CameraProjection projection(camera);
    const double step = viewer.has_mesh() ? cell_px : kOverlayNodeCells * cell_px;
    setups.emplace(image->camera_id, Setup{projection, cell_px, RayLattice(projection, step),
                                           LookSetup(camera, viewer, FinestCell(camera, viewer))});
  }
  MakeFolder(folder);
  std::vector<std::string> problems(images.size());
  ParallelFor(num_threads, 0, static_cast<int>(images.size()), [&](int i) {
    const SparseImage& image = *images[i];
    const Setup& setup = setups.at(image.camera_id);
    const Camera& camera = setup.projection.camera();
    const auto read = views.Read(image, &problems[i]);
    if (!read) return;
    const ScanView view = viewer.Look(setup.lattice, camera, image.cam_from_model, setup.cell_px);
    ScanView corner_view = setup.corners.Look(viewer, image.cam_from_model);
    const cv::Mat photo = views.Still(image, corner_view, setup.corners, *read);
    views.LeaveOutTransparent(image, &corner_view);
    const GradientShifts shifts = MeasureGradientShifts(corner_view, photo, setup.projection,
                                                        viewer.sample_angle(), options.gradient);
    std::vector<ScanEdge> edges = grid_edges;
    if (viewer.has_mesh()) {
      const Scan seen =
          ScanFromPhoto(viewer.free_space(), setup.lattice, camera, image.cam_from_model);
      for (ScanEdge& edge : FindScanEdges(seen, options.edges)) edges.push_back(std::move(edge));
    }
    const cv::Mat sheet = DrawOverlay(
        photo, view, SeeEdges(edges, viewer.free_space(), setup.projection, image.cam_from_model),
        shifts, image.name, options);
    std::vector<uchar> bytes;
    cv::imencode(".jpg", sheet, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
    OutputFile file(paths[i]);
    file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                        static_cast<std::streamsize>(bytes.size()));
    file.Commit();
  });
  std::vector<std::string> written;
  for (size_t i = 0; i < paths.size(); ++i) {
    if (problems[i].empty()) {
      written.push_back(paths[i]);
    } else {
      warnings->push_back("Overlay: " + problems[i]);
    }
  }
  return written;
}

}  // namespace roomtex
