#pragma once
// A scene of two parallel walls with exact truth: a large back wall 4 m in front of the scanner,
// and a board 2 m in front of it that hides a part of the wall. Scan frame as RTPI: y up, the
// scanner looks along -z.

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/camera_model.h"
#include "core/photo.h"
#include "core/scan.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

struct TwoWalls {
  double wall_z = -4, board_z = -2;
  double board_half = 0.4;  // metres; 0 = no board
  // Linear light r, g, b at a point of the scene.
  std::function<Eigen::Vector3f(const Eigen::Vector3d&)> color = [](const Eigen::Vector3d& p) {
    if (p.z() > -3) return Eigen::Vector3f(0.6f, 0.05f, 0.05f);  // red board
    const auto wave = static_cast<float>(std::sin(7 * p.x()) * std::cos(5 * p.y()));
    return Eigen::Vector3f(0.3f + 0.1f * wave, 0.35f, 0.3f - 0.1f * wave);
  };

  // The first point along a ray that goes towards -z.
  Eigen::Vector3d Hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d board = origin + direction * ((board_z - origin.z()) / direction.z());
    if (origin.z() > board_z && std::abs(board.x()) < board_half &&
        std::abs(board.y()) < board_half) {
      return board;
    }
    return origin + direction * ((wall_z - origin.z()) / direction.z());
  }

  // columns x rows samples over +-half_angle in azimuth and elevation.
  Scan MakeScan(int columns, int rows, double half_angle = 0.5,
                const Eigen::Vector3d& station = Eigen::Vector3d::Zero()) const {
    Scan scan;
    scan.scan_from_station.translation = station;
    scan.num_columns = columns;
    scan.num_rows = rows;
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns; ++c) {
        const double azimuth = half_angle * (2.0 * c / (columns - 1) - 1);
        const double elevation = half_angle * (1 - 2.0 * r / (rows - 1));
        const Eigen::Vector3d direction(std::sin(azimuth) * std::cos(elevation),
                                        std::sin(elevation),
                                        -std::cos(azimuth) * std::cos(elevation));
        scan.points.push_back(Hit(station, direction));
        scan.intensity.push_back(static_cast<float>(10 + c % 50));
      }
    }
    return scan;
  }

  // A camera at `centre` that looks along -z (cam: y down, z forward).
  PhotoView View(const Eigen::Vector3d& centre, const std::string& name) const {
    PhotoView view;
    view.name = name;
    view.camera.model = CameraModel::kOpenCv;
    view.camera.width = 640;
    view.camera.height = 480;
    view.camera.params = {520, 515, 322, 241, -0.08, 0.02, 0.001, -0.0005};
    view.cam_from_scan.rotation = Eigen::Quaterniond(0, 1, 0, 0);  // half a turn about x
    view.cam_from_scan.translation = -(view.cam_from_scan.rotation * centre);
    return view;
  }

  // The photo, exposed `exposure` times; one ray through every pixel's centre.
  cv::Mat Render(const PhotoView& view, float exposure) const {
    const CameraProjection projection(view.camera);
    cv::Mat3b photo(view.camera.height, view.camera.width);
    for (int y = 0; y < photo.rows; ++y) {
      for (int x = 0; x < photo.cols; ++x) {
        const auto ray = projection.CamFromImg({x + 0.5, y + 0.5});
        const Eigen::Vector3d direction =
            view.cam_from_scan.rotation.conjugate() * Eigen::Vector3d(ray->x(), ray->y(), 1);
        const Eigen::Vector3f light = color(Hit(view.Centre(), direction)) * exposure;
        for (int k = 0; k < 3; ++k) photo(y, x)[2 - k] = SrgbByteFromLinear(light[k]);
      }
    }
    return photo;
  }

  // Writes the photo into `folder`, with EXIF when shutter_seconds > 0, and sets view->path.
  void Shoot(PhotoView* view, float exposure, const std::string& folder,
             double shutter_seconds) const {
    view->path = folder + "/" + view->name;
    cv::imwrite(view->path, Render(*view, exposure), {cv::IMWRITE_JPEG_QUALITY, 98});
    if (shutter_seconds > 0) {
      ExposureData exif;
      exif.exposure_time = shutter_seconds;
      exif.f_number = 8;
      exif.iso = 100;
      WriteExposureData(view->path, exif);
    }
  }
};

}  // namespace roomtex
