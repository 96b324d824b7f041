#include "capture/simulation/room_layout.h"

#include <algorithm>
#include <optional>

#include <Eigen/Geometry>

#include "capture/simulation/room_builder.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

using Footprint = Eigen::AlignedBox2d;

// In the axes of the piece, metres, with what people need to get at it.
Footprint FootprintOf(Piece piece) {
  const auto box = [](double x0, double y0, double x1, double y1) {
    return Footprint(Eigen::Vector2d(x0, y0), Eigen::Vector2d(x1, y1));
  };
  switch (piece) {
    case Piece::kTable:
      return box(-1.0, -0.95, 1.35, 0.95);
    case Piece::kSofa:
      return box(-0.95, 0, 0.95, 0.85);
    case Piece::kShelf:
      return box(-0.75, 0, 0.75, 0.34);
    case Piece::kSideboard:
      return box(-0.72, 0, 0.72, 0.46);
    case Piece::kFloorLamp:
      return box(-0.24, -0.24, 0.24, 0.24);
    case Piece::kPlant:
      return box(-0.42, -0.42, 0.42, 0.42);
    case Piece::kParcels:
      return box(0, 0, 1.02, 0.43);
  }
  return box(0, 0, 0, 0);
}

Footprint InRoom(const Footprint& of_piece, const Rigid& at) {
  Footprint result;
  for (const auto corner :
       {Footprint::BottomLeft, Footprint::BottomRight, Footprint::TopLeft, Footprint::TopRight}) {
    const Eigen::Vector2d xy = of_piece.corner(corner);
    result.extend((at * Eigen::Vector3d(xy.x(), xy.y(), 0)).head<2>());
  }
  return result;
}

std::vector<PlacedPiece> UsualLayout(const SimulatedRoomOptions& options) {
  const double width = options.width, depth = options.depth;
  const double sideboard_x = (width - 3.3 > 1.2 ? 1.35 : 0.9) + (options.bare ? 0.2 : 0);
  const PlacedPiece table{Piece::kTable, Placed(width - 1.75, 1.55, 0)};
  const PlacedPiece sofa{Piece::kSofa, Placed(0.02, 0.47 * depth, 0, -90)};
  if (options.bare) {
    return {table,
            sofa,
            {Piece::kSideboard, Placed(sideboard_x, 0.016, 0)},
            {Piece::kParcels, Placed(1.0, depth - 0.62, 0, 5)}};
  }
  return {table,
          sofa,
          {Piece::kShelf, Placed(width - 0.015, depth - 1.15, 0, 90)},
          {Piece::kSideboard, Placed(sideboard_x, 0.016, 0)},
          {Piece::kFloorLamp, Placed(0.38, depth - 0.4, 0)},
          {Piece::kPlant, Placed(width - 0.42, 0.42, 0)},
          {Piece::kParcels, Placed(0.95, depth - 0.62, 0, 5)}};
}

class LayoutDrawer {
 public:
  explicit LayoutDrawer(const SimulatedRoomOptions& options)
      : options_(options),
        random_(MixBits(static_cast<uint64_t>(options.layout_seed), 205)),
        // Where the door opens, and who comes in stands.
        door_(Eigen::Vector2d(options.DoorX() - 0.5 * kDoorWidth - 0.1, 0),
              Eigen::Vector2d(options.DoorX() + 0.5 * kDoorWidth + 0.1,
                              options.second_room ? 1.6 : 0.9)) {}

  // The large ones first.
  std::vector<PlacedPiece> Draw() {
    const double area = options_.width * options_.depth;
    AddSome(Piece::kTable, 0.8, area > 24 ? 2 : 1);
    AddSome(Piece::kSofa, 0.6, 2);
    AddSome(Piece::kSideboard, 0.6, 2);
    if (!options_.bare) AddSome(Piece::kShelf, 0.75, 3);
    AddSome(Piece::kParcels, 0.6, 2);
    if (!options_.bare) {
      AddSome(Piece::kPlant, 0.6, 2);
      AddSome(Piece::kFloorLamp, 0.6, 2);
    }
    return placed_;
  }

 private:
  void AddSome(Piece piece, double likely, int most) {
    for (int i = 0; i < most; ++i) {
      if (random_.Uniform() < likely) AddOne(piece);
    }
  }

  void AddOne(Piece piece) {
    for (int attempt = 0; attempt < 40; ++attempt) {
      const Rigid at = StandsFree(piece) ? Free() : AtWall(piece);
      const Footprint footprint = InRoom(FootprintOf(piece), at);
      if (!Fits(piece, footprint)) continue;
      taken_.push_back(footprint);
      placed_.push_back({piece, at});
      return;
    }
  }

  static bool StandsFree(Piece piece) {
    return piece == Piece::kTable || piece == Piece::kFloorLamp || piece == Piece::kPlant;
  }
  // A mirror hangs above a sideboard.
  static bool IsHigh(Piece piece) {
    return piece == Piece::kShelf || piece == Piece::kFloorLamp || piece == Piece::kSideboard;
  }

  Rigid Free() {
    return Placed(random_.Uniform(0, options_.width), random_.Uniform(0, options_.depth), 0,
                  90 * random_.Index(4) + random_.Uniform(-25, 25));
  }

  // Its back to a wall: close, as the turn allows; before the radiator on that of the window.
  Rigid AtWall(Piece piece) {
    const auto wall = static_cast<Wall>(random_.Index(4));
    const double turn = piece == Piece::kShelf ? 0 : random_.Uniform(-4, 4);
    const double half = FootprintOf(piece).sizes().x() / (piece == Piece::kParcels ? 1 : 2);
    const double gap = 0.02 + half * std::abs(std::sin(RadFromDeg(turn))) +
                       (wall == kNorth && !options_.bare_walls ? 0.2 : 0);
    const double along = random_.Uniform();
    switch (wall) {
      case kSouth:
        return Placed(along * options_.width, gap, 0, turn);
      case kEast:
        return Placed(options_.width - gap, along * options_.depth, 0, 90 + turn);
      case kNorth:
        return Placed(along * options_.width, options_.depth - gap, 0, 180 + turn);
      case kWest:
        break;
    }
    return Placed(gap, along * options_.depth, 0, -90 + turn);
  }

  bool Fits(Piece piece, const Footprint& footprint) const {
    constexpr double kFromWall = 0.01, kApart = 0.06, kFromWindow = 0.5;
    const Footprint room(
        Eigen::Vector2d::Constant(kFromWall),
        Eigen::Vector2d(options_.width, options_.depth) - Eigen::Vector2d::Constant(kFromWall));
    if (!room.contains(footprint) || footprint.intersects(door_)) return false;
    const double from_window = options_.depth - footprint.max().y();
    if (IsHigh(piece) && !options_.bare_walls && from_window < kFromWindow) return false;
    return std::all_of(taken_.begin(), taken_.end(), [&](const Footprint& other) {
      return (footprint.min() - other.max()).maxCoeff() > kApart ||
             (other.min() - footprint.max()).maxCoeff() > kApart;
    });
  }

  const SimulatedRoomOptions& options_;
  RandomStream random_;
  Footprint door_;
  std::vector<Footprint> taken_;
  std::vector<PlacedPiece> placed_;
};

}  // namespace

std::vector<PlacedPiece> LayOut(const SimulatedRoomOptions& options) {
  return options.layout_seed < 0 ? UsualLayout(options) : LayoutDrawer(options).Draw();
}

}  // namespace roomtex
