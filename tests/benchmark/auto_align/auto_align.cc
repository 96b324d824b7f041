// How often roomtex-align finds the place of the photos in the scan without clicks, and whether
// wrong places are believed: simulated rooms with known truth, in memory (keypoints 0.7 px, range
// noise 1 to 5 mm, other sizes, furniture, photos, points, and parts of the room scanned for every
// seed).
//   build/bin/auto_align --set tuning|check [--rooms N] [--first SEED] [--photos 1] [--whole 1]
// A row for each room, then a table. --photos 1: photos are drawn, too, and asked (slow); without,
// geometry is alone, and a user is taken to have said that scan and photos are of one room. --whole
// 1: fitted and adjusted as well, as the command does (slow). The verdict was tuned on the set
// `tuning` only.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <map>
#include <string>

#include <opencv2/imgcodecs.hpp>

#include "align/automatic_alignment.h"
#include "align/trust/scan_view.h"
#include "core/frames.h"
#include "core/random_stream.h"
#include "core/statistics.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr double kSearchRight = 0.02;                  // metres, before poses are adjusted
constexpr double kRight = 0.005, kRightTurnDeg = 0.1;  // medians over the photos
constexpr uint64_t kTuning = 1000, kCheck = 500000;    // first seeds

struct Kind {
  const char* name;
  bool has_answer;
};
enum KindIndex { kFurnished, kPart, kFew, kEmpty, kMirroredScan, kSimilarRoom, kOtherRoom, kNum };
const Kind kKinds[kNum] = {{"furnished", true},
                           {"40 to 90 % of the room scanned", true},
                           {"8 photos, 300 points", true},
                           {"empty room", true},
                           {"mirrored scan", false},
                           {"scan of a similar room", false},
                           {"scan of another room", false}};

struct Settings {
  uint64_t first = kTuning;
  int num_rooms = 28;
  bool photos = false, whole = false;
};

SimulatedRoomOptions RoomOptions(uint64_t seed, KindIndex kind) {
  RandomStream random(MixBits(seed, 11, 0));
  SimulatedRoomOptions options;
  options.random_seed = static_cast<int>(seed);
  options.width = random.Uniform(4.6, 8.0);
  options.depth = random.Uniform(3.8, 6.5);
  options.height = random.Uniform(2.5, 3.4);
  options.furnished = kind != kEmpty;
  options.num_photos = kind == kFew ? 8 : static_cast<int>(random.Uniform(10, 40));
  options.photo_width = 768;
  options.photo_height = 512;
  options.field_of_view_deg = random.Uniform(55, 80);
  options.scan_columns = 900;
  options.scan_rows = 450;
  options.range_noise = random.Uniform(0.001, 0.005);
  return options;
}

// A sector of the columns is missing.
void LeaveOut(double share, double from, Scan* scan) {
  for (int row = 0; row < scan->num_rows; ++row) {
    for (int column = 0; column < scan->num_columns; ++column) {
      const double at = static_cast<double>(column) / scan->num_columns - from;
      if (at - std::floor(at) >= share) continue;
      scan->points[scan->Index(column, row)] = Scan::MissingPoint();
      scan->intensity[scan->Index(column, row)] = 0;
    }
  }
}

struct Room {
  KindIndex kind = kFurnished;
  SimulatedCase one;
  Similarity truth;  // scan_from_sparse
};

Room MakeRoom(uint64_t seed) {
  Room room;
  room.kind = static_cast<KindIndex>(seed % kNum);
  RandomStream random(MixBits(seed, 13, 0));
  const SimulatedRoomOptions options = RoomOptions(seed, room.kind);
  SimulatedCase& one = room.one;
  one.room = std::make_shared<SimulatedRoom>(options);
  const int num_points = room.kind == kFew ? 300 : static_cast<int>(random.Uniform(500, 4000));
  one.model = one.room->MakeSparseModel(num_points, 0.7);
  SimulatedRoomOptions scanned = options;
  if (room.kind == kSimilarRoom) scanned.random_seed += 7919;
  if (room.kind == kOtherRoom) scanned = RoomOptions(seed + 7919 * kNum, kFurnished);
  one.scans = {SimulatedRoom(scanned).MakeScan(0)};
  if (room.kind == kPart) LeaveOut(random.Uniform(0.1, 0.6), random.Uniform(), &one.scans[0]);
  if (room.kind == kMirroredScan) one.scans = MirrorScans(one.scans);
  // The scale is unknown by a factor of ten.
  const double factor = std::exp(random.Uniform(-1.15, 1.15));
  TransformModel({factor, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}, &one.model);
  room.truth = one.room->ScanFromSparse() *
               Similarity{1 / factor, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
  return room;
}

struct Error {
  double position = 0, turn_deg = 0;  // medians over the photos
};

Error ErrorOf(const SimulatedRoom& room, const SparseModel& aligned) {
  std::vector<double> positions, turns;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const Rigid& found = aligned.FindImage(room.PhotoName(photo))->cam_from_model;
    const Rigid truth = room.CamFromScan(photo);
    positions.push_back((found.TargetOriginInSource() - truth.TargetOriginInSource()).norm());
    turns.push_back(DegFromRad(RotationAngle(found.rotation, truth.rotation)));
  }
  return {Median(&positions), Median(&turns)};
}

// Those that are asked first (MeasureAgreement); drawing is what takes most time here.
void DrawPhotos(const SimulatedRoom& room, const SparseModel& model, const std::string& folder) {
  const std::vector<const SparseImage*> images = SpreadImages(model, 24);
  const size_t num_sets = (images.size() + 7) / 8;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    for (size_t i = num_sets / 2; i < images.size(); i += num_sets) {
      if (images[i]->name != room.PhotoName(photo)) continue;
      cv::imwrite(folder + "/" + room.PhotoName(photo), room.RenderPhoto(photo));
    }
  }
}

struct Count {
  int rooms = 0, right_trusted = 0, right_refused = 0, wrong_trusted = 0, wrong_refused = 0;
};

class Run {
 public:
  explicit Run(const Settings& settings) : settings_(settings) {}

  void Room(uint64_t seed) {
    const auto room = MakeRoom(seed);
    const TempFolder folder;
    if (settings_.photos) DrawPhotos(*room.one.room, room.one.model, folder.path());
    const SurveyedScans surveyed(room.one.scans);
    AlignmentInput input{room.one.model, surveyed, {}, "", "clockwise"};
    if (settings_.photos) input.image_path = folder.path();
    input.num_threads = 1;
    const std::clock_t before = std::clock();
    Progress progress(true);
    AutomaticAlignment found;
    if (settings_.whole) {
      found = AlignAutomatically(input, {}, AlignmentOptions(), &progress);
    } else {
      StartSearchOptions search;
      search.num_threads = 1;
      found.search = SearchStarts(input, {}, AlignmentOptions(), search);
      found.verdict = JudgeStarts(input, found.search, !settings_.photos, StartVerdictOptions());
    }
    const double seconds = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
    Judge(seed, room.kind, *room.one.room, room.one.model, found, seconds);
  }

  void Table() const {
    std::printf(
        "\n| rooms | number | right, trusted | right, refused | wrong, refused | wrong, trusted "
        "|\n|---|---|---|---|---|---|\n");
    for (const auto& [kind, count] : counts_) {
      std::printf("| %s | %d | %d | %d | %d | %d |\n", kKinds[kind].name, count.rooms,
                  count.right_trusted, count.right_refused, count.wrong_refused,
                  count.wrong_trusted);
    }
  }

 private:
  void Judge(uint64_t seed, KindIndex kind, const SimulatedRoom& room, const SparseModel& model,
             const AutomaticAlignment& found, double seconds) {
    Error error{1e9, 180};
    bool trusted = found.verdict.kind == StartVerdict::Kind::kTrusted;
    SparseModel aligned = model;
    const auto& alignment = found.attempt.alignment;
    if (alignment && alignment->adjusted()) {
      aligned = alignment->adjustment.bundle.model;
    } else if (found.verdict.best >= 0) {
      TransformModel(found.search.starts[found.verdict.best].scan_from_sparse, &aligned);
    }
    if (found.verdict.best >= 0) error = ErrorOf(room, aligned);
    if (settings_.whole) trusted = found.attempt.trusted();
    const bool right =
        kKinds[kind].has_answer &&
        (settings_.whole ? error.position <= kRight && error.turn_deg <= kRightTurnDeg
                         : error.position <= kSearchRight);
    Count& count = counts_[kind];
    ++count.rooms;
    (right ? (trusted ? count.right_trusted : count.right_refused)
           : (trusted ? count.wrong_trusted : count.wrong_refused)) += 1;
    const auto& starts = found.search.starts;
    const StartVerdict& v = found.verdict;
    const double score = v.best < 0 ? 0 : starts[v.best].sights.Score();
    const GradientShifts shifts = v.asked.empty() ? GradientShifts() : v.asked[0].gradient.shifts;
    std::printf(
        "%llu %s: %s, %s; off %.4f m %.3f deg; score %.3f second %.3f mirrored %.3f through %.3f "
        "photos %d share %.3f by chance %.3f far %.3f of %ld chance_wrong %.2g; verdict %d; %.1f "
        "CPU-s; points %zu photos %d %.100s\n",
        static_cast<unsigned long long>(seed), kKinds[kind].name, right ? "right" : "wrong",
        trusted ? "trusted" : "refused", error.position, error.turn_deg, score,
        v.second < 0 ? 0 : starts[v.second].sights.Score(), v.mirrored_score,
        v.best < 0 ? 0 : starts[v.best].sights.ThroughShare(), v.photos_support,
        shifts.at_pose.Share(), shifts.elsewhere.Share(), shifts.far.Share(), shifts.at_pose.num,
        v.chance_wrong, static_cast<int>(v.kind), seconds, model.points.size(), room.NumPhotos(),
        alignment && !alignment->reasons.empty() ? alignment->reasons[0].c_str() : "");
    std::fflush(stdout);
  }

  const Settings settings_;
  std::map<KindIndex, Count> counts_;
};

bool Parse(int argc, char** argv, Settings* settings) {
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    if (option == "--set" && value == "tuning")
      settings->first = kTuning;
    else if (option == "--set" && value == "check")
      settings->first = kCheck;
    else if (option == "--first")
      settings->first = std::strtoull(argv[i + 1], nullptr, 10);
    else if (option == "--rooms")
      settings->num_rooms = std::atoi(argv[i + 1]);
    else if (option == "--photos")
      settings->photos = value == "1";
    else if (option == "--whole")
      settings->whole = value == "1";
    else
      return false;
  }
  return argc % 2 == 1 && settings->num_rooms > 0;
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::Settings settings;
  if (!roomtex::Parse(argc, argv, &settings)) {
    std::fprintf(stderr,
                 "auto_align --set tuning|check [--rooms N] [--first SEED] [--photos 1] "
                 "[--whole 1]\n");
    return 2;
  }
  roomtex::Run run(settings);
  for (int i = 0; i < settings.num_rooms; ++i) run.Room(settings.first + i);
  run.Table();
}
