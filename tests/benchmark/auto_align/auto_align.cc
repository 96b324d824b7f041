// How often roomtex-align finds the place of the photos in the scan without clicks, and whether
// wrong places are believed: simulated rooms with known truth, in memory, the whole way of the
// command (search, verdict, fit, adjustment).
//   build/bin/auto_align --output_path rooms.csv --set tuning|check [--rooms N] [--first SEED]
//     [--walls plain|pattern|twofold] [--fine 1]
// A line of rooms.csv for each room, written when it is done; rooms that have one already are left
// out, so that a run that was ended goes on where it was, and several may write side by side to
// files of their own. tests/benchmark/auto_align/auto_align_table.py makes tables of them. Ten of
// sixteen rooms have an answer, six must be refused. With --walls all rooms but the empty one have
// plain walls, or nothing but a projected pattern: those to be refused, too. Constants were only
// ever chosen on the set `tuning`.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include <opencv2/imgcodecs.hpp>
#include <sys/resource.h>

#include "align/automatic_alignment.h"
#include "align/trust/scan_view.h"
#include "core/csv.h"
#include "core/frames.h"
#include "core/random_stream.h"
#include "core/statistics.h"
#include "core/text.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/cpu_seconds.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr uint64_t kTuning = 16000, kCheck = 800000;  // first seeds
constexpr double kSightTolerance = 0.05;              // metres, as the search has it
constexpr int kAllPhotos = 24;                        // that are asked (AgreementOptions)

enum class Kind {
  kFurnished,
  kTilted,
  kPart,
  kFew,
  kBareWalls,
  kBare,
  kEmpty,
  kSamePlan,
  kSimilar,
  kOther,
  kMirrored,
};

const char* NameOf(Kind kind) {
  switch (kind) {
    case Kind::kFurnished:
      return "furnished";
    case Kind::kTilted:
      return "cameras tilted by up to 40 degrees";
    case Kind::kPart:
      return "40 to 90 % of the room scanned";
    case Kind::kFew:
      return "8 photos with 300 points";
    case Kind::kBareWalls:
      return "plain walls, few points there";
    case Kind::kBare:
      return "bare, points by a projected pattern";
    case Kind::kEmpty:
      return "empty, alike from both ends";
    case Kind::kSamePlan:
      return "scan of a room of the same plan";
    case Kind::kSimilar:
      return "scan of a similar room";
    case Kind::kOther:
      return "scan of another room";
    case Kind::kMirrored:
      return "mirrored scan";
  }
  return "";
}

const Kind kKinds[16] = {Kind::kFurnished, Kind::kSamePlan, Kind::kTilted,    Kind::kPart,
                         Kind::kMirrored,  Kind::kFew,      Kind::kBareWalls, Kind::kSimilar,
                         Kind::kFurnished, Kind::kOther,    Kind::kBare,      Kind::kPart,
                         Kind::kSamePlan,  Kind::kEmpty,    Kind::kTilted,    Kind::kSimilar};

bool HasAnswer(Kind kind) {
  return kind != Kind::kSamePlan && kind != Kind::kSimilar && kind != Kind::kOther &&
         kind != Kind::kMirrored;
}

// Of all rooms of a run. kTwofold: nothing stands or hangs in any, and their walls are plain, so
// that each is the same from both ends; a projected pattern gives the points.
enum class Walls { kAsTheKindHasThem, kPlain, kPattern, kTwofold };

struct Settings {
  uint64_t first = kTuning;
  Walls walls = Walls::kAsTheKindHasThem;
  bool fine = false;  // scans of 2 million samples, photos of 1200 x 800
  int num_rooms = 16;
  std::string output_path;
};

SimulatedRoomOptions RoomOptions(uint64_t seed, Kind kind, const Settings& settings) {
  RandomStream random(MixBits(seed, 11, 0));
  SimulatedRoomOptions options;
  options.random_seed = static_cast<int>(seed);
  options.width = random.Uniform(4.6, 8.0);
  options.depth = random.Uniform(3.8, 6.5);
  options.height = random.Uniform(2.5, 3.4);
  const bool twofold = settings.walls == Walls::kTwofold;
  options.furnished = kind != Kind::kEmpty && !twofold;
  // Nothing would tell the ends of an empty room apart.
  const Walls walls = kind == Kind::kEmpty && !twofold ? Walls::kAsTheKindHasThem : settings.walls;
  options.bare_walls = kind == Kind::kBareWalls || walls == Walls::kPlain || twofold;
  options.bare = kind == Kind::kBare || walls == Walls::kPattern || twofold;
  options.num_photos = static_cast<int>(random.Uniform(8, 61));
  if (kind == Kind::kFew) options.num_photos = 8;
  options.photo_width = settings.fine ? 1200 : 720;
  options.photo_height = settings.fine ? 800 : 480;
  options.field_of_view_deg = random.Uniform(55, 80);
  if (kind == Kind::kTilted) options.roll_deg = 40;
  options.num_stations = random.Uniform() < 0.2 ? 2 : 1;
  options.scan_columns = settings.fine ? 2000 : 800;
  options.scan_rows = settings.fine ? 1000 : 400;
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

// What scanners report as intensity: 0 = as the simulation has it, falling with range and flatness;
// 1 = a logarithm; 2 = dark and bright are alike, what lies between differs.
void ChangeReflectance(int model, Scan* scan) {
  std::vector<double> values;
  for (const float value : scan->intensity) {
    if (value > 0) values.push_back(value);
  }
  const double middle = Median(&values);
  for (float& value : scan->intensity) {
    if (!(value > 0)) continue;
    const double changed = model == 1   ? 1000 * std::log1p(value / 60)
                           : model == 2 ? std::abs(value - middle)
                                        : value;
    value = static_cast<float>(std::clamp(std::round(changed), 1.0, 4095.0));
  }
}

// Where the rays through its keypoints come nearest together.
void PlaceByItsRays(const SparseModel& model, const CameraProjection& camera, SparsePoint* point) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
  for (const TrackElement& element : point->track) {
    const SparseImage& image = model.images.at(element.image_id);
    const auto ray = camera.RayFromImg(image.points2d[element.point2d_index]);
    if (!ray) continue;
    const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
    const Eigen::Vector3d d = image.cam_from_model.rotation.conjugate() * ray->normalized();
    const Eigen::Matrix3d across = (Eigen::Matrix3d::Identity() - d * d.transpose()) /
                                   (point->x_in_model - centre).squaredNorm();
    normal += across;
    right_side += across * centre;
  }
  const Eigen::Vector3d x = normal.ldlt().solve(right_side);
  if (x.allFinite()) point->x_in_model = x;
}

// A wrong match along the epipolar line: two photos agree about a place that is none.
void MismatchPoint(const CameraProjection& camera, double range_factor, SparsePoint* point,
                   SparseModel* model) {
  const SparseImage& first = model->images.at(point->track[0].image_id);
  SparseImage& second = model->images.at(point->track[1].image_id);
  const Eigen::Vector3d centre = first.cam_from_model.TargetOriginInSource();
  const Eigen::Vector3d x = centre + range_factor * (point->x_in_model - centre);
  const auto x_in_img = camera.ImgFromCam(second.cam_from_model * x);
  if (!x_in_img || !camera.InImage(*x_in_img)) return;
  second.points2d[point->track[1].point2d_index] = *x_in_img;
  for (size_t i = 2; i < point->track.size(); ++i) {
    const TrackElement& element = point->track[i];
    model->images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
  }
  point->track.resize(2);
  point->x_in_model = x;
}

// As a reconstruction leaves it: poses inexact, points where their keypoints have them, some of
// them wrong matches. metre: of the model.
void MakeInexact(const SimulatedRoom& room, double metre, double outlier_share,
                 RandomStream* random, SparseModel* model) {
  const double off = random->Uniform(0, 0.002) * metre,
               turned = RadFromDeg(random->Uniform(0, 0.02));
  const auto gaussian = [random] {
    const double x = random->Gaussian(), y = random->Gaussian();
    return Eigen::Vector3d(x, y, random->Gaussian());
  };
  for (auto& [id, image] : model->images) {
    Rigid& pose = image.cam_from_model;
    const Eigen::Vector3d centre = pose.TargetOriginInSource() + off * gaussian();
    const Eigen::Vector3d turn = turned * gaussian();
    pose.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.stableNormalized())) * pose.rotation;
    pose.translation = -(pose.rotation * centre);
  }
  const CameraProjection camera(room.camera());
  for (auto& [id, point] : model->points) {
    PlaceByItsRays(*model, camera, &point);
    if (random->Uniform() >= outlier_share) continue;
    MismatchPoint(camera, random->Uniform(0.5, 1.6), &point, model);
  }
}

// Leaves one in ten of the points that lie on walls, floor and ceiling.
void ThinWalls(const SimulatedRoom& room, RandomStream* random, SparseModel* model) {
  const SimulatedRoomOptions& options = room.options();
  const Eigen::Vector3d size(options.width, options.depth, options.height);
  const Similarity scan_from_sparse = room.ScanFromSparse();
  const Rigid room_from_scan = room.ScanFromRoom().Inverse();
  for (auto it = model->points.begin(); it != model->points.end();) {
    const Eigen::Vector3d x = room_from_scan * (scan_from_sparse * it->second.x_in_model);
    const double beside = x.cwiseMin(size - x).minCoeff();
    if (beside > 0.01 || random->Uniform() < 0.1) {
      ++it;
      continue;
    }
    for (const TrackElement& element : it->second.track) {
      model->images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
    }
    it = model->points.erase(it);
  }
}

struct Room {
  Kind kind = Kind::kFurnished;
  SimulatedCase one;
  Similarity truth;  // scan_from_sparse
  double scanned_share = 1;
  int reflectance = 0;
};

Room MakeRoom(uint64_t seed, const Settings& settings) {
  Room room;
  room.kind = kKinds[seed % 16];
  RandomStream random(MixBits(seed, 13, 0));
  const SimulatedRoomOptions options = RoomOptions(seed, room.kind, settings);
  SimulatedCase& one = room.one;
  one.room = std::make_shared<SimulatedRoom>(options);
  const double noise_px = random.Uniform(0.4, 1.0);
  const int num_points =
      room.kind == Kind::kFew ? 300 : static_cast<int>(random.Uniform(500, 4000));
  one.model = one.room->MakeSparseModel(num_points, noise_px);
  if (options.bare_walls && settings.walls != Walls::kTwofold)
    ThinWalls(*one.room, &random, &one.model);
  SimulatedRoomOptions scanned = options;
  if (!HasAnswer(room.kind)) scanned.num_stations = 1;
  if (room.kind == Kind::kSamePlan || room.kind == Kind::kSimilar) scanned.random_seed += 7919;
  if (room.kind == Kind::kSimilar) {
    scanned.width = std::max(4.6, options.width * random.Uniform(0.95, 1.05));
    scanned.depth = std::max(3.8, options.depth * random.Uniform(0.95, 1.05));
  }
  if (room.kind == Kind::kOther) {
    scanned = RoomOptions(seed + 7919 * 16, Kind::kFurnished, settings);
  }
  const bool is_other = scanned.random_seed != options.random_seed;
  room.reflectance = random.Index(3);
  if (room.kind == Kind::kPart) room.scanned_share = random.Uniform(0.4, 0.9);
  const double from = random.Uniform();
  const auto scan_of = [&](const SimulatedRoom& of) {
    for (int k = 0; k < of.options().num_stations; ++k) {
      one.scans.push_back(of.MakeScan(k));
      Scan& scan = one.scans.back();
      scan.path = "scan" + std::to_string(k) + ".rtpi";
      scan.is_rtpi = true;
      ChangeReflectance(room.reflectance, &scan);
      LeaveOut(1 - room.scanned_share, from, &scan);
    }
  };
  if (is_other) {
    scan_of(SimulatedRoom(scanned));
  } else {
    scan_of(*one.room);
  }
  if (room.kind == Kind::kMirrored) one.scans = MirrorScans(one.scans);
  MakeInexact(*one.room, 1 / one.room->ScanFromSparse().scale, random.Uniform(0, 0.06), &random,
              &one.model);
  // The scale is unknown by a factor of ten.
  const double factor = std::exp(random.Uniform(-1.15, 1.15));
  TransformModel({factor, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}, &one.model);
  room.truth = one.room->ScanFromSparse() *
               Similarity{1 / factor, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
  return room;
}

struct Error {
  double position = 1e9, turn_deg = 180;  // medians over the photos
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

// Those that may be asked, also one by one; drawing takes most time here.
void DrawPhotos(const Room& room, const std::string& folder) {
  const SimulatedRoom& of = *room.one.room;
  std::set<std::string> names;
  for (const SparseImage* image : SpreadImages(room.one.model, kAllPhotos)) {
    names.insert(image->name);
  }
  for (int photo = 0; photo < of.NumPhotos(); ++photo) {
    if (names.count(of.PhotoName(photo)) == 0) continue;
    cv::imwrite(folder + "/" + of.PhotoName(photo), of.RenderPhoto(photo));
  }
}

const char kHeader[] =
    "seed,kind,has_answer,trusted,verdict,start_m,start_deg,position_m,turn_deg,expected_m,"
    "truth_score,score,second,mirrored,through,rms_m,support,share,chance,far,ring,num_patches,num_"
    "clear,"
    "contradicts,"
    "second_share,chance_wrong,cpu_s,make_s,peak_mb,points,photos,stations,scanned,reflectance,"
    "range_noise_m,looks_alike,cells,cells_second,cells_apart,asked,placed,agreeing,placed_cells,"
    "placed_cells_apart,reason\n";

class Line {
 public:
  void Add(const std::string& text) { fields_.push_back(text); }
  void Add(double value, int decimals) { fields_.push_back(Number(value, decimals)); }
  std::string Text() const { return CsvLine(fields_); }

 private:
  std::vector<std::string> fields_;
};

void AddErrors(const Room& room, const AutomaticAlignment& found, Line* line) {
  Error start, final;
  const auto& alignment = found.attempt.alignment;
  if (found.verdict.best >= 0) {
    SparseModel placed = room.one.model;
    TransformModel(found.search.starts[found.verdict.best].scan_from_sparse, &placed);
    start = final = ErrorOf(*room.one.room, placed);
  }
  if (alignment) {
    SparseModel placed = room.one.model;
    TransformModel(alignment->scan_from_sparse, &placed);
    final = ErrorOf(*room.one.room,
                    alignment->adjusted() ? alignment->adjustment.bundle.model : placed);
  }
  line->Add(start.position, 5);
  line->Add(start.turn_deg, 3);
  line->Add(final.position, 5);
  line->Add(final.turn_deg, 3);
  line->Add(alignment ? alignment->expected_error.at_cameras : -1, 5);
}

void AddEvidence(const Room& room, const SurveyedScans& surveyed, const AutomaticAlignment& found,
                 Line* line) {
  const StartVerdict& v = found.verdict;
  const auto& starts = found.search.starts;
  const FittedStart best = v.best < 0 ? FittedStart() : starts[v.best];
  const auto photos_at = [&](int start) {
    return start < 0 ? GradientAgreement() : starts[start].photos.value_or(GradientAgreement());
  };
  const GradientAgreement photos = photos_at(v.best), second = photos_at(v.second);
  const GradientShifts& shifts = photos.shifts;
  const SightAgreement true_sights =
      CheckSights(found.search.cloud, room.truth, surveyed.free_space(), kSightTolerance);
  line->Add(HasAnswer(room.kind) ? true_sights.Score() : 0, 4);
  line->Add(best.sights.Score(), 4);
  line->Add(v.second < 0 ? 0 : starts[v.second].sights.Score(), 4);
  line->Add(v.mirrored_score, 4);
  line->Add(best.sights.ThroughShare(), 4);
  line->Add(best.rms, 4);
  line->Add(static_cast<int>(v.support), 0);
  line->Add(shifts.at_pose.Share(), 4);
  line->Add(shifts.elsewhere.Share(), 4);
  line->Add(shifts.far.Share(), 4);
  line->Add(shifts.ring.Share(), 4);
  line->Add(static_cast<double>(shifts.at_pose.num), 0);
  line->Add(static_cast<double>(shifts.clear.num), 0);
  line->Add(photos.contradicts, 0);
  line->Add(second.shifts.at_pose.Share(), 4);
  line->Add(v.chance_wrong, 4);
}

std::string LineOfRoom(uint64_t seed, const Settings& settings) {
  const double before_making = CpuSeconds();
  const Room room = MakeRoom(seed, settings);
  const TempFolder folder;
  DrawPhotos(room, folder.path());
  const double before = CpuSeconds();
  const SurveyedScans surveyed(room.one.scans);
  AlignmentInput input{room.one.model, surveyed, {}, "", "clockwise"};
  input.image_path = folder.path();
  input.num_threads = 1;
  Progress progress(true);
  const AutomaticAlignment found = AlignAutomatically(input, {}, AlignmentOptions(), &progress);
  const double after = CpuSeconds();
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);

  Line line;
  line.Add(std::to_string(seed));
  line.Add(NameOf(room.kind));
  line.Add(HasAnswer(room.kind), 0);
  line.Add(found.attempt.trusted(), 0);
  line.Add(NameOf(found.verdict.kind));
  AddErrors(room, found, &line);
  AddEvidence(room, surveyed, found, &line);
  line.Add(after - before, 1);
  line.Add(before - before_making, 1);
  line.Add(static_cast<double>(usage.ru_maxrss) / 1024, 0);
  line.Add(static_cast<double>(room.one.model.points.size()), 0);
  line.Add(room.one.room->NumPhotos(), 0);
  line.Add(static_cast<double>(room.one.scans.size()), 0);
  line.Add(room.scanned_share, 2);
  line.Add(room.reflectance, 0);
  line.Add(room.one.room->options().range_noise, 4);
  // By appearance; nothing where it was not asked.
  const auto& appearance = found.search.appearance;
  line.Add(found.verdict.looks_alike, 0);
  for (const size_t k : {0, 1}) {
    const auto& places = appearance ? appearance->places : std::vector<AppearancePlace>();
    line.Add(appearance ? std::to_string(k < places.size() ? places[k].num_cells : 0) : "");
  }
  line.Add(appearance ? std::to_string(appearance->spread.num_apart) : "");
  const auto& alone = found.search.placed_photos;
  line.Add(alone ? std::to_string(alone->num_asked) : "");
  line.Add(alone ? std::to_string(alone->num_placed) : "");
  line.Add(alone ? std::to_string(alone->num_agreeing) : "");
  line.Add(alone ? std::to_string(alone->spread.num_cells) : "");
  line.Add(alone ? std::to_string(alone->spread.num_apart) : "");
  const auto& alignment = found.attempt.alignment;
  line.Add(alignment && !alignment->reasons.empty() ? alignment->reasons[0]
                                                    : found.attempt.refusal);
  return line.Text();
}

std::set<std::string> SeedsIn(const std::string& path) {
  std::set<std::string> seeds;
  std::ifstream stream(path);
  for (std::string line; std::getline(stream, line);) seeds.insert(line.substr(0, line.find(',')));
  return seeds;
}

void Run(const Settings& settings) {
  const std::set<std::string> done = SeedsIn(settings.output_path);
  std::ofstream stream(settings.output_path, std::ios::app);
  if (done.empty()) stream << kHeader;
  for (int i = 0; i < settings.num_rooms; ++i) {
    const uint64_t seed = settings.first + i;
    if (done.count(std::to_string(seed)) > 0) continue;
    const std::string line = LineOfRoom(seed, settings);
    stream << line << std::flush;
    std::fputs(line.c_str(), stdout);
    std::fflush(stdout);
  }
}

bool Parse(int argc, char** argv, Settings* settings) {
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    if (option == "--set" && value == "tuning")
      settings->first = kTuning;
    else if (option == "--set" && value == "check")
      settings->first = kCheck;
    else if (option == "--walls" && value == "plain")
      settings->walls = Walls::kPlain;
    else if (option == "--walls" && value == "pattern")
      settings->walls = Walls::kPattern;
    else if (option == "--walls" && value == "twofold")
      settings->walls = Walls::kTwofold;
    else if (option == "--fine")
      settings->fine = value == "1";
    else if (option == "--first")
      settings->first = std::strtoull(argv[i + 1], nullptr, 10);
    else if (option == "--rooms")
      settings->num_rooms = std::atoi(argv[i + 1]);
    else if (option == "--output_path")
      settings->output_path = value;
    else
      return false;
  }
  return argc % 2 == 1 && settings->num_rooms > 0 && !settings->output_path.empty();
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::Settings settings;
  if (!roomtex::Parse(argc, argv, &settings)) {
    std::fprintf(stderr,
                 "auto_align --output_path rooms.csv --set tuning|check [--rooms N] [--first SEED] "
                 "[--walls plain|pattern|twofold] [--fine 1]\n");
    return 2;
  }
  roomtex::Run(settings);
}
