#include "colmap_ext/misplaced_photos.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "colmap_ext/expected_sightings.h"
#include "colmap_ext/lookalike_rooms.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Photos that the others contradict are left out up to this share of all. Where more are doubtful
// some go first (ModelCheck::doubtful): a photo before the wrong one of two shelves makes those
// doubtful that match it. If photos are in doubt yet when so many are gone, nobody knows which are
// right, and all stay.
constexpr double kMaxLeftOut = 0.2;
constexpr size_t kStepsIfMore = 4;
constexpr int kMaxLeavings = 5;

// Of some photos of a model, without points.
SparseModel PosesOf(const SparseModel& model, const std::set<uint32_t>& photos) {
  SparseModel poses;
  poses.cameras = model.cameras;
  for (const uint32_t id : photos) {
    const SparseImage& image = model.images.at(id);
    poses.images[id] = {id, image.camera_id, image.name, image.cam_from_model, {}, {}};
  }
  return poses;
}

class PhotoParting {
 public:
  PhotoParting(const MappingOptions& options, const Command::Context& context,
               const Database& database, const KnownPhotos& known, MappingPass* pass)
      : options_(options), context_(context), database_(database), known_(known), pass_(pass) {}

  void Run() {
    pass_->check = Check(pass_->model());
    LeaveOutDoubtful();
    if (!options_.take_rooms_apart || !TakeRoomsApart()) return;
    pass_->check = Check(pass_->model());
    for (const MapperResult& room : pass_->best[0].other_rooms) {
      pass_->room_checks.push_back(Check(room.model));
    }
  }

 private:
  ModelCheck Check(const SparseModel& model) const;
  void LeaveOutDoubtful();
  // Adjusts the model without them; false: that failed, and nothing has changed.
  bool LeaveOut(const std::vector<uint32_t>& leaving);
  // True: there were several, and the model is that of one.
  bool TakeRoomsApart();
  const std::string& NameOf(uint32_t image_id) const {
    return pass_->images->images().at(image_id).name;
  }

  const MappingOptions& options_;
  const Command::Context& context_;
  const Database& database_;
  const KnownPhotos& known_;
  MappingPass* pass_;
};

ModelCheck PhotoParting::Check(const SparseModel& model) const {
  MatchedImages images = ImagesOfModel(database_, *pass_->images, model);
  ModelCheckOptions check_options;
  check_options.pair = HypothesisOptionsOf(options_, context_);
  check_options.min_confidence = options_.init.min_confidence;
  const PairTrial& trial = pass_->best[0].seed.trial;
  return CheckModel(&images, model, {trial.image_id1, trial.image_id2}, check_options,
                    context_.options.num_threads);
}

void PhotoParting::LeaveOutDoubtful() {
  MappingOutcome& outcome = pass_->best[0];
  const MapperResult whole = outcome.result;
  const ModelCheck check_of_whole = pass_->check;
  auto left = static_cast<size_t>(kMaxLeftOut * static_cast<double>(whole.model.images.size()));
  const bool are_many = pass_->check.doubtful.size() > left;
  std::map<uint32_t, double> support;  // of those left out
  for (int i = 0; i < kMaxLeavings && left > 0 && !pass_->check.doubtful.empty(); ++i) {
    std::vector<uint32_t> leaving = pass_->check.doubtful;
    if (leaving.size() > left) leaving.resize(std::max<size_t>(1, left / kStepsIfMore));
    if (!LeaveOut(leaving)) break;
    left -= leaving.size();
    for (const uint32_t image_id : leaving) support[image_id] = pass_->check.support.at(image_id);
    pass_->check = Check(pass_->model());
  }
  if (are_many && !pass_->check.doubtful.empty()) {
    outcome.result = whole;
    pass_->check = check_of_whole;
    return;
  }
  for (const auto& [image_id, share] : support) {
    outcome.reasons[image_id] = "stood where only " + Percent(share) + " of its own matches put it";
    context_.Warn(NameOf(image_id) + " is left out: only " + Percent(share) +
                  " of its own matches obey the model. It may show a repeated pattern, another "
                  "room, or something that moved.");
  }
}

bool PhotoParting::LeaveOut(const std::vector<uint32_t>& leaving) {
  std::set<uint32_t> kept;
  for (const auto& [id, image] : pass_->model().images) kept.insert(id);
  for (const uint32_t image_id : leaving) kept.erase(image_id);
  const SparseModel poses = PosesOf(pass_->model(), kept);
  MapperResult adjusted = pass_->mapper->Adjust(poses);
  if (!adjusted.problem.empty() || adjusted.model.images.size() != poses.images.size()) {
    return false;
  }
  MapperResult& result = pass_->best[0].result;
  adjusted.grew = result.grew;
  result = std::move(adjusted);
  return true;
}

bool PhotoParting::TakeRoomsApart() {
  context_.progress.Stage("look for rooms");
  MappingOutcome& outcome = pass_->best[0];
  const SparseModel& model = outcome.result.model;
  LookalikeRooms found =
      FindLookalikeRooms(model, FindExpectedSightings(model, HiddenByOwnPoints(model), {}));
  std::vector<std::set<uint32_t>>& rooms = found.rooms;
  if (rooms.size() < 2) return false;
  const auto num_known = [&](const std::set<uint32_t>& room) {
    return std::count_if(room.begin(), room.end(),
                         [&](uint32_t id) { return known_.cam_from_scan.count(id) > 0; });
  };
  std::stable_sort(rooms.begin(), rooms.end(),
                   [&](const auto& a, const auto& b) { return num_known(a) > num_known(b); });
  std::vector<MapperResult> results;
  for (const std::set<uint32_t>& room : rooms) {
    MapperResult result = pass_->mapper->Adjust(PosesOf(model, room));
    // Rather one model of two rooms, which roomtex-align can refuse, than none.
    if (!result.problem.empty() || result.model.images.size() != room.size()) return false;
    result.grew = outcome.result.grew;
    results.push_back(std::move(result));
  }
  context_.Warn(fmt::format(
      "The photos show {} rooms that are alike, or a room before and after much was moved: of what "
      "those of one show ({} of what they ought to), those of another show {}. Each has a model of "
      "its own: one holds {} photos, e.g. {}, another {}, e.g. {}. --Rooms.enabled 0 leaves them "
      "together.",
      rooms.size(), Percent(found.share_within), Percent(found.share_between), rooms[0].size(),
      NameOf(*rooms[0].begin()), rooms[1].size(), NameOf(*rooms[1].begin())));
  outcome.result = std::move(results[0]);
  outcome.other_rooms.assign(std::make_move_iterator(results.begin() + 1),
                             std::make_move_iterator(results.end()));
  outcome.share_within = found.share_within;
  outcome.share_between = found.share_between;
  return true;
}

}  // namespace

void PartMisplacedPhotos(const MappingOptions& options, const Command::Context& context,
                         const Database& database, const KnownPhotos& known, MappingPass* pass) {
  PhotoParting(options, context, database, known, pass).Run();
}

}  // namespace roomtex
