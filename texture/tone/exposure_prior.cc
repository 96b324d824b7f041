#include "texture/tone/exposure_prior.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include "core/statistics.h"

namespace roomtex {

void ExposurePrior::Forget() {
  std::fill(log_gain.begin(), log_gain.end(), std::nullopt);
  std::fill(kind.begin(), kind.end(), -1);
  num_kinds = 0;
}

ExposurePrior PriorFromExif(const std::vector<ExposureData>& exposures, bool one_kind) {
  ExposurePrior prior;
  std::map<std::string, int> kinds;
  for (const ExposureData& data : exposures) {
    const auto exposure = data.RelativeExposure();
    prior.log_gain.push_back(exposure ? std::optional<double>(-std::log(*exposure)) : std::nullopt);
    if (!exposure) {
      prior.kind.push_back(-1);
      continue;
    }
    const std::string name =
        one_kind ? "" : data.camera + (data.f_number ? "|aperture" : "") + (data.iso ? "|iso" : "");
    prior.kind.push_back(kinds.emplace(name, static_cast<int>(kinds.size())).first->second);
  }
  prior.num_kinds = static_cast<int>(kinds.size());
  return prior;
}

std::optional<double> ExifScatter(const ExposurePrior& prior, const std::vector<int>& groups,
                                  const std::vector<double>& log_gains) {
  std::map<std::pair<int, int>, std::vector<double>> departures;
  for (size_t i = 0; i < groups.size(); ++i) {
    if (!prior.log_gain[i]) continue;
    departures[{groups[i], prior.kind[i]}].push_back(*prior.log_gain[i] - log_gains[i]);
  }
  std::vector<double> sizes;
  for (const auto& [key, values] : departures) {
    if (values.size() < 3) continue;
    const double middle = Median(values);
    for (const double value : values) sizes.push_back(std::abs(value - middle));
  }
  if (sizes.size() < 5) return std::nullopt;
  // Root mean square of the smaller four fifths: EXIF of a few photos may be wrong. The factor
  // makes it a standard deviation. (Cameras round to steps: a median could be 0.)
  std::sort(sizes.begin(), sizes.end());
  const size_t count = sizes.size() * 4 / 5;
  double squares = 0;
  for (size_t i = 0; i < count; ++i) squares += sizes[i] * sizes[i];
  return 1.5 * std::sqrt(squares / static_cast<double>(count));
}

std::vector<int> GroupPhotos(int num_photos, const std::vector<Overlap>& overlaps,
                             const ExposurePrior* prior) {
  std::vector<int> parent(num_photos + 1);  // the last one stands for EXIF
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const Overlap& overlap : overlaps) parent[root(overlap.photo_a)] = root(overlap.photo_b);
  if (prior != nullptr) {
    for (int i = 0; i < num_photos; ++i) {
      if (prior->log_gain[i]) parent[root(i)] = root(num_photos);
    }
  }
  std::vector<int> groups;
  for (int i = 0; i < num_photos; ++i) groups.push_back(root(i));
  return groups;
}

int LargestGroup(const std::vector<int>& groups) {
  std::map<int, int> sizes;
  for (const int group : groups) ++sizes[group];
  int largest = groups.empty() ? -1 : groups[0];
  for (const int group : groups) {
    if (sizes[group] > sizes[largest]) largest = group;
  }
  return largest;
}

}  // namespace roomtex
