#pragma once
// Puts the simulated room together, surface by surface: the shell in room_shell.cc, what stands in
// it in room_furniture.cc. Frame: `room`. Only these two and FurnishRoom() use it.

#include "capture/simulation/room_pictures.h"
#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"
#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {

enum Wall { kSouth, kEast, kNorth, kWest };  // y = 0, x = width, y = depth, x = 0

inline Rigid Placed(double x, double y, double z, double yaw_deg = 0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(yaw_deg), Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(x, y, z)};
}

class RoomBuilder {
 public:
  // Both must outlive the builder.
  RoomBuilder(const SimulatedRoomOptions& options, RoomScene* scene);

  void AddShell();
  void AddWindow();
  void AddLights();
  void AddPictures();
  void AddFurniture();
  void AddDoor();
  void AddDoorway();  // of the wall between two rooms

 private:
  struct WallFrame {
    Eigen::Vector3d top_left, right, inward;  // seen from the room
    double length;
  };

  uint32_t NextSeed() {
    const bool is_shell = num_seeds_ < num_shell_seeds_;
    const int seed =
        is_shell || options_.furniture_seed < 0 ? options_.random_seed : options_.furniture_seed;
    return static_cast<uint32_t>(MixBits(static_cast<uint64_t>(seed), 77, ++num_seeds_));
  }
  int Add(const TexturePtr& texture, const Infrared& infrared,
          Surface::Kind kind = Surface::Kind::kOpaque, bool shines = false,
          bool varnished = false) {
    return scene_.AddSurface({options_.bare ? MakePlain(MeanAlbedo(*texture)) : texture, infrared,
                              kind, shines, varnished});
  }
  int AddVarnished(const TexturePtr& texture, const Infrared& infrared) {
    return Add(texture, infrared, Surface::Kind::kOpaque, false, true);
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
  void Face(const Rigid& room_from_piece, int surface, const Eigen::Vector3d& corner,
            const Eigen::Vector3d& right, const Eigen::Vector3d& down) {
    scene_.AddQuad(surface, room_from_piece * corner, room_from_piece.rotation * right,
                   room_from_piece.rotation * down);
  }
  void AddWallWithDoorway(int surface);
  // Centre `from_left` metres along the wall and `z` above the floor.
  void Hang(Wall wall, double from_left, double z, double width, double height,
            const cv::Mat& picture, double thickness = 0.004);
  void AddPieces();
  void AddTableWithChairs(const Rigid& at);
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
  uint64_t num_shell_seeds_ = UINT64_MAX;  // those before are of the shell; set when it stands
  int oak_, walnut_, pine_, white_, black_, metal_;
  // The opening of the window in the north wall.
  double window_left_ = 0, window_right_ = 0, window_bottom_ = 0.85, window_top_ = 2.15;
};

}  // namespace roomtex
