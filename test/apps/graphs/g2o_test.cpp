#include <catch2/catch.hpp>

#include "test/apps/graphs/graph_checks.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Three vertices, ids as they come, an edge before one of them, an information that is full.
constexpr const char* kSmall = R"(# a comment
VERTEX_SE3:QUAT 7 1 2 3 0 0 0 1
VERTEX_SE3:QUAT 3 2 2 3 0 0 0.6 0.8
EDGE_SE3:QUAT 7 3 1.1 0 0 0 0 0.6 0.8 10 1 0 0 0 0 20 0 0 0 0 30 0 0 0 40 2 0 50 0 60
EDGE_SE3:QUAT 11 7 -1 0.5 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1
VERTEX_SE3:QUAT 11 2 3 3 0 0 0 1.0001
)";

}  // namespace

TEST_CASE("g2o: what the numbers mean") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.g2o";
  write_text(path, kSmall);
  const GraphFile file = read_graph(path);
  CHECK(file.format == GraphFormat::kG2o);
  CHECK(file.frame_names == std::vector<std::string>{"7", "3", "11"});
  REQUIRE(file.graph.edges.size() == 2);
  CHECK(file.graph.frames[0].fixed);
  CHECK_FALSE(file.graph.frames[1].fixed);
  CHECK(inverse(file.graph.frames[1].cam_from_world)
            .translation()
            .isApprox(Eigen::Vector3d(2, 2, 3), 1e-15));
  const GraphEdge& edge = file.graph.edges[0];
  CHECK(edge.a == 0);
  CHECK(edge.b == 1);
  CHECK_FALSE(edge.loop);
  CHECK(edge.information(0, 1) == 1);
  CHECK(edge.information(1, 0) == 1);
  CHECK(edge.information(3, 4) == 2);
  CHECK(edge.information(5, 5) == 60);
  CHECK(file.graph.edges[1].a == 2);
  CHECK(file.graph.edges[1].loop);
  // By hand: edge 0 is off by 0.1 along the axis x of vertex 7, which the turn of the measurement
  // takes to (0.28, -0.96) 0.1 in vertex 3's; edge 1 by (0, -1.5, 0).
  const double x = 0.028, y = -0.096;
  const double first = 10 * x * x + 2 * x * y + 20 * y * y;
  CHECK(reference_cost(file.graph) == Approx(0.5 * (first + 2.25)).epsilon(1e-12));
  check_round_trip(path);
}

TEST_CASE("g2o: FIX takes the place of the first vertex") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.g2o";
  write_text(path, std::string("FIX 3 11\n") + kSmall);
  const GraphFile file = read_graph(path);
  CHECK_FALSE(file.graph.frames[0].fixed);
  CHECK(file.graph.frames[1].fixed);
  CHECK(file.graph.frames[2].fixed);
  check_round_trip(path);
}

TEST_CASE("g2o: what is refused") {
  check_faults(
      "small.g2o", kSmall,
      {{"a plane vertex", "VERTEX_SE3:QUAT 3 2 2 3 0 0 0.6 0.8", "VERTEX_SE2 3 2 2 0.5",
        ":3: \"VERTEX_SE2\" is not supported"},
       {"a plane edge", "EDGE_SE3:QUAT 7 3 1.1", "EDGE_SE2 7 3 1.1",
        ":4: \"EDGE_SE2\" is not supported"},
       {"no such vertex", "EDGE_SE3:QUAT 11 7", "EDGE_SE3:QUAT 12 7", ":5: there is no vertex 12"},
       {"nothing of this name to fix", "# a comment", "FIX 8", ":1: there is no vertex 8"},
       {"FIX without a name", "# a comment", "FIX", ":1: vertex is missing"},
       {"the same id twice", "QUAT 11 2 3 3", "QUAT 7 2 3 3", ":6: vertex 7 is there already"},
       {"an edge to itself", "EDGE_SE3:QUAT 11 7", "EDGE_SE3:QUAT 7 7", ":5: the edge joins a"},
       {"NaN", "1.1 0 0", "1.1 nan 0", ":4: \"nan\" is not finite"},
       {"NaN in the information", "40 2 0", "40 nan 0", ":4: \"nan\" is not finite"},
       {"information missing", " 50 0 60", " 50 0", ":4: one of the 21 numbers"},
       {"truncated", "1 0 0 1 0 1\nVERTEX_SE3:QUAT 11 2 3 3 0 0 0 1.0001", "1 0", ":5: one of the"},
       {"too many numbers", " 50 0 60", " 50 0 60 1", ":4: expected the end of the line"},
       {"not positive definite", "10 1 0 0 0 0 20", "10 15 0 0 0 0 20", ":4: the information is"},
       {"no rotation", "0 0 0.6 0.8\nEDGE", "0 0 0 0\nEDGE", ":3: the quaternion is not of unit"},
       {"a name that is no number", "QUAT 11 2 3 3", "QUAT b 2 3 3", ":6: vertex: \"b\""},
       {"a negative name", "QUAT 11 2 3 3", "QUAT -1 2 3 3", ":6: vertex: \"-1\""},
       {"no vertices", kSmall, "# nothing\n\n", ": is empty"},
       {"a fix alone", kSmall, "FIX\n", ":1: vertex is missing"}});
}

TEST_CASE("g2o: published graphs") {
  const auto folder = shared_graphs();
  if (!folder) return;
  struct Graph {
    const char* name;
    std::size_t vertices, edges;
  };
  for (const Graph& graph : {Graph{"sphere2500", 2500, 4949}, Graph{"torus3D", 5000, 9048},
                             Graph{"parking-garage", 1661, 6275}, Graph{"smallGrid3D", 125, 297}}) {
    CAPTURE(graph.name);
    const fs::path path = *folder / "g2o" / (std::string(graph.name) + ".g2o");
    const GraphFile file = read_graph(path);
    CHECK(file.graph.frames.size() == graph.vertices);
    CHECK(file.graph.edges.size() == graph.edges);
    CHECK(file.graph.frames.front().fixed);
    check_round_trip(path);
  }
}

}  // namespace hybrid_slam
