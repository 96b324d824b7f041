#include "capture/simulation/room_furniture.h"

#include <cmath>

#include "capture/simulation/room_builder.h"
#include "capture/simulation/room_layout.h"

namespace roomtex {

using Eigen::Vector3d;

void RoomBuilder::AddTable(const Rigid& at) {
  constexpr double kLong = 1.4, kWide = 0.8, kHigh = 0.74;
  Part(at, oak_, -kLong / 2, -kWide / 2, kHigh - 0.032, kLong, kWide, 0.032);
  for (const double x : {-kLong / 2 + 0.04, kLong / 2 - 0.11}) {
    for (const double y : {-kWide / 2 + 0.04, kWide / 2 - 0.11}) {
      Part(at, oak_, x, y, 0, 0.07, 0.07, kHigh - 0.032, 2);
    }
  }
  Part(at, oak_, -kLong / 2 + 0.11, -kWide / 2 + 0.06, kHigh - 0.12, kLong - 0.22, 0.025, 0.088);
  Part(at, oak_, -kLong / 2 + 0.11, kWide / 2 - 0.085, kHigh - 0.12, kLong - 0.22, 0.025, 0.088);
  if (options_.bare) return;
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

void RoomBuilder::AddChair(const Rigid& at, int cushion) {
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

void RoomBuilder::AddSofa(const Rigid& at) {
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

void RoomBuilder::AddBookRow(const Rigid& at, double z, double from, double to) {
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

void RoomBuilder::AddShelf(const Rigid& at, double width) {
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

void RoomBuilder::AddSideboard(const Rigid& at) {
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
  if (options_.bare) return;
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

void RoomBuilder::AddFloorLamp(double x, double y) {
  const int shade = Add(MakePlaid({RgbFromSrgb(244, 226, 180), RgbFromSrgb(238, 210, 150),
                                   RgbFromSrgb(225, 190, 130)},
                                  0.03f, NextSeed()),
                        {0.6f, 0.2f, {0.3f, 0.3f, 0.3f}}, Surface::Kind::kOpaque, true);
  scene_.AddFrustum(black_, {x, y, 0}, 0.15, 0.14, 0.025, 20, true);
  scene_.AddFrustum(metal_, {x, y, 0.025}, 0.014, 0.014, 1.4, 10, true);
  scene_.AddFrustum(shade, {x, y, 1.32}, 0.22, 0.14, 0.3, 20, false);
}

void RoomBuilder::AddPlant(double x, double y, double z, double size) {
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

void RoomBuilder::AddParcels(const Rigid& at) {
  if (options_.bare) {
    const int carton = Add(MakePlain(RgbFromSrgb(176, 138, 92)), {0.3f, 0.6f, {0.6f, 0.3f, 0}});
    Part(at, carton, 0, 0, 0, 0.55, 0.42, 0.38);
    return;
  }
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

void RoomBuilder::AddCurtain(double x0, double x1, double y, int surface) {
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

void RoomBuilder::AddTableWithChairs(const Rigid& at) {
  if (options_.bare) {
    AddTable(at * Placed(0, 0, 0, 7));
    AddChair(at * Placed(-0.3, -0.62, 0, 10), walnut_);
    AddChair(at * Placed(0.35, 0.66, 0, 174), walnut_);
    return;
  }
  const auto cushion = [&](int red, int green, int blue) {
    return Add(MakePlaid({RgbFromSrgb(red, green, blue), RgbFromSrgb(220, 208, 184),
                          RgbFromSrgb(red / 2, green / 2, blue / 2)},
                         0.03f, NextSeed()),
               {0.6f, 0.2f, {0.5f, 0.2f, 0.2f}});
  };
  const auto rug = AddPictureSurface(DrawRug(2300, 1600, NextSeed()), 2.3, 1.6, 0.1f,
                                     {0.5f, 0.35f, {0.3f, 0.3f, 0.3f}});
  Face(at * Placed(-0.15, 0.1, 0, 4), rug, {-1.15, 0.8, 0.007}, {2.3, 0, 0}, {0, -1.6, 0});
  AddTable(at * Placed(0, 0, 0, 7));
  AddChair(at * Placed(-0.3, -0.62, 0, 10), cushion(170, 60, 50));
  AddChair(at * Placed(0.35, 0.66, 0, 174), cushion(60, 100, 150));
  AddChair(at * Placed(1.02, -0.1, 0, 101), cushion(90, 130, 70));
}

void RoomBuilder::AddPieces() {
  for (const PlacedPiece& placed : LayOut(options_)) {
    const Vector3d foot = placed.at.translation;
    switch (placed.piece) {
      case Piece::kTable:
        AddTableWithChairs(placed.at);
        break;
      case Piece::kSofa:
        AddSofa(placed.at);
        break;
      case Piece::kShelf:
        AddShelf(placed.at, 1.5);
        break;
      case Piece::kSideboard:
        AddSideboard(placed.at);
        break;
      case Piece::kFloorLamp:
        AddFloorLamp(foot.x(), foot.y());
        break;
      case Piece::kPlant:
        AddPlant(foot.x(), foot.y(), 0, 1.1);
        break;
      case Piece::kParcels:
        AddParcels(placed.at);
        break;
    }
  }
}

void RoomBuilder::AddFurniture() {
  AddPieces();
  if (options_.bare || options_.bare_walls) return;
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

namespace {

void FurnishOneRoom(const SimulatedRoomOptions& options, RoomScene* scene) {
  RoomBuilder builder(options, scene);
  builder.AddShell();
  builder.AddLights();
  if (!options.bare_walls) {
    builder.AddWindow();
    builder.AddDoor();
  }
  if (options.furnished && !options.bare_walls) builder.AddPictures();
  if (options.furnished) builder.AddFurniture();
}

}  // namespace

void FurnishRoom(const SimulatedRoomOptions& options, RoomScene* scene) {
  FurnishOneRoom(options, scene);
  if (!options.second_room) return;
  RoomBuilder(options, scene).AddDoorway();
  scene->Place(options.RoomFromSecondRoom());
  FurnishOneRoom(options.SecondRoom(), scene);
  scene->Place(Rigid());
}

}  // namespace roomtex
