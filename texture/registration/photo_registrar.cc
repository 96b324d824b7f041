#include "texture/registration/photo_registrar.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/row_motion.h"
#include "core/statistics.h"
#include "core/twist.h"

namespace roomtex {
namespace {

constexpr double kLargestSide = 1280;    // pixels of a picture
constexpr double kPictureBytes = 256e6;  // of all pictures
constexpr double kNodesAcross = 28;      // of the longer side
constexpr double kFewestNodePx = 20;
constexpr double kMostNodes = 150000;  // of all photos
constexpr int kMostPixels = 120;       // of a patch
constexpr size_t kFewestPatches = 6;
constexpr size_t kFewestOfPatch = 40;  // sightings
constexpr double kNoShift = std::numeric_limits<double>::quiet_NaN();

}  // namespace

PhotoRegistrar::PhotoRegistrar(SharedSamples* samples, const std::vector<Eigen::Vector3f>& gains,
                               const RegistrationOptions& options, int num_threads,
                               std::vector<PhotoView>* photos)
    : samples_(*samples),
      options_(options),
      num_threads_(num_threads),
      photos_(*photos),
      registered_(photos->size()),
      found_(photos->size()) {
  ParallelFor(num_threads, 0, num_photos(), [&](int i) { Load(i, gains[i]); });
}

std::vector<double> PhotoRegistrar::Disagreement() {
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

void PhotoRegistrar::Measure(int level, int radius) {
  Look(level);
  radius_ = radius;
  patches_.assign(photos_.size(), {});
  median_px_.assign(photos_.size(), 0);
  ParallelFor(num_threads_, 0, num_photos(), [&](int i) { MeasurePhoto(i, radius); });
}

bool PhotoRegistrar::AreOff() const {
  double sum = 0, most = 0;
  for (const double median : median_px_) {
    sum += median;
    most = std::max(most, median);
  }
  constexpr double kMuch = 3;
  return sum > options_.least_px * num_photos() || most > kMuch * options_.least_px;
}

bool PhotoRegistrar::FreeIfOff() {
  is_free_ = is_free_ || AreOff();
  return is_free_;
}

void PhotoRegistrar::Correct(bool by_scan, bool with_warps) {
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

PhotoRegistrar::Stand PhotoRegistrar::Here() const {
  Stand stand;
  for (int i = 0; i < num_photos(); ++i) {
    stand.poses.push_back(photos_[i].cam_from_scan);
    stand.shown.push_back(photos_[i].warp);
    stand.row_turns.push_back(registered_[i].row_turn);
    stand.warps.push_back(registered_[i].warp);
  }
  return stand;
}

void PhotoRegistrar::Return(const Stand& stand) {
  for (int i = 0; i < num_photos(); ++i) {
    RegisteredPhoto& photo = registered_[i];
    photos_[i].cam_from_scan = stand.poses[i];
    photos_[i].warp = stand.shown[i];
    photo.row_turn = stand.row_turns[i];
    photo.warp = stand.warps[i];
    photo.shown = stand.shown[i] ? *stand.shown[i] : photo.warp;
  }
}

double PhotoRegistrar::MotionFrom(const Stand& stand) const {
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

void PhotoRegistrar::KeepAside() {
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

KeptAsideLikeness PhotoRegistrar::Judge() {
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

std::vector<PhotoRegistration> PhotoRegistrar::Report() {
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

double PhotoRegistrar::MeanScale() const {
  double sum = 0;
  for (const RegisteredPhoto& photo : registered_) sum += photo.scale;
  return sum / num_photos();
}

void PhotoRegistrar::Look(int level) {
  level_ = level;
  std::vector<LevelPicture> pictures;
  std::vector<float> gains;
  for (const RegisteredPhoto& photo : registered_) {
    pictures.push_back(photo.At(level));
    gains.push_back(photo.gain);
  }
  samples_.Look(photos_, pictures, gains, num_threads_);
}

bool PhotoRegistrar::IsCompared(const Sighting& s) const {
  constexpr float kLeastOthers = 0.02f;
  return !std::isnan(s.grey) && samples_.OthersWeight(s) > kLeastOthers * s.weight;
}

bool PhotoRegistrar::IsFree(int i) const {
  return is_free_ && !photos_[i].camera.IsPanorama() && patches_[i].size() >= kFewestPatches;
}

void PhotoRegistrar::Load(int i, const Eigen::Vector3f& gain) {
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
  photo.scales = Eigen::Array2f(static_cast<float>(grey.cols), static_cast<float>(grey.rows)) /
                 Eigen::Array2f(static_cast<float>(picture.cols), static_cast<float>(picture.rows));
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

std::vector<std::vector<int>> PhotoRegistrar::GatherPatches(int i, bool kept_aside) const {
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

std::vector<ExpectedPixel> PhotoRegistrar::Expect(int i, const std::vector<int>& members,
                                                  const GreyOf& grey_of,
                                                  Eigen::Vector2f* middle) const {
  const RegisteredPhoto& photo = registered_[i];
  const std::vector<Sighting>& sightings = samples_.Of(i);
  const LevelPicture picture = photo.At(level_);
  const size_t skip = std::max<size_t>(1, members.size() / kMostPixels);
  std::vector<ExpectedPixel> expected;
  middle->setZero();
  for (size_t k = 0; k < members.size(); k += skip) {
    const Sighting& s = sightings[members[k]];
    const Eigen::Vector2f shown = s.place + photo.shown.At(s.place.x(), s.place.y());
    expected.push_back({picture.Place(shown), grey_of(s)});
    *middle += s.place;
  }
  *middle /= static_cast<float>(expected.size());
  return expected;
}

std::optional<PhotoRegistrar::Patch> PhotoRegistrar::Compare(int i, const std::vector<int>& members,
                                                             int radius,
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

void PhotoRegistrar::AddShiftsAgainstScan(int i, std::vector<MeasuredShift>* shifts) const {
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

void PhotoRegistrar::SetShift(int i, const Patch& patch, MeasuredShift* shift) const {
  const double scale = registered_[i].scale / (1 << level_);
  shift->shift = patch.shift.shift / static_cast<float>(scale);
  // However much texture it has, a patch knows its place no better than this.
  constexpr double kBestPx = 0.2;
  const double most = 2 / (kBestPx * kBestPx), trace = patch.shift.information.trace();
  const double certain = std::min(1.0, most / trace) * scale * scale;
  shift->information = patch.shift.information * static_cast<float>(certain);
}

void PhotoRegistrar::JudgePhoto(int i, KeptAsideLikeness* likeness) const {
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

void PhotoRegistrar::MeasurePhoto(int i, int radius) {
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

std::optional<PhotoRegistrar::Seen> PhotoRegistrar::See(int i, const Sighting& sighting) const {
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
  Eigen::Matrix<double, 3, 6> by_step;  // of MovedInPlace()
  by_step << -CrossMatrix(x_in_cam), Eigen::Matrix3d::Identity();
  seen.place.by_pose.leftCols<6>() = (by_point * by_step).cast<float>();
  if (options_.row_turn_deg > 0) {
    seen.place.by_pose.rightCols<3>() =
        (RowShare(view.camera, sighting.place.cast<double>()) * by_point * -CrossMatrix(x_in_cam))
            .cast<float>();
  }
  registered_[i].warp.NodesAt(sighting.place.x(), sighting.place.y(), &seen.place.nodes,
                              &seen.place.node_weights);
  return seen;
}

std::optional<MeasuredShift> PhotoRegistrar::ShiftAt(int i, const Patch& patch) const {
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

PhotoPrior PhotoRegistrar::PriorOf(int i, bool with_warp) const {
  const RegisteredPhoto& photo = registered_[i];
  PhotoPrior prior;
  prior.is_free = IsFree(i);
  const Rigid& pose = photos_[i].cam_from_scan;
  const Eigen::Quaterniond turn = pose.rotation * photo.first_pose.rotation.conjugate();
  prior.pose << VectorFromRotation(turn), pose.translation - turn * photo.first_pose.translation,
      photo.row_turn;
  // What moves nothing is held at 0 by any sigma.
  const double row_turn_deg = options_.row_turn_deg > 0 ? options_.row_turn_deg : 1;
  prior.pose_sigma << Eigen::Vector3d::Constant(RadFromDeg(options_.turn_deg)),
      Eigen::Vector3d::Constant(options_.move), Eigen::Vector3d::Constant(RadFromDeg(row_turn_deg));
  if (with_warp) prior.warp = &photo.warp;
  prior.warp_sigma = options_.warp_px / photo.scale;
  prior.step_sigma = options_.warp_step_px / photo.scale;
  return prior;
}

void PhotoRegistrar::Move(int i, const PhotoStep& step) {
  if (!IsFree(i)) return;
  RegisteredPhoto& photo = registered_[i];
  photos_[i].cam_from_scan = MovedInPlace(photos_[i].cam_from_scan, step.pose.head<6>());
  photo.row_turn += step.pose.tail<3>();
  for (size_t n = 0; n < step.warp.size(); ++n) {
    photo.warp.Shift(static_cast<int>(n)) += step.warp[n];
  }
  photo.shown = photo.warp;
  if (!photo.row_turn.isZero()) AddRowTurn(photos_[i].camera, &photo);
  if (step.warp.empty() && photo.row_turn.isZero()) return;
  photos_[i].warp = std::make_shared<const PhotoWarp>(photo.shown);
}

void PhotoRegistrar::AddRowTurn(const Camera& camera, RegisteredPhoto* photo) {
  for (int n = 0; n < photo->shown.num_nodes(); ++n) {
    const Eigen::Vector2f place =
        photo->shown.Place(n).cwiseMin(Eigen::Vector2i(camera.width, camera.height).cast<float>());
    const auto ray = photo->camera->RayFromImg(place.cast<double>());
    if (!ray) continue;
    const auto shown = photo->camera->ImgFromCam(
        RotationFromVector(RowShare(camera, place.cast<double>()) * photo->row_turn) * *ray);
    if (shown) photo->shown.Shift(n) += shown->cast<float>() - place;
  }
}

void PhotoRegistrar::FindShiftBefore(int i) {
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

size_t PhotoRegistrar::MapCell(const Camera& camera, const Eigen::Vector2f& place) {
  constexpr int kColumns = PhotoRegistration::kMapColumns, kRows = PhotoRegistration::kMapRows;
  const int column = static_cast<int>(place.x() * kColumns / static_cast<float>(camera.width));
  const int row = static_cast<int>(place.y() * kRows / static_cast<float>(camera.height));
  return static_cast<size_t>(std::clamp(row, 0, kRows - 1)) * kColumns +
         std::clamp(column, 0, kColumns - 1);
}

}  // namespace roomtex
