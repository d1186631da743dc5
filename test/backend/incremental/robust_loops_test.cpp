#include <algorithm>

#include "cameras/geometry/se3.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/support/pose_graphs.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// Of a pose's place, after a graph was streamed.
double worst_error(const TestPoseGraph& made, Loss loop_loss) {
  IncrementalOptions options;
  options.loop_loss = loop_loss;
  GraphFeed feed(made.graph, options);
  while (!feed.done()) feed.feed_next();
  double worst = 0;
  for (std::uint32_t i = 0; i < made.truth.size(); ++i) {
    const Eigen::Vector3d at = origin_in_a(feed.solver().pose(i));
    worst = std::max(worst, (at - origin_in_a(made.truth[i])).norm());
  }
  return worst;
}

TEST_CASE("false loops do not bend a streamed pose graph whose loops take a robust loss") {
  Random random(4);
  TestPoseGraph made = grid_pose_graph({7, 7, 1}, {0.02, 0.01}, random);
  for (GraphEdge& edge : made.graph.edges) {
    edge.loop = std::max(edge.a, edge.b) - std::min(edge.a, edge.b) > 1;
  }
  const double honest = worst_error(made, Loss::kCauchy);
  CHECK(honest < 0.3);
  GraphEdge wrong = made.graph.edges.front();
  wrong.loop = true;
  for (const auto& [a, b] : {std::pair(0U, 40U), std::pair(3U, 30U), std::pair(12U, 48U)}) {
    wrong.a = a;
    wrong.b = b;
    wrong.a_from_b = random.rigid(2, 1);
    made.graph.edges.push_back(wrong);
  }
  CHECK(worst_error(made, Loss::kNone) > 1);
  CHECK(worst_error(made, Loss::kCauchy) < honest + 0.05);
}

}  // namespace
}  // namespace hybrid_slam
