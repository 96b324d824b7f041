#include "capture/simulation/room_layout.h"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "capture/simulation/simulated_room.h"

namespace roomtex {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

// Corners of the furniture itself, metres, in the room.
Corners CornersOf(const PlacedPiece& placed) {
  const auto box = [&](double x0, double y0, double x1, double y1) {
    Corners corners;
    for (const auto& [x, y] : {std::pair{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}) {
      corners.push_back((placed.at * Eigen::Vector3d(x, y, 0)).head<2>());
    }
    return corners;
  };
  switch (placed.piece) {
    case Piece::kTable:
      return box(-0.75, -0.45, 0.75, 0.45);
    case Piece::kSofa:
      return box(-0.95, 0, 0.95, 0.85);
    case Piece::kShelf:
      return box(-0.75, 0, 0.75, 0.32);
    case Piece::kSideboard:
      return box(-0.7, 0, 0.7, 0.436);
    case Piece::kFloorLamp:
      return box(-0.15, -0.15, 0.15, 0.15);
    case Piece::kPlant:
      return box(-0.18, -0.18, 0.18, 0.18);
    case Piece::kParcels:
      return box(0, 0, 0.55, 0.42);
  }
  return {};
}

// A line along a side of one of two convex shapes has all of the other beyond it.
bool AreApart(const Corners& a, const Corners& b) {
  for (const auto& [one, other] : {std::pair{&a, &b}, {&b, &a}}) {
    for (size_t i = 0; i < one->size(); ++i) {
      const Eigen::Vector2d side = (*one)[(i + 1) % one->size()] - (*one)[i];
      const Eigen::Vector2d outwards(side.y(), -side.x());
      if (std::all_of(other->begin(), other->end(), [&](const Eigen::Vector2d& corner) {
            return outwards.dot(corner - (*one)[i]) >= 0;
          })) {
        return true;
      }
    }
  }
  return false;
}

TEST(RoomLayout, NothingStandsInAWallOrInSomethingElse) {
  for (int seed = 0; seed < 300; ++seed) {
    SimulatedRoomOptions options;
    options.layout_seed = seed;
    options.width = 4.6 + 0.1 * (seed % 40);
    options.depth = 3.8 + 0.1 * (seed % 31);
    options.bare = seed % 5 == 0;
    options.bare_walls = options.bare;
    const std::vector<PlacedPiece> layout = LayOut(options);
    EXPECT_GE(layout.size(), 1u) << "seed " << seed;
    // Nothing stands where the door opens.
    const double door = options.DoorX();
    std::vector<Corners> others = {
        {{door - 0.44, 0}, {door + 0.44, 0}, {door + 0.44, 0.85}, {door - 0.44, 0.85}}};
    for (const PlacedPiece& placed : layout) {
      const Corners corners = CornersOf(placed);
      for (const Eigen::Vector2d& corner : corners) {
        EXPECT_TRUE(corner.x() > 0 && corner.x() < options.width && corner.y() > 0 &&
                    corner.y() < options.depth)
            << "seed " << seed << ": " << corner.transpose();
      }
      for (const Corners& other : others) EXPECT_TRUE(AreApart(corners, other)) << "seed " << seed;
      others.push_back(corners);
    }
  }
}

TEST(RoomLayout, RoomsDifferInWhatTheyHoldAndWhere) {
  std::set<size_t> numbers;
  std::set<double> sofas;
  for (int seed = 0; seed < 20; ++seed) {
    SimulatedRoomOptions options;
    options.layout_seed = seed;
    const std::vector<PlacedPiece> layout = LayOut(options);
    numbers.insert(layout.size());
    for (const PlacedPiece& placed : layout) {
      if (placed.piece == Piece::kSofa) sofas.insert(placed.at.translation.x());
    }
    // Prints, photos and noise of another seed: the furniture stays.
    options.random_seed = 7;
    const std::vector<PlacedPiece> again = LayOut(options);
    ASSERT_EQ(again.size(), layout.size());
    for (size_t i = 0; i < layout.size(); ++i) {
      EXPECT_EQ(again[i].at.translation, layout[i].at.translation);
    }
  }
  EXPECT_GE(numbers.size(), 4u);
  EXPECT_GE(sofas.size(), 15u);
}

// Where photos are taken from and what they look at.
TEST(RoomLayout, PhotosAndScannersStandElsewhere) {
  SimulatedRoomOptions options;
  options.num_photos = 12;
  options.photo_width = 120;
  options.photo_height = 80;
  options.scan_columns = 120;
  options.scan_rows = 60;
  options.num_stations = 2;
  std::vector<Eigen::Vector3d> stations;
  for (const int seed : {-1, 1, 2, 3}) {
    options.layout_seed = seed;
    const SimulatedRoom room(options);
    for (int photo = 0; photo < room.NumPhotos(); ++photo) {
      const Rigid room_from_cam = (room.CamFromScan(photo) * room.ScanFromRoom()).Inverse();
      const Eigen::Vector3d place = room_from_cam.translation;
      EXPECT_GT(place.minCoeff(), 0.5) << "seed " << seed;
      EXPECT_LT(place.x(), options.width - 0.5);
      EXPECT_LT(place.y(), options.depth - 0.5);
    }
    stations.push_back(room.ScanFromRoom().Inverse().translation);
  }
  for (size_t i = 0; i < stations.size(); ++i) {
    for (size_t k = 0; k < i; ++k) EXPECT_GT((stations[i] - stations[k]).norm(), 0.2);
  }
}

}  // namespace
}  // namespace roomtex
