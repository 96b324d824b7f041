#pragma once
// Which photo gives the detail where photos disagree: one per place, chosen so that neighbours
// choose alike unless their photos show the same (after Lempitsky and Ivanov 2007, "Seamless
// Mosaicing of Image-Based Texture Maps", with cells of space in place of triangles). Cells serve
// samples of grids and the texels of grids and meshes alike.

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "texture/sampling/blend.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

class PhotoChoice {
 public:
  struct Cell {
    int photo = -1;      // chosen; -1 = none sees enough of it
    float strength = 0;  // 0: the mean of the photos is as sharp as they are, 1: it is not
  };

  // The choices of the eight cells around a place, linear between their middles.
  struct Place {
    float strength = 0;  // share of the photos' detail in place of that of the blend
    int count = 0;
    std::array<int, 8> photos{};    // `count` of them; one may come several times
    std::array<float, 8> shares{};  // not brought to the sum of 1
  };

  PhotoChoice() = default;

  bool empty() const { return cells_.empty(); }

  // Looks up places, fastest if one lies beside the other.
  class Reader {
   public:
    explicit Reader(const PhotoChoice& choice) : choice_(choice) {}
    const Place& At(const Eigen::Vector3d& x_in_scan);

   private:
    void GoTo(const Eigen::Vector3i& first);

    const PhotoChoice& choice_;
    Eigen::Vector3i first_ = Eigen::Vector3i::Constant(INT32_MIN);
    std::array<const Cell*, 8> around_{};
    bool is_any_ = false;
    Place place_;
  };

 private:
  friend class PhotoChooser;

  PhotoChoice(const Eigen::Vector3d& origin, double cell_size)
      : origin_(origin), cell_size_(cell_size) {}

  static uint64_t Key(const Eigen::Vector3i& cell);
  // The middle of cell (i, j, k) is at (i, j, k) + 1/2.
  Eigen::Vector3d InCells(const Eigen::Vector3d& x_in_scan) const {
    return (x_in_scan - origin_) / cell_size_;
  }
  Eigen::Vector3i CellOf(const Eigen::Vector3d& x_in_scan) const;

  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double cell_size_ = 1;
  std::unordered_map<uint64_t, int> number_;  // of a key
  std::vector<Cell> cells_;
};

// Whether a photo may give the detail of a sample, beside the best one of it: neither in doubt nor
// beside a depth boundary, where it has next to no weight.
inline bool MayGiveDetail(const Observation& photo, const Observation& best) {
  constexpr float kNextToNone = 0.02f;
  return photo.in_doubt == 0 &&
         UnpackWeight(photo.weight) > kNextToNone * UnpackWeight(best.weight);
}

// From what the photos say of the samples, gains applied; at most 100 000 cells. Empty for
// blend.mode "average", and for blend.detail, which is another way to the same. The result does
// not depend on num_threads.
PhotoChoice ChoosePhotos(const PhotoPassInput& input, const ObservationStore& store,
                         const std::vector<Eigen::Vector3f>& gains,
                         const std::vector<PhotoView>& photos, const BlendOptions& blend,
                         int num_threads);

}  // namespace roomtex
