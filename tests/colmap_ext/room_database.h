#pragma once
// Databases of made-up rooms with keypoints and descriptors, as colmap feature_extractor leaves
// them.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "colmap_ext/database.h"
#include "core/random_stream.h"
#include "tests/colmap_ext/database_maker.h"
#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {

// The descriptor of something that looks like nothing else but `look`, as `view` sees it.
inline std::vector<uint8_t> DescriptorOfLook(uint64_t look, uint64_t view) {
  RandomStream values(look), noise(MixBits(view, look, 7));
  std::vector<uint8_t> descriptor(kSiftSize);
  for (uint8_t& byte : descriptor) {
    const double value = 45 * std::abs(values.Gaussian()) + 5 * noise.Gaussian();
    byte = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
  }
  return descriptor;
}

struct RoomDatabaseOptions {
  std::vector<std::string> rooms;       // what the names of their photos begin with: "a0.jpg" ...
  int num_views = 8, num_points = 300;  // of each room
  // The first points of all rooms look alike, as the same furniture does.
  int num_shared = 0;
  DatabaseMaker::Schema schema = DatabaseMaker::Schema::k38;
};

// A camera for all. All photos of a room overlap.
inline void WriteRoomDatabase(const std::string& path, const RoomDatabaseOptions& options) {
  DatabaseMaker maker(path, options.schema);
  maker.Run("BEGIN");
  uint32_t image_id = 0;
  for (size_t room = 0; room < options.rooms.size(); ++room) {
    SimulatedViewsOptions view_options;
    view_options.num_points = options.num_points;
    view_options.num_views = options.num_views;
    view_options.baseline = 0.8 / options.num_views;
    const SimulatedViews views = SimulateViews(view_options);
    if (room == 0) maker.AddCamera(views.cameras.begin()->second);
    for (const auto& [id, image] : views.images) {
      std::vector<uint8_t> bytes;
      for (const int point : views.point_of_keypoint.at(id)) {
        const uint64_t owner = point < options.num_shared ? 0 : room + 1;
        const auto one = DescriptorOfLook(MixBits(owner, static_cast<uint64_t>(point)),
                                          options.rooms.size() * id + room);
        bytes.insert(bytes.end(), one.begin(), one.end());
      }
      maker.AddImage(++image_id, options.rooms[room] + std::to_string(id - 1) + ".jpg",
                     views.cameras.begin()->first);
      maker.AddKeypoints(image_id, views.keypoints.at(id), 6);
      maker.AddDescriptors(image_id, bytes);
    }
  }
  maker.Run("COMMIT");
}

}  // namespace roomtex
