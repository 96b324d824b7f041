// A PLY goes through memory number by number: what stays is the model alone, of a cloud no more
// points than are shown.

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "core/error.h"
#include "core/frames.h"
#include "core/free_vectors.h"
#include "core/resource_limits.h"
#include "core/surfels.h"
#include "importers/mesh_scan.h"
#include "importers/ply.h"
#include "texture/view/view_model.h"

namespace roomtex {
namespace {

const PlyOptions kWithClouds = [] {
  PlyOptions options;
  options.clouds = true;
  return options;
}();

// The first look: where the points lie, how many there are, and what is black and white.
class Survey : public PlyVisitor {
 public:
  PlyFacts facts;
  Eigen::AlignedBox3d box;
  size_t num_measured = 0;
  std::vector<float> intensities;  // of a part, where there are no colours

  void Begin(const PlyFacts& given) override {
    facts = given;
    every_ = facts.num_vertices / kMostIntensities + 1;
  }
  void Vertex(const PlyVertex& vertex) override {
    if (!vertex.point.allFinite()) return;
    box.extend(vertex.point);
    const auto intensity = static_cast<float>(vertex.intensity);
    const bool is_asked = !facts.has_color && facts.has_intensity && num_measured % every_ == 0;
    if (is_asked && std::isfinite(intensity)) intensities.push_back(intensity);
    ++num_measured;
  }
  void Face(const Triangle&) override {}

 private:
  static constexpr size_t kMostIntensities = 1000000;
  size_t every_ = 1;
};

// Colours of the vertices that it is told, one after the other.
class Colors {
 public:
  explicit Colors(Survey* survey)
      : facts_(survey->facts),
        scale_(facts_.color_scale),
        is_grey_(std::any_of(survey->intensities.begin(), survey->intensities.end(),
                             [](float intensity) { return intensity > 0; })),
        grey_(FindGreyScale(std::move(survey->intensities))) {}

  void Add(const PlyVertex& vertex, CellColors* colors) {
    constexpr uint8_t kPlain = 200;
    if (facts_.has_color) {
      colors->push_back(scale_.Bytes(vertex.color, colors));
    } else {
      const auto intensity = static_cast<float>(vertex.intensity);
      const uint8_t grey = !is_grey_ ? kPlain : std::isfinite(intensity) ? grey_(intensity) : 0;
      colors->push_back({grey, grey, grey});
    }
  }

 private:
  const PlyFacts facts_;
  ColorScale scale_;
  const bool is_grey_;
  const GreyScale grey_;
};

class MeshMaker : public PlyVisitor {
 public:
  MeshMaker(Survey* survey, ViewModel* model) : colors_(survey), model_(*model) {}

  void Begin(const PlyFacts& facts) override {
    RequireMemoryForSamples(model_.path, static_cast<double>(facts.num_vertices));
    model_.points.reserve(facts.num_vertices);
    model_.colors.reserve(facts.num_vertices);
    model_.triangles.reserve(facts.num_faces);
  }
  void Vertex(const PlyVertex& vertex) override {
    model_.points.push_back((vertex.point - model_.origin).cast<float>());
    colors_.Add(vertex, &model_.colors);
  }
  void Face(const Triangle& triangle) override { model_.triangles.push_back(triangle); }

  // Without the triangles at points that were not measured.
  void Finish() {
    const auto is_open = [this](const Triangle& t) {
      return std::any_of(t.begin(), t.end(),
                         [this](int i) { return !model_.points[i].allFinite(); });
    };
    std::vector<Triangle>& triangles = model_.triangles;
    triangles.erase(std::remove_if(triangles.begin(), triangles.end(), is_open), triangles.end());
    if (triangles.empty()) {
      throw InputError(model_.path, "", "holds no triangle with three measured corners",
                       "Give what roomtex-texture wrote");
    }
  }

 private:
  Colors colors_;
  ViewModel& model_;
};

// Every second, third ... point, so that no more than kMostDiscs are held.
class CloudMaker : public PlyVisitor {
 public:
  explicit CloudMaker(Survey* survey)
      : every_((survey->num_measured - 1) / kMostDiscs + 1), colors_(survey) {
    const size_t count = survey->num_measured / every_ + 1;
    cloud_.points.reserve(count);
    cloud_.colors.reserve(count);
    cloud_.intensity.reserve(count);
    if (survey->facts.has_normal) cloud_.normals.reserve(count);
  }

  void Begin(const PlyFacts& facts) override {
    has_normals_ = facts.has_normal;
    cloud_.up = facts.up;
    cloud_.scan_from_station.translation = facts.station;
  }
  void Vertex(const PlyVertex& vertex) override {
    if (!vertex.point.allFinite() || num_measured_++ % every_ != 0) return;
    cloud_.points.push_back(vertex.point);
    cloud_.intensity.push_back(0);
    if (has_normals_) cloud_.normals.emplace_back(vertex.normal.cast<float>());
    colors_.Add(vertex, &cloud_.colors);
  }
  void Face(const Triangle&) override {}

  Scan Finish(const std::string& path) {
    FinishCloud(path, 0, &cloud_);
    return std::move(cloud_);
  }

 private:
  const size_t every_;
  Colors colors_;
  size_t num_measured_ = 0;
  bool has_normals_ = false;
  Scan cloud_;
};

// A triangle on the surface around each point, as large as its share of it: in place of the points.
void ShowAsDiscs(const Scan& scan, ViewModel* model) {
  constexpr double kRadius =
      1.4;  // of the corners, in spacings: the circle inside reaches half way
  CloudSurface cloud = FindCloudSurface(scan, -1);
  FreeVectors(&cloud.points);
  cloud.patches = {};
  model->is_cloud = true;
  model->points.reserve(3 * scan.points.size());
  model->colors.reserve(3 * scan.points.size());
  model->normals.reserve(3 * scan.points.size());
  model->triangles.reserve(scan.points.size());
  for (size_t i = 0; i < scan.points.size(); ++i) {
    const double spacing = cloud.spacings[i] > 0 ? cloud.spacings[i] : cloud.spacing;
    const double radius = kRadius * spacing;
    const Eigen::Vector3d normal =
        cloud.normals[i].isZero() ? scan.up : Eigen::Vector3d(cloud.normals[i].cast<double>());
    const Eigen::Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
    const int first = static_cast<int>(model->points.size());
    for (int k = 0; k < 3; ++k) {
      const double angle = 2 * kPi * k / 3;
      model->points.push_back(
          (scan.points[i] + radius * (std::cos(angle) * u + std::sin(angle) * v) - model->origin)
              .cast<float>());
      model->colors.push_back(scan.colors[i]);
      // Both sides are shown where nobody knows the front.
      model->normals.push_back(cloud.angular_spacing > 0 ? cloud.normals[i]
                                                         : Eigen::Vector3f(0, 0, 0));
    }
    model->triangles.push_back({first, first + 1, first + 2});
  }
}

}  // namespace

ViewModel ReadViewPly(const std::string& path) {
  Survey survey;
  VisitPly(path, kWithClouds, &survey);
  if (survey.num_measured == 0) {
    throw InputError(path, "", "holds no point", "Give what roomtex-texture wrote");
  }
  ViewModel model;
  model.path = path;
  model.up = survey.facts.up;
  model.origin = survey.box.center();
  if (survey.facts.num_faces > 0) {
    MeshMaker maker(&survey, &model);
    VisitPly(path, kWithClouds, &maker);
    maker.Finish();
  } else {
    CloudMaker maker(&survey);
    VisitPly(path, kWithClouds, &maker);
    ShowAsDiscs(maker.Finish(path), &model);
  }
  model.page_of_triangle.assign(model.triangles.size(), -1);
  return model;
}

}  // namespace roomtex
