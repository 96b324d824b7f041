#include "capture/room_furniture.h"

#include <cmath>

#include "capture/random_stream.h"
#include "capture/room_pictures.h"

namespace roomtex {
namespace {

using Eigen::Vector3d;

enum Wall { kSouth, kEast, kNorth, kWest };  // y = 0, x = width, y = depth, x = 0

Rigid Placed(double x, double y, double z, double yaw_deg = 0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(yaw_deg), Vector3d::UnitZ())),
          Vector3d(x, y, z)};
}

class Builder {
 public:
  Builder(const SimulatedRoomOptions& options, RoomScene* scene)
      : options_(options),
        scene_(*scene),
        width_(options.width),
        depth_(options.depth),
        height_(options.height) {
    oak_ = Add(MakeWood(RgbFromSrgb(196, 150, 98), NextSeed()), {0.25f, 0.5f, {0.8f, 0.2f, 0}});
    walnut_ = Add(MakeWood(RgbFromSrgb(120, 78, 50), NextSeed()), {0.3f, 0.8f, {0.8f, 0.2f, 0}});
    pine_ = Add(MakeWood(RgbFromSrgb(222, 186, 134), NextSeed()), {0.2f, 0.6f, {0.6f, 0.4f, 0}});
    white_ = Add(MakePlaster(RgbFromSrgb(236, 233, 225), 0.05f, NextSeed()),
                 {0.5f, 0.3f, {0.4f, 0.3f, 0.3f}});
    black_ = Add(MakePlaster(RgbFromSrgb(48, 46, 46), 0.15f, NextSeed()),
                 {0.05f, 0.6f, {0.4f, 0.3f, 0.3f}});
    metal_ = Add(MakePlaster(RgbFromSrgb(150, 148, 142), 0.12f, NextSeed()),
                 {0.55f, 0.3f, {0.3f, 0.3f, 0.3f}});
  }

  void AddShell();
  void AddWindow();
  void AddLights();
  void AddPictures();
  void AddFurniture();

 private:
  struct WallFrame {
    Vector3d top_left, right, inward;  // seen from the room
    double length;
  };

  uint32_t NextSeed() {
    return static_cast<uint32_t>(
        MixBits(static_cast<uint64_t>(options_.random_seed), 77, ++num_seeds_));
  }
  int Add(const TexturePtr& texture, const Infrared& infrared,
          Surface::Kind kind = Surface::Kind::kOpaque, bool shines = false) {
    return scene_.AddSurface({texture, infrared, kind, shines});
  }
  // A picture of this size in metres, one pixel per millimetre of its longer side.
  int AddPictureSurface(const cv::Mat& picture, double width, double height, float grain = 0.03f,
                        const Infrared& infrared = {0.3f, 0.45f, {0.9f, 0.2f, -0.3f}}) {
    return Add(MakePicture(picture, static_cast<float>(width), static_cast<float>(height), grain,
                           NextSeed()),
               infrared);
  }
  WallFrame FrameOf(Wall wall) const;
  // Box in room axes.
  void Box(int surface, double x, double y, double z, double sx, double sy, double sz,
           int along = 0) {
    scene_.AddBox(surface, Placed(x, y, z), {sx, sy, sz}, along);
  }
  // Box in the axes of a piece of furniture.
  void Part(const Rigid& room_from_piece, int surface, double x, double y, double z, double sx,
            double sy, double sz, int along = 0) {
    scene_.AddBox(surface, room_from_piece * Placed(x, y, z), {sx, sy, sz}, along);
  }
  // Picture on the face of something: corner at the upper left, seen from the front.
  void Face(const Rigid& room_from_piece, int surface, const Vector3d& corner,
            const Vector3d& right, const Vector3d& down) {
    scene_.AddQuad(surface, room_from_piece * corner, room_from_piece.rotation * right,
                   room_from_piece.rotation * down);
  }
  // Centre `from_left` metres along the wall and `z` above the floor.
  void Hang(Wall wall, double from_left, double z, double width, double height,
            const cv::Mat& picture, double thickness = 0.004);
  void AddTable(const Rigid& at);
  void AddChair(const Rigid& at, int cushion);
  void AddSofa(const Rigid& at);
  void AddShelf(const Rigid& at, double width);
  void AddBookRow(const Rigid& at, double z, double from, double to);
  void AddSideboard(const Rigid& at);
  void AddFloorLamp(double x, double y);
  void AddPlant(double x, double y, double z, double size);
  void AddParcels(const Rigid& at);
  void AddCurtain(double x0, double x1, double y, int surface);

  const SimulatedRoomOptions& options_;
  RoomScene& scene_;
  double width_, depth_, height_;
  uint64_t num_seeds_ = 0;
  int oak_, walnut_, pine_, white_, black_, metal_;
  // The opening of the window in the north wall.
  double window_left_ = 0, window_right_ = 0, window_bottom_ = 0.85, window_top_ = 2.15;
};

Builder::WallFrame Builder::FrameOf(Wall wall) const {
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

void Builder::AddShell() {
  int floor, ceiling, walls[4];
  if (options_.bare_walls) {
    const Infrared infrared{0.2f, 0.6f, {0.5f, 0.3f, 0.2f}};
    floor = Add(MakePlain(RgbFromSrgb(150, 140, 128)), infrared);
    ceiling = Add(MakePlain(RgbFromSrgb(240, 238, 232)), infrared);
    for (int& wall : walls) wall = Add(MakePlain(RgbFromSrgb(226, 222, 212)), infrared);
  } else {
    floor =
        Add(MakePlanks(RgbFromSrgb(190, 142, 92), NextSeed()), {0.2f, 0.7f, {0.8f, 0.3f, -0.2f}});
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
    scene_.AddQuad(walls[wall], frame.top_left, frame.length * frame.right,
                   -height_ * Vector3d::UnitZ());
  }
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

void Builder::AddWindow() {
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

void Builder::AddLights() {
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

void Builder::Hang(Wall wall, double from_left, double z, double width, double height,
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

void Builder::AddPictures() {
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

void Builder::AddTable(const Rigid& at) {
  constexpr double kLong = 1.4, kWide = 0.8, kHigh = 0.74;
  Part(at, oak_, -kLong / 2, -kWide / 2, kHigh - 0.032, kLong, kWide, 0.032);
  for (const double x : {-kLong / 2 + 0.04, kLong / 2 - 0.11}) {
    for (const double y : {-kWide / 2 + 0.04, kWide / 2 - 0.11}) {
      Part(at, oak_, x, y, 0, 0.07, 0.07, kHigh - 0.032, 2);
    }
  }
  Part(at, oak_, -kLong / 2 + 0.11, -kWide / 2 + 0.06, kHigh - 0.12, kLong - 0.22, 0.025, 0.088);
  Part(at, oak_, -kLong / 2 + 0.11, kWide / 2 - 0.085, kHigh - 0.12, kLong - 0.22, 0.025, 0.088);
  // A laptop, newspapers, a pile of books, a cup and a bowl.
  const Rigid laptop = at * Placed(-0.3, 0.0, kHigh, 14);
  Part(laptop, metal_, -0.17, -0.12, 0, 0.34, 0.24, 0.018);
  Rigid lid = laptop * Placed(-0.17, 0.12, 0.018);
  lid.rotation =
      lid.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(-18), Vector3d::UnitX()));
  Part(lid, metal_, 0, 0, 0, 0.34, 0.012, 0.22);
  Face(lid, AddPictureSurface(DrawScreen(340, 220, NextSeed()), 0.34, 0.22, 0), {0, -0.002, 0.22},
       {0.34, 0, 0}, {0, 0, -0.22});
  const Rigid paper = at * Placed(0.22, -0.17, kHigh, -25);
  Face(paper, AddPictureSurface(DrawTextPoster(300, 400, "MORNING POST", NextSeed()), 0.3, 0.4),
       {-0.15, 0.2, 0.004}, {0.3, 0, 0}, {0, -0.4, 0});
  double z = kHigh;
  for (int i = 0; i < 4; ++i) {
    const double thick = 0.022 + 0.008 * (i % 3);
    const Rigid book = at * Placed(0.45, 0.14, z, 12.0 * i - 20);
    const int cover = AddPictureSurface(
        i == 3 ? DrawAbstract(170, 240, NextSeed()) : DrawBookSpine(170, 240, NextSeed()), 0.17,
        0.24);
    Part(book, cover, -0.12, -0.085, 0, 0.24, 0.17, thick);
    if (i == 3) Face(book, cover, {0.12, 0.085, thick + 0.001}, {0, -0.17, 0}, {-0.24, 0, 0});
    z += thick;
  }
  const Vector3d cup = at * Vector3d(0.02, 0.24, kHigh), bowl = at * Vector3d(-0.5, -0.24, kHigh);
  const int glaze = Add(
      MakePlaid({RgbFromSrgb(230, 228, 220), RgbFromSrgb(40, 80, 150), RgbFromSrgb(230, 228, 220)},
                0.014f, NextSeed()),
      {0.5f, 0.2f, {0.3f, 0.3f, 0.3f}});
  scene_.AddFrustum(glaze, cup, 0.032, 0.043, 0.095, 14, true);
  scene_.AddFrustum(glaze, bowl, 0.06, 0.13, 0.075, 18, true);
  for (int i = 0; i < 5; ++i) {
    const int fruit = Add(MakeBlotches(i % 2 ? RgbFromSrgb(200, 50, 40) : RgbFromSrgb(225, 140, 30),
                                       RgbFromSrgb(215, 180, 60), 0.04f, NextSeed()),
                          {0.6f, 0.2f, {0.5f, 0.2f, 0}});
    const Vector3d foot =
        bowl + Vector3d(0.06 * std::cos(1.3 * i), 0.06 * std::sin(1.3 * i), 0.075);
    scene_.AddFrustum(fruit, foot, 0.025, 0.04, 0.03, 10, false);
    scene_.AddFrustum(fruit, foot + Vector3d(0, 0, 0.03), 0.04, 0.015, 0.035, 10, false);
    scene_.AddFrustum(fruit, foot + Vector3d(0, 0, 0.065), 0.015, 0.0, 0.003, 10, false);
  }
}

void Builder::AddChair(const Rigid& at, int cushion) {
  // Looks along +y; the origin is under the middle of the seat.
  constexpr double kSeat = 0.45, kHalf = 0.21, kLeg = 0.038;
  Part(at, pine_, -kHalf, -kHalf, kSeat - 0.03, 2 * kHalf, 2 * kHalf, 0.03);
  Part(at, cushion, -kHalf + 0.02, -kHalf + 0.02, kSeat, 2 * kHalf - 0.04, 2 * kHalf - 0.04, 0.035);
  for (const double x : {-kHalf, kHalf - kLeg}) {
    Part(at, pine_, x, kHalf - kLeg, 0, kLeg, kLeg, kSeat - 0.03, 2);
    Part(at, pine_, x, -kHalf, 0, kLeg, kLeg, 0.95, 2);
  }
  for (const double z : {0.6, 0.73, 0.86}) {
    Part(at, pine_, -kHalf + kLeg, -kHalf + 0.008, z, 2 * (kHalf - kLeg), 0.02, 0.075);
  }
}

void Builder::AddSofa(const Rigid& at) {
  // Looks along +y; the origin is in the middle of its back.
  constexpr double kLong = 1.9, kDeep = 0.85, kArm = 0.18;
  const int cloth = Add(MakePlaid({RgbFromSrgb(150, 88, 62), RgbFromSrgb(172, 112, 78),
                                   RgbFromSrgb(128, 70, 52), RgbFromSrgb(186, 140, 104)},
                                  0.035f, NextSeed()),
                        {0.65f, 0.25f, {0.5f, 0.2f, 0.2f}});
  const int first = Add(
      MakePlaid({RgbFromSrgb(48, 88, 96), RgbFromSrgb(214, 200, 160), RgbFromSrgb(84, 130, 130)},
                0.03f, NextSeed()),
      {0.5f, 0.4f, {0.5f, 0.2f, 0.2f}});
  const int second = AddPictureSurface(DrawFlowers(420, 420, NextSeed()), 0.42, 0.42, 0.06f);
  Part(at, cloth, -kLong / 2, 0, 0.06, kLong, kDeep, 0.22);
  Part(at, cloth, -kLong / 2, 0, 0.28, kLong, 0.22, 0.54);
  Part(at, cloth, -kLong / 2, 0.22, 0.28, kArm, kDeep - 0.22, 0.32);
  Part(at, cloth, kLong / 2 - kArm, 0.22, 0.28, kArm, kDeep - 0.22, 0.32);
  const double seat = kLong / 2 - kArm;
  Part(at, cloth, -seat + 0.004, 0.22, 0.28, seat - 0.008, kDeep - 0.2, 0.15);
  Part(at, cloth, 0.004, 0.22, 0.28, seat - 0.008, kDeep - 0.2, 0.15);
  for (const double x : {-kLong / 2 + 0.05, kLong / 2 - 0.11}) {
    for (const double y : {0.05, kDeep - 0.11}) Part(at, walnut_, x, y, 0, 0.06, 0.06, 0.06, 2);
  }
  for (int i = 0; i < 2; ++i) {
    Rigid pillow = at * Placed(i == 0 ? -0.45 : 0.5, 0.36, 0.43, i == 0 ? 12 : -17);
    pillow.rotation =
        pillow.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(22), Vector3d::UnitX()));
    Part(pillow, first, -0.21, -0.05, 0, 0.42, 0.1, 0.42);
    if (i == 1) Face(pillow, second, {0.21, 0.052, 0.42}, {-0.42, 0, 0}, {0, 0, -0.42});
  }
}

void Builder::AddBookRow(const Rigid& at, double z, double from, double to) {
  RandomStream random(NextSeed());
  for (double x = from; x < to - 0.03;) {
    const double thick = std::min(random.Uniform(0.02, 0.055), to - x),
                 high = random.Uniform(0.19, 0.275);
    const double deep = random.Uniform(0.15, 0.22);
    const double front = 0.3 - random.Uniform(0.01, 0.05);
    const auto px = [](double metres) { return static_cast<int>(std::lround(1000 * metres)); };
    const int spine = AddPictureSurface(
        DrawBookSpine(px(thick), px(high), NextSeed()), thick, high, 0.04f,
        {static_cast<float>(random.Uniform(0.15, 0.6)), 0.4f, {0.5f, 0.2f, -0.2f}});
    const Rigid book = at * Placed(x, front - deep, z);
    // The cover has the colours of the spine: a far place of its picture is its border.
    Part(book, spine, 0, 0, 0, thick - 0.001, deep, high);
    Face(book, spine, {thick - 0.001, deep + 0.001, high}, {-thick + 0.001, 0, 0}, {0, 0, -high});
    x += thick;
    if (random.Uniform() < 0.06) x += random.Uniform(0.04, 0.14);
  }
}

void Builder::AddShelf(const Rigid& at, double width) {
  // Looks along +y; the origin is at the foot of its back, in the middle.
  constexpr double kDeep = 0.32, kHigh = 2.05, kBoard = 0.024;
  const Rigid left = at * Placed(-width / 2, 0, 0);
  Part(left, walnut_, 0, 0, 0, kBoard, kDeep, kHigh, 2);
  Part(left, walnut_, width - kBoard, 0, 0, kBoard, kDeep, kHigh, 2);
  Part(left, walnut_, kBoard, 0, 0, width - 2 * kBoard, 0.01, kHigh, 2);
  const double middle = width * 0.52;
  Part(left, walnut_, middle, 0.01, 0.08, kBoard, kDeep - 0.015, kHigh - 0.1, 2);
  for (int level = 0; level < 6; ++level) {
    const double z = level == 0 ? 0.06 : 0.06 + level * (kHigh - 0.06 - kBoard) / 5.0;
    Part(left, walnut_, kBoard, 0.01, z, width - 2 * kBoard, kDeep - 0.012, kBoard);
    if (level == 5) break;
    const double top = z + kBoard;
    const bool left_full = level != 3, right_full = level != 1;
    AddBookRow(left, top, kBoard + 0.005, left_full ? middle : 0.3 * width);
    AddBookRow(left, top, middle + kBoard + 0.005,
               right_full ? width - kBoard - 0.01 : 0.75 * width);
  }
  const double step = (kHigh - 0.06 - kBoard) / 5.0;
  const Vector3d vase = left * Vector3d(0.42 * width, 0.16, 0.06 + 3 * step + kBoard);
  const int glaze =
      Add(MakeBlotches(RgbFromSrgb(60, 110, 140), RgbFromSrgb(200, 210, 190), 0.05f, NextSeed()),
          {0.4f, 0.3f, {0.2f, 0.2f, 0.5f}});
  scene_.AddFrustum(glaze, vase, 0.045, 0.085, 0.11, 16, true);
  scene_.AddFrustum(glaze, vase + Vector3d(0, 0, 0.11), 0.085, 0.03, 0.1, 16, true);
  const Rigid photo = left * Placed(0.86 * width, 0.2, 0.06 + step + kBoard, 8);
  Part(photo, black_, -0.1, 0, 0, 0.2, 0.015, 0.26);
  Face(photo, AddPictureSurface(DrawCity(170, 230, NextSeed()), 0.17, 0.23), {0.085, 0.017, 0.245},
       {-0.17, 0, 0}, {0, 0, -0.23});
  const Rigid carton = at * Placed(-0.35, 0.05, kHigh, 6);
  Part(carton, AddPictureSurface(DrawCardboard(420, 240, NextSeed()), 0.42, 0.24), 0, 0, 0, 0.42,
       0.24, 0.2);
}

void Builder::AddSideboard(const Rigid& at) {
  // Looks along +y; the origin is at the foot of its back, in the middle.
  constexpr double kLong = 1.4, kDeep = 0.42, kHigh = 0.82;
  Part(at, oak_, -kLong / 2, 0, 0.08, kLong, kDeep, kHigh - 0.08);
  Part(at, walnut_, -kLong / 2 - 0.015, 0, kHigh, kLong + 0.03, kDeep + 0.02, 0.025);
  Part(at, black_, -kLong / 2 + 0.03, 0.03, 0, kLong - 0.06, kDeep - 0.06, 0.08);
  for (int i = 0; i < 3; ++i) {
    const double x = -kLong / 2 + 0.02 + i * (kLong - 0.04) / 3;
    const double wide = (kLong - 0.04) / 3 - 0.012;
    Part(at, i == 1 ? walnut_ : pine_, x, kDeep, 0.1, wide, 0.016, kHigh - 0.13, 2);
    scene_.AddBox(metal_, at * Placed(x + (i == 2 ? 0.03 : wide - 0.05), kDeep + 0.016, 0.5),
                  {0.02, 0.025, 0.09});
  }
  const double top = kHigh + 0.025;
  const Rigid clock = at * Placed(0.42, 0.2, top, -10);
  Part(clock, walnut_, -0.13, -0.04, 0, 0.26, 0.08, 0.28);
  Face(clock, AddPictureSurface(DrawClock(240, NextSeed()), 0.24, 0.24, 0), {0.12, 0.042, 0.26},
       {-0.24, 0, 0}, {0, 0, -0.24});
  const int radio = AddPictureSurface(DrawScreen(300, 180, NextSeed()), 0.3, 0.18);
  const Rigid set = at * Placed(-0.52, 0.12, top, 9);
  Part(set, black_, 0, 0, 0, 0.3, 0.14, 0.18);
  Face(set, radio, {0.3, 0.142, 0.18}, {-0.3, 0, 0}, {0, 0, -0.18});
  const Vector3d plant = at * Vector3d(-0.08, 0.2, top);
  AddPlant(plant.x(), plant.y(), plant.z(), 0.4);
  // The mirror above it, in a frame.
  const int mirror =
      Add(MakePlain(RgbFromSrgb(225, 228, 228)), {0, 0, {0, 0, 0}}, Surface::Kind::kMirror);
  constexpr double kMirrorWide = 0.62, kMirrorHigh = 0.8, kMirrorFoot = 1.15, kRim = 0.05;
  Face(at, mirror, {kMirrorWide / 2, 0.015, kMirrorFoot + kMirrorHigh}, {-kMirrorWide, 0, 0},
       {0, 0, -kMirrorHigh});
  for (const double x : {-kMirrorWide / 2 - kRim, kMirrorWide / 2}) {
    Part(at, walnut_, x, 0.002, kMirrorFoot - kRim, kRim, 0.028, kMirrorHigh + 2 * kRim, 2);
  }
  for (const double z : {kMirrorFoot - kRim, kMirrorFoot + kMirrorHigh}) {
    Part(at, walnut_, -kMirrorWide / 2, 0.002, z, kMirrorWide, 0.028, kRim);
  }
}

void Builder::AddFloorLamp(double x, double y) {
  const int shade = Add(MakePlaid({RgbFromSrgb(244, 226, 180), RgbFromSrgb(238, 210, 150),
                                   RgbFromSrgb(225, 190, 130)},
                                  0.03f, NextSeed()),
                        {0.6f, 0.2f, {0.3f, 0.3f, 0.3f}}, Surface::Kind::kOpaque, true);
  scene_.AddFrustum(black_, {x, y, 0}, 0.15, 0.14, 0.025, 20, true);
  scene_.AddFrustum(metal_, {x, y, 0.025}, 0.014, 0.014, 1.4, 10, true);
  scene_.AddFrustum(shade, {x, y, 1.32}, 0.22, 0.14, 0.3, 20, false);
}

void Builder::AddPlant(double x, double y, double z, double size) {
  RandomStream random(NextSeed());
  const int pot =
      Add(MakeBlotches(RgbFromSrgb(176, 96, 62), RgbFromSrgb(206, 130, 92), 0.08f, NextSeed()),
          {0.3f, 0.5f, {0.7f, 0.2f, 0}});
  const int soil =
      Add(MakeBlotches(RgbFromSrgb(60, 44, 34), RgbFromSrgb(96, 74, 56), 0.02f, NextSeed()),
          {0.1f, 0.4f, {0.5f, 0.3f, 0}});
  const int leaf =
      Add(MakeBlotches(RgbFromSrgb(46, 104, 48), RgbFromSrgb(140, 176, 84), 0.06f, NextSeed()),
          {0.75f, 0.3f, {0, 0.5f, 0}});
  const Vector3d foot(x, y, z);
  const double pot_high = 0.3 * size, pot_radius = 0.17 * size;
  scene_.AddFrustum(pot, foot, 0.75 * pot_radius, pot_radius, pot_high, 16, true);
  scene_.AddFrustum(soil, foot + Vector3d(0, 0, pot_high), 0.9 * pot_radius, 0.88 * pot_radius,
                    0.004, 16, true);
  const Vector3d base = foot + Vector3d(0, 0, pot_high);
  // Every leaf is a stem and two bent halves, each two triangles wide.
  for (int i = 0; i < 34; ++i) {
    const double turn = 2.4 * i + random.Uniform(-0.4, 0.4), rise = random.Uniform(0.35, 1.35);
    const double stem = size * random.Uniform(0.15, 0.62),
                 length = size * random.Uniform(0.2, 0.34);
    const Vector3d out(std::cos(turn), std::sin(turn), 0), side(-std::sin(turn), std::cos(turn), 0);
    const Vector3d direction = std::cos(rise) * out + std::sin(rise) * Vector3d::UnitZ();
    const Vector3d start = base + stem * direction;
    const Vector3d middle = start + 0.5 * length * direction;
    const Vector3d tip =
        middle + 0.5 * length * (0.9 * out + 0.25 * direction - 0.35 * Vector3d::UnitZ());
    const double half = 0.3 * length;
    const Vector3d dip(0, 0, 0.12 * length);
    const auto triangle = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
      Patch patch;
      patch.origin = a;
      patch.edge_s = b - a;
      patch.edge_t = c - a;
      patch.is_triangle = patch.two_sided = true;
      patch.surface = leaf;
      patch.uv_origin = {static_cast<float>(random.Uniform(0, 20)),
                         static_cast<float>(random.Uniform(0, 20))};
      patch.uv_s = {static_cast<float>(patch.edge_s.norm()), 0};
      patch.uv_t = {0, static_cast<float>(patch.edge_t.norm())};
      scene_.AddPatch(patch);
    };
    for (const double sign : {-1.0, 1.0}) {
      const Vector3d edge = middle + sign * half * side + dip;
      triangle(start, middle, edge);
      triangle(middle, tip, edge);
    }
    triangle(base, start + 0.006 * size * side, start - 0.006 * size * side);
  }
}

void Builder::AddParcels(const Rigid& at) {
  const auto parcel = [&](const Rigid& where, double sx, double sy, double sz) {
    const auto px = [](double metres) { return static_cast<int>(std::lround(1000 * metres)); };
    const int plain = Add(MakePlaster(RgbFromSrgb(176, 138, 92), 0.09f, NextSeed()),
                          {0.3f, 0.6f, {0.6f, 0.3f, 0}});
    Part(where, plain, 0, 0, 0, sx, sy, sz);
    const Vector3d x(sx, 0, 0), y(0, sy, 0), z(0, 0, sz);
    constexpr double kOff = 0.0015;
    const auto show = [&](const Vector3d& corner, const Vector3d& right, const Vector3d& down) {
      const Vector3d out = kOff * down.cross(right).normalized();
      const double wide = right.norm(), high = down.norm();
      Face(where, AddPictureSurface(DrawCardboard(px(wide), px(high), NextSeed()), wide, high),
           corner + out, right, down);
    };
    show(z, x, -z);
    show(x + y + z, -x, -z);
    show(x + z, y, -z);
    show(y + z, -y, -z);
    show(y + z, x, -y);
  };
  parcel(at, 0.55, 0.42, 0.38);
  parcel(at * Placed(0.08, 0.03, 0.38, 9), 0.4, 0.32, 0.28);
  parcel(at * Placed(0.62, 0.03, 0, -6), 0.38, 0.34, 0.3);
}

void Builder::AddCurtain(double x0, double x1, double y, int surface) {
  constexpr int kStrips = 18;
  const auto at = [&](int i) {
    const double t = static_cast<double>(i) / kStrips;
    return Vector3d(x0 + t * (x1 - x0), y + 0.028 * std::sin(2 * kPi * 3.2 * t), 2.32);
  };
  float u = static_cast<float>(3 * x0);
  for (int i = 0; i < kStrips; ++i) {
    Patch patch;
    patch.origin = at(i);
    patch.edge_s = at(i + 1) - at(i);
    patch.edge_t = Vector3d(0, 0, -2.2);
    patch.two_sided = true;
    patch.surface = surface;
    const auto wide = static_cast<float>(patch.edge_s.norm());
    patch.uv_origin = {u, 0};
    patch.uv_s = {wide, 0};
    patch.uv_t = {0, 2.2f};
    u += wide;
    scene_.AddPatch(patch);
  }
}

void Builder::AddFurniture() {
  const auto cushion = [&](int red, int green, int blue) {
    return Add(MakePlaid({RgbFromSrgb(red, green, blue), RgbFromSrgb(220, 208, 184),
                          RgbFromSrgb(red / 2, green / 2, blue / 2)},
                         0.03f, NextSeed()),
               {0.6f, 0.2f, {0.5f, 0.2f, 0.2f}});
  };
  // Floor: the rug under the table.
  const double table_x = width_ - 1.75, table_y = 1.55;
  const auto rug = AddPictureSurface(DrawRug(2300, 1600, NextSeed()), 2.3, 1.6, 0.1f,
                                     {0.5f, 0.35f, {0.3f, 0.3f, 0.3f}});
  const Rigid rug_at = Placed(table_x - 0.15, table_y + 0.1, 0, 4);
  Face(rug_at, rug, {-1.15, 0.8, 0.007}, {2.3, 0, 0}, {0, -1.6, 0});
  AddTable(Placed(table_x, table_y, 0, 7));
  AddChair(Placed(table_x - 0.3, table_y - 0.62, 0, 10), cushion(170, 60, 50));
  AddChair(Placed(table_x + 0.35, table_y + 0.66, 0, 174), cushion(60, 100, 150));
  AddChair(Placed(table_x + 1.02, table_y - 0.1, 0, 101), cushion(90, 130, 70));
  AddSofa(Placed(0.02, 0.47 * depth_, 0, -90));
  AddShelf(Placed(width_ - 0.015, depth_ - 1.15, 0, 90), 1.5);
  AddSideboard(Placed(width_ - 3.3 > 1.2 ? 1.35 : 0.9, 0.016, 0));
  AddFloorLamp(0.38, depth_ - 0.4);
  AddPlant(width_ - 0.42, 0.42, 0, 1.1);
  AddParcels(Placed(0.95, depth_ - 0.62, 0, 5));
  if (options_.bare_walls) return;
  // Radiator under the window and curtains beside it.
  for (int rib = 0; rib < 20; ++rib) {
    Box(white_, window_left_ + 0.2 + 0.06 * rib, depth_ - 0.11, 0.14, 0.045, 0.08, 0.55, 2);
  }
  Box(white_, window_left_ + 0.18, depth_ - 0.08, 0.6, 1.24, 0.02, 0.03);
  Box(white_, window_left_ + 0.18, depth_ - 0.08, 0.2, 1.24, 0.02, 0.03);
  const int curtain = Add(MakePlaid({RgbFromSrgb(196, 96, 62), RgbFromSrgb(214, 132, 84),
                                     RgbFromSrgb(232, 190, 140), RgbFromSrgb(150, 66, 50)},
                                    0.05f, NextSeed()),
                          {0.7f, 0.15f, {0.3f, 0.3f, 0.3f}});
  AddCurtain(window_left_ - 0.32, window_left_ + 0.03, depth_ - 0.15, curtain);
  AddCurtain(window_right_ - 0.03, window_right_ + 0.32, depth_ - 0.15, curtain);
  Box(metal_, window_left_ - 0.4, depth_ - 0.16, 2.325, window_right_ - window_left_ + 0.8, 0.02,
      0.02);
}

void AddDoorOn(const Rigid& at, int door, int frame, int handle, RoomScene* scene) {
  // Looks along +y; the origin is at its foot, in the middle.
  constexpr double kWide = 0.88, kHigh = 2.04;
  scene->AddQuad(door, at * Vector3d(kWide / 2, 0.012, kHigh), at.rotation * Vector3d(-kWide, 0, 0),
                 at.rotation * Vector3d(0, 0, -kHigh));
  for (const double x : {-kWide / 2 - 0.08, kWide / 2}) {
    scene->AddBox(frame, at * Placed(x, 0, 0), {0.08, 0.03, kHigh + 0.08}, 2);
  }
  scene->AddBox(frame, at * Placed(-kWide / 2, 0, kHigh), {kWide, 0.03, 0.08}, 0);
  scene->AddBox(handle, at * Placed(kWide / 2 - 0.1, 0.012, 0.98), {0.035, 0.01, 0.16}, 2);
  scene->AddBox(handle, at * Placed(kWide / 2 - 0.18, 0.04, 1.07), {0.11, 0.018, 0.022}, 0);
  scene->AddBox(handle, at * Placed(kWide / 2 - 0.09, 0.02, 1.072), {0.018, 0.03, 0.018}, 0);
}

}  // namespace

void FurnishRoom(const SimulatedRoomOptions& options, RoomScene* scene) {
  Builder builder(options, scene);
  builder.AddShell();
  if (!options.bare_walls) builder.AddWindow();
  builder.AddLights();
  if (options.furnished && !options.bare_walls) builder.AddPictures();
  if (options.furnished) builder.AddFurniture();
  if (!options.bare_walls) {
    const auto seed = static_cast<uint64_t>(options.random_seed);
    const int door = scene->AddSurface(
        {MakePicture(DrawDoor(880, 2040, MixBits(seed, 78)), 0.88f, 2.04f, 0.05f, 5),
         {0.5f, 0.3f, {0.2f, 0.5f, 0.2f}}});
    const int frame = scene->AddSurface(
        {MakePlaster(RgbFromSrgb(92, 112, 106), 0.1f, 6), {0.5f, 0.3f, {0.2f, 0.5f, 0.2f}}});
    const int handle = scene->AddSurface(
        {MakePlaster(RgbFromSrgb(190, 165, 100), 0.1f, 7), {0.5f, 0.3f, {0.4f, 0.3f, 0.1f}}});
    AddDoorOn(Placed(options.width - 0.75, 0, 0), door, frame, handle, scene);
  }
}

}  // namespace roomtex
