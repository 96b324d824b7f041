#include "texture/registration/register_photos.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/statistics.h"
#include "core/twist.h"
#include "texture/registration/shared_samples.h"
#include "texture/registration/shift_patch.h"
#include "texture/registration/shift_solver.h"

namespace roomtex {
namespace {

constexpr int kNumLevels = 3;
constexpr double kLargestSide = 1280;    // pixels of a picture
constexpr double kPictureBytes = 256e6;  // of all pictures
constexpr double kNodesAcross = 28;      // of the longer side
constexpr double kFewestNodePx = 20;
constexpr double kMostNodes = 150000;  // of all photos
constexpr int kMostPixels = 120;       // of a patch
constexpr size_t kFewestPatches = 6;
constexpr size_t kFewestOfPatch = 40;  // sightings
constexpr double kNoShift = std::numeric_limits<double>::quiet_NaN();

// A photo in grey, and how it has been moved.
struct RegisteredPhoto {
  std::vector<cv::Mat1b> levels;  // the next one has half the size
  double scale = 1;               // pixels of the first level per pixel of the photo
  float gain = 1;
  std::optional<CameraProjection> camera;
  Rigid first_pose;
  Eigen::Vector3d row_turn = Eigen::Vector3d::Zero();  // from the first row to the last one
  PhotoWarp warp{1, 1, 1};                             // what else is left
  PhotoWarp shown{1, 1, 1};                            // both together
};

// When a place of a photo is read: -1/2 at the first row, 1/2 at the last one. Rows lie along the
// longer side, also of photos that were turned.
double RowShare(const Camera& camera, const Eigen::Vector2f& place) {
  return camera.height > camera.width ? place.x() / camera.width - 0.5
                                      : place.y() / camera.height - 0.5;
}

// A place at which a photo was compared with the others.
struct Patch {
  int middle = 0;  // sighting
  PatchShift shift;
};

class Registrar {
 public:
  Registrar(SharedSamples* samples, const std::vector<Eigen::Vector3f>& gains,
            const RegistrationOptions& options, int num_threads, std::vector<PhotoView>* photos)
      : samples_(*samples),
        options_(options),
        num_threads_(num_threads),
        photos_(*photos),
        registered_(photos->size()),
        found_(photos->size()) {
    ParallelFor(num_threads, 0, num_photos(), [&](int i) { Load(i, gains[i]); });
  }

  // Mean difference between what a photo shows and what the others say, in the finest pictures: per
  // photo, and last of all of them.
  std::vector<double> Disagreement() {
    Look(0);
    std::vector<double> result;
    double all = 0, all_count = 0;
    for (int i = 0; i < num_photos(); ++i) {
      double sum = 0, count = 0;
      for (const Sighting& s : samples_.Of(i)) {
        if (!IsCompared(s)) continue;
        sum += std::abs(s.grey - samples_.OthersGrey(s));
        ++count;
      }
      result.push_back(count > 0 ? sum / count : 0);
      all += sum;
      all_count += count;
    }
    result.push_back(all_count > 0 ? all / all_count : 0);
    return result;
  }

  // Compares at one level; the shift is searched for within +- radius pixels of it. Sets the median
  // shifts.
  void Measure(int level, int radius) {
    Look(level);
    radius_ = radius;
    patches_.assign(photos_.size(), {});
    median_px_.assign(photos_.size(), 0);
    ParallelFor(num_threads_, 0, num_photos(), [&](int i) { MeasurePhoto(i, radius); });
  }

  bool is_free() const { return is_free_; }
  int num_photos() const { return static_cast<int>(photos_.size()); }

  // Whether the photos are off by more than noise, on the whole or one of them by much.
  bool AreOff() const {
    double sum = 0, most = 0;
    for (const double median : median_px_) {
      sum += median;
      most = std::max(most, median);
    }
    constexpr double kMuch = 3;
    return sum > options_.least_px * num_photos() || most > kMuch * options_.least_px;
  }
  // If so, from then on all of them may move: what holds still is a measure of the others, and
  // would bend them.
  bool FreeIfOff() {
    is_free_ = is_free_ || AreOff();
    return is_free_;
  }

  // Moves all photos that may at once, by what was measured last and, if asked for, by the scan,
  // which is searched within as many pixels.
  void Correct(bool by_scan, bool with_warps) {
    std::vector<std::vector<MeasuredShift>> of_photo(photos_.size());
    ParallelFor(num_threads_, 0, num_photos(), [&](int i) {
      for (const Patch& patch : patches_[i]) {
        std::optional<MeasuredShift> shift = ShiftAt(i, patch);
        if (shift) of_photo[i].push_back(std::move(*shift));
      }
      if (by_scan) AddShiftsAgainstScan(i, &of_photo[i]);
    });
    std::vector<MeasuredShift> shifts;
    for (std::vector<MeasuredShift>& some : of_photo) {
      std::move(some.begin(), some.end(), std::back_inserter(shifts));
    }
    std::vector<PhotoPrior> priors;
    for (int i = 0; i < num_photos(); ++i) priors.push_back(PriorOf(i, with_warps));
    constexpr double kOutlierPx = 2;  // of the level
    const std::vector<PhotoStep> steps =
        SolveShifts(shifts, priors, kOutlierPx * (1 << level_) / MeanScale());
    for (int i = 0; i < num_photos(); ++i) Move(i, steps[i]);
  }

  // Where all photos stand.
  struct Stand {
    std::vector<Rigid> poses;
    std::vector<std::shared_ptr<const PhotoWarp>> shown;
    std::vector<Eigen::Vector3d> row_turns;
    std::vector<PhotoWarp> warps;
  };
  Stand Here() const {
    Stand stand;
    for (int i = 0; i < num_photos(); ++i) {
      stand.poses.push_back(photos_[i].cam_from_scan);
      stand.shown.push_back(photos_[i].warp);
      stand.row_turns.push_back(registered_[i].row_turn);
      stand.warps.push_back(registered_[i].warp);
    }
    return stand;
  }
  void Return(const Stand& stand) {
    for (int i = 0; i < num_photos(); ++i) {
      RegisteredPhoto& photo = registered_[i];
      photos_[i].cam_from_scan = stand.poses[i];
      photos_[i].warp = stand.shown[i];
      photo.row_turn = stand.row_turns[i];
      photo.warp = stand.warps[i];
      photo.shown = stand.shown[i] ? *stand.shown[i] : photo.warp;
    }
  }

  // How far the pixels of the photos have moved from there, median, pixels of the pictures.
  double MotionFrom(const Stand& stand) const {
    std::vector<double> lengths;
    for (int i = 0; i < num_photos(); ++i) {
      const RegisteredPhoto& photo = registered_[i];
      for (const Patch& patch : patches_[i]) {
        const Sighting& s = samples_.Of(i)[patch.middle];
        const Eigen::Vector3d x_in_scan = samples_.Point(s.sample);
        const auto show = [&](const Rigid& pose,
                              const PhotoWarp* warp) -> std::optional<Eigen::Vector2d> {
          const auto place = photo.camera->ImgFromCam(pose * x_in_scan);
          if (!place || warp == nullptr) return place;
          const Eigen::Vector2f at = place->cast<float>();
          return *place + warp->At(at.x(), at.y()).cast<double>();
        };
        const auto here = show(photos_[i].cam_from_scan, photos_[i].warp.get());
        const auto there = show(stand.poses[i], stand.shown[i].get());
        if (here && there) lengths.push_back((*here - *there).norm() * photo.scale);
      }
    }
    return Median(&lengths);
  }

  // A part of the surface is kept aside from Measure() and Correct().
  void KeepAside() {
    std::vector<double> widths;  // of a patch
    for (int i = 0; i < num_photos(); ++i) {
      constexpr size_t kStride = 1000;
      const double angle = 2 * registered_[i].warp.spacing() / photos_[i].camera.MeanFocalLength();
      for (size_t k = 0; k < samples_.Of(i).size(); k += kStride) {
        const Eigen::Vector3d x_in_scan = samples_.Point(samples_.Of(i)[k].sample);
        widths.push_back(angle * (photos_[i].cam_from_scan * x_in_scan).norm());
      }
    }
    samples_.KeepAside(Median(&widths));
  }
  void KeepNothingAside() { samples_.KeepAside(0); }

  // How alike photos are there, in the finest pictures.
  KeptAsideLikeness Judge() {
    Look(0);
    std::vector<KeptAsideLikeness> of_photo(photos_.size());
    ParallelFor(num_threads_, 0, num_photos(), [&](int i) { JudgePhoto(i, &of_photo[i]); });
    KeptAsideLikeness all;
    for (const KeptAsideLikeness& some : of_photo) {
      std::copy(some.among_photos.begin(), some.among_photos.end(),
                std::back_inserter(all.among_photos));
      std::copy(some.with_scan.begin(), some.with_scan.end(), std::back_inserter(all.with_scan));
    }
    return all;
  }

  std::vector<PhotoRegistration> Report() {
    for (int i = 0; i < num_photos(); ++i) {
      PhotoRegistration& found = found_[i];
      const RegisteredPhoto& photo = registered_[i];
      found.shift_after_px = median_px_[i] * (1 << level_) / photo.scale;
      found.moved = (photos_[i].Centre() - photo.first_pose.TargetOriginInSource()).norm();
      found.turned_deg =
          DegFromRad(RotationAngle(photos_[i].cam_from_scan.rotation, photo.first_pose.rotation));
      for (int n = 0; n < photo.warp.num_nodes(); ++n) {
        found.warp_px = std::max(found.warp_px, static_cast<double>(photo.warp.Shift(n).norm()));
      }
      found.row_turned_deg = DegFromRad(photo.row_turn.norm());
      found.corrected =
          found.moved > 0 || found.turned_deg > 0 || found.row_turned_deg > 0 || found.warp_px > 0;
      FindShiftBefore(i);
    }
    return found_;
  }

 private:
  double MeanScale() const {
    double sum = 0;
    for (const RegisteredPhoto& photo : registered_) sum += photo.scale;
    return sum / num_photos();
  }

  void Look(int level) {
    level_ = level;
    std::vector<cv::Mat1b> pictures;
    std::vector<double> scales;
    std::vector<float> gains;
    for (const RegisteredPhoto& photo : registered_) {
      pictures.push_back(photo.levels[level]);
      scales.push_back(photo.scale / (1 << level));
      gains.push_back(photo.gain);
    }
    samples_.Look(photos_, pictures, scales, gains, num_threads_);
  }

  // The others say something about it, and not next to nothing.
  bool IsCompared(const Sighting& s) const {
    constexpr float kLeastOthers = 0.02f;
    return !std::isnan(s.grey) && samples_.OthersWeight(s) > kLeastOthers * s.weight;
  }

  bool IsFree(int i) const {
    return is_free_ && !photos_[i].camera.IsPanorama() && patches_[i].size() >= kFewestPatches;
  }

  void Load(int i, const Eigen::Vector3f& gain) {
    RegisteredPhoto& photo = registered_[i];
    const PhotoView& view = photos_[i];
    cv::Mat picture = ReadPhoto(view.path, view.pixels);
    if (view.tone) view.tone->response.ToSrgb(&picture);
    cv::Mat1b grey;
    cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
    const double most_pixels = 0.75 * kPictureBytes / num_photos();
    photo.scale = std::min({1.0, kLargestSide / std::max(grey.cols, grey.rows),
                            std::sqrt(most_pixels / static_cast<double>(grey.total()))});
    if (photo.scale < 1) {
      cv::resize(grey, grey, {}, photo.scale, photo.scale, cv::INTER_AREA);
    }
    photo.levels.push_back(grey);
    for (int level = 1; level < kNumLevels; ++level) {
      cv::Mat1b next;
      cv::pyrDown(photo.levels.back(), next);
      photo.levels.push_back(next);
    }
    // sRGB is about a power of 2.2.
    photo.gain = static_cast<float>(std::pow(std::cbrt(gain.prod()), 1 / 2.2));
    photo.camera.emplace(view.camera);
    photo.first_pose = view.cam_from_scan;
    const double side = std::max(grey.cols, grey.rows);
    const double across = std::min(kNodesAcross, std::sqrt(kMostNodes / num_photos()));
    photo.warp = PhotoWarp(view.camera.width, view.camera.height,
                           std::max(kFewestNodePx, side / across) / photo.scale);
    photo.shown = photo.warp;
  }

  // Sightings around every node of the lattice, those within the cells that meet there; at a coarse
  // level of every second or fourth node.
  std::vector<std::vector<int>> GatherPatches(int i, bool kept_aside = false) const {
    const PhotoWarp& warp = registered_[i].warp;
    const int step = 1 << level_;
    const double pitch = warp.spacing() * step;
    std::vector<std::vector<int>> members(warp.num_nodes());
    const std::vector<Sighting>& sightings = samples_.Of(i);
    for (size_t k = 0; k < sightings.size(); ++k) {
      const Sighting& s = sightings[k];
      if (!IsCompared(s) || samples_.IsKeptAside(s.sample) != kept_aside) continue;
      const int column = static_cast<int>(s.place.x() / pitch) * step;
      const int row = static_cast<int>(s.place.y() / pitch) * step;
      for (const int r : {row, row + step}) {
        for (const int c : {column, column + step}) {
          if (c >= warp.columns() || r >= warp.rows()) continue;
          members[static_cast<size_t>(r) * warp.columns() + c].push_back(static_cast<int>(k));
        }
      }
    }
    return members;
  }

  // What `grey` says that the photo shows around a node, and the middle of that.
  template <typename GreyOf>
  std::vector<ExpectedPixel> Expect(int i, const std::vector<int>& members, const GreyOf& grey_of,
                                    Eigen::Vector2f* middle) const {
    const RegisteredPhoto& photo = registered_[i];
    const std::vector<Sighting>& sightings = samples_.Of(i);
    const auto scale = static_cast<float>(photo.scale / (1 << level_));
    const size_t skip = std::max<size_t>(1, members.size() / kMostPixels);
    std::vector<ExpectedPixel> expected;
    middle->setZero();
    for (size_t k = 0; k < members.size(); k += skip) {
      const Sighting& s = sightings[members[k]];
      const Eigen::Vector2f shown = s.place + photo.shown.At(s.place.x(), s.place.y());
      expected.push_back({shown * scale, grey_of(s)});
      *middle += s.place;
    }
    *middle /= static_cast<float>(expected.size());
    return expected;
  }

  template <typename GreyOf>
  std::optional<Patch> Compare(int i, const std::vector<int>& members, int radius,
                               const GreyOf& grey_of) const {
    const RegisteredPhoto& photo = registered_[i];
    const std::vector<Sighting>& sightings = samples_.Of(i);
    Eigen::Vector2f middle;
    const std::vector<ExpectedPixel> expected = Expect(i, members, grey_of, &middle);
    Patch patch;
    patch.shift = FindPatchShift(photo.levels[level_], expected, radius);
    if (!patch.shift.is_found()) return std::nullopt;
    patch.middle = *std::min_element(members.begin(), members.end(), [&](int a, int b) {
      return (sightings[a].place - middle).squaredNorm() <
             (sightings[b].place - middle).squaredNorm();
    });
    return patch;
  }

  // What the scanner measured stays where it is, and so holds what all photos might do together.
  // Counted only where photo and scan show the same: intensity is not brightness.
  void AddShiftsAgainstScan(int i, std::vector<MeasuredShift>* shifts) const {
    constexpr float kAlike = 0.7f;
    for (const std::vector<int>& members : GatherPatches(i)) {
      if (members.size() < kFewestOfPatch) continue;
      const auto patch = Compare(i, members, radius_, [this](const Sighting& s) {
        return static_cast<float>(samples_.Intensity(s.sample));
      });
      if (!patch || patch->shift.likeness < kAlike) continue;
      const auto seen = See(i, samples_.Of(i)[patch->middle]);
      if (!seen) continue;
      MeasuredShift shift;
      shift.terms.push_back({seen->place, Eigen::Matrix2f::Identity()});
      SetShift(i, *patch, &shift);
      shifts->push_back(std::move(shift));
    }
  }

  void SetShift(int i, const Patch& patch, MeasuredShift* shift) const {
    const double scale = registered_[i].scale / (1 << level_);
    shift->shift = patch.shift.shift / static_cast<float>(scale);
    // However much texture it has, a patch knows its place no better than this.
    constexpr double kBestPx = 0.2;
    const double most = 2 / (kBestPx * kBestPx), trace = patch.shift.information.trace();
    const double certain = std::min(1.0, most / trace) * scale * scale;
    shift->information = patch.shift.information * static_cast<float>(certain);
  }

  void JudgePhoto(int i, KeptAsideLikeness* likeness) const {
    const auto look = [&](const std::vector<int>& members, const auto& grey_of) {
      if (members.size() < kFewestOfPatch) return std::numeric_limits<float>::quiet_NaN();
      Eigen::Vector2f middle;
      return PatchLikeness(registered_[i].levels[0], Expect(i, members, grey_of, &middle))
          .value_or(std::numeric_limits<float>::quiet_NaN());
    };
    for (const std::vector<int>& members : GatherPatches(i, true)) {
      likeness->among_photos.push_back(
          look(members, [this](const Sighting& s) { return samples_.OthersGrey(s); }));
      likeness->with_scan.push_back(look(members, [this](const Sighting& s) {
        return static_cast<float>(samples_.Intensity(s.sample));
      }));
    }
  }

  void MeasurePhoto(int i, int radius) {
    std::vector<double> lengths;
    int num_asked = 0;
    for (const std::vector<int>& members : GatherPatches(i)) {
      if (members.size() < kFewestOfPatch) continue;
      ++num_asked;
      const auto patch =
          Compare(i, members, radius, [this](const Sighting& s) { return samples_.OthersGrey(s); });
      if (!patch) continue;
      lengths.push_back(patch->shift.shift.norm());
      patches_[i].push_back(*patch);
    }
    median_px_[i] = Median(&lengths);
    found_[i].share_measured = static_cast<double>(patches_[i].size()) / std::max(1, num_asked);
  }

  // How a photo's pixels move with a point of the surface, and with the photo.
  struct Seen {
    PlaceInPhoto place;
    Eigen::Matrix<double, 2, 3> by_point;  // in `scan`
  };
  std::optional<Seen> See(int i, const Sighting& sighting) const {
    const PhotoView& view = photos_[i];
    const CameraProjection& camera = *registered_[i].camera;
    const Eigen::Vector3d x_in_scan = samples_.Point(sighting.sample);
    const Eigen::Vector3d x_in_cam = view.cam_from_scan * x_in_scan;
    const double h = 1e-4 * x_in_cam.norm();
    Eigen::Matrix<double, 2, 3> by_point;
    for (int k = 0; k < 3; ++k) {
      const auto before = camera.ImgFromCam(x_in_cam - h * Eigen::Vector3d::Unit(k));
      const auto after = camera.ImgFromCam(x_in_cam + h * Eigen::Vector3d::Unit(k));
      if (!before || !after) return std::nullopt;
      by_point.col(k) = (*after - *before) / (2 * h);
    }
    Seen seen;
    seen.by_point = by_point * view.cam_from_scan.rotation.toRotationMatrix();
    seen.place.photo = i;
    Eigen::Matrix<double, 3, 6> by_step;  // of Moved()
    by_step << -CrossMatrix(view.cam_from_scan.rotation * x_in_scan), Eigen::Matrix3d::Identity();
    seen.place.by_pose.leftCols<6>() = (by_point * by_step).cast<float>();
    if (options_.row_turn_deg > 0) {
      seen.place.by_pose.rightCols<3>() =
          (RowShare(view.camera, sighting.place) * by_point * -CrossMatrix(x_in_cam)).cast<float>();
    }
    registered_[i].warp.NodesAt(sighting.place.x(), sighting.place.y(), &seen.place.nodes,
                                &seen.place.node_weights);
    return seen;
  }

  std::optional<MeasuredShift> ShiftAt(int i, const Patch& patch) const {
    const Sighting& middle = samples_.Of(i)[patch.middle];
    const auto own = See(i, middle);
    const Eigen::Vector3d normal = samples_.Normal(middle.sample).cast<double>();
    if (!own || normal.isZero()) return std::nullopt;
    Eigen::Matrix<double, 3, 2> tangent;
    tangent.col(0) = normal.unitOrthogonal();
    tangent.col(1) = normal.cross(tangent.col(0));
    const Eigen::Matrix2d own_by_surface = own->by_point * tangent;
    MeasuredShift shift;
    shift.terms.push_back({own->place, Eigen::Matrix2f::Identity()});
    const float others = samples_.OthersWeight(middle);
    for (auto s = samples_.Begin(middle.sample); s != samples_.End(middle.sample); ++s) {
      const Sighting& other = samples_.Of(s->photo)[s->number];
      if (s->photo == i || std::isnan(other.grey)) continue;
      const auto seen = See(s->photo, other);
      if (!seen) continue;
      const Eigen::Matrix2d by_surface = seen->by_point * tangent;
      // Seen at too steep a slant to say where on the surface.
      constexpr double kSlant = 0.1;
      if (std::abs(by_surface.determinant()) < kSlant * by_surface.squaredNorm() / 2) continue;
      const Eigen::Matrix2d share = -other.weight / others * own_by_surface * by_surface.inverse();
      shift.terms.push_back({seen->place, share.cast<float>()});
    }
    SetShift(i, patch, &shift);
    return shift;
  }

  PhotoPrior PriorOf(int i, bool with_warp) const {
    const RegisteredPhoto& photo = registered_[i];
    PhotoPrior prior;
    prior.is_free = IsFree(i);
    const Rigid& pose = photos_[i].cam_from_scan;
    const Eigen::AngleAxisd turn(pose.rotation * photo.first_pose.rotation.conjugate());
    prior.pose << turn.angle() * turn.axis(), pose.translation - photo.first_pose.translation,
        photo.row_turn;
    // What moves nothing is held at 0 by any sigma.
    const double row_turn_deg = options_.row_turn_deg > 0 ? options_.row_turn_deg : 1;
    prior.pose_sigma << Eigen::Vector3d::Constant(RadFromDeg(options_.turn_deg)),
        Eigen::Vector3d::Constant(options_.move),
        Eigen::Vector3d::Constant(RadFromDeg(row_turn_deg));
    if (with_warp) prior.warp = &photo.warp;
    prior.warp_sigma = options_.warp_px / photo.scale;
    prior.step_sigma = options_.warp_step_px / photo.scale;
    return prior;
  }

  void Move(int i, const PhotoStep& step) {
    if (!IsFree(i)) return;
    RegisteredPhoto& photo = registered_[i];
    photos_[i].cam_from_scan = Moved(photos_[i].cam_from_scan, step.pose.head<6>());
    photo.row_turn += step.pose.tail<3>();
    for (size_t n = 0; n < step.warp.size(); ++n) {
      photo.warp.Shift(static_cast<int>(n)) += step.warp[n];
    }
    photo.shown = photo.warp;
    if (!photo.row_turn.isZero()) AddRowTurn(photos_[i].camera, &photo);
    if (step.warp.empty() && photo.row_turn.isZero()) return;
    photos_[i].warp = std::make_shared<const PhotoWarp>(photo.shown);
  }

  // A camera that turns about itself moves what it shows by as much at any distance.
  static void AddRowTurn(const Camera& camera, RegisteredPhoto* photo) {
    for (int n = 0; n < photo->shown.num_nodes(); ++n) {
      const Eigen::Vector2f place = photo->shown.Place(n).cwiseMin(
          Eigen::Vector2i(camera.width, camera.height).cast<float>());
      const auto ray = photo->camera->RayFromImg(place.cast<double>());
      if (!ray) continue;
      const auto shown = photo->camera->ImgFromCam(
          RotationFromVector(RowShare(camera, place) * photo->row_turn) * *ray);
      if (shown) photo->shown.Shift(n) += shown->cast<float>() - place;
    }
  }

  // From where the photo showed a place when it came to where it shows it now, and what was still
  // measured there, over the places that were compared.
  void FindShiftBefore(int i) {
    const RegisteredPhoto& photo = registered_[i];
    const auto scale = static_cast<float>(photo.scale / (1 << level_));
    std::vector<double> pixels, metres;
    std::array<std::vector<double>, PhotoRegistration::kMapColumns * PhotoRegistration::kMapRows>
        of_cell;
    for (const Patch& patch : patches_[i]) {
      const Sighting& s = samples_.Of(i)[patch.middle];
      const Eigen::Vector3d x_in_cam = photo.first_pose * samples_.Point(s.sample);
      const auto before = photo.camera->ImgFromCam(x_in_cam);
      if (!before) continue;
      const Eigen::Vector2f shown = s.place + photo.shown.At(s.place.x(), s.place.y());
      const Eigen::Vector2d shift = (shown + patch.shift.shift / scale).cast<double>() - *before;
      pixels.push_back(shift.norm());
      metres.push_back(shift.norm() * x_in_cam.norm() / photos_[i].camera.MeanFocalLength());
      of_cell[MapCell(photos_[i].camera, s.place)].push_back(shift.norm());
    }
    PhotoRegistration& found = found_[i];
    found.shift_before_px = Median(&pixels);
    found.shift_before = Median(&metres);
    for (std::vector<double>& cell : of_cell) found.map_px.push_back(Median(&cell, kNoShift));
  }

  static size_t MapCell(const Camera& camera, const Eigen::Vector2f& place) {
    constexpr int kColumns = PhotoRegistration::kMapColumns, kRows = PhotoRegistration::kMapRows;
    const int column = static_cast<int>(place.x() * kColumns / static_cast<float>(camera.width));
    const int row = static_cast<int>(place.y() * kRows / static_cast<float>(camera.height));
    return static_cast<size_t>(std::clamp(row, 0, kRows - 1)) * kColumns +
           std::clamp(column, 0, kColumns - 1);
  }

  SharedSamples& samples_;
  const RegistrationOptions& options_;
  int num_threads_;
  std::vector<PhotoView>& photos_;
  std::vector<RegisteredPhoto> registered_;
  std::vector<PhotoRegistration> found_;
  bool is_free_ = false;
  int level_ = 0, radius_ = 0;               // measured last
  std::vector<std::vector<Patch>> patches_;  // per photo
  std::vector<double> median_px_;
};

// Whether photos agree better than before, by more than those of a bare room or of moved things do
// by chance: all of them, or one by much and the others no worse for it.
bool AgreeBetter(const std::vector<double>& before, const std::vector<double>& after) {
  constexpr double kBetter = 0.95, kMuchBetter = 0.8;
  if (after.back() < kBetter * before.back()) return true;
  if (!(after.back() < before.back())) return false;
  for (size_t i = 0; i + 1 < before.size(); ++i) {
    if (after[i] < kMuchBetter * before[i]) return true;
  }
  return false;
}

// Pixels of the level: the first search finds what is off by much, the others what it left.
constexpr int kCoarseRadius = 3, kFineRadius = 2, kLastRadius = 1;
constexpr int kFineRounds = 3;
int RadiusAt(int level, int round) {
  return level == kNumLevels - 1 ? kCoarseRadius : round == 0 ? kFineRadius : kLastRadius;
}
int RoundsAt(int level) { return level > 0 ? 1 : kFineRounds; }

// Coarse to fine, until the photos agree. False if they agree no better than before.
bool BringTogether(bool with_warps, Registrar* registrar) {
  const std::vector<double> before = registrar->Disagreement();
  for (int level = kNumLevels - 1; level >= 0; --level) {
    for (int i = 0; i < RoundsAt(level); ++i) {
      registrar->Measure(level, RadiusAt(level, i));
      if (!registrar->FreeIfOff()) break;
      registrar->Correct(true, with_warps && level == 0);
    }
  }
  if (!registrar->is_free()) return true;
  registrar->Measure(0, kLastRadius);
  return AgreeBetter(before, registrar->Disagreement());
}

// Tries one correction after the other, and takes back those for which nothing speaks but what they
// were fitted to.
class TrialRun {
 public:
  explicit TrialRun(Registrar* registrar) : registrar_(*registrar) {}

  std::vector<RegistrationTrial> Run() {
    int level = kNumLevels - 1;
    for (; level >= 0; --level) {
      registrar_.Measure(level, RadiusAt(level, 0));
      if (registrar_.FreeIfOff()) break;
    }
    if (!registrar_.is_free()) return {};
    registrar_.KeepAside();
    stand_ = registrar_.Here();
    likeness_ = registrar_.Judge();
    // What photos say of each other first: the scan, which nothing was fitted to then, is a
    // witness. If it says that they slid along it, it has to hold them.
    const Registrar::Stand first = stand_;
    MovePoses(level, false);
    const bool by_photos = Keep("pose");
    bool by_scan = false;
    if (by_photos) {
      // They were off each by itself: what they still have in common is the mean of that.
      const double most_px =
          kCommon * registrar_.MotionFrom(first) / std::sqrt(registrar_.num_photos()) + kCommonPx;
      for (int i = 0; i < kScanRounds; ++i) {
        registrar_.Measure(0, kLastRadius);
        registrar_.Correct(true, false);
      }
      by_scan = registrar_.MotionFrom(stand_) < most_px && Keep("pose_by_scan");
      if (!by_scan) registrar_.Return(stand_);
    } else {
      MovePoses(level, true);
      by_scan = Keep("pose_by_scan");
    }
    // Photos that agree with each other or with the scan, but not with both, see another shape.
    const bool is_bent = by_scan && !by_photos;
    if (by_photos || by_scan) registrar_.Measure(0, kLastRadius);
    if (is_bent || (by_photos && registrar_.AreOff())) {
      for (int i = 0; i < kWarpRounds; ++i) {
        if (i > 0) registrar_.Measure(0, kLastRadius);
        registrar_.Correct(by_scan, true);
      }
      Keep("warp");
    }
    registrar_.KeepNothingAside();
    registrar_.Measure(0, kLastRadius);
    return std::move(trials_);
  }

 private:
  static constexpr int kScanRounds = 2, kWarpRounds = 2;
  static constexpr double kCommon = 2, kCommonPx = 0.25;  // standard errors; pixels

  void MovePoses(int level, bool by_scan) {
    for (; level >= 0; --level) {
      for (int i = 0; i < RoundsAt(level); ++i) {
        registrar_.Measure(level, RadiusAt(level, i));
        registrar_.Correct(by_scan, false);
      }
    }
  }

  // Whether the photos stay where they are now; they go back otherwise.
  bool Keep(const char* mode) {
    const KeptAsideLikeness now = registrar_.Judge();
    trials_.push_back(JudgeTrial(mode, trials_, likeness_, now));
    if (!trials_.back().kept) {
      registrar_.Return(stand_);
      return false;
    }
    stand_ = registrar_.Here();
    likeness_ = now;
    return true;
  }

  Registrar& registrar_;
  Registrar::Stand stand_;
  KeptAsideLikeness likeness_;
  std::vector<RegistrationTrial> trials_;
};

}  // namespace

void RegistrationOptions::Declare(OptionFields* fields) {
  fields->Choice("Registration.mode", &mode, {"auto", "pose", "warp", "measure", "none"},
                 "Photos that show the same surface in different places are brought together: by "
                 "their poses, or by a smooth warp of each photo as well; auto: by whichever of "
                 "these makes them agree where nothing was fitted, or not at all; measure: the "
                 "report says how far they are off, and the colours are made without. Photos that "
                 "agree stay as they are.");
  fields
      ->Number("Registration.turn_deg", &turn_deg,
               "How far a pose may be turned wrongly, one standard deviation, degrees. Larger = "
               "held less by the alignment.")
      .Above(0)
      .AtMost(90)
      .Says("must be positive, at most 90 degrees");
  fields
      ->Number("Registration.move", &move,
               "How far a pose may be off its place, one standard deviation, metres. Larger = "
               "held less by the alignment.")
      .Positive();
  fields
      ->Number("Registration.row_turn_deg", &row_turn_deg,
               "How far a camera may turn while the rows of its photo are read (rolling shutter), "
               "one standard deviation, degrees; 0 = not at all. Larger = held less.")
      .Within(0, 90, "degrees");
  fields
      ->Number("Registration.warp_px", &warp_px,
               "How far a warp may shift what a photo shows, one standard deviation, pixels of a "
               "photo of 1280. Larger = bent more.")
      .Positive();
  fields
      ->Number("Registration.warp_step_px", &warp_step_px,
               "How much a warp's shift may change over 1/28 of the photo, one standard deviation, "
               "pixels of a photo of 1280. Larger = bent more.")
      .Positive();
  fields
      ->Number("Registration.least_px", &least_px,
               "Photos that are off by less, in the mean over the photos, are left as they are; "
               "pixels of a photo of 1280.")
      .NotNegative();
}

std::vector<std::string> RegistrationOptions::Problems() const { return ProblemsOf(*this); }

Registration RegisterPhotos(const PhotoPassInput& input, const std::vector<GridOfSamples>& grids,
                            const std::vector<std::vector<uint8_t>>& intensities,
                            const ObservationStore& store,
                            const std::vector<Eigen::Vector3f>& gains,
                            const RegistrationOptions& options, int num_threads,
                            std::vector<PhotoView>* photos) {
  Registration result;
  if (options.mode == "none" || photos->empty()) return result;
  SharedSamples samples(input, grids, intensities, store, static_cast<int>(photos->size()));
  std::vector<PhotoView> moved = *photos;
  Registrar registrar(&samples, gains, options, num_threads, &moved);
  if (options.mode == "auto") {
    result.trials = TrialRun(&registrar).Run();
  } else {
    const Registrar::Stand first = registrar.Here();
    if (!BringTogether(options.mode == "warp", &registrar)) {
      registrar.Return(first);
      registrar.Measure(0, kLastRadius);
    }
  }
  result.photos = registrar.Report();
  if (options.mode == "measure") {
    for (PhotoRegistration& photo : result.photos) {
      photo.corrected = false;
      photo.shift_after_px = photo.shift_before_px;
    }
  } else {
    *photos = std::move(moved);
  }
  return result;
}

}  // namespace roomtex
