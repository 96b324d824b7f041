#include "colmap_ext/view_graph.h"

#include <algorithm>
#include <numeric>
#include <set>

namespace roomtex {
namespace {

// Positions of the edges, the strongest first.
std::vector<int> ByWeight(const std::vector<GraphEdge>& edges) {
  std::vector<int> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return edges[static_cast<size_t>(a)].weight > edges[static_cast<size_t>(b)].weight;
  });
  return order;
}

}  // namespace

DisjointSets::DisjointSets(int num_nodes)
    : parent_(static_cast<size_t>(num_nodes)), size_(static_cast<size_t>(num_nodes), 1) {
  std::iota(parent_.begin(), parent_.end(), 0);
}

int DisjointSets::Find(int node) {
  while (parent_[static_cast<size_t>(node)] != node) {
    int& parent = parent_[static_cast<size_t>(node)];
    parent = parent_[static_cast<size_t>(parent)];
    node = parent;
  }
  return node;
}

int DisjointSets::SizeOf(int node) const { return size_[static_cast<size_t>(node)]; }

bool DisjointSets::Join(int node1, int node2) {
  const int root1 = Find(node1), root2 = Find(node2);
  if (root1 == root2) return false;
  const int root = std::min(root1, root2), other = std::max(root1, root2);
  parent_[static_cast<size_t>(other)] = root;
  size_[static_cast<size_t>(root)] += size_[static_cast<size_t>(other)];
  return true;
}

std::vector<std::vector<int>> DisjointSets::Groups() {
  std::vector<std::vector<int>> of_root(parent_.size()), groups;
  for (int node = 0; node < static_cast<int>(parent_.size()); ++node) {
    of_root[static_cast<size_t>(Find(node))].push_back(node);
  }
  for (std::vector<int>& group : of_root) {
    if (!group.empty()) groups.push_back(std::move(group));
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return groups;
}

std::vector<int> SparseEdges(int num_nodes, const std::vector<GraphEdge>& edges, int max_per_node) {
  std::vector<std::vector<int>> of_node(static_cast<size_t>(num_nodes));
  std::set<int> kept;
  DisjointSets sets(num_nodes);
  for (const int edge : ByWeight(edges)) {
    const auto [node1, node2, weight] = edges[static_cast<size_t>(edge)];
    of_node[static_cast<size_t>(node1)].push_back(edge);
    of_node[static_cast<size_t>(node2)].push_back(edge);
    if (sets.Join(node1, node2)) kept.insert(edge);
  }
  const auto limit = static_cast<size_t>(std::max(0, max_per_node));
  for (const std::vector<int>& strongest_first : of_node) {
    const size_t count = std::min(strongest_first.size(), limit);
    const size_t num_strongest = strongest_first.size() <= limit ? count : (limit + 1) / 2;
    const size_t num_others = count - num_strongest;
    for (size_t i = 0; i < num_strongest; ++i) kept.insert(strongest_first[i]);
    for (size_t i = 0; i < num_others; ++i) {
      const size_t behind = strongest_first.size() - num_strongest;
      kept.insert(strongest_first[num_strongest + (i + 1) * behind / (num_others + 1)]);
    }
  }
  return {kept.begin(), kept.end()};
}

}  // namespace roomtex
