#include "texture/sampling/photo_pass.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <opencv2/core.hpp>

#include "core/cpu_stages.h"
#include "core/parallel.h"
#include "core/photo.h"

namespace roomtex {
namespace {

struct SlotObservation {
  int slot;
  Observation observation;
};

// Of a panorama: reaches as far as a cubic or a footprint.
constexpr int kSeamPx = 20;

// What one photo sees, tile by tile; tile_end[i] is the end of tile i's part.
struct PhotoObservations {
  std::vector<SlotObservation> all;
  std::vector<size_t> tile_end;
  std::vector<SharpnessProbe> probes;
};

cv::Mat Decode(const PhotoView& view) {
  const CpuTimer timer(CpuStage::kDecode);
  cv::Mat photo = ReadPhoto(view.path, view.pixels);
  if (view.tone) view.tone->response.ToSrgb(&photo);
  return photo;
}

class PhotoObserver {
 public:
  PhotoObserver(const PhotoPassInput& input, const PhotoView& view, cv::Mat picture,
                const OcclusionOptions& occlusion, const BlendOptions& blend, size_t probe_stride)
      : input_(input),
        blend_(blend),
        photo_weight_(view.weight),
        probe_stride_(probe_stride),
        projector_(view),
        warp_(view.warp),
        moving_(view.moving),
        transparent_(view.transparent),
        visibility_(projector_, input.occluders, input.angular_spacing, occlusion),
        image_(std::move(picture)) {
    if (view.camera.IsPanorama()) {
      seam_px_ = std::min(kSeamPx, image_.cols);
      cv::copyMakeBorder(image_, image_, 0, 0, seam_px_, seam_px_, cv::BORDER_WRAP);
    } else if (view.tone && !view.tone->vignetting.is_none()) {
      vignetting_.emplace(view.tone->vignetting, projector_.camera());
    }
  }

  PhotoObservations Observe(int photo) {
    const CpuTimer timer(CpuStage::kSamples);
    PhotoObservations seen;
    for (const SampleTile& tile : input_.samples) {
      if (projector_.MaySee(tile.points.origin, tile.points.radius))
        ObserveTile(tile, photo, &seen);
      seen.tile_end.push_back(seen.all.size());
    }
    return seen;
  }

 private:
  void ObserveTile(const SampleTile& tile, int photo, PhotoObservations* seen) {
    projector_.Project(tile.points, &projected_);
    const Eigen::Vector3f camera = projector_.CentreFrom(tile.points.origin);
    const auto width = static_cast<float>(projector_.width());
    const auto height = static_cast<float>(projector_.height());
    const float focal_length = static_cast<float>(projector_.camera().camera().MeanFocalLength());
    const bool scanner_known = tile.scanner.allFinite();
    const auto seam = static_cast<float>(seam_px_);
    for (int i = 0; i < tile.points.size(); ++i) {
      const float x = projected_.x[i], y = projected_.y[i], depth = projected_.depth[i];
      if (!(depth > 0) || !(x >= 0 && y >= 0 && x <= width && y <= height)) continue;
      const Eigen::Vector3f point(tile.points.x[i], tile.points.y[i], tile.points.z[i]);
      const Eigen::Vector3f to_camera = camera - point;
      const Eigen::Vector3f normal = tile.NormalTowards(to_camera, i);
      if (!FacesCamera(to_camera, normal)) continue;
      Sight sight = visibility_.Look(x, y, depth);
      if (sight == Sight::kHidden) continue;
      // A sample without a triangle is a stray one at a depth jump.
      if (normal.isZero()) sight = std::min(sight, Sight::kBoundary);
      const Eigen::Vector3f to_scanner =
          scanner_known ? Eigen::Vector3f(tile.scanner - point) : Eigen::Vector3f(to_camera);
      const float spacing_px =
          static_cast<float>(input_.angular_spacing) * to_scanner.norm() * focal_length / depth;
      Eigen::Vector2f shown(x, y);
      if (warp_) shown += warp_->At(x, y);
      if (!(shown.minCoeff() >= 0 && shown.x() <= width && shown.y() <= height)) continue;
      if (transparent_ && transparent_->At(shown.x(), shown.y())) continue;
      const Eigen::Vector3f camera_direction = to_camera.normalized();
      if (probe_stride_ > 0 && (tile.first_slot + i) % probe_stride_ == 0 && sight == Sight::kClear)
        Probe(tile.first_slot + i, shown, to_camera.norm() / focal_length,
              normal.dot(camera_direction), &seen->probes);
      const PhotoColor color = blend_.footprint > 0
                                   ? LookUpPhoto(image_, shown.x() + seam, shown.y(),
                                                 static_cast<float>(blend_.footprint) * spacing_px)
                                   : LookUpPhoto(image_, shown.x() + seam, shown.y());
      // A panorama has no left and right border.
      const float from_side = seam_px_ > 0 ? 0.5f * width : x;
      float weight = ThesisWeight(from_side, y, width, height, sight != Sight::kClear) *
                     color.reliability * photo_weight_;
      if (blend_.angle_weight) {
        weight *= AngleWeight(camera_direction, to_scanner.normalized(), normal);
      }
      if (blend_.resolution_weight && spacing_px > 0) {
        const float cosine = normal.isZero() ? 0.3f : normal.dot(camera_direction);
        weight *= ResolutionWeight(spacing_px * spacing_px * cosine);
      }
      Observation observation;
      observation.color =
          PackColor(vignetting_ ? color.linear * vignetting_->At(x, y) : color.linear);
      observation.weight = PackWeight(std::max(weight, 1e-10f));
      observation.photo = static_cast<uint16_t>(photo) & (kMaxPhotos - 1);
      observation.at_boundary = sight != Sight::kClear;
      observation.in_doubt =
          sight < Sight::kBoundary || (moving_ && moving_->At(shown.x(), shown.y()));
      seen->all.push_back({tile.first_slot + i, observation});
    }
  }

  void Probe(uint32_t slot, const Eigen::Vector2f& shown, float pixel_width, float cosine,
             std::vector<SharpnessProbe>* probes) const {
    constexpr float kSlant = 0.5f;  // beyond it, pixels are much wider one way than the other
    if (cosine < kSlant) return;
    const float contrast = ContrastAt(image_, shown.x() + static_cast<float>(seam_px_), shown.y());
    if (contrast >= 0) probes->push_back({slot, contrast, pixel_width / std::sqrt(cosine)});
  }

  const PhotoPassInput& input_;
  const BlendOptions& blend_;
  float photo_weight_;
  size_t probe_stride_;  // 0 = no probes
  PhotoProjector projector_;
  std::shared_ptr<const PhotoWarp> warp_;
  std::shared_ptr<const PhotoMask> moving_, transparent_;
  PhotoVisibility visibility_;
  cv::Mat image_;    // sRGB
  int seam_px_ = 0;  // columns that a panorama's image goes on for beyond both borders
  std::optional<VignettingFactor> vignetting_;
  ProjectedBlock projected_;
};

}  // namespace

std::vector<std::vector<size_t>> ObservePhotos(const PhotoPassInput& input,
                                               const std::vector<PhotoView>& photos,
                                               const OcclusionOptions& occlusion,
                                               const BlendOptions& blend, int num_threads,
                                               Progress* progress, ObservationStore* store,
                                               std::vector<std::vector<SharpnessProbe>>* probes) {
  const int num_photos = static_cast<int>(photos.size());
  const int num_tiles = static_cast<int>(input.samples.size());
  const int batch_size = EffectiveThreads(num_threads);
  std::vector<std::vector<size_t>> num_seen(num_photos);
  std::vector<PhotoObservations> batch(batch_size);
  std::vector<std::string> problems(num_photos);
  const size_t probe_stride = probes ? SharpnessStride(store->num_samples()) : 0;
  if (probes) probes->assign(num_photos, {});
  for (int first = 0; first < num_photos; first += batch_size) {
    const int count = std::min(batch_size, num_photos - first);
    ParallelFor(num_threads, 0, count, [&](int i) {
      const int photo = first + i;
      cv::Mat picture;
      try {
        picture = Decode(photos[photo]);
      } catch (const InputError& error) {
        problems[photo] = error.what();
        batch[i] = {{}, std::vector<size_t>(num_tiles, 0), {}};
        return;
      }
      batch[i] =
          PhotoObserver(input, photos[photo], std::move(picture), occlusion, blend, probe_stride)
              .Observe(photo);
      if (probes) {
        KeepSomeProbes(photos.size(), &batch[i].probes);
        (*probes)[photo] = std::move(batch[i].probes);
      }
      size_t before = 0;
      for (const size_t end_tile : input.grid_ends) {
        const size_t end = end_tile == 0 ? 0 : batch[i].tile_end[end_tile - 1];
        num_seen[photo].push_back(end - before);
        before = end;
      }
      progress->Tick();
    });
    constexpr int kTilesAtOnce = 64;
    const int num_blocks = (num_tiles + kTilesAtOnce - 1) / kTilesAtOnce;
    ParallelFor(num_threads, 0, num_blocks, [&](int block) {
      const CpuTimer timer(CpuStage::kMerge);
      const int begin_tile = block * kTilesAtOnce;
      const int end_tile = std::min(num_tiles, begin_tile + kTilesAtOnce);
      for (int i = 0; i < count; ++i) {
        const size_t begin = begin_tile == 0 ? 0 : batch[i].tile_end[begin_tile - 1];
        for (size_t k = begin; k < batch[i].tile_end[end_tile - 1]; ++k) {
          store->Add(batch[i].all[k].slot, batch[i].all[k].observation);
        }
      }
    });
  }
  std::vector<PhotoLeftOut> unreadable;
  for (int i = 0; i < num_photos; ++i) {
    if (!problems[i].empty()) unreadable.push_back({photos[i].name, problems[i]});
  }
  if (!unreadable.empty()) throw UnusablePhotos(std::move(unreadable));
  return num_seen;
}

}  // namespace roomtex
