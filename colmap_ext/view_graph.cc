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

// Finds the edges that no loop contains (Tarjan 1974), without recursion: a chain of 100 000 photos
// is as deep.
class CutEdges {
 public:
  CutEdges(int num_nodes, const std::vector<std::pair<int, int>>& edges)
      : edges_(edges),
        of_node_(static_cast<size_t>(num_nodes)),
        order_(static_cast<size_t>(num_nodes), -1),
        low_(static_cast<size_t>(num_nodes)),
        next_(static_cast<size_t>(num_nodes)),
        is_cut_(edges.size()) {
    for (size_t edge = 0; edge < edges.size(); ++edge) {
      of_node_[static_cast<size_t>(edges[edge].first)].push_back(edge);
      of_node_[static_cast<size_t>(edges[edge].second)].push_back(edge);
    }
    for (size_t node = 0; node < of_node_.size(); ++node) {
      if (order_[node] < 0) Search(node);
    }
  }
  bool operator[](size_t edge) const { return is_cut_[edge]; }

 private:
  struct Step {
    size_t node = 0, from_edge = 0;
  };

  void Enter(size_t node, size_t from_edge) {
    order_[node] = low_[node] = num_entered_++;
    path_.push_back({node, from_edge});
  }

  void Search(size_t root) {
    Enter(root, edges_.size());
    while (!path_.empty()) {
      const auto [node, from_edge] = path_.back();
      if (next_[node] < of_node_[node].size()) {
        const size_t edge = of_node_[node][next_[node]++];
        if (edge == from_edge) continue;
        const auto other = static_cast<size_t>(edges_[edge].first) == node
                               ? static_cast<size_t>(edges_[edge].second)
                               : static_cast<size_t>(edges_[edge].first);
        if (order_[other] < 0) {
          Enter(other, edge);
        } else {
          low_[node] = std::min(low_[node], order_[other]);
        }
        continue;
      }
      path_.pop_back();
      if (path_.empty()) return;
      const size_t parent = path_.back().node;
      low_[parent] = std::min(low_[parent], low_[node]);
      is_cut_[from_edge] = low_[node] > order_[parent];
    }
  }

  const std::vector<std::pair<int, int>>& edges_;
  std::vector<std::vector<size_t>> of_node_;
  std::vector<int> order_, low_;  // when a node was entered; the earliest it leads back to
  std::vector<size_t> next_;
  std::vector<bool> is_cut_;
  std::vector<Step> path_;
  int num_entered_ = 0;
};

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

std::vector<std::vector<int>> LooseEnds(int num_nodes,
                                        const std::vector<std::pair<int, int>>& edges) {
  const CutEdges is_cut(num_nodes, edges);
  DisjointSets sets(num_nodes);
  for (size_t edge = 0; edge < edges.size(); ++edge) {
    if (!is_cut[edge]) sets.Join(edges[edge].first, edges[edge].second);
  }
  std::vector<int> num_cuts(static_cast<size_t>(num_nodes));
  for (size_t edge = 0; edge < edges.size(); ++edge) {
    if (!is_cut[edge]) continue;
    ++num_cuts[static_cast<size_t>(sets.Find(edges[edge].first))];
    ++num_cuts[static_cast<size_t>(sets.Find(edges[edge].second))];
  }
  std::vector<std::vector<int>> loose;
  for (std::vector<int>& group : sets.Groups()) {
    if (num_cuts[static_cast<size_t>(group[0])] == 1) loose.push_back(std::move(group));
  }
  return loose;
}

}  // namespace roomtex
