#include "align/join/room_links.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include <Eigen/LU>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/twist.h"
#include "importers/content_hash.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

// As for stations in one room (station_check).
constexpr double kDeviations = 4, kLeastOffset = 0.006;
const double kLeastTurn = RadFromDeg(0.1);
// Of one scan in two rooms: both frames are told by it, but for what was rounded.
constexpr double kScanPositionSigma = 0.0005, kScanRotationSigma = 1e-4;
constexpr int kNumSteps = 5;

using Vector6d = Eigen::Matrix<double, 6, 1>;

// The turn that takes `from` to `to`, as a rotation vector in the target frame.
Eigen::Vector3d TurnBetween(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
  return VectorFromRotation(to * from.conjugate());
}

// d (first_from_second * x) / d (turn, shift).
Eigen::Matrix<double, 3, 6> JacobianAt(const Rigid& first_from_second,
                                       const Eigen::Vector3d& x_in_first) {
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << -CrossMatrix(x_in_first - first_from_second.translation), Eigen::Matrix3d::Identity();
  return jacobian;
}

// ---- which photos are the same

// Reads a file only if another room has one of the same size.
class FileHashes {
 public:
  const std::string& Of(const std::string& path) {
    std::error_code error;
    const fs::path canonical = fs::weakly_canonical(path, error);
    std::string& hash = hashes_[canonical.string()];
    if (hash.empty()) hash = HashOfFile(path);
    return hash;
  }

 private:
  std::map<std::string, std::string> hashes_;
};

struct PhotoOfRoom {
  int room = 0, photo = 0;
};

// The photos of several rooms, by content; of each room at most one of a content.
std::vector<std::vector<PhotoOfRoom>> FindSharedPhotos(const std::vector<RoomRecord>& rooms) {
  std::map<uintmax_t, std::vector<PhotoOfRoom>> by_size;
  for (int room = 0; room < static_cast<int>(rooms.size()); ++room) {
    for (int photo = 0; photo < static_cast<int>(rooms[room].photos.size()); ++photo) {
      std::error_code error;
      const uintmax_t size = fs::file_size(rooms[room].photos[photo].path, error);
      if (!error) by_size[size].push_back({room, photo});
    }
  }
  FileHashes hashes;
  std::vector<std::vector<PhotoOfRoom>> shared;
  for (const auto& [size, photos] : by_size) {
    if (photos.front().room == photos.back().room) continue;
    std::map<std::string, std::vector<PhotoOfRoom>> by_hash;
    for (const PhotoOfRoom& one : photos) {
      std::vector<PhotoOfRoom>& same = by_hash[hashes.Of(rooms[one.room].photos[one.photo].path)];
      if (same.empty() || same.back().room != one.room) same.push_back(one);
    }
    for (const auto& [hash, same] : by_hash) {
      if (same.size() > 1) shared.push_back(same);
    }
  }
  return shared;
}

SharedView ViewOf(const RoomPhoto& first, const RoomPhoto& second) {
  SharedView view;
  view.name = first.name;
  view.first_from_second = first.cam_from_room.Inverse() * second.cam_from_room;
  view.x_in_first = first.cam_from_room.TargetOriginInSource();
  view.x_in_second = second.cam_from_room.TargetOriginInSource();
  view.position_sigma = std::hypot(first.position_sigma, second.position_sigma);
  view.rotation_sigma = std::hypot(first.rotation_sigma, second.rotation_sigma);
  return view;
}

// ---- which scans are the same

SharedView ScanView(const std::string& name, const RoomRecord& first, const RoomRecord& second,
                    const Rigid& first_from_second_scan, const Eigen::Vector3d& x_in_first_scan) {
  SharedView view;
  view.kind = SharedView::Kind::kScan;
  view.name = name;
  view.first_from_second =
      first.RoomFromScan() * first_from_second_scan * second.RoomFromScan().Inverse();
  view.x_in_first = first.RoomFromScan() * x_in_first_scan;
  view.x_in_second = view.first_from_second.Inverse() * view.x_in_first;
  view.position_sigma = kScanPositionSigma;
  view.rotation_sigma = kScanRotationSigma;
  return view;
}

bool AnyGiven(const ScanRecord& scan) {
  return std::any_of(scan.poses.begin(), scan.poses.end(),
                     [](const ScanRecord::Pose& pose) { return pose.given; });
}

// Of one file to which both rooms were aligned: its stations tell where one frame lies in the
// other.
std::vector<SharedView> ViewsOfStations(const RoomRecord& first, const ScanRecord& a,
                                        const RoomRecord& second, const ScanRecord& b) {
  std::vector<SharedView> views;
  for (size_t k = 0; k < a.poses.size(); ++k) {
    const Rigid& in_first = a.poses[k].scan_from_station;
    std::string name = a.path + (a.part.empty() ? "" : "#" + a.part);
    if (a.poses.size() > 1) name += ", scan " + std::to_string(k + 1);
    views.push_back(ScanView(name, first, second, in_first * b.poses[k].scan_from_station.Inverse(),
                             in_first.translation));
  }
  return views;
}

// Parts of a file whose own poses hold lie in the frame of the file.
SharedView ViewOfFile(const RoomRecord& first, const ScanRecord& a, const RoomRecord& second) {
  return ScanView(a.path + ", the frame of the file", first, second, Rigid(),
                  a.poses[0].scan_from_station.translation);
}

std::string ReadingOf(const ScanRecord& scan) {
  return scan.azimuth + " " + std::to_string(scan.meters_per_unit);
}

struct ScanOfRoom {
  int room = 0;
  const ScanRecord* scan = nullptr;
};

using LinkMap = std::map<std::pair<int, int>, RoomLink>;

// Frames are exact: each scan is compared with the first one that it can be, not with all of a file
// that hundreds of rooms share.
void AddScans(const std::vector<RoomRecord>& rooms, LinkMap* links,
              std::vector<std::string>* problems) {
  std::map<std::string, std::vector<ScanOfRoom>> by_hash;
  for (int room = 0; room < static_cast<int>(rooms.size()); ++room) {
    for (const ScanRecord& scan : rooms[room].alignment.scans) {
      if (!scan.poses.empty()) by_hash[scan.content_hash].push_back({room, &scan});
    }
  }
  const auto is_same = [](const ScanRecord& a, const ScanRecord& b) {
    return a.part == b.part && a.poses.size() == b.poses.size();
  };
  const auto are_in_frame = [](const ScanRecord& a, const ScanRecord& b) {
    return !AnyGiven(a) && !AnyGiven(b);
  };
  for (const auto& same_file : by_hash) {
    const std::vector<ScanOfRoom>& scans = same_file.second;
    for (auto at = scans.begin(); at != scans.end(); ++at) {
      const ScanRecord& b = *at->scan;
      const auto first_of = [&](const auto& fits) {
        return std::find_if(scans.begin(), at, [&](const ScanOfRoom& other) {
          return other.room != at->room && fits(*other.scan, b);
        });
      };
      auto other = first_of(is_same);
      const bool is_station = other != at;
      if (!is_station) other = first_of(are_in_frame);
      if (other == at) continue;
      const ScanRecord& a = *other->scan;
      const RoomRecord &first = rooms[other->room], &second = rooms[at->room];
      if (ReadingOf(a) != ReadingOf(b)) {
        problems->push_back(a.path + " was read in another way for " + first.name + " than for " +
                            second.name +
                            " (azimuth, units): one of them is wrong. Align it anew.");
        continue;
      }
      std::vector<SharedView>& views = (*links)[{other->room, at->room}].views;
      for (const SharedView& view : is_station
                                        ? ViewsOfStations(first, a, second, b)
                                        : std::vector<SharedView>{ViewOfFile(first, a, second)}) {
        const bool is_there = std::any_of(views.begin(), views.end(), [&](const SharedView& known) {
          return known.kind == view.kind && known.name == view.name;
        });
        if (!is_there) views.push_back(view);  // of many parts
      }
    }
  }
}

// ---- the relation

// Of a view from the relation that another one gives, with the errors of both.
Misfit MisfitBetween(const SharedView& view, const SharedView& by) {
  SharedView both = view;
  both.rotation_sigma = std::hypot(view.rotation_sigma, by.rotation_sigma);
  const double arm = (view.x_in_first - by.x_in_first).norm();
  both.position_sigma = std::hypot(view.position_sigma, by.position_sigma, by.rotation_sigma * arm);
  return MisfitOf(both, by.first_from_second);
}

// The view with which most others agree; of equals the one that they fit best.
const SharedView& Elected(const std::vector<SharedView>& views) {
  size_t best = 0;
  std::pair<int, double> most(-1, 0);  // number, minus the sum of squared deviations
  for (size_t i = 0; i < views.size(); ++i) {
    std::pair<int, double> votes(0, 0);
    for (const SharedView& other : views) {
      const Misfit misfit = MisfitBetween(other, views[i]);
      if (misfit.Contradicts()) continue;
      ++votes.first;
      votes.second -= std::pow(misfit.offset / misfit.offset_sigma, 2) +
                      std::pow(misfit.turn / misfit.turn_sigma, 2);
    }
    if (votes > most) {
      most = votes;
      best = i;
    }
  }
  return views[best];
}

// Gauss-Newton over the views that agree; the normal matrix.
Matrix6d Adjust(RoomLink* link) {
  Matrix6d normal;
  for (int step = 0; step < kNumSteps; ++step) {
    normal.setZero();
    Vector6d right = Vector6d::Zero();
    for (const SharedView& view : link->views) {
      if (!view.agrees) continue;
      const double w = 1 / std::pow(view.position_sigma, 2);
      const Eigen::Vector3d moved = link->first_from_second * view.x_in_second;
      const Eigen::Matrix<double, 3, 6> jacobian = JacobianAt(link->first_from_second, moved);
      normal += w * jacobian.transpose() * jacobian;
      right += w * jacobian.transpose() * (view.x_in_first - moved);
      const double v = 1 / std::pow(view.rotation_sigma, 2);
      normal.topLeftCorner<3, 3>() += v * Eigen::Matrix3d::Identity();
      right.head<3>() +=
          v * TurnBetween(link->first_from_second.rotation, view.first_from_second.rotation);
    }
    link->first_from_second = Moved(link->first_from_second, SolveSymmetric(normal, right));
  }
  return normal;
}

}  // namespace

int RoomLink::NumAgreeing() const {
  return static_cast<int>(std::count_if(views.begin(), views.end(),
                                        [](const SharedView& view) { return view.agrees; }));
}

bool RoomLink::HasScan() const {
  return std::any_of(views.begin(), views.end(), [](const SharedView& view) {
    return view.agrees && view.kind == SharedView::Kind::kScan;
  });
}

bool Misfit::Contradicts() const {
  return !(offset <= std::max(kLeastOffset, kDeviations * offset_sigma)) ||
         !(turn <= std::max(kLeastTurn, kDeviations * turn_sigma));
}

Misfit MisfitOf(const SharedView& view, const Rigid& first_from_second) {
  return {(first_from_second * view.x_in_second - view.x_in_first).norm(),
          RotationAngle(first_from_second.rotation, view.first_from_second.rotation),
          view.position_sigma, view.rotation_sigma};
}

Misfit MisfitOf(const RoomLink& link, const Rigid& first_from_second) {
  const Eigen::Vector3d x_in_second = link.first_from_second.Inverse() * link.x_in_first;
  const RelationVariance variance = VarianceAt(link, link.x_in_first);
  return {(first_from_second * x_in_second - link.x_in_first).norm(),
          RotationAngle(first_from_second.rotation, link.first_from_second.rotation),
          std::sqrt(variance.position / 3), std::sqrt(variance.rotation / 3)};
}

RelationVariance VarianceAt(const RoomLink& link, const Eigen::Vector3d& x_in_first) {
  const Eigen::Matrix<double, 3, 6> jacobian = JacobianAt(link.first_from_second, x_in_first);
  return {(jacobian * link.covariance * jacobian.transpose()).trace(),
          link.covariance.topLeftCorner<3, 3>().trace()};
}

void FitRoomLink(RoomLink* link) {
  const SharedView elected = Elected(link->views);
  link->first_from_second = elected.first_from_second;
  for (SharedView& view : link->views) view.agrees = !MisfitBetween(view, elected).Contradicts();
  const Matrix6d normal = Adjust(link);
  const int count = link->NumAgreeing();
  link->covariance = count * normal.inverse();
  link->x_in_first.setZero();
  for (const SharedView& view : link->views) {
    if (view.agrees) link->x_in_first += view.x_in_first / count;
  }
}

std::vector<RoomLink> FindRoomLinks(const std::vector<RoomRecord>& rooms,
                                    std::vector<std::string>* problems) {
  LinkMap links;
  for (const std::vector<PhotoOfRoom>& same : FindSharedPhotos(rooms)) {
    for (size_t i = 0; i < same.size(); ++i) {
      for (size_t j = i + 1; j < same.size(); ++j) {
        const PhotoOfRoom &a = same[i], &b = same[j];
        links[{a.room, b.room}].views.push_back(
            ViewOf(rooms[a.room].photos[a.photo], rooms[b.room].photos[b.photo]));
      }
    }
  }
  AddScans(rooms, &links, problems);
  std::vector<RoomLink> result;
  for (auto& [pair, link] : links) {
    link.first = pair.first;
    link.second = pair.second;
    std::sort(link.views.begin(), link.views.end(), [](const SharedView& a, const SharedView& b) {
      return std::pair(a.kind, a.name) < std::pair(b.kind, b.name);
    });
    FitRoomLink(&link);
    result.push_back(link);
  }
  return result;
}

}  // namespace roomtex
