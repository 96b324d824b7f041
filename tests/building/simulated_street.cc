#include "tests/building/simulated_street.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <opencv2/imgcodecs.hpp>

#include "building/building_solid.h"
#include "building/cell_arrangement.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/ray_caster.h"

namespace roomtex {
namespace {

std::vector<Eigen::Vector2d> Placed(const std::vector<Eigen::Vector2d>& local,
                                    const Eigen::Vector2d& at, double turn_deg) {
  const Eigen::Rotation2Dd turn(RadFromDeg(turn_deg));
  std::vector<Eigen::Vector2d> placed;
  for (const Eigen::Vector2d& x : local) placed.push_back(at + turn * x);
  return placed;
}

std::vector<Eigen::Vector2d> Rectangle(double width, double depth) {
  return {{0, 0}, {width, 0}, {width, depth}, {0, depth}};
}

RoofPlane Level(double height) { return {{0, 0, height}, 0, 0}; }

OutlineBuilding House(const std::string& name, double ground,
                      const std::vector<Eigen::Vector2d>& footprint,
                      const std::vector<RoofPlane>& roof) {
  OutlineBuilding house;
  house.name = name;
  house.ground = ground;
  house.footprint = footprint;
  house.roof = roof;
  return house;
}

// A roof plane through the wall from corner i, rising inwards.
RoofPlane RisingFrom(const std::vector<Eigen::Vector2d>& footprint, size_t i, double height,
                     double rise) {
  const Eigen::Vector2d &a = footprint[i], &b = footprint[(i + 1) % footprint.size()];
  const Eigen::Vector2d along = (b - a).normalized(), inwards(-along.y(), along.x());
  return RoofPlane::FromGradient({a.x(), a.y(), height}, rise * inwards);
}

std::vector<OutlineBuilding> Houses(const StreetOptions& options) {
  if (options.mock_up) {
    // A box, and two piles of books beside it.
    return {House("1", 0, Placed(Rectangle(0.32, 0.24), {0.1, 0.1}, 8), {Level(0.18)}),
            House("2", 0, Placed(Rectangle(0.21, 0.29), {0.62, 0.08}, -5), {Level(0.09)})};
  }
  std::vector<OutlineBuilding> houses;
  const auto ground = [&](double x) { return options.ground_slope * x; };
  houses.push_back(House("1", 0, Placed(Rectangle(10, 8), {0, 0}, 0), {Level(ground(5) + 6)}));
  const auto two = Placed(Rectangle(9, 11), {15, 0.5}, 3);
  const double eaves = ground(20) + 5;
  houses.push_back(
      House("2", 0, two, {RisingFrom(two, 1, eaves, 3 / 4.5), RisingFrom(two, 3, eaves, 3 / 4.5)}));
  const auto three = Placed(Rectangle(8, 9), {29, 1.5}, -7);
  houses.push_back(House("3", 0, three, {RisingFrom(three, 0, ground(33) + 3.6, 2.0 / 9)}));
  const auto four = Placed({{0, 0}, {12, 0}, {12, 10}, {7, 10}, {7, 6}, {0, 6}}, {43, -1}, 5);
  houses.push_back(House("4", 0, four, {Level(ground(49) + 7)}));
  for (OutlineBuilding& house : houses) {
    house.ground = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& corner : house.footprint) {
      house.ground = std::min(house.ground, ground(corner.x()));
    }
  }
  return houses;
}

// Everything that photos see, as triangles that carry features.
struct StreetSurface {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
  std::vector<double> features_per_m2;  // of each triangle
  std::vector<double> roughness;        // metres, normal to it
  std::vector<bool> wall;

  void Add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
           double density, double rough = 0, bool is_wall = false) {
    const int first = static_cast<int>(vertices.size());
    vertices.insert(vertices.end(), {a, b, c});
    triangles.push_back({first, first + 1, first + 2});
    features_per_m2.push_back(density);
    roughness.push_back(rough);
    wall.push_back(is_wall);
  }
  void AddQuad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
               const Eigen::Vector3d& d, double density, double rough = 0) {
    Add(a, b, c, density, rough);
    Add(a, c, d, density, rough);
  }
  void AddBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double density,
              double rough) {
    Eigen::Vector3d v[8];
    for (int k = 0; k < 8; ++k) {
      v[k] = {k & 1 ? high.x() : low.x(), k & 2 ? high.y() : low.y(), k & 4 ? high.z() : low.z()};
    }
    AddQuad(v[0], v[1], v[5], v[4], density, rough);
    AddQuad(v[1], v[3], v[7], v[5], density, rough);
    AddQuad(v[3], v[2], v[6], v[7], density, rough);
    AddQuad(v[2], v[0], v[4], v[6], density, rough);
    AddQuad(v[4], v[5], v[7], v[6], density, rough);
  }
};

StreetSurface SurfaceOf(const StreetOptions& options, const std::vector<OutlineBuilding>& houses) {
  StreetSurface surface;
  for (size_t h = 0; h < houses.size(); ++h) {
    const BuildingSolid solid = ExtrudeBuilding(houses[h]);
    int wall = 0;
    for (const SolidFace& face : solid.faces) {
      if (face.kind == SolidFace::Kind::kGround) continue;
      const bool is_wall = face.kind == SolidFace::Kind::kWall;
      bool bare = false;
      if (is_wall) {
        // The wall that begins at this corner of the footprint.
        const Eigen::Vector2d begin =
            solid.vertices[static_cast<size_t>(face.corners[0])].head<2>();
        for (size_t i = 0; i < houses[h].footprint.size(); ++i) {
          if ((houses[h].footprint[i] - begin).norm() < 1e-6) wall = static_cast<int>(i);
        }
        bare = options.bare_house == static_cast<int>(h) && options.bare_wall == wall;
      }
      const double density = options.features_per_m2 * (is_wall ? 1 : 0.6);
      for (const Triangle& t : TrianglesOf(solid, face)) {
        surface.Add(solid.vertices[static_cast<size_t>(t[0])],
                    solid.vertices[static_cast<size_t>(t[1])],
                    solid.vertices[static_cast<size_t>(t[2])], bare ? 0 : density, 0, is_wall);
      }
    }
  }
  if (options.mock_up) {
    surface.AddQuad({-0.5, -0.5, 0}, {1.4, -0.5, 0}, {1.4, 0.9, 0}, {-0.5, 0.9, 0},
                    options.features_per_m2 / 4);
    return surface;
  }
  const auto ground = [&](double x) { return options.ground_slope * x; };
  surface.AddQuad({-20, -25, ground(-20)}, {75, -25, ground(75)}, {75, 35, ground(75)},
                  {-20, 35, ground(-20)}, options.features_per_m2 / 4, 0.02);
  if (!options.clutter) return surface;
  for (const double x : {12.5, 26.5, 40.5}) {
    // Trees between and before the houses, all leaves.
    const Eigen::Vector3d at(x, x > 20 && x < 30 ? -4.5 : 3, ground(x) + 2);
    surface.AddBox(at + Eigen::Vector3d(-1.2, -1.2, 0), at + Eigen::Vector3d(1.2, 1.2, 2.6), 20,
                   0.5);
  }
  for (const double x : {4.0, 19.0, 33.0, 50.0}) {
    const Eigen::Vector3d at(x, -6.5, ground(x));
    surface.AddBox(at, at + Eigen::Vector3d(4.2, 1.8, 1.4), 8, 0.04);
  }
  return surface;
}

std::vector<Rigid> Cameras(const StreetOptions& options) {
  std::vector<Rigid> cameras;
  const double size = options.mock_up ? 0.02 : 1;  // of the street's 55 metres
  const Eigen::Vector3d middle =
      options.mock_up ? Eigen::Vector3d(0.42, 0.2, 0.05) : Eigen::Vector3d(27, 4, 3);
  for (int i = 0; i < 60; ++i) {
    // Once around, 20 m from the walls; every third from a pole or a drone.
    const double angle = 2 * kPi * i / 60;
    const bool above = options.photos_from_above && i % 3 == 0;
    const double c = std::cos(angle), s = std::sin(angle);
    const Eigen::Vector3d eye =
        middle + size * Eigen::Vector3d(46 * c, 24 * s,
                                        options.mock_up ? (above ? 30 : 12) : (above ? 15 : -1.3));
    // Across the street, in turn a little to the left and to the right.
    const Eigen::Vector3d target = middle + size * Eigen::Vector3d(36 * c + (i % 2 == 0 ? 12 : -12),
                                                                   2 * s, above ? -2.0 : 0.6);
    const Eigen::Vector3d z = (target - eye).normalized();
    const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d model_from_cam;
    model_from_cam << x, z.cross(x), z;
    Rigid pose;
    pose.rotation = Eigen::Quaterniond(model_from_cam).normalized().conjugate();
    pose.translation = -(pose.rotation * eye);
    cameras.push_back(pose);
  }
  return cameras;
}

Eigen::Vector3d AnyPointOn(const StreetSurface& surface, size_t t, RandomStream* random) {
  const Triangle& triangle = surface.triangles[t];
  const Eigen::Vector3d &a = surface.vertices[static_cast<size_t>(triangle[0])],
                        &b = surface.vertices[static_cast<size_t>(triangle[1])],
                        &c = surface.vertices[static_cast<size_t>(triangle[2])];
  double u = random->Uniform(), v = random->Uniform();
  if (u + v > 1) u = 1 - u, v = 1 - v;
  Eigen::Vector3d x = a + u * (b - a) + v * (c - a);
  const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
  x += surface.roughness[t] * random->Gaussian() * normal;
  // Windows lie a hand's breadth behind the wall.
  if (surface.wall[t] && (a - b).norm() > 2) {
    const double cell_x = std::floor((x.x() + x.y()) / 1.5), cell_z = std::floor(x.z() / 1.4);
    if ((static_cast<int>(cell_x) + static_cast<int>(cell_z)) % 5 == 0) x -= 0.1 * normal;
  }
  return x;
}

double AreaOf(const StreetSurface& surface, size_t t) {
  const Triangle& triangle = surface.triangles[t];
  const Eigen::Vector3d& a = surface.vertices[static_cast<size_t>(triangle[0])];
  return 0.5 * (surface.vertices[static_cast<size_t>(triangle[1])] - a)
                   .cross(surface.vertices[static_cast<size_t>(triangle[2])] - a)
                   .norm();
}

}  // namespace

SimulatedStreet MakeStreet(const StreetOptions& options) {
  SimulatedStreet street;
  street.truth.metric = true;
  street.truth.buildings = Houses(options);
  const StreetSurface surface = SurfaceOf(options, street.truth.buildings);
  const RayCaster caster(surface.vertices, surface.triangles);
  RandomStream random(MixBits(static_cast<uint64_t>(options.seed), 0x57e7));

  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 4000, camera.height = 3000;
  camera.params = {3000, 2000, 1500};
  street.model.cameras[1] = camera;
  const CameraProjection projection(camera);
  const std::vector<Rigid> poses = Cameras(options);
  for (size_t i = 0; i < poses.size(); ++i) {
    SparseImage image;
    image.image_id = static_cast<uint32_t>(i + 1);
    image.camera_id = 1;
    image.name = "photo_" + std::to_string(101 + i) + ".jpg";
    image.cam_from_model = poses[i];
    street.model.images[image.image_id] = image;
  }
  const double size = options.mock_up ? 0.02 : 1;
  const auto add = [&](const Eigen::Vector3d& truth, bool outlier) {
    SparsePoint point;
    point.color = {150, 140, 130};
    uint64_t id = street.model.points.size() + 1;
    double nearest = std::numeric_limits<double>::infinity();
    Eigen::Vector3d ray = Eigen::Vector3d::UnitX();
    std::vector<std::pair<uint32_t, Eigen::Vector2d>> seen;
    for (auto& [image_id, image] : street.model.images) {
      const Eigen::Vector3d eye = image.cam_from_model.TargetOriginInSource();
      const double distance = (truth - eye).norm();
      if (distance > 45 * size) continue;
      const auto pixel = projection.ImgFromCam(image.cam_from_model * truth);
      if (!pixel || !projection.InImage(*pixel)) continue;
      if (random.Uniform() < 0.4) continue;  // not every photo finds it
      if (!outlier && caster.IsOccluded(eye, truth, 0.3 * size)) continue;
      seen.emplace_back(image_id, *pixel);
      if (distance < nearest) nearest = distance, ray = (truth - eye) / distance;
      if (seen.size() >= 6) break;
    }
    if (seen.size() < 3 && !(outlier && seen.size() == 2)) return;
    point.x_in_model = truth + options.depth_error * nearest * random.Gaussian() * ray;
    for (int axis = 0; axis < 3; ++axis) {
      point.x_in_model[axis] += 0.25 * options.depth_error * nearest * random.Gaussian();
    }
    point.error = 0.7;
    for (const auto& [image_id, pixel] : seen) {
      SparseImage& image = street.model.images[image_id];
      point.track.push_back({image_id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(pixel);
      image.point3d_ids.push_back(id);
    }
    street.model.points[id] = point;
  };
  const double per_area = options.mock_up ? 1 / (size * size) : 1;
  for (size_t t = 0; t < surface.triangles.size(); ++t) {
    const double count = AreaOf(surface, t) * surface.features_per_m2[t] * per_area;
    for (int k = 0; k < static_cast<int>(count + random.Uniform()); ++k) {
      add(AnyPointOn(surface, t, &random), false);
    }
  }
  const int num_outliers =
      static_cast<int>(options.outliers * static_cast<double>(street.model.points.size()));
  for (int k = 0; k < num_outliers; ++k) {
    add(size * Eigen::Vector3d(random.Uniform(-15, 70), random.Uniform(-20, 30),
                               random.Uniform(-3, 15)),
        true);
  }
  return street;
}

void WriteStreetPhotos(const StreetOptions& options, const SparseModel& model,
                       const std::string& folder, int num_threads) {
  const StreetSurface surface = SurfaceOf(options, Houses(options));
  const RayCaster caster(surface.vertices, surface.triangles);
  constexpr int kReduced = 8;
  MakeFolder(folder);
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.cameras.at(image.camera_id);
    const CameraProjection projection(camera);
    const Eigen::Vector3d eye = image.cam_from_model.TargetOriginInSource();
    cv::Mat photo(camera.height / kReduced, camera.width / kReduced, CV_8UC3);
    ParallelFor(num_threads, 0, photo.rows, [&](int row) {
      for (int column = 0; column < photo.cols; ++column) {
        const Eigen::Vector3d ray =
            *projection.RayFromImg(kReduced * Eigen::Vector2d(column + 0.5, row + 0.5));
        const Eigen::Vector3d direction =
            (image.cam_from_model.rotation.conjugate() * ray).normalized();
        const auto hit = caster.Cast(eye, direction);
        cv::Vec3b color(235, 206, 170);  // the sky
        if (hit) {
          // Squares of a metre, each face in colours of its own.
          const Eigen::Vector3d at =
              (hit->point * 1.0 + Eigen::Vector3d(0.01, 0.02, 0.03)).array().floor();
          const auto square = static_cast<uint64_t>(static_cast<int64_t>(at.x()) * 31 +
                                                    static_cast<int64_t>(at.y()) * 57 +
                                                    static_cast<int64_t>(at.z()) * 101 + 100000);
          const uint64_t bits =
              MixBits(square, surface.wall[static_cast<size_t>(hit->triangle)] ? 1 : 2);
          for (int c = 0; c < 3; ++c) color[c] = static_cast<uchar>(70 + (bits >> (8 * c)) % 150);
        }
        photo.at<cv::Vec3b>(row, column) = color;
      }
    });
    cv::imwrite(folder + "/" + image.name, photo);
  }
}

std::vector<Eigen::Vector3d> MakeDenseStreet(const StreetOptions& options, size_t count) {
  const std::vector<OutlineBuilding> houses = Houses(options);
  const StreetSurface surface = SurfaceOf(options, houses);
  RandomStream random(MixBits(static_cast<uint64_t>(options.seed), 0xde25e));
  double total = 0;
  for (size_t t = 0; t < surface.triangles.size(); ++t) {
    total += AreaOf(surface, t) * surface.features_per_m2[t];
  }
  std::vector<Eigen::Vector3d> points;
  for (size_t t = 0; t < surface.triangles.size(); ++t) {
    const double share = AreaOf(surface, t) * surface.features_per_m2[t] / total;
    const auto here = static_cast<size_t>(share * static_cast<double>(count));
    for (size_t k = 0; k < here; ++k) {
      Eigen::Vector3d x = AnyPointOn(surface, t, &random);
      for (int axis = 0; axis < 3; ++axis) x[axis] += 10 * options.depth_error * random.Gaussian();
      points.push_back(x);
    }
  }
  return points;
}

void WriteCloud(const std::vector<Eigen::Vector3d>& points, const std::string& path) {
  std::ofstream stream(path, std::ios::binary);
  stream << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.size()
         << "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3f x = point.cast<float>();
    stream.write(reinterpret_cast<const char*>(x.data()), sizeof(float) * 3);
  }
}

StreetErrors CompareStreet(const Outline& truth, const Outline& found,
                           const Similarity& found_from_truth) {
  StreetErrors errors;
  const auto moved = [&](const Eigen::Vector2d& x, double z) {
    return found_from_truth * Eigen::Vector3d(x.x(), x.y(), z);
  };
  const double scale = found_from_truth.scale;
  for (const OutlineBuilding& house : truth.buildings) {
    const OutlineBuilding* best = nullptr;
    double best_error = std::numeric_limits<double>::infinity();
    for (const OutlineBuilding& building : found.buildings) {
      if (building.footprint.size() != house.footprint.size()) continue;
      double worst = 0;
      for (const Eigen::Vector2d& corner : house.footprint) {
        const Eigen::Vector2d at = moved(corner, house.ground).head<2>();
        double nearest = std::numeric_limits<double>::infinity();
        for (const Eigen::Vector2d& other : building.footprint) {
          nearest = std::min(nearest, (other - at).norm());
        }
        worst = std::max(worst, nearest);
      }
      if (worst < best_error) best_error = worst, best = &building;
    }
    if (best == nullptr || best_error > 2 * scale) {
      ++errors.missed;
      continue;
    }
    const auto [true_eaves, true_ridge] = ExtrudeBuilding(house).RoofHeights();
    const auto [eaves, ridge] = ExtrudeBuilding(*best).RoofHeights();
    const auto z_of = [&](double z) { return moved(house.footprint[0], z).z(); };
    errors.corner = std::max(errors.corner, best_error / scale);
    errors.ground = std::max(errors.ground, std::abs(best->ground - z_of(house.ground)) / scale);
    errors.eaves = std::max(errors.eaves, std::abs(eaves - z_of(true_eaves)) / scale);
    errors.ridge = std::max(errors.ridge, std::abs(ridge - z_of(true_ridge)) / scale);
    const double volume = ExtrudeBuilding(house).Volume() * scale * scale * scale;
    errors.volume_share =
        std::max(errors.volume_share, std::abs(ExtrudeBuilding(*best).Volume() / volume - 1));
  }
  return errors;
}

}  // namespace roomtex
