// graph_score FILE...: what a graph's estimate costs, whoever computed it. One line of JSON per
// file, as `map_optimizer` reads it: half the squared whitened residuals, the same twice, and
// SE-Sync's objective of its edges.

#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/io/graphs/graph_file.h"
#include "apps/pose_graph/pose_graph_start.h"
#include "backend/problem/solve_graph.h"

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  try {
    for (int i = 1; i < argc; ++i) {
      const FactorGraph graph = read_graph(argv[i]).graph;
      const double half = cost(graph);
      const nlohmann::ordered_json score = {{"file", argv[i]},
                                            {"cost", half},
                                            {"chi2", 2 * half},
                                            {"se_sync", isotropic_objective(graph)}};
      std::puts(score.dump().c_str());
    }
  } catch (const InputError& error) {
    std::fprintf(stderr, "graph_score: %s\n", error.what());
    return 3;
  }
  return 0;
}
