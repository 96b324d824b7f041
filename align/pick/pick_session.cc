#include "align/pick/pick_session.h"

#include <chrono>
#include <filesystem>
#include <set>
#include <tuple>

#include "core/error.h"

namespace roomtex {
namespace {

// The place of a point in the scan whose surface is nearest to it there.
std::optional<ScanSpot> SpotOf(const PickScene& scene, const Eigen::Vector3d& x_in_scan) {
  std::optional<ScanSpot> spot;
  double nearest = std::numeric_limits<double>::infinity();
  for (int scan = 0; scan < scene.num_scans(); ++scan) {
    const ScanPlaces& places = scene.places(scan);
    const auto place = places.PlaceOf(x_in_scan);
    if (!place) continue;
    const ScanPlaces::Found found = places.PointAt(*place);
    // Where nothing can be picked the place is better than none.
    const double distance = found.reason == ScanPlaces::Reason::kNone
                                ? (found.x_in_scan - x_in_scan).norm()
                                : 1e6 + scan;
    if (distance >= nearest) continue;
    nearest = distance;
    spot = ScanSpot{scan, *place};
  }
  return spot;
}

// What a picks file refuses (picks.h) must not be written into one.
void RefuseDuplicates(const std::vector<SessionPick>& picks) {
  std::set<std::tuple<std::string, double, double>> pixels;
  std::set<std::tuple<std::string, double, double, double>> points;
  for (const SessionPick& pick : picks) {
    if (!pick.complete()) continue;
    const Eigen::Vector2d& x = *pick.x_in_img;
    const Eigen::Vector3d& p = *pick.x_in_scan;
    if (!pixels.emplace(pick.image_name, x.x(), x.y()).second) {
      throw UsageError("This pixel of " + pick.image_name + " is picked already.");
    }
    if (!points.emplace(pick.image_name, p.x(), p.y(), p.z()).second) {
      throw UsageError("This point of the scan is picked already for " + pick.image_name + ".");
    }
  }
}

}  // namespace

PickSession::PickSession(const PickScene& scene, const std::string& picks_path)
    : scene_(scene), file_(picks_path), solver_(scene) {
  Read();
}

void PickSession::Read() {
  Snapshot snapshot;
  if (std::filesystem::exists(picks_path())) {
    std::vector<Pick> picks = ReadPicks(picks_path());
    std::vector<const SparseModel*> models;
    for (const SparseModel& model : scene_.models()) models.push_back(&model);
    NamePicksAsInModels(models, &picks);
    CheckPickNames(picks_path(), picks, models,
                   !scene_.has_model()  ? "among those of --image_path"
                   : models.size() == 1 ? "in the sparse model"
                                        : "in any of the sparse models");
    for (const Pick& pick : picks) {
      SessionPick one{pick.image_name, pick.x_in_img, pick.x_in_scan, {}, pick.weight, pick.label};
      one.spot = SpotOf(scene_, pick.x_in_scan);
      snapshot.picks.push_back(one);
    }
  }
  SolveInto(&snapshot);
  Publish(std::move(snapshot));
}

std::shared_ptr<const PickSession::Snapshot> PickSession::Now() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return now_;
}

std::shared_ptr<const PickSession::Snapshot> PickSession::Publish(Snapshot snapshot) {
  auto published = std::make_shared<const Snapshot>(std::move(snapshot));
  const std::lock_guard<std::mutex> lock(mutex_);
  now_ = published;
  return published;
}

void PickSession::SolveInto(Snapshot* snapshot) {
  const auto start = std::chrono::steady_clock::now();
  snapshot->solution = solver_.Solve(snapshot->picks);
  const std::chrono::duration<double, std::milli> passed = std::chrono::steady_clock::now() - start;
  snapshot->milliseconds = passed.count();
}

std::shared_ptr<const PickSession::Snapshot> PickSession::Refresh() {
  const auto is_current = [this](const Snapshot& snapshot) {
    return snapshot.solution.with_rays || scene_.rays() == nullptr;
  };
  if (const auto now = Now(); is_current(*now)) return now;
  const std::lock_guard<std::mutex> lock(changing_);
  const auto now = Now();
  if (is_current(*now)) return now;
  Snapshot next = *now;
  SolveInto(&next);
  return Publish(std::move(next));
}

std::shared_ptr<const PickSession::Snapshot> PickSession::Put(int revision,
                                                              std::vector<SessionPick> picks) {
  const std::lock_guard<std::mutex> lock(changing_);
  const auto now = Now();
  if (revision != now->revision) {
    throw UsageError(
        "The picks were changed elsewhere, perhaps in another tab: load the page again.");
  }
  RefuseDuplicates(picks);
  for (SessionPick& pick : picks) {
    if (pick.x_in_scan && !pick.spot) pick.spot = SpotOf(scene_, *pick.x_in_scan);
  }
  Snapshot next;
  next.revision = revision + 1;
  next.solution_number = now->solution_number + 1;
  next.picks = std::move(picks);
  next.save_error = Save(next.picks);
  next.saved = next.save_error.empty();
  SolveInto(&next);
  return Publish(std::move(next));
}

void PickSession::TakeFound(std::shared_ptr<const FoundPlaces> found) {
  const std::lock_guard<std::mutex> lock(changing_);
  Snapshot next = *Now();
  solver_.TakeFound(std::move(found));
  ++next.solution_number;
  SolveInto(&next);
  Publish(std::move(next));
}

bool PickSession::SaveAgain(bool over_others) {
  const std::lock_guard<std::mutex> lock(changing_);
  const auto now = Now();
  if (now->saved) return true;
  if (changed_elsewhere_ && !over_others) return false;
  Snapshot next = *now;
  next.save_error = Save(next.picks);
  next.saved = next.save_error.empty();
  return Publish(std::move(next))->saved;
}

// "" or why the picks could not be saved.
std::string PickSession::Save(const std::vector<SessionPick>& picks) {
  std::vector<Pick> complete;
  for (const SessionPick& pick : picks) {
    if (!pick.complete()) continue;
    complete.push_back(
        {pick.image_name, *pick.x_in_img, *pick.x_in_scan, 0, pick.weight, pick.label});
  }
  changed_elsewhere_ = false;
  try {
    file_.Save([&] { WritePicks(picks_path(), complete); });
  } catch (const ChangedElsewhere& error) {
    changed_elsewhere_ = true;
    return std::string("The picks could not be saved: ") + error.what();
  } catch (const std::exception& error) {
    return std::string("The picks could not be saved: ") + error.what();
  }
  return "";
}

}  // namespace roomtex
