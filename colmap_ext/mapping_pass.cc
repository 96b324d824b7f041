#include "colmap_ext/mapping_pass.h"

namespace roomtex {

std::vector<const MapperResult*> MappingOutcome::Models() const {
  std::vector<const MapperResult*> models = {&result};
  for (const MapperResult& room : other_rooms) models.push_back(&room);
  return models;
}

std::vector<MappedModel> ListModels(const std::vector<MappingPass>& passes) {
  std::vector<MappedModel> models;
  for (const MappingPass& pass : passes) {
    const std::vector<const MapperResult*> of_pass = pass.best[0].Models();
    for (size_t i = 0; i < of_pass.size(); ++i) {
      models.push_back({&pass, of_pass[i], i == 0 ? &pass.check : &pass.room_checks[i - 1], i > 0});
    }
  }
  return models;
}

HypothesisOptions HypothesisOptionsOf(const MappingOptions& options,
                                      const Command::Context& context) {
  HypothesisOptions pair;
  pair.keypoint_noise_px = options.init.keypoint_noise_px;
  pair.max_error_px = options.init.max_error_px;
  pair.random_seed = static_cast<uint64_t>(context.options.random_seed);
  return pair;
}

MatchedImages ImagesOfModel(const Database& database, const MatchedImages& images,
                            const SparseModel& model) {
  std::map<uint32_t, Camera> cameras = images.cameras();
  for (const auto& [camera_id, camera] : model.cameras) cameras[camera_id] = camera;
  return MatchedImages(cameras, images.images(), images.pairs(),
                       [&database](uint32_t image_id) { return database.ReadKeypoints(image_id); });
}

}  // namespace roomtex
