#pragma once
// Photos and the pairs that connect them: groups, and which pairs to keep.

#include <utility>
#include <vector>

namespace roomtex {

struct GraphEdge {
  int node1 = 0, node2 = 0;
  double weight = 0;  // larger = stronger
};

// Sets of nodes that grow together.
class DisjointSets {
 public:
  explicit DisjointSets(int num_nodes);
  int Find(int node);               // the set's smallest node
  int SizeOf(int node) const;       // of the set whose smallest node this is
  bool Join(int node1, int node2);  // false if they were joined before
  // Each ascending; the largest first, equal ones by their first node.
  std::vector<std::vector<int>> Groups();

 private:
  std::vector<int> parent_, size_;
};

// Positions in `edges`, ascending, of those to keep: per node its strongest ones and, for as many
// again, an even choice of the weaker ones (other views of the same, which close loops and have
// long baselines), max_per_node together; and a spanning forest of the strongest (Kruskal), so that
// nothing falls apart. A node may have more, because others asked for it.
std::vector<int> SparseEdges(int num_nodes, const std::vector<GraphEdge>& edges, int max_per_node);

// Sets of nodes that a single edge connects to the rest of what they belong to, each ascending:
// cutting it would cut them off, so no loop leads through them. The ends of a chain are two. edges:
// no pair of nodes twice.
std::vector<std::vector<int>> LooseEnds(int num_nodes,
                                        const std::vector<std::pair<int, int>>& edges);

}  // namespace roomtex
