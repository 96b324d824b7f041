#pragma once
// Features of a database's photos in bounded memory, and the signatures made from them.

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "colmap_ext/database.h"
#include "colmap_ext/pair_check.h"
#include "core/progress.h"

namespace roomtex {

// Photos are numbered by their image ids' order.
class FeatureCache {
 public:
  // num_features: the largest of each photo. `database` must outlive the cache.
  FeatureCache(const Database& database, int num_features);

  int num_photos() const { return static_cast<int>(images_.size()); }
  std::vector<int> PhotosWithFeatures() const;
  size_t max_photos() const;  // that Load() may be asked for at once

  // These photos' features into memory; others make room. Throws InputError as Database does.
  void Load(const std::set<int>& photos);
  // Of a photo of the last Load(). May be called by several threads.
  const ComparedFeatures& At(int photo) const { return features_.at(photo); }

 private:
  const Database* database_;
  int num_features_;
  std::map<uint32_t, Camera> cameras_;
  std::vector<DatabaseImage> images_;
  std::map<int, ComparedFeatures> features_;
};

// A column per photo, see photo_signature.h: words and axes are learned from an even choice of the
// photos that have features, which are read three times in the whole. Same seed, same signatures.
Eigen::MatrixXf SignPhotos(FeatureCache* features, int num_threads, uint64_t random_seed,
                           Progress* progress);

}  // namespace roomtex
