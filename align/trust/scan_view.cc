#include "align/trust/scan_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/frames.h"
#include "core/photo_fit.h"
#include "core/similarity.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// A step of the inverse range that changes by more than this share of the inverse range from one
// sample to the next is a depth edge. A corner of two walls changes it by twice the sample angle
// (0.006 at 0.18 degrees) times the slopes; range noise of 2 mm at 0.3 m by 0.016.
constexpr double kEdgeBend = 0.03;
// The same for the four corners of a cell of the ray lattice, which is several samples wide.
constexpr double kCellBend = 0.03;
// Standard deviations of what the noise of three samples, or four corners, makes of either; a depth
// camera's at some metres is more than the above.
constexpr double kBendReach = 3;
const double kBendOfThree = std::sqrt(6.0), kBendOfFour = 2;
// Of a normal distribution, the size that two fifths of the deviations do not reach (RangeNoise).
constexpr double kTwoFifths = 0.524;
constexpr int kNodeCells = 3;  // cells between the rays that are cast

// 1 / range of every sample; 0 where missing.
std::vector<float> InverseRanges(const Scan& scan) {
  std::vector<float> inverse(scan.points.size(), 0.0f);
  for (size_t i = 0; i < inverse.size(); ++i) {
    const double range = (scan.points[i] - scan.Station()).norm();
    if (range > 0) inverse[i] = static_cast<float>(1 / range);
  }
  return inverse;
}

// From what three samples in a row bend, which a smooth surface hardly does.
RangeNoise FindSampleNoise(const Scan& scan) {
  if (!scan.organised) return {};
  std::vector<std::pair<float, float>> observations;
  const size_t stride = scan.points.size() / 100000 + 1;
  const auto range_at = [&scan](int i) { return (scan.points[i] - scan.Station()).norm(); };
  for (size_t i = 0; i < scan.points.size(); i += stride) {
    const int index = static_cast<int>(i), column = index % scan.num_columns;
    if (column == 0 || column + 1 >= scan.num_columns) continue;
    if (scan.IsMissing(index) || scan.IsMissing(index - 1) || scan.IsMissing(index + 1)) continue;
    const double range = range_at(index);
    const double bend = 1 / range_at(index - 1) - 2 / range + 1 / range_at(index + 1);
    observations.emplace_back(
        static_cast<float>(range),
        static_cast<float>(std::abs(bend) * range * range / (kBendOfThree * kTwoFifths)));
  }
  return RangeNoise(std::move(observations));
}

double GridSampleAngle(const Scan& scan) {
  std::vector<double> across, down;
  const size_t stride = scan.points.size() / 20000 + 1;
  for (size_t i = 0; i < scan.points.size(); i += stride) {
    const int index = static_cast<int>(i);
    const int column = index % scan.num_columns, row = index / scan.num_columns;
    if (scan.IsMissing(index)) continue;
    const Eigen::Vector3d ray = scan.points[index] - scan.Station();
    const auto add = [&](int other, std::vector<double>* angles) {
      if (!scan.IsMissing(other)) {
        angles->push_back(AngleBetween(ray, scan.points[other] - scan.Station()));
      }
    };
    if (column + 1 < scan.num_columns) add(index + 1, &across);
    if (row + 1 < scan.num_rows) add(index + scan.num_columns, &down);
  }
  return std::max(Median(&across), Median(&down));
}

double MeshSampleAngle(const Scan& scan) {
  if (scan.triangles.empty()) return 0;
  const Bounds bounds = FindBounds(scan);
  const Eigen::Vector3d centre = 0.5 * (bounds.min + bounds.max);
  std::vector<double> edges, distances;
  const size_t stride = scan.triangles.size() / 20000 + 1;
  for (size_t i = 0; i < scan.triangles.size(); i += stride) {
    const Triangle& t = scan.triangles[i];
    edges.push_back((scan.points[t[0]] - scan.points[t[1]]).norm());
    distances.push_back((scan.points[t[0]] - centre).norm());
  }
  const double distance = Median(&distances);
  return distance > 0 ? Median(&edges) / distance : 0;
}

// read(path, fit) of an image's photo; none, and a warning, if it cannot be used.
template <typename Read>
std::optional<cv::Mat> ReadFitting(const SparseImage& image, const Camera& camera,
                                   const std::string& image_path, std::string* warning,
                                   const Read& read) {
  const std::string path = image_path + "/" + image.name;
  const PhotoFit fit = FitPhotoToCamera(path, image.name, camera.width, camera.height);
  if (!fit.usable()) {
    *warning = fit.problem;
    return std::nullopt;
  }
  try {
    return read(path, fit);
  } catch (const InputError& error) {
    *warning = error.what();
    return std::nullopt;
  }
}

}  // namespace

RayLattice::RayLattice(const CameraProjection& projection, double step)
    : columns_(static_cast<int>(std::ceil(projection.camera().width / step)) + 1),
      rows_(static_cast<int>(std::ceil(projection.camera().height / step)) + 1),
      step_(step) {
  rays_.reserve(static_cast<size_t>(columns_) * rows_);
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const auto ray = projection.CamFromImg({column * step, row * step});
      rays_.push_back(ray ? Eigen::Vector3d(ray->homogeneous().normalized())
                          : Eigen::Vector3d::Constant(kNaN));
    }
  }
}

Eigen::Vector2d RayLattice::RayAt(const Eigen::Vector2d& x_in_img) const {
  const double x = std::clamp(x_in_img.x() / step_, 0.0, columns_ - 1.0);
  const double y = std::clamp(x_in_img.y() / step_, 0.0, rows_ - 1.0);
  const int column = std::min(static_cast<int>(x), columns_ - 2);
  const int row = std::min(static_cast<int>(y), rows_ - 2);
  const double s = x - column, t = y - row;
  return (1 - t) *
             ((1 - s) * Ray(column, row).hnormalized() + s * Ray(column + 1, row).hnormalized()) +
         t * ((1 - s) * Ray(column, row + 1).hnormalized() +
              s * Ray(column + 1, row + 1).hnormalized());
}

std::vector<uint8_t> FindSmoothSamples(const Scan& scan) {
  return FindSmoothSamples(scan, FindSampleNoise(scan));
}

std::vector<uint8_t> FindSmoothSamples(const Scan& scan, const RangeNoise& noise) {
  std::vector<uint8_t> smooth(scan.points.size(), 0);
  if (!scan.organised) return smooth;
  const std::vector<float> inverse = InverseRanges(scan);
  const int columns = scan.num_columns, rows = scan.num_rows;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int i = scan.Index(column, row);
      bool is_smooth = inverse[i] > 0;
      if (!is_smooth) continue;
      const double most =
          std::max(kEdgeBend * inverse[i],
                   kBendReach * kBendOfThree * inverse[i] * inverse[i] * noise.At(1 / inverse[i]));
      // Lines through the sample: across, down, and the two diagonals.
      const int steps[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
      for (int k = 0; k < 4 && is_smooth; ++k) {
        const int dc = steps[k][0], dr = steps[k][1];
        const bool inside = column - dc >= 0 && column + dc < columns && row - dr >= 0 &&
                            row - dr < rows && row + dr >= 0 && row + dr < rows;
        if (!inside) continue;
        const float before = inverse[i - dc - dr * columns],
                    behind = inverse[i + dc + dr * columns];
        is_smooth = before > 0 && behind > 0 && std::abs(before - 2 * inverse[i] + behind) <= most;
      }
      smooth[i] = is_smooth;
    }
  }
  return smooth;
}

ScanViewer::ScanViewer(const std::vector<Scan>& scans, const FreeSpace& free_space)
    : scans_(scans), free_space_(free_space) {
  for (const Scan& scan : scans) {
    has_mesh_ = has_mesh_ || !scan.organised;
    sample_angle_ =
        std::max(sample_angle_, scan.organised ? GridSampleAngle(scan) : MeshSampleAngle(scan));
    grey_.push_back(scan.organised ? IntensityAsGrey(scan) : std::vector<uint8_t>());
    noise_.push_back(FindSampleNoise(scan));
    smooth_.push_back(FindSmoothSamples(scan, noise_.back()));
  }
}

std::optional<float> ScanViewer::GreyAt(int scan_index, float column, float row) const {
  const Scan& scan = scans_[scan_index];
  const int left = static_cast<int>(column), top = static_cast<int>(row);
  if (left < 0 || top < 0 || top + 1 >= scan.num_rows || left >= scan.num_columns) {
    return std::nullopt;
  }
  const int right = left + 1 == scan.num_columns ? 0 : left + 1;
  const int corners[4] = {scan.Index(left, top), scan.Index(right, top), scan.Index(left, top + 1),
                          scan.Index(right, top + 1)};
  const std::vector<uint8_t>& smooth = smooth_[scan_index];
  if (!(smooth[corners[0]] & smooth[corners[1]] & smooth[corners[2]] & smooth[corners[3]])) {
    return std::nullopt;
  }
  const std::vector<uint8_t>& grey = grey_[scan_index];
  const float s = column - left, t = row - top;
  return (1 - t) * ((1 - s) * grey[corners[0]] + s * grey[corners[1]]) +
         t * ((1 - s) * grey[corners[2]] + s * grey[corners[3]]);
}

std::vector<ScanViewer::Node> ScanViewer::CastRays(const RayLattice& lattice,
                                                   const Rigid& cam_from_scan) const {
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  const Eigen::Matrix3d rotation = scan_from_cam.rotation.toRotationMatrix();
  std::vector<Node> nodes(static_cast<size_t>(lattice.columns()) * lattice.rows());
  for (int row = 0; row < lattice.rows(); ++row) {
    for (int column = 0; column < lattice.columns(); ++column) {
      const Eigen::Vector3d& ray = lattice.Ray(column, row);
      if (!(ray.z() > 0)) continue;
      const auto sight = free_space_.Look(scan_from_cam.translation, rotation * ray);
      if (!sight) continue;
      const double depth = (sight->x_in_scan - scan_from_cam.translation).norm() * ray.z();
      if (!(depth > 0)) continue;
      const double range = (sight->x_in_scan - scans_[sight->scan].Station()).norm();
      nodes[row * lattice.columns() + column] = {true,
                                                 sight->scan,
                                                 static_cast<float>(sight->column),
                                                 static_cast<float>(sight->row),
                                                 static_cast<float>(1 / depth),
                                                 sight->grey,
                                                 static_cast<float>(noise_[sight->scan].At(range))};
    }
  }
  return nodes;
}

ScanView ScanViewer::Look(const RayLattice& lattice, const Camera& camera,
                          const Rigid& cam_from_scan, int cell_px) const {
  const int per_node = static_cast<int>(std::lround(lattice.step() / cell_px));
  const int columns = camera.width / cell_px, rows = camera.height / cell_px;
  ScanView view;
  view.cell_px = cell_px;
  view.grey = cv::Mat1f(rows, columns, 0.0f);
  view.valid = cv::Mat1b(rows, columns, static_cast<uchar>(0));
  view.depth = cv::Mat1f(rows, columns, 0.0f);
  view.column = cv::Mat1f(rows, columns, kNaN);
  view.row = cv::Mat1f(rows, columns, kNaN);
  view.scan = cv::Mat1w(rows, columns, static_cast<ushort>(0));
  const std::vector<Node> nodes = CastRays(lattice, cam_from_scan);
  long num_valid = 0;
  for (int node_row = 0; node_row + 1 < lattice.rows(); ++node_row) {
    for (int node_column = 0; node_column + 1 < lattice.columns(); ++node_column) {
      const Node* upper = &nodes[node_row * lattice.columns() + node_column];
      Node n[4] = {upper[0], upper[1], upper[lattice.columns()], upper[lattice.columns() + 1]};
      if (!(n[0].hit && n[1].hit && n[2].hit && n[3].hit)) continue;
      if (n[1].scan != n[0].scan || n[2].scan != n[0].scan || n[3].scan != n[0].scan) continue;
      // On a plane the inverse depth is linear in x/z, y/z.
      const float w = n[0].inverse_depth;
      const float bend =
          n[0].inverse_depth - n[1].inverse_depth - n[2].inverse_depth + n[3].inverse_depth;
      const float largest =
          std::max({std::abs(n[1].inverse_depth - w), std::abs(n[2].inverse_depth - w),
                    std::abs(n[3].inverse_depth - w)});
      const double most = std::max(kCellBend, kBendReach * kBendOfFour * n[0].noise * w);
      if (std::abs(bend) > most * w || largest > 0.3f * w) continue;
      const Scan& scan = scans_[n[0].scan];
      for (int k = 1; k < 4 && scan.organised; ++k) {  // over the seam of a full turn
        if (n[k].column - n[0].column > 0.5f * scan.num_columns) n[k].column -= scan.num_columns;
        if (n[0].column - n[k].column > 0.5f * scan.num_columns) n[k].column += scan.num_columns;
      }
      for (int y = node_row * per_node; y < std::min(rows, (node_row + 1) * per_node); ++y) {
        const float t = (y + 0.5f) / per_node - node_row;
        for (int x = node_column * per_node; x < std::min(columns, (node_column + 1) * per_node);
             ++x) {
          const float s = (x + 0.5f) / per_node - node_column;
          const auto between = [&](float Node::*value) {
            return (1 - t) * ((1 - s) * (n[0].*value) + s * (n[1].*value)) +
                   t * ((1 - s) * (n[2].*value) + s * (n[3].*value));
          };
          float grey = between(&Node::grey), column = kNaN, row = kNaN;
          if (scan.organised) {
            column = between(&Node::column);
            row = between(&Node::row);
            if (column < 0) column += scan.num_columns;
            if (column >= scan.num_columns) column -= scan.num_columns;
            const std::optional<float> found = GreyAt(n[0].scan, column, row);
            if (!found) continue;
            grey = *found;
          }
          view.grey(y, x) = grey;
          view.valid(y, x) = 255;
          view.depth(y, x) = 1 / between(&Node::inverse_depth);
          view.column(y, x) = column;
          view.row(y, x) = row;
          view.scan(y, x) = static_cast<ushort>(std::min(n[0].scan, 65535));
          ++num_valid;
        }
      }
    }
  }
  view.valid_share = static_cast<double>(num_valid) / std::max(1, columns * rows);
  return view;
}

LookSetup::LookSetup(const Camera& camera, const ScanViewer& viewer, int view_cell_px)
    : projection(camera),
      cell_px(view_cell_px),
      lattice(projection, cell_px * (viewer.has_mesh() ? 1 : kNodeCells)) {}

int FinestCell(const Camera& camera, const ScanViewer& viewer) {
  const double sample_px = viewer.sample_angle() * camera.MeanFocalLength();
  int cell_px = std::max(1, static_cast<int>(std::lround(0.5 * sample_px)));
  if (viewer.has_mesh()) cell_px = std::max(cell_px, (camera.width + 319) / 320);
  return std::min({cell_px, std::max(1, camera.width / 32), std::max(1, camera.height / 32)});
}

std::vector<const SparseImage*> SpreadImages(const SparseModel& model, int count) {
  std::vector<const SparseImage*> images;
  for (const auto& [id, image] : model.images) images.push_back(&image);
  std::sort(images.begin(), images.end(),
            [](const SparseImage* a, const SparseImage* b) { return a->name < b->name; });
  const int n = static_cast<int>(images.size()), taken = std::min(n, count);
  std::vector<const SparseImage*> spread;
  for (int i = 0; i < taken; ++i) {
    spread.push_back(images[static_cast<size_t>((static_cast<long>(2 * i + 1) * n) / (2 * taken))]);
  }
  return spread;
}

std::optional<cv::Mat> ReadPhotoOf(const SparseImage& image, const Camera& camera,
                                   const std::string& image_path, std::string* warning) {
  return ReadFitting(image, camera, image_path, warning,
                     [&](const std::string& path, const PhotoFit& fit) {
                       return ReadFittedPhoto(path, fit, camera.width, camera.height);
                     });
}

std::optional<cv::Mat> ReadCellsOf(const SparseImage& image, const Camera& camera, int cell_px,
                                   const std::string& image_path, std::string* warning) {
  return ReadFitting(image, camera, image_path, warning,
                     [&](const std::string& path, const PhotoFit& fit) {
                       return ReadFittedCells(path, fit, camera.width, camera.height, cell_px);
                     });
}

}  // namespace roomtex
