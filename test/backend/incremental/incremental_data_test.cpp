#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>

#include "apps/io/graphs/g2o.h"
#include "apps/io/graphs/stereo_stream.h"
#include "backend/problem/solve_graph.h"
#include "test/backend/incremental/graph_feed.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

std::optional<std::string> shared_graphs() {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data != nullptr) return std::string(data) + "/graphs/";
  std::puts("SKIPPED: HYBRID_SLAM_DATA is not set");
  return std::nullopt;
}

// The cost after the last update, in the order of the file.
double streamed_cost(const FactorGraph& graph) {
  GraphFeed feed(graph, {});
  while (!feed.done()) feed.feed_next();
  return cost(feed.solver().graph());
}

TEST_CASE("survey-150-stereo, streamed: the batch optimum") {
  const auto graphs = shared_graphs();
  if (!graphs) return;
  const double streamed =
      streamed_cost(read_stereo_stream(*graphs + "stereo_seq/survey-150-stereo.seq").graph);
  CHECK(streamed == Approx(29014.602).epsilon(1e-3));
}

// 2 * cost of the optima, in the residual (t, 2 vec(q)).

TEST_CASE("sphere2500, streamed: the batch optimum", "[slow]") {
  const auto graphs = shared_graphs();
  if (!graphs) return;
  const double streamed = streamed_cost(read_g2o(*graphs + "g2o/sphere2500.g2o").graph);
  CHECK(2 * streamed == Approx(1351.2157).epsilon(1e-3));
}

TEST_CASE("parking-garage, streamed: the batch optimum", "[slow]") {
  const auto graphs = shared_graphs();
  if (!graphs) return;
  const double streamed = streamed_cost(read_g2o(*graphs + "g2o/parking-garage.g2o").graph);
  CHECK(2 * streamed == Approx(1.2683844).epsilon(1e-3));
}

}  // namespace
}  // namespace hybrid_slam
