#include "texture/sampling/mesh_front.h"

#include <set>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

// The walls of a room of 4 x 3 x 2.5 m, each of two triangles. shared: with corners in common, as
// one closed surface; outwards: which walls are wound so.
Scan Box(bool shared, const std::set<int>& outwards) {
  const int walls[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1},
                           {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
  Scan mesh;
  mesh.organised = false;
  mesh.station_is_assumed = true;
  const auto corner = [](int i) {
    return Eigen::Vector3d(4.0 * (i & 1), 3.0 * (i >> 1 & 1), 2.5 * (i >> 2));
  };
  for (int i = 0; shared && i < 8; ++i) mesh.points.push_back(corner(i));
  for (int wall = 0; wall < 6; ++wall) {
    int c[4];
    for (int k = 0; k < 4; ++k) {
      c[k] = shared ? walls[wall][k] : static_cast<int>(mesh.points.size());
      if (!shared) mesh.points.push_back(corner(walls[wall][k]) + Eigen::Vector3d::Constant(wall));
    }
    if (!shared) {  // each a little apart, so that they are pieces of their own
      for (int k = 0; k < 4; ++k) mesh.points[c[k]] -= Eigen::Vector3d::Constant(0.999 * wall);
    }
    const bool is_turned = outwards.count(wall) > 0;
    for (const int k : {1, 2}) {
      Triangle t = {c[0], c[k], c[k + 1]};
      if (is_turned) std::swap(t[1], t[2]);
      mesh.triangles.push_back(t);
    }
  }
  mesh.num_columns = static_cast<int>(mesh.points.size());
  mesh.num_rows = 1;
  return mesh;
}

// From the middle of the room, all around.
std::vector<PhotoView> Photos() {
  std::vector<PhotoView> photos;
  for (int i = 0; i < 4; ++i) {
    PhotoView photo;
    photo.camera.model = CameraModel::kEquirectangular;
    photo.camera.width = 200;
    photo.camera.height = 100;
    photo.camera.params = {200, 100};
    photo.cam_from_scan.translation = -Eigen::Vector3d(1 + 0.5 * i, 1.4, 1.2);
    photos.push_back(photo);
  }
  return photos;
}

// Seen from within, all triangles are wound inwards.
void ExpectInwards(const Scan& mesh) {
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.points[t[0]];
    const Eigen::Vector3d normal = (mesh.points[t[1]] - a).cross(mesh.points[t[2]] - a);
    EXPECT_GT(normal.dot(Eigen::Vector3d(2, 1.5, 1.25) - a), 0);
  }
}

TEST(MeshFront, ATurnedRoomIsTurnedBack) {
  for (const bool shared : {true, false}) {
    for (const std::set<int>& outwards :
         {std::set<int>{}, {0, 1, 2, 3, 4, 5}, {1, 4}, {0, 2, 3, 5}}) {
      Scan mesh = Box(shared, outwards);
      EXPECT_EQ(TurnMeshToPhotos(Photos(), 2, &mesh), 2 * outwards.size());
      ExpectInwards(mesh);
    }
  }
}

TEST(MeshFront, AWallBetweenTwoRoomsAndWhatNobodySeesStay) {
  Scan wall = Box(true, {});
  wall.triangles = {wall.triangles[8], wall.triangles[9]};  // at x = 0
  std::vector<PhotoView> photos = Photos();
  photos.resize(2);
  photos[0].cam_from_scan.translation.x() = -1;
  photos[1].cam_from_scan.translation.x() = 1;  // behind it
  const std::vector<Triangle> before = wall.triangles;
  EXPECT_EQ(TurnMeshToPhotos(photos, 1, &wall), 0u);
  EXPECT_EQ(wall.triangles, before);
  photos.clear();
  EXPECT_EQ(TurnMeshToPhotos(photos, 1, &wall), 0u);
}

TEST(MeshFront, AMeshOfAKnownStationIsBelieved) {
  Scan mesh = Box(true, {0, 1, 2, 3, 4, 5});
  mesh.station_is_assumed = false;
  EXPECT_EQ(TurnMeshToPhotos(Photos(), 1, &mesh), 0u);
}

}  // namespace
}  // namespace roomtex
