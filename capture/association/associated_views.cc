#include "capture/association/associated_views.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <utility>

#include <fmt/core.h>

#include "capture/association/associated_views_photo.h"
#include "colmap_ext/database.h"
#include "core/csv.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/photo_files.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kMeasuredSize = 1900;    // pixels: photos are measured at this size or up to twice it
constexpr int kSearched = 5;           // most alike photos that are compared
constexpr double kClearDetail = 1.15;  // ratio of detail that tells the patterned photo
// LightComparison::two_sided, more = both have a pattern. Of 12 places in the light of one
// projector or two and in none 0.07 at most; of two patterns that reach alike far 0.5.
constexpr double kTwoPatterns = 0.2;
constexpr double kEqualBrightness = 1.03;
constexpr double kLeastAdvantage = 12;
constexpr double kLargestError = 0.3;  // pixels: an offset known worse is none

// Keypoints of the database by image name.
class KeypointSource {
 public:
  explicit KeypointSource(const std::string& path) {
    if (path.empty()) return;
    database_ = std::make_unique<Database>(path);
    for (const auto& [id, image] : database_->ReadImages()) ids_[image.name] = id;
    counts_ = database_->CountKeypoints();
  }
  bool Has(const std::string& name) const {
    const auto id = ids_.find(name);
    if (id == ids_.end()) return false;
    const auto count = counts_.find(id->second);
    return count != counts_.end() && count->second > 0;
  }
  std::vector<Eigen::Vector2d> Read(const std::string& name) const {
    return database_->ReadKeypoints(ids_.at(name));
  }
  const std::map<std::string, uint32_t>& ids() const { return ids_; }

 private:
  std::unique_ptr<Database> database_;
  std::map<std::string, uint32_t> ids_;
  std::map<uint32_t, size_t> counts_;
};

// Two photos of one place, as far as the small pictures tell; first < second.
struct Candidate {
  int first = 0, second = 0;
  std::string found_by;
  PlaceComparison place;
  LightComparison light;
  // Measured if the light differs.
  bool second_is_patterned = false;
  CameraShift camera;  // x_in_patterned - x_in_plain, pixels of the photos
  std::optional<KeypointShift> keypoints;
  bool by_keypoints = false;

  int patterned() const { return second_is_patterned ? second : first; }
  int plain() const { return second_is_patterned ? first : second; }
};

cv::Mat1b ReadToMeasure(const PhotoSummary& photo, double* scale) {
  int shrink = 1;
  while (shrink < 8 && std::max(photo.size[0], photo.size[1]) / (2 * shrink) >= kMeasuredSize) {
    shrink *= 2;
  }
  cv::Mat1b grey = ReadGreyPhoto(photo.path, shrink);
  *scale = static_cast<double>(photo.size[0]) / grey.cols;
  return grey;
}

class Finder {
 public:
  Finder(const AssociateOptions& options, Progress* progress)
      : options_(options), progress_(*progress), keypoints_(options.database_path) {}

  Associations Find() {
    ReadPhotos();
    progress_.Stage("compare neighbours");
    const auto by_name = NameOrder(), by_time = TimeOrder();
    CompareNeighbours(by_name, 1, "name order");
    CompareNeighbours(by_time, 1, "time order");
    CompareNeighbours(by_name, 2, "name order");
    CompareNeighbours(by_time, 2, "time order");
    Search();
    Measure();
    FollowSameLight();
    ComparePartners();
    return Collect();
  }

 private:
  void ReadPhotos() {
    const auto names = ListPhotoFiles(options_.image_path,
                                      "Give the folder with the patterned and the plain photos");
    if (names.size() < 2) {
      throw InputError(options_.image_path, "",
                       "holds " + std::to_string(names.size()) +
                           " photos (JPEG, PNG, TIFF), expected pairs of them",
                       "Give the folder with the patterned and the plain photos");
    }
    photos_.resize(names.size());
    progress_.Stage("read photos", static_cast<int>(names.size()));
    ParallelFor(options_.num_threads, 0, static_cast<int>(names.size()), [&](int i) {
      photos_[i] = SummarizePhoto(names[i], options_.image_path + "/" + names[i]);
      progress_.Tick();
    });
    int missing = 0;
    std::string example;
    for (const auto& [name, id] : keypoints_.ids()) {
      if (std::binary_search(names.begin(), names.end(), name)) continue;
      if (missing++ == 0) example = name;
    }
    if (missing > 0) {
      result_.warnings.push_back(std::to_string(missing) + " images of " + options_.database_path +
                                 " are not in " + options_.image_path + ", e.g. " + example);
    }
  }

  bool IsUsable(int i) const { return photos_[i].unreadable.empty(); }

  std::vector<int> NameOrder() const {
    std::vector<int> order;
    for (int i = 0; i < static_cast<int>(photos_.size()); ++i) {
      if (IsUsable(i)) order.push_back(i);
    }
    return order;
  }
  std::vector<int> TimeOrder() const {
    std::vector<int> order;
    for (const int i : NameOrder()) {
      if (!photos_[i].date_time.empty()) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return photos_[a].date_time < photos_[b].date_time; });
    return order;
  }

  // Photos that were seen in another light from the same place.
  std::set<int> Settled() const {
    std::set<int> settled;
    for (const Candidate& c : candidates_) {
      if (!c.light.same_light) settled.insert({c.first, c.second});
    }
    return settled;
  }

  void CompareNeighbours(const std::vector<int>& order, int step, const std::string& found_by) {
    const std::set<int> settled = Settled();
    std::vector<std::pair<int, int>> pairs;
    for (size_t k = 0; k + step < order.size(); ++k) {
      const int a = order[k], b = order[k + step];
      if (step == 1 || settled.count(a) == 0 || settled.count(b) == 0) pairs.push_back({a, b});
    }
    Compare(pairs, found_by);
  }

  void Search() {
    const std::set<int> settled = Settled();
    std::vector<int> open;
    for (const int i : NameOrder()) {
      if (settled.count(i) == 0) open.push_back(i);
    }
    progress_.Stage("search", static_cast<int>(open.size()));
    std::vector<std::vector<std::pair<int, int>>> found(open.size());
    ParallelFor(options_.num_threads, 0, static_cast<int>(open.size()), [&](int k) {
      std::vector<std::pair<double, int>> alike;
      for (const int other : NameOrder()) {
        if (other == open[k]) continue;
        alike.push_back({-SketchLikeness(photos_[open[k]], photos_[other]), other});
      }
      std::sort(alike.begin(), alike.end());
      for (size_t n = 0; n < alike.size() && n < kSearched; ++n) {
        found[k].push_back({open[k], alike[n].second});
      }
      progress_.Tick();
    });
    std::vector<std::pair<int, int>> pairs;
    for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
    Compare(pairs, "search");
  }

  // Adds those that show one place to the candidates.
  void Compare(const std::vector<std::pair<int, int>>& pairs, const std::string& found_by) {
    std::vector<Candidate> fresh;
    for (auto [a, b] : pairs) {
      if (a > b) std::swap(a, b);
      if (!compared_.insert({a, b}).second) continue;
      Candidate candidate;
      candidate.first = a;
      candidate.second = b;
      candidate.found_by = found_by;
      fresh.push_back(candidate);
    }
    ParallelFor(options_.num_threads, 0, static_cast<int>(fresh.size()), [&](int k) {
      Candidate& c = fresh[k];
      const PhotoSummary &first = photos_[c.first], &second = photos_[c.second];
      c.place = ComparePlaces(first, second);
      if (c.place.same_place) c.light = CompareLight(first, second, c.place.shift);
    });
    for (Candidate& c : fresh) {
      if (!c.place.same_place) continue;
      if (photos_[c.first].size != photos_[c.second].size) {
        other_size_[c.first] = c.second;
        other_size_[c.second] = c.first;
      } else {
        candidates_.push_back(std::move(c));
      }
    }
  }

  // The offsets of the candidates that have none yet.
  void Measure() {
    std::vector<Candidate*> open;
    for (Candidate& c : candidates_) {
      if (!c.light.same_light && !measured_.count({c.first, c.second})) {
        measured_.insert({c.first, c.second});
        open.push_back(&c);
      }
    }
    std::sort(open.begin(), open.end(), [](const Candidate* a, const Candidate* b) {
      return std::make_pair(a->first, a->second) < std::make_pair(b->first, b->second);
    });
    progress_.Stage("measure offsets", static_cast<int>(open.size()));
    for (Candidate* c : open) ReadKeypointShift(c);  // one database, one thread
    ParallelFor(options_.num_threads, 0, static_cast<int>(open.size()), [&](int k) {
      MeasureOne(open[k]);
      progress_.Tick();
    });
  }

  void ReadKeypointShift(Candidate* c) const {
    // Thesis 6: the one with the pattern is brighter. It has more detail, too, and that holds where
    // the exposure or the room's light was changed.
    const double detail = c->light.detail_ratio;
    c->second_is_patterned = detail > kClearDetail       ? true
                             : detail < 1 / kClearDetail ? false
                                                         : c->light.brightness_ratio > 1;
    const std::string &plain = photos_[c->plain()].name, &patterned = photos_[c->patterned()].name;
    if (!keypoints_.Has(plain) || !keypoints_.Has(patterned)) return;
    c->keypoints =
        FindKeypointShift(keypoints_.Read(plain), keypoints_.Read(patterned), StartOf(*c));
    if (!c->keypoints) c->keypoints = KeypointShift{};
  }

  static Eigen::Vector2d StartOf(const Candidate& c) {
    return c.second_is_patterned ? c.place.shift : Eigen::Vector2d(-c.place.shift);
  }

  void MeasureOne(Candidate* c) const {
    double scale = 1;
    const cv::Mat1b plain = ReadToMeasure(photos_[c->plain()], &scale);
    const cv::Mat1b patterned = ReadToMeasure(photos_[c->patterned()], &scale);
    CameraShift& camera = c->camera;
    if (plain.size() == patterned.size()) {
      camera = FindCameraShift(plain, patterned, StartOf(*c) / scale);
    }
    camera.shift *= scale;
    for (double* value : {&camera.roll_px, &camera.scale_px, &camera.offset_px, &camera.error_px}) {
      *value *= scale;
    }
    if (!IsClear(camera) && c->keypoints && c->keypoints->num_common > 0) {
      c->by_keypoints = true;
      camera = CameraShift();
      camera.found = true;
      camera.shift = c->keypoints->shift;
      camera.offset_px = camera.shift.norm();
      camera.error_px = c->keypoints->error_px;
    }
  }

  // A camera has moved where the photos are clearly likelier so.
  bool IsKnown(const Candidate& c) const {
    return !c.light.same_light && (c.by_keypoints || IsClear(c.camera));
  }
  bool IsClear(const CameraShift& camera) const {
    if (!camera.found || camera.error_px > kLargestError) return false;
    if (camera.offset_px <= options_.max_offset) return true;
    return camera.advantage > kLeastAdvantage &&
           camera.offset_px > options_.max_offset + 2 * camera.error_px;
  }
  bool IsUnmoved(const Candidate& c) const {
    return IsKnown(c) && c.camera.offset_px <= options_.max_offset;
  }

  // A photo in the same light as one that has a partner shares the partner.
  void FollowSameLight() {
    std::map<int, std::vector<int>> partners;
    for (const Candidate& c : candidates_) {
      if (!IsUnmoved(c)) continue;
      partners[c.first].push_back(c.second);
      partners[c.second].push_back(c.first);
    }
    std::vector<std::pair<int, int>> pairs;
    for (const Candidate& c : candidates_) {
      if (!c.light.same_light) continue;
      for (const auto& [a, b] : {std::make_pair(c.first, c.second), {c.second, c.first}}) {
        if (partners.count(a) > 0 || partners.count(b) == 0) continue;
        for (const int partner : partners.at(b)) pairs.push_back({a, partner});
      }
    }
    if (pairs.empty()) return;
    Compare(pairs, "search");
    Measure();
  }

  // Two photos that share a partner show one place, too, whatever small pictures say: with both
  // projectors, with one and with none, each is compared with each.
  void ComparePartners() {
    while (true) {
      std::map<int, std::set<int>> partners;
      std::set<std::pair<int, int>> known;
      for (const Candidate& c : candidates_) {
        known.insert({c.first, c.second});
        if (!IsUnmoved(c)) continue;
        partners[c.first].insert(c.second);
        partners[c.second].insert(c.first);
      }
      const size_t num_before = candidates_.size();
      for (const auto& [photo, others] : partners) {
        for (const int a : others) {
          for (const int b : others) {
            if (a >= b || !known.insert({a, b}).second) continue;
            Candidate c;
            c.first = a;
            c.second = b;
            c.found_by = "search";
            c.place.same_place = true;
            c.light = CompareLight(photos_[a], photos_[b], c.place.shift);
            candidates_.push_back(std::move(c));
          }
        }
      }
      if (candidates_.size() == num_before) return;
      Measure();
    }
  }

  static bool HasClearDetail(const Candidate& c) {
    return c.light.detail_ratio > kClearDetail || c.light.detail_ratio < 1 / kClearDetail;
  }

  // Photos with a pattern: those that have more detail than another one of their place, or detail
  // that it lacks where it has some of its own. Photos that share part of a pattern lie on each
  // other best of all, so that this comes before offsets.
  void FindPatterned() {
    std::set<int> plain;
    for (const Candidate& c : candidates_) {
      if (!IsUnmoved(c)) continue;
      if (c.light.two_sided > kTwoPatterns) {
        has_pattern_.insert({c.first, c.second});
        continue;
      }
      if (!HasClearDetail(c)) continue;
      has_pattern_.insert(c.patterned());
      plain.insert(c.plain());
    }
    for (const int photo : plain) {
      if (has_pattern_.count(photo) == 0) is_plain_.insert(photo);
    }
  }
  // An unmoved pair of a photo with a pattern and one without.
  bool IsPair(const Candidate& c) const {
    return IsUnmoved(c) && has_pattern_.count(c.plain()) == 0 &&
           is_plain_.count(c.patterned()) == 0;
  }

  // A better plain photo for the same patterned one: what has least of the pattern, and, where
  // exposures tell, of its light; among equals, the one that lies on it best.
  static bool IsBetter(const Candidate& a, const Candidate& b) {
    constexpr double kEqual = 1.15;
    const double share = a.light.changed_share / b.light.changed_share;
    if (share > kEqual || share < 1 / kEqual) return share > 1;
    if (a.light.exif_brightness && b.light.exif_brightness) {
      const double ratio = BrightnessRatio(a) / BrightnessRatio(b);
      if (ratio > kEqual || ratio < 1 / kEqual) return ratio > 1;
    }
    return a.camera.offset_px < b.camera.offset_px;
  }
  // Patterned over plain.
  static double BrightnessRatio(const Candidate& c) {
    return c.second_is_patterned ? c.light.brightness_ratio
                                 : 1 / std::max(c.light.brightness_ratio, 1e-9);
  }

  Associations Collect() {
    FindPatterned();
    std::map<int, const Candidate*> best_of_patterned;
    for (const Candidate& c : candidates_) {
      if (!IsPair(c)) continue;
      const Candidate*& best = best_of_patterned[c.patterned()];
      if (best == nullptr || IsBetter(c, *best)) best = &c;
    }
    std::map<int, const Candidate*> best_of_plain;
    for (const auto& [patterned, c] : best_of_patterned) {
      const Candidate*& best = best_of_plain[c->plain()];
      if (best == nullptr || c->camera.offset_px < best->camera.offset_px) best = c;
    }
    for (const auto& [patterned, c] : best_of_patterned) {
      result_.pairs.push_back(Describe(*c, best_of_plain.at(c->plain()) != c));
    }
    CollectMoved();
    WarnOfBrightness();
    for (int i = 0; i < static_cast<int>(photos_.size()); ++i) {
      result_.num_photos += IsUsable(i);
      if (best_of_patterned.count(i) > 0 || best_of_plain.count(i) > 0) continue;
      result_.singles.push_back({photos_[i].name, WhySingle(i)});
    }
    return std::move(result_);
  }

  AssociatedPair Describe(const Candidate& c, bool is_spare) {
    AssociatedPair pair;
    pair.patterned_image = photos_[c.patterned()].name;
    pair.plain_image = photos_[c.plain()].name;
    pair.shift = c.camera.shift;
    pair.offset_px = c.camera.offset_px;
    pair.offset_error_px = c.camera.error_px;
    pair.brightness_ratio = BrightnessRatio(c);
    pair.exif_brightness = c.light.exif_brightness;
    if (c.keypoints) pair.num_common_keypoints = c.keypoints->num_common;
    pair.found_by = c.found_by;
    pair.by_keypoints = c.by_keypoints;
    pair.is_spare = is_spare;
    if (pair.brightness_ratio < kEqualBrightness) not_brighter_.push_back(pair);
    WarnOfKeypoints(c);
    return pair;
  }

  // Keypoints that contradict the edges.
  void WarnOfKeypoints(const Candidate& c) {
    if (c.by_keypoints || !c.keypoints || c.keypoints->num_common == 0) return;
    const double difference = (c.keypoints->shift - c.camera.shift).norm();
    const double errors = c.keypoints->error_px + c.camera.error_px;
    if (!(difference > options_.max_offset + 2 * errors)) return;
    result_.warnings.push_back(fmt::format(
        "{} and {}: their edges say that the camera moved by {:.2f} pixels, {} keypoints of the "
        "database that both have say {:.2f}: look at the two before they are used",
        photos_[c.patterned()].name, photos_[c.plain()].name, c.camera.offset_px,
        c.keypoints->num_common, c.keypoints->shift.norm()));
  }

  void CollectMoved() {
    for (const Candidate& c : candidates_) {
      if (!IsKnown(c) || IsUnmoved(c)) continue;
      const double sign = c.second_is_patterned ? 1 : -1;
      result_.moved.push_back({photos_[c.first].name, photos_[c.second].name, sign * c.camera.shift,
                               c.camera.offset_px, c.camera.error_px});
    }
    std::sort(
        result_.moved.begin(), result_.moved.end(), [](const MovedPair& a, const MovedPair& b) {
          return std::tie(a.first_image, a.second_image) < std::tie(b.first_image, b.second_image);
        });
  }

  void WarnOfBrightness() {
    if (not_brighter_.empty()) return;
    const AssociatedPair& first = not_brighter_[0];
    result_.warnings.push_back(fmt::format(
        "{} patterned photos are not brighter than their plain twins and were told by their "
        "detail: "
        "{} is {:.2f} times as bright as {} ({}){}",
        not_brighter_.size(), first.patterned_image, first.brightness_ratio, first.plain_image,
        first.exif_brightness ? "exposures taken into account"
                              : "no exposures in EXIF: automatic exposure hides the light",
        not_brighter_.size() > 1 ? ", and so on" : ""));
  }

  std::string WhySingle(int i) const {
    if (!IsUsable(i)) return "it cannot be read: " + photos_[i].unreadable;
    const Candidate *moved = nullptr, *unclear = nullptr, *spare = nullptr, *same = nullptr;
    const Candidate* of_pattern = nullptr;
    for (const Candidate& c : candidates_) {
      if (c.first != i && c.second != i) continue;
      if (c.light.same_light) {
        same = &c;
      } else if (IsPair(c)) {
        spare = &c;
      } else if (IsUnmoved(c)) {
        of_pattern = &c;
      } else if (!IsKnown(c)) {
        unclear = &c;
      } else if (moved == nullptr || c.camera.offset_px < moved->camera.offset_px) {
        moved = &c;
      }
    }
    const auto other = [&](const Candidate* c) {
      return photos_[c->first == i ? c->second : c->first].name;
    };
    if (spare != nullptr) return "a further plain photo of the place of " + other(spare);
    if (of_pattern != nullptr && is_plain_.count(i) == 0) {
      return other(of_pattern) +
             " of its place has a pattern itself, and no photo without any was found there that "
             "the camera did not move for";
    }
    if (of_pattern != nullptr) {
      return "a further plain photo, in other light, of the place of " + other(of_pattern);
    }
    if (moved != nullptr) {
      return fmt::format("the camera moved by {:.2f} pixels against {}", moved->camera.offset_px,
                         other(moved));
    }
    if (unclear != nullptr) {
      const std::string offset =
          unclear->camera.found ? fmt::format(" ({:.2f} pixels, give or take {:.2f})",
                                              unclear->camera.offset_px, unclear->camera.error_px)
                                : "";
      return "it shows the place of " + other(unclear) +
             ", but too few edges that both show tell whether the camera moved" + offset;
    }
    if (same != nullptr) {
      return "it shows the place of " + other(same) +
             " in the same light: both are patterned, or both are plain";
    }
    const auto size = other_size_.find(i);
    if (size != other_size_.end()) {
      const auto text = [&](int k) {
        return std::to_string(photos_[k].size[0]) + " x " + std::to_string(photos_[k].size[1]);
      };
      return "it shows the place of " + photos_[size->second].name + ", but has " + text(i) +
             " pixels and the other " + text(size->second);
    }
    return "no other photo was taken from the same place";
  }

  const AssociateOptions& options_;
  Progress& progress_;
  KeypointSource keypoints_;
  std::vector<PhotoSummary> photos_;
  std::set<std::pair<int, int>> compared_, measured_;
  std::vector<Candidate> candidates_;
  std::map<int, int> other_size_;
  std::vector<AssociatedPair> not_brighter_;
  std::set<int> has_pattern_, is_plain_;  // by their detail
  Associations result_;
};

}  // namespace

void AssociateOptions::Declare(OptionFields* fields) {
  fields
      ->Number("max_offset", &max_offset,
               "pixels by which the camera may have moved between the two photos; larger = "
               "more tolerant")
      .Above(0)
      .AtMost(20)
      .Says("must lie above 0 and at most at 20 pixels");
}

std::vector<std::string> AssociateOptions::Problems() const { return ProblemsOf(*this); }

Associations FindAssociations(const AssociateOptions& options, Progress* progress) {
  ThrowIfProblems(options.Problems());
  return Finder(options, progress).Find();
}

void WriteAssociations(const std::string& path, const std::vector<AssociatedPair>& pairs) {
  OutputFile file(path);
  file.stream() << CsvLine({"patterned_image", "plain_image", "offset_px", "brightness_ratio"});
  for (const AssociatedPair& pair : pairs) {
    file.stream() << CsvLine({pair.patterned_image, pair.plain_image, Number(pair.offset_px, 3),
                              Number(pair.brightness_ratio, 3)});
  }
  file.Commit();
}

}  // namespace roomtex
