#pragma once
// Scans of several stations against each other, where they show the same surface: whether each
// stands where its pose says. Point-to-plane ICP (Chen and Medioni 1992) between the patches of two
// scans, with the weights of the similarity fit and without a scale.

#include <string>
#include <vector>

#include "core/scan.h"
#include "core/similarity.h"

namespace roomtex {

struct StationPair {
  int first = 0, second = 0;  // indices into the scans
  int num_patches = 0;        // of the second scan that lie on the first one's surface
  // What brings the second scan onto the first one; the identity where they do not overlap enough.
  Rigid first_from_second;
  // Metres: by how much that moves the common surface across itself (root mean square), and the
  // standard deviation of it. Along open directions nothing is known, and nothing moves.
  double offset = 0, sigma = 0;
  double turn = 0;  // radians

  bool Disagrees() const;
};

struct StationCheck {
  std::vector<StationPair> pairs;  // those that overlap
  // Stations that most of their neighbours contradict, worst first; of two that contradict each
  // other, both.
  std::vector<int> wrong;
  const StationPair* Worst() const;  // of those that disagree; null without
  std::string Sentence(const std::vector<Scan>& scans) const;  // "" without wrong ones
};

StationCheck CheckStations(const std::vector<Scan>& scans);

// The scans with every wrong station moved onto the others; the first scan stays. Returns what
// moved.
std::vector<int> RegisterStations(std::vector<Scan>* scans);

}  // namespace roomtex
