// Walls, floor, ceiling, window, door, light, and what hangs on the walls.

#include <cmath>

#include "capture/simulation/room_builder.h"

namespace roomtex {

using Eigen::Vector3d;

RoomBuilder::RoomBuilder(const SimulatedRoomOptions& options, RoomScene* scene)
    : options_(options),
      scene_(*scene),
      width_(options.width),
      depth_(options.depth),
      height_(options.height) {
  oak_ =
      AddVarnished(MakeWood(RgbFromSrgb(196, 150, 98), NextSeed()), {0.25f, 0.5f, {0.8f, 0.2f, 0}});
  walnut_ =
      AddVarnished(MakeWood(RgbFromSrgb(120, 78, 50), NextSeed()), {0.3f, 0.8f, {0.8f, 0.2f, 0}});
  pine_ =
      AddVarnished(MakeWood(RgbFromSrgb(222, 186, 134), NextSeed()), {0.2f, 0.6f, {0.6f, 0.4f, 0}});
  white_ = Add(MakePlaster(RgbFromSrgb(236, 233, 225), 0.05f, NextSeed()),
               {0.5f, 0.3f, {0.4f, 0.3f, 0.3f}});
  black_ = Add(MakePlaster(RgbFromSrgb(48, 46, 46), 0.15f, NextSeed()),
               {0.05f, 0.6f, {0.4f, 0.3f, 0.3f}});
  metal_ = Add(MakePlaster(RgbFromSrgb(150, 148, 142), 0.12f, NextSeed()),
               {0.55f, 0.3f, {0.3f, 0.3f, 0.3f}});
}

RoomBuilder::WallFrame RoomBuilder::FrameOf(Wall wall) const {
  switch (wall) {
    case kSouth:
      return {{width_, 0, height_}, -Vector3d::UnitX(), Vector3d::UnitY(), width_};
    case kEast:
      return {{width_, depth_, height_}, -Vector3d::UnitY(), -Vector3d::UnitX(), depth_};
    case kNorth:
      return {{0, depth_, height_}, Vector3d::UnitX(), -Vector3d::UnitY(), width_};
    case kWest:
      break;
  }
  return {{0, 0, height_}, Vector3d::UnitY(), Vector3d::UnitX(), depth_};
}

void RoomBuilder::AddShell() {
  int floor, ceiling, walls[4];
  if (options_.bare_walls) {
    const Infrared infrared{0.2f, 0.6f, {0.5f, 0.3f, 0.2f}};
    floor = AddVarnished(MakePlain(RgbFromSrgb(150, 140, 128)), infrared);
    ceiling = Add(MakePlain(RgbFromSrgb(240, 238, 232)), infrared);
    for (int& wall : walls) wall = Add(MakePlain(RgbFromSrgb(226, 222, 212)), infrared);
  } else {
    floor = AddVarnished(MakePlanks(RgbFromSrgb(190, 142, 92), NextSeed()),
                         {0.2f, 0.7f, {0.8f, 0.3f, -0.2f}});
    ceiling = Add(MakePlaster(RgbFromSrgb(238, 234, 224), 0.09f, NextSeed()),
                  {0.75f, -0.35f, {0.3f, 0.3f, 0.3f}});
    walls[kSouth] = Add(MakePlaster(RgbFromSrgb(222, 190, 130), 0.1f, NextSeed()),
                        {0.85f, -0.5f, {0.5f, 0.4f, 0}});
    walls[kEast] = Add(MakeBrick(RgbFromSrgb(176, 96, 70), RgbFromSrgb(200, 192, 180), NextSeed()),
                       {0.15f, 0.6f, {0.9f, 0, 0}});
    walls[kNorth] = Add(MakePlaster(RgbFromSrgb(206, 214, 206), 0.1f, NextSeed()),
                        {0.3f, 0.5f, {0.2f, 0.6f, 0.2f}});
    walls[kWest] = Add(MakeWallpaper(RgbFromSrgb(58, 98, 104),
                                     {RgbFromSrgb(120, 160, 140), RgbFromSrgb(196, 176, 120),
                                      RgbFromSrgb(84, 138, 140), RgbFromSrgb(214, 206, 184),
                                      RgbFromSrgb(168, 104, 78)},
                                     0.11f, NextSeed()),
                       {0.35f, 0.5f, {-0.3f, 0.6f, 0.6f}});
  }
  scene_.AddQuad(floor, {0, depth_, 0}, {width_, 0, 0}, {0, -depth_, 0});
  scene_.AddQuad(ceiling, {0, 0, height_}, {width_, 0, 0}, {0, depth_, 0});
  for (const Wall wall : {kSouth, kEast, kNorth, kWest}) {
    const WallFrame frame = FrameOf(wall);
    if (wall == kNorth && !options_.bare_walls) continue;  // AddWindow
    if (wall == kSouth && options_.second_room) {
      AddWallWithDoorway(walls[wall]);
      continue;
    }
    scene_.AddQuad(walls[wall], frame.top_left, frame.length * frame.right,
                   -height_ * Vector3d::UnitZ());
  }
  num_shell_seeds_ = num_seeds_;
  if (options_.bare_walls) return;
  window_left_ = 0.5 * width_ - 0.85;
  window_right_ = 0.5 * width_ + 0.75;
  const auto piece = [&](double left, double right, double bottom, double top) {
    scene_.AddQuad(walls[kNorth], {left, depth_, top}, {right - left, 0, 0}, {0, 0, bottom - top},
                   {static_cast<float>(left), static_cast<float>(height_ - top)});
  };
  piece(0, window_left_, 0, height_);
  piece(window_right_, width_, 0, height_);
  piece(window_left_, window_right_, window_top_, height_);
  piece(window_left_, window_right_, 0, window_bottom_);
  // Skirting boards and two beams.
  constexpr double kHigh = 0.09, kThick = 0.014;
  Box(white_, 0, 0, 0, width_ - 1.35, kThick, kHigh);
  Box(white_, 0, depth_ - kThick, 0, width_, kThick, kHigh);
  Box(white_, 0, 0, 0, kThick, depth_, kHigh, 1);
  Box(white_, width_ - kThick, 0, 0, kThick, depth_, kHigh, 1);
  Box(walnut_, 0.24 * width_, 0, height_ - 0.16, 0.13, depth_, 0.16, 1);
  Box(walnut_, 0.77 * width_, 0, height_ - 0.16, 0.13, depth_, 0.16, 1);
}

void RoomBuilder::AddWallWithDoorway(int surface) {
  const WallFrame frame = FrameOf(kSouth);
  const auto piece = [&](double left, double right, double bottom) {
    scene_.AddQuad(surface, frame.top_left + left * frame.right, (right - left) * frame.right,
                   (bottom - height_) * Vector3d::UnitZ(), {static_cast<float>(left), 0.0f});
  };
  const double left = width_ - options_.DoorX() - kDoorWidth / 2, right = left + kDoorWidth;
  piece(0, left, 0);
  piece(left, right, kDoorHeight);
  piece(right, frame.length, 0);
}

void RoomBuilder::AddDoorway() {
  // What lies in the wall: the sides, the lintel and the threshold.
  const double left = options_.DoorX() - kDoorWidth / 2, right = left + kDoorWidth;
  const Vector3d through(0, kPartitionThickness, 0), up(0, 0, kDoorHeight);
  const Vector3d foot_left(left, -kPartitionThickness, 0), foot_right(right, 0, 0);
  scene_.AddQuad(white_, foot_left + up, through, -up);
  scene_.AddQuad(white_, foot_right + up, -through, -up);
  scene_.AddQuad(white_, foot_left + up, {kDoorWidth, 0, 0}, through);
  scene_.AddQuad(oak_, foot_left + through, {kDoorWidth, 0, 0}, -through);
}

void RoomBuilder::AddWindow() {
  const double wide = window_right_ - window_left_, tall = window_top_ - window_bottom_;
  constexpr double kBar = 0.055, kDeep = 0.14;
  // Reveal, then the frame at its outer end.
  const double y = depth_;
  Box(white_, window_left_ - 0.02, y, window_bottom_ - 0.02, 0.02, kDeep, tall + 0.04);
  Box(white_, window_right_, y, window_bottom_ - 0.02, 0.02, kDeep, tall + 0.04);
  Box(white_, window_left_ - 0.02, y, window_top_, wide + 0.04, kDeep, 0.02);
  Box(oak_, window_left_ - 0.08, y - 0.09, window_bottom_ - 0.03, wide + 0.16, kDeep + 0.09, 0.03);
  const double frame_y = y + kDeep - 0.06;
  for (const double x : {window_left_, window_left_ + wide / 2 - kBar / 2, window_right_ - kBar}) {
    Box(white_, x, frame_y, window_bottom_, kBar, 0.05, tall, 2);
  }
  for (const double z : {window_bottom_, window_bottom_ + 0.68 * tall, window_top_ - kBar}) {
    Box(white_, window_left_, frame_y + 0.002, z, wide, 0.045, kBar);
  }
  constexpr double kViewWidth = 24, kViewHeight = 12;
  const int outside =
      Add(MakePicture(DrawOutside(3200, 1600, NextSeed()), kViewWidth, kViewHeight, 0, 0),
          {0.3f, 0, {0, 0, 0}}, Surface::Kind::kOutside, true);
  scene_.AddQuad(outside, {width_ / 2 - kViewWidth / 2, depth_ + 6, 1.4 + 0.45 * kViewHeight},
                 {kViewWidth, 0, 0}, {0, 0, -kViewHeight});
}

void RoomBuilder::AddLights() {
  const double x = 0.5 * width_, y = 0.5 * depth_;
  const int lamp = Add(MakePlaster(RgbFromSrgb(252, 246, 230), 0.03f, NextSeed()),
                       {0.8f, 0, {0, 0, 0}}, Surface::Kind::kOpaque, true);
  Box(metal_, x - 0.46, y - 0.26, height_ - 0.035, 0.92, 0.52, 0.035);
  scene_.AddQuad(lamp, {x - 0.43, y - 0.23, height_ - 0.037}, {0.86, 0, 0}, {0, 0.46, 0});
  scene_.AddLight({{x - 0.6, y - 0.6, height_ - 0.06},
                   {1.2, 0, 0},
                   {0, 1.2, 0},
                   LinearRgb(2.5f, 2.35f, 2.05f)});
  if (!options_.bare_walls) {
    scene_.AddLight({{window_left_, depth_ + 0.02, window_top_},
                     {window_right_ - window_left_, 0, 0},
                     {0, 0, window_bottom_ - window_top_},
                     LinearRgb(1.55f, 1.75f, 2.0f)});
  }
}

void RoomBuilder::Hang(Wall wall, double from_left, double z, double width, double height,
                       const cv::Mat& picture, double thickness) {
  const WallFrame frame = FrameOf(wall);
  const Vector3d up = Vector3d::UnitZ();
  const Vector3d corner =
      frame.top_left + (from_left - width / 2) * frame.right - (height_ - z - height / 2) * up;
  const int surface = AddPictureSurface(picture, width, height);
  scene_.AddQuad(surface, corner + thickness * frame.inward, width * frame.right, -height * up);
  if (thickness < 0.01) return;
  // The sides of a frame.
  const int sides = black_;
  const Vector3d out = thickness * frame.inward, right = width * frame.right, down = -height * up;
  scene_.AddQuad(sides, corner, out, down);
  scene_.AddQuad(sides, corner + right + out, -out, down);
  scene_.AddQuad(sides, corner, right, out);
  scene_.AddQuad(sides, corner + out + down, right, -out);
}

void RoomBuilder::AddPictures() {
  const auto mm = [](double metres) { return static_cast<int>(std::lround(1000 * metres)); };
  const auto seed = [this] { return static_cast<uint64_t>(NextSeed()); };
  // West wall, above the sofa.
  Hang(kWest, 0.47 * depth_, 1.62, 1.15, 0.78, DrawLandscape(mm(1.15), mm(0.78), seed()), 0.025);
  Hang(kWest, 0.17 * depth_, 1.85, 0.4, 0.52, DrawAbstract(mm(0.4), mm(0.52), seed()), 0.02);
  Hang(kWest, 0.17 * depth_, 1.27, 0.4, 0.3, DrawFlowers(mm(0.4), mm(0.3), seed()), 0.02);
  Hang(kWest, 0.77 * depth_, 1.72, 0.5, 0.7, DrawCity(mm(0.5), mm(0.7), seed()), 0.02);
  // South wall, from the left: door (AddFurniture), posters, the sideboard with its mirror.
  Hang(kSouth, 1.67, 1.55, 0.55, 0.8, DrawTextPoster(mm(0.55), mm(0.8), "RANGE & COLOUR", seed()));
  Hang(kSouth, 2.42, 1.62, 0.6, 0.85, DrawAbstract(mm(0.6), mm(0.85), seed()), 0.02);
  Hang(kSouth, width_ - 0.32, 1.62, 0.42, 0.62, DrawCalendar(mm(0.42), mm(0.62), seed()));
  // North wall, beside the window.
  Hang(kNorth, 0.62, 1.6, 0.7, 0.95, DrawMap(mm(0.7), mm(0.95), "TERRA NOVA", seed()));
  Hang(kNorth, width_ - 0.95, 1.75, 0.62, 0.45, DrawLandscape(mm(0.62), mm(0.45), seed()), 0.02);
  Hang(kNorth, width_ - 0.95, 1.18, 0.5, 0.36, DrawCity(mm(0.5), mm(0.36), seed()), 0.02);
  // East wall, beside the shelf.
  Hang(kEast, depth_ - 1.35, 1.62, 0.62, 0.88, DrawFlowers(mm(0.62), mm(0.88), seed()), 0.02);
  Hang(kEast, depth_ - 0.5, 1.6, 0.55, 0.8,
       DrawTextPoster(mm(0.55), mm(0.8), "NIGHT TRAINS", seed()));
  Hang(kEast, depth_ - 0.9, 0.72, 0.9, 0.6, DrawMap(mm(0.9), mm(0.6), "OLD HARBOUR", seed()), 0.01);
}

void RoomBuilder::AddDoor() {
  const int door = AddPictureSurface(DrawDoor(880, 2040, NextSeed()), 0.88, 2.04, 0.05f,
                                     {0.5f, 0.3f, {0.2f, 0.5f, 0.2f}});
  const int frame = Add(MakePlaster(RgbFromSrgb(92, 112, 106), 0.1f, NextSeed()),
                        {0.5f, 0.3f, {0.2f, 0.5f, 0.2f}});
  const int brass = Add(MakePlaster(RgbFromSrgb(190, 165, 100), 0.1f, NextSeed()),
                        {0.5f, 0.3f, {0.4f, 0.3f, 0.1f}});
  // Looks along +y; the origin is at its foot, in the middle.
  const Rigid at = Placed(options_.DoorX(), 0, 0);
  constexpr double kWide = kDoorWidth, kHigh = kDoorHeight;
  const bool has_leaf = !options_.second_room;  // else it was taken off its hinges
  if (has_leaf) Face(at, door, {kWide / 2, 0.012, kHigh}, {-kWide, 0, 0}, {0, 0, -kHigh});
  for (const double x : {-kWide / 2 - 0.08, kWide / 2})
    Part(at, frame, x, 0, 0, 0.08, 0.03, kHigh + 0.08, 2);
  Part(at, frame, -kWide / 2, 0, kHigh, kWide, 0.03, 0.08);
  if (!has_leaf) return;
  Part(at, brass, kWide / 2 - 0.1, 0.012, 0.98, 0.035, 0.01, 0.16, 2);
  Part(at, brass, kWide / 2 - 0.18, 0.04, 1.07, 0.11, 0.018, 0.022);
  Part(at, brass, kWide / 2 - 0.09, 0.02, 1.072, 0.018, 0.03, 0.018);
}

}  // namespace roomtex
