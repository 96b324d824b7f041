#pragma once
// A simulated set of views as the files a user would hand to roomtex-mapper: database.db and
// photos/.

#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "tests/colmap_ext/database_maker.h"
#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {

// `folder` must exist. Photos are grey: COLMAP looks at them for colours only.
inline void WriteSimulatedDatabase(const SimulatedViews& views, const std::string& folder,
                                   bool with_pairs = true) {
  DatabaseMaker database(folder + "/database.db", DatabaseMaker::Schema::k38);
  std::filesystem::create_directories(folder + "/photos");
  database.Run("BEGIN");
  for (const auto& [camera_id, camera] : views.cameras) database.AddCamera(camera);
  for (const auto& [image_id, image] : views.images) {
    database.AddImage(image_id, image.name, image.camera_id);
    database.AddKeypoints(image_id, views.keypoints.at(image_id), 2);
    const Camera& camera = views.cameras.at(image.camera_id);
    cv::imwrite(folder + "/photos/" + image.name,
                cv::Mat(camera.height, camera.width, CV_8UC3, cv::Scalar(90, 120, 150)));
  }
  for (const DatabasePair& pair : views.pairs) {
    std::vector<uint32_t> rows;
    for (const Eigen::Vector2i& match : pair.matches) {
      rows.push_back(static_cast<uint32_t>(match.x()));
      rows.push_back(static_cast<uint32_t>(match.y()));
    }
    if (with_pairs) database.AddPair(pair.image_id1, pair.image_id2, rows, pair.config);
  }
  database.Run("COMMIT");
}

}  // namespace roomtex
