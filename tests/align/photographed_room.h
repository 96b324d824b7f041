#pragma once
// A simulated room with its photos in a folder, its sparse model and its scan.

#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "capture/simulation/simulated_room.h"
#include "colmap_ext/sparse_model.h"
#include "core/scan.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

// Into a folder, which is made.
inline void WritePhotos(const SimulatedRoom& room, const std::string& folder) {
  std::filesystem::create_directories(folder);
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    cv::imwrite(folder + "/" + room.PhotoName(photo), room.RenderPhoto(photo));
  }
}

struct PhotographedRoom {
  PhotographedRoom(const SimulatedRoomOptions& options, int num_points, double noise_px)
      : room(options) {
    sparse = model = room.MakeSparseModel(num_points, noise_px);
    TransformModel(room.ScanFromSparse(), &model);
    WritePhotos(room, folder.path());
    scans = {room.MakeScan(0)};
  }

  TempFolder folder;
  SimulatedRoom room;
  SparseModel sparse, model;  // in the sparse frame, in the scan frame
  std::vector<Scan> scans;
};

}  // namespace roomtex
