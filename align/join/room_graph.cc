#include "align/join/room_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <Eigen/Cholesky>
#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>

#include "colmap_ext/solver_log.h"
#include "core/frames.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Scanners stand upright to less than this.
const double kMostTilt = RadFromDeg(5);
// A link whose residual is beyond some standard deviations of six numbers pulls less.
constexpr double kCauchy = 4;

// Which links may be used.
using Allowed = std::vector<char>;

// A way through the rooms, link by link.
struct Way {
  std::vector<int> rooms, links;  // one room more than links
  Rigid start_from_end;           // frames `room`
};

Rigid FromTo(const RoomLink& link, int to, int from) {
  return link.first == to && link.second == from ? link.first_from_second
                                                 : link.first_from_second.Inverse();
}

double VarianceOf(const RoomLink& link) {
  const RelationVariance variance = VarianceAt(link, link.x_in_first);
  return variance.position;
}

class Ways {
 public:
  Ways(size_t num_rooms, const std::vector<RoomLink>& links) : links_(links), at_(num_rooms) {
    for (int i = 0; i < static_cast<int>(links.size()); ++i) {
      at_[links[i].first].push_back(i);
      at_[links[i].second].push_back(i);
      variance_.push_back(VarianceOf(links[i]));
    }
  }

  // The link over which each room is reached by the way with the least variance (Dijkstra 1959);
  // -1 = the start, or not at all. Ends at `end` if it is there.
  std::vector<int> From(int start, const Allowed& allowed, int end,
                        std::vector<double>* cost) const {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    std::vector<int> over(at_.size(), -1);
    cost->assign(at_.size(), kFar);
    (*cost)[start] = 0;
    std::set<std::pair<double, int>> open = {{0.0, start}};
    while (!open.empty()) {
      const auto [so_far, room] = *open.begin();
      open.erase(open.begin());
      if (room == end) break;
      for (const int link : at_[room]) {
        if (!allowed[link]) continue;
        const int next = links_[link].first == room ? links_[link].second : links_[link].first;
        const double length = so_far + variance_[link];
        if (length >= (*cost)[next]) continue;
        open.erase({(*cost)[next], next});
        (*cost)[next] = length;
        over[next] = link;
        open.insert({length, next});
      }
    }
    return over;
  }

  std::optional<Way> Between(int start, int end, const Allowed& allowed) const {
    std::vector<double> cost;
    const std::vector<int> over = From(start, allowed, end, &cost);
    if (!std::isfinite(cost[end])) return std::nullopt;
    return Back(start, end, over);
  }

  Way Back(int start, int end, const std::vector<int>& over) const {
    Way way;
    way.rooms = {end};
    for (int room = end; room != start;) {
      const RoomLink& link = links_[over[room]];
      const int before = link.first == room ? link.second : link.first;
      way.start_from_end = FromTo(link, before, room) * way.start_from_end;
      way.links.push_back(over[room]);
      way.rooms.push_back(before);
      room = before;
    }
    std::reverse(way.rooms.begin(), way.rooms.end());
    std::reverse(way.links.begin(), way.links.end());
    return way;
  }

  // Of the place x of the last room, seen from the first.
  RelationVariance VarianceOver(const Way& way, Eigen::Vector3d x_in_end) const {
    RelationVariance sum;
    for (size_t i = way.links.size(); i-- > 0;) {
      const RoomLink& link = links_[way.links[i]];
      const Eigen::Vector3d before = FromTo(link, way.rooms[i], way.rooms[i + 1]) * x_in_end;
      const RelationVariance one = VarianceAt(link, link.first == way.rooms[i] ? before : x_in_end);
      sum.position += one.position;
      sum.rotation += one.rotation;
      x_in_end = before;
    }
    return sum;
  }

 private:
  const std::vector<RoomLink>& links_;
  std::vector<std::vector<int>> at_;  // links of each room
  std::vector<double> variance_;
};

std::string PairName(const std::vector<RoomRecord>& rooms, const RoomLink& link) {
  return rooms[link.first].name + " and " + rooms[link.second].name;
}

std::string MisfitText(const Misfit& misfit) {
  return Number(1000 * misfit.offset, misfit.offset < 0.1 ? 1 : 0) + " mm and " +
         Number(DegFromRad(misfit.turn), 2) + " degrees";
}

std::string ExpectedText(const Misfit& misfit) {
  return Number(1000 * misfit.offset_sigma, 1) + " mm and " +
         Number(DegFromRad(misfit.turn_sigma), 2) + " degrees expected";
}

class Joiner {
 public:
  Joiner(const std::vector<RoomRecord>& rooms, const std::vector<RoomLink>& links)
      : rooms_(rooms), links_(links), ways_(rooms.size(), links) {
    graph_.places.resize(rooms.size());
    graph_.verdicts.resize(links.size());
  }

  RoomGraph Join(bool registered) {
    for (size_t i = 0; i < links_.size(); ++i) LookAtViews(i);
    if (registered) {
      TakeAsTheyAre();
    } else {
      FindLoops();
      JudgeLoops();
      RequireSecondView();
      Place();
    }
    return graph_;
  }

 private:
  void Doubt(size_t link, const std::string& reason) {
    LinkVerdict& verdict = graph_.verdicts[link];
    verdict.trusted = false;
    verdict.reason += (verdict.reason.empty() ? "" : " ") + reason;
  }

  Allowed Trusted() const {
    Allowed allowed;
    for (const LinkVerdict& verdict : graph_.verdicts) allowed.push_back(verdict.trusted);
    return allowed;
  }

  // What a link's own views say against it.
  void LookAtViews(size_t i) {
    const RoomLink& link = links_[i];
    const int count = static_cast<int>(link.views.size()), agreeing = link.NumAgreeing();
    const SharedView* worst = nullptr;
    bool other_kind = false;
    for (const SharedView& view : link.views) {
      if (view.agrees) continue;
      const Misfit misfit = MisfitOf(view, link.first_from_second);
      const bool is_worse =
          worst == nullptr || misfit.offset > MisfitOf(*worst, link.first_from_second).offset;
      if (is_worse) worst = &view;
      other_kind |= view.kind == SharedView::Kind::kScan || link.HasScan();
      graph_.verdicts[i].notes.push_back(
          view.name + " puts " + PairName(rooms_, link) + " " + MisfitText(misfit) +
          " elsewhere than what else they share: it is wrong in one of them");
    }
    if (worst != nullptr && (other_kind || 2 * agreeing <= count)) {
      Doubt(i, PairName(rooms_, link) + " share " + std::to_string(count) + " views, and only " +
                   std::to_string(agreeing) + " of them agree: " + worst->name + " is " +
                   MisfitText(MisfitOf(*worst, link.first_from_second)) + " off.");
    }
    const auto &up = rooms_[link.first].up, &other_up = rooms_[link.second].up;
    if (up && other_up) {
      const double tilt = AngleBetween(*up, link.first_from_second.rotation * *other_up);
      graph_.verdicts[i].tilt = tilt;
      if (tilt > kMostTilt) {
        Doubt(i, "Between " + PairName(rooms_, link) + " the vertical leans by " +
                     Number(DegFromRad(tilt), 1) + " degrees.");
      }
    }
    for (const int room : {link.first, link.second}) {
      if (rooms_[room].alignment.trusted) continue;
      Doubt(i, "The alignment of " + rooms_[room].name + " is not to be trusted.");
    }
  }

  // Around each link, the way back with the least variance. Where that does not close, a way that
  // passes by one of its links may: then that one is wrong.
  void FindLoops() {
    Allowed allowed(links_.size(), 1);
    for (size_t i = 0; i < links_.size(); ++i) {
      allowed[i] = 0;
      const std::optional<Way> way = ways_.Between(links_[i].first, links_[i].second, allowed);
      if (way && AddLoop(i, *way).Contradicts()) {
        for (const int other : way->links) {
          allowed[other] = 0;
          const auto around = ways_.Between(links_[i].first, links_[i].second, allowed);
          allowed[other] = 1;
          if (around && !MisfitAround(i, *around).Contradicts()) {
            AddLoop(i, *around);
            break;
          }
        }
      }
      allowed[i] = 1;
    }
  }

  // Of the way back over one link.
  Misfit MisfitAround(size_t i, const Way& way) const {
    Misfit misfit = MisfitOf(links_[i], way.start_from_end);
    const RelationVariance more =
        ways_.VarianceOver(way, way.start_from_end.Inverse() * links_[i].x_in_first);
    misfit.offset_sigma = std::hypot(misfit.offset_sigma, std::sqrt(more.position / 3));
    misfit.turn_sigma = std::hypot(misfit.turn_sigma, std::sqrt(more.rotation / 3));
    return misfit;
  }

  Misfit AddLoop(size_t i, const Way& way) {
    RoomLoop loop{way.rooms, way.links, MisfitAround(i, way)};
    loop.links.push_back(static_cast<int>(i));
    std::vector<int> sorted = loop.links;
    std::sort(sorted.begin(), sorted.end());
    if (known_loops_.insert(sorted).second) graph_.loops.push_back(loop);
    return loop.misfit;
  }

  // Of a loop that does not close, those links are in doubt that no closing loop confirms, and all
  // if every one is.
  void JudgeLoops() {
    confirmed_.assign(links_.size(), 0);
    for (const RoomLoop& loop : graph_.loops) {
      if (loop.misfit.Contradicts()) continue;
      for (const int link : loop.links) confirmed_[link] = 1;
    }
    for (const RoomLoop& loop : graph_.loops) {
      if (!loop.misfit.Contradicts()) continue;
      const bool all = std::all_of(loop.links.begin(), loop.links.end(),
                                   [&](int link) { return confirmed_[link] != 0; });
      std::string names;
      for (const int room : loop.rooms) names += rooms_[room].name + ", ";
      for (const int link : loop.links) {
        if (!all && confirmed_[link]) continue;
        Doubt(static_cast<size_t>(link), "The way around " + names + rooms_[loop.rooms[0]].name +
                                             " misses its start by " + MisfitText(loop.misfit) +
                                             " (" + ExpectedText(loop.misfit) +
                                             "): one of its links is wrong, perhaps that between " +
                                             PairName(rooms_, links_[link]) + ".");
      }
    }
  }

  void RequireSecondView() {
    for (size_t i = 0; i < links_.size(); ++i) {
      const RoomLink& link = links_[i];
      if (link.HasScan() || link.views.size() > 1 || confirmed_[i]) continue;
      Doubt(i, PairName(rooms_, link) + " share one photo alone, " + link.views[0].name +
                   ", and nothing else says whether it is right: let two or three photos of the "
                   "doorway be in both.");
    }
  }

  // The rooms that any link leads to, from the first on; over links that are not trusted only where
  // no others lead.
  void Place() {
    std::vector<char> done(rooms_.size(), 0);
    const Allowed trusted = Trusted();
    const Allowed all(links_.size(), 1);
    Allowed used = trusted;
    for (int frame = 0; frame < static_cast<int>(rooms_.size()); ++frame) {
      if (done[frame]) continue;
      std::vector<int> members = {frame};
      done[frame] = 1;
      graph_.places[frame].frame = frame;
      for (bool grown = true; grown;) {
        grown = Grow(frame, used, &done, &members);
        if (grown) continue;
        const int link = BestBridge(done, members);
        if (link < 0) break;
        used[link] = 1;
        grown = true;
      }
      Solve(frame, members, used);
      MarkTrusted(frame, members, trusted);
    }
    for (size_t i = 0; i < links_.size(); ++i) MeasureMisfit(i, used);
  }

  // All that `used` links reach and is not there yet.
  bool Grow(int frame, const Allowed& used, std::vector<char>* done, std::vector<int>* members) {
    std::vector<double> cost;
    const std::vector<int> over = ways_.From(frame, used, -1, &cost);
    bool grown = false;
    for (int room = 0; room < static_cast<int>(rooms_.size()); ++room) {
      if ((*done)[room] || !std::isfinite(cost[room])) continue;
      const Way way = ways_.Back(frame, room, over);
      RoomPlace& place = graph_.places[room];
      place.frame = frame;
      place.frame_from_room = way.start_from_end;
      const RelationVariance variance = ways_.VarianceOver(way, Eigen::Vector3d::Zero());
      place.position_sigma = std::sqrt(variance.position / 3);
      place.rotation_sigma = std::sqrt(variance.rotation / 3);
      (*done)[room] = 1;
      members->push_back(room);
      grown = true;
    }
    return grown;
  }

  // Of the links out of the group, none of which is trusted, the one with most that agrees.
  int BestBridge(const std::vector<char>& done, const std::vector<int>& members) const {
    const std::set<int> inside(members.begin(), members.end());
    int best = -1;
    for (int i = 0; i < static_cast<int>(links_.size()); ++i) {
      const bool first = inside.count(links_[i].first) > 0;
      const bool second = inside.count(links_[i].second) > 0;
      if (first == second || done[first ? links_[i].second : links_[i].first]) continue;
      if (best < 0 || links_[i].NumAgreeing() > links_[best].NumAgreeing()) best = i;
    }
    return best;
  }

  void Solve(int frame, const std::vector<int>& members, const Allowed& used);

  void MarkTrusted(int frame, const std::vector<int>& members, const Allowed& trusted) {
    std::vector<double> cost;
    ways_.From(frame, trusted, -1, &cost);
    for (const int room : members) graph_.places[room].trusted = std::isfinite(cost[room]);
  }

  // From the places as they are; null where only this link holds them together.
  void MeasureMisfit(size_t i, const Allowed& used) {
    const RoomLink& link = links_[i];
    Allowed others = used;
    others[i] = 0;
    const bool is_held = ways_.Between(link.first, link.second, others).has_value();
    if (is_held) graph_.verdicts[i].misfit = MisfitOf(link, Relation(link));
  }

  Rigid Relation(const RoomLink& link) const {
    return graph_.places[link.first].frame_from_room.Inverse() *
           graph_.places[link.second].frame_from_room;
  }

  void TakeAsTheyAre() {
    for (size_t room = 0; room < rooms_.size(); ++room) {
      graph_.places[room].frame_from_room =
          rooms_[0].RoomFromScan() * rooms_[room].RoomFromScan().Inverse();
    }
    for (size_t i = 0; i < links_.size(); ++i) {
      const Misfit misfit = MisfitOf(links_[i], Relation(links_[i]));
      graph_.verdicts[i].misfit = misfit;
      if (!misfit.Contradicts()) continue;
      Doubt(i, "What " + PairName(rooms_, links_[i]) + " share contradicts the frame of their " +
                   "scans by " + MisfitText(misfit) + " (" + ExpectedText(misfit) + ").");
    }
    MarkDoubted();
  }

  // One of the two rooms of such a link is wrong.
  void MarkDoubted() {
    for (size_t i = 0; i < links_.size(); ++i) {
      if (graph_.verdicts[i].trusted) continue;
      for (const int room : {links_[i].first, links_[i].second})
        graph_.places[room].trusted = false;
    }
  }

  const std::vector<RoomRecord>& rooms_;
  const std::vector<RoomLink>& links_;
  const Ways ways_;
  std::set<std::vector<int>> known_loops_;  // by their links
  std::vector<char> confirmed_;             // by a loop that closes
  RoomGraph graph_;
};

// The residual of a link: (turn, shift) from its own relation to that of its rooms' places, over
// its standard deviations.
struct LinkCost {
  Rigid first_from_second;
  Matrix6d whitening;

  template <typename T>
  bool operator()(const T* first_q, const T* first_t, const T* second_q, const T* second_t,
                  T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> q1(first_q), q2(second_q);
    const Eigen::Map<const Vector> t1(first_t), t2(second_t);
    const Eigen::Quaternion<T> q = q1.conjugate() * q2;
    const Eigen::Quaternion<T> off = q * first_from_second.rotation.conjugate().cast<T>();
    const T wxyz[4] = {off.w(), off.x(), off.y(), off.z()};
    Eigen::Matrix<T, 6, 1> difference;
    ceres::QuaternionToAngleAxis(wxyz, difference.data());
    difference.template tail<3>() =
        q1.conjugate() * (t2 - t1) - first_from_second.translation.cast<T>();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> result(residual);
    result = whitening.cast<T>() * difference;
    return true;
  }
};

void Joiner::Solve(int frame, const std::vector<int>& members, const Allowed& used) {
  if (members.size() < 2) return;
  const std::set<int> inside(members.begin(), members.end());
  ceres::Problem::Options owning;
  owning.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  owning.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::CauchyLoss loss(kCauchy);
  ceres::EigenQuaternionManifold manifold;
  ceres::Problem problem(owning);
  const auto rotation = [&](int room) {
    return graph_.places[room].frame_from_room.rotation.coeffs().data();
  };
  const auto shift = [&](int room) {
    return graph_.places[room].frame_from_room.translation.data();
  };
  for (size_t i = 0; i < links_.size(); ++i) {
    const RoomLink& link = links_[i];
    if (!used[i] || inside.count(link.first) == 0) continue;
    const Matrix6d lower = link.covariance.llt().matrixL();
    const Matrix6d whitening = lower.triangularView<Eigen::Lower>().solve(Matrix6d::Identity());
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LinkCost, 6, 4, 3, 4, 3>(
                                 new LinkCost{link.first_from_second, whitening}),
                             &loss, rotation(link.first), shift(link.first), rotation(link.second),
                             shift(link.second));
  }
  for (const int room : members) problem.SetManifold(rotation(room), &manifold);
  problem.SetParameterBlockConstant(rotation(frame));
  problem.SetParameterBlockConstant(shift(frame));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 100;
  options.num_threads = 1;
  options.function_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  SilenceCeres();
  ceres::Solve(options, &problem, &summary);
  for (const int room : members) graph_.places[room].frame_from_room.rotation.normalize();
}

}  // namespace

RoomGraph PlaceRooms(const std::vector<RoomRecord>& rooms, const std::vector<RoomLink>& links,
                     bool registered) {
  return Joiner(rooms, links).Join(registered);
}

}  // namespace roomtex
