#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>

#include "apps/pose_graph/solve_pose_graph.h"
#include "backend/problem/solve_graph.h"
#include "test/apps/graphs/graph_checks.h"
#include "test/support/shared_cases.h"
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
        ":3: one file holds items of a plane and of space"},
       {"a plane edge", "EDGE_SE3:QUAT 7 3 1.1", "EDGE_SE2 7 3 1.1",
        ":4: one file holds items of a plane and of space"},
       {"another kind", "EDGE_SE3:QUAT 7 3 1.1", "EDGE_BEARING_SE2_XY 7 3 1.1",
        ":4: \"EDGE_BEARING_SE2_XY\" is not supported: VERTEX_SE3:QUAT"},
       {"a prior of no vertex", "# a comment",
        "EDGE_SE3_PRIOR 8 0 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 "
        "0 0 1 0 0 0 1 0 0 1 0 1",
        "there is no "},
       {"decimal commas", "# a comment", "VERTEX_SE3:QUAT 1 0,5 1,0 0,0 0,0 0,0 0,0 1,0",
        ":1: decimal commas"},
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
       {"no rotation", "0 0 0.6 0.8\nEDGE", "0 0 0 0\nEDGE", ":3: the quaternion is not of unit"},
       {"a name that is no number", "QUAT 11 2 3 3", "QUAT b 2 3 3", ":6: vertex: \"b\""},
       {"a negative name", "QUAT 11 2 3 3", "QUAT -1 2 3 3", ":6: vertex: \"-1\""},
       {"no vertices", kSmall, "# nothing\n\n", ": is empty"},
       {"a fix alone", kSmall, "FIX\n", ":1: vertex is missing"}});
}

namespace {

// One warning that holds this.
void check_warning(const GraphFile& file, const std::string& part) {
  REQUIRE(file.warnings.size() == 1);
  INFO(file.warnings[0]);
  CHECK(file.warnings[0].find(part) != std::string::npos);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace

TEST_CASE("g2o: what is below zero in an information is cut") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.g2o";
  // (10 15; 15 20) has the eigenvalues 15 -+ sqrt(250).
  write_text(path, replaced(kSmall, "10 1 0 0 0 0 20", "10 15 0 0 0 0 20"));
  const GraphFile file = read_graph(path);
  check_warning(file,
                "1 of 2 informations have eigenvalues below zero, which are cut (worst in "
                "line 4: -0.811 beside 60)");
  const Eigen::Matrix2d block = file.graph.edges[0].information.topLeftCorner<2, 2>();
  CHECK(std::abs(block.determinant()) < 1e-12);
  CHECK(block.trace() == Approx(15 + std::sqrt(250.0)));
  CHECK(file.graph.edges[0].information(5, 5) == Approx(60));
  CHECK(file.graph.validate() == "");
  check_round_trip(path);

  write_text(path, replaced(kSmall, "40 2 0 50 0 60", "40 2 0 50 0 0"));
  check_warning(read_graph(path), "1 of 2 informations are singular");
  CHECK(read_graph(path).graph.validate() == "");
  check_round_trip(path);
}

TEST_CASE("g2o: each part of a graph is held once") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.g2o";
  const std::string apart = "VERTEX_SE3:QUAT 20 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 21 9 0 0 0 0 0 1\n";
  write_text(path, kSmall + apart);
  const GraphFile file = read_graph(path);
  check_warning(file, "3 parts that no edge joins, 3 of 5 vertices in the largest");
  std::string fixed;
  for (const GraphFrame& frame : file.graph.frames) fixed += frame.fixed ? '1' : '0';
  CHECK(fixed == "10011");
  check_round_trip(path);
}

TEST_CASE("g2o: quaternions off unit length are normalised, with a warning") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.g2o";
  write_text(path, replaced(kSmall, "2 2 3 0 0 0.6 0.8", "2 2 3 0 0 0.63 0.84"));
  const GraphFile file = read_graph(path);
  check_warning(file,
                "1 quaternions are not of unit length and are normalised (worst in line 3: 5.0 %");
  CHECK(inverse(file.graph.frames[1].cam_from_world).rotation().z() == Approx(0.6));
}

TEST_CASE("g2o: a plane is solved in space and written as a plane") {
  const TempFolder folder;
  const fs::path path = folder.path() / "plane.g2o";
  write_text(path,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.1 0.2 1.5\nVERTEX_XY 5 1 2.2\nFIX 0\n"
             "EDGE_SE2 0 1 1 0 1.5 500 3 0 400 0 5000\n"
             "EDGE_SE2_XY 0 5 1 2 100 5 200\nEDGE_SE2_XY 1 5 2 0 100 0 100\n");
  const GraphFile file = read_graph(path);
  REQUIRE(file.graph.edges.size() == 1);
  REQUIRE(file.graph.factors.size() == 2);
  CHECK(file.point_ids == std::vector<std::uint64_t>{5});
  CHECK(file.graph.validate() == "");
  // By hand: the edge is off by (0.1, 0.2) in frame 1, which is turned by 1.5.
  const Eigen::Vector2d e = Eigen::Rotation2Dd(-1.5) * Eigen::Vector2d(0.1, 0.2);
  const double edge = 500 * e.x() * e.x() + 6 * e.x() * e.y() + 400 * e.y() * e.y();
  const double first = 200 * 0.04;
  const Eigen::Vector2d seen = Eigen::Rotation2Dd(-1.5) * Eigen::Vector2d(-0.1, 2.0);
  const double second = 100 * (seen - Eigen::Vector2d(2, 0)).squaredNorm();
  CHECK(cost(file.graph) == Approx(0.5 * (edge + first + second)).epsilon(1e-9));
  FactorGraph solved = file.graph;
  ProblemOptions options;
  options.rounds.assign(1, {50, Loss::kNone, 1e-12});
  CHECK(solve_graph(solved, options).final_cost < 0.1 * cost(file.graph));
  const std::string text = read_text(file.writers[0].write(solved, folder.path() / ""));
  CHECK(text.find("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 ") == 0);
  CHECK(text.find("\nVERTEX_XY 5 ") != std::string::npos);
  CHECK(text.find("\nEDGE_SE2 0 1 1 0 1.5 500 3 0 400 0 5000\n") != std::string::npos);
  CHECK(cost(read_graph(folder.path() / "optimized.g2o").graph) ==
        Approx(cost(solved)).epsilon(1e-9));
}

TEST_CASE("g2o: landmarks and priors in space") {
  const TempFolder folder;
  const fs::path path = folder.path() / "landmarks.g2o";
  // A sensor 0.5 to the side of its body and turned by 90 degrees about z.
  const Rigid3d offset(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ())),
                       {0, 0.5, 0});
  const Rigid3d body(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX())),
                     {1, 2, 3});
  const Eigen::Vector3d point(2, 3, 5);
  const Eigen::Vector3d seen = inverse(body * offset) * point;
  const auto pose = [](const Rigid3d& p) {
    const auto q = p.rotation();
    const auto t = p.translation();
    std::ostringstream text;
    text.precision(17);
    text << t.x() << ' ' << t.y() << ' ' << t.z() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z()
         << ' ' << q.w();
    return text.str();
  };
  std::ostringstream text;
  text.precision(17);
  text << "PARAMS_SE3OFFSET 3 " << pose(offset) << "\nVERTEX_SE3:QUAT 1 " << pose(body)
       << "\nVERTEX_TRACKXYZ 2 2 3 5\nEDGE_SE3_TRACKXYZ 1 2 3 " << seen.x() + 0.1 << ' ' << seen.y()
       << ' ' << seen.z() << " 100 0 0 100 0 100\nEDGE_SE3_PRIOR 1 3 " << pose(body * offset)
       << " 4 0 0 0 0 0 9 0 0 0 0 16 0 0 0 1 0 0 2 0 3\n";
  write_text(path, text.str());
  const GraphFile file = read_graph(path);
  CHECK(file.warnings.empty());
  CHECK(file.frame_names == std::vector<std::string>{"world", "1"});
  CHECK(file.graph.frames[0].fixed);
  CHECK_FALSE(file.graph.frames[1].fixed);
  CHECK(cost(file.graph) == Approx(0.5 * 100 * 0.01).epsilon(1e-9));
  // The body 0.1 along its axis y is the sensor 0.1 along its axis x.
  FactorGraph moved = file.graph;
  moved.factors.clear();
  moved.frames[1].cam_from_world =
      inverse(body * Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0.1, 0)));
  CHECK(cost(moved) == Approx(0.5 * 4 * 0.01).epsilon(1e-9));
  // A turn of 0.01 about the body's z takes the sensor along; the information sees it as exactly.
  moved.frames[1].cam_from_world =
      inverse(body * Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitZ())),
                             {0, 0, 0}));
  CHECK(cost(moved) == Approx(0.5 * (3e-4 + 9 * 0.25e-4)).epsilon(0.02));
  const std::string written = read_text(file.writers[0].write(file.graph, folder.path() / ""));
  CHECK(written.find("world") == std::string::npos);
  CHECK(written.find("EDGE_SE3_PRIOR 1 3 ") != std::string::npos);
  CHECK(cost(read_graph(folder.path() / "optimized.g2o").graph) == Approx(0.5).epsilon(1e-9));
}

TEST_CASE("g2o: the cases as their users had them") {
  const auto cases = shared_cases("g2o");
  if (!cases) return;
  CHECK(refusal(*cases / "comma.g2o").find("decimal commas") != std::string::npos);
  CHECK(cost(read_graph(*cases / "crlf_bom.g2o").graph) ==
        cost(read_graph(*cases / "good.g2o").graph));
  check_warning(read_graph(*cases / "disconnected.g2o"), "2 parts that no edge joins");
  check_warning(read_graph(*cases / "zero_rotation.g2o"), "1 of 3 informations are singular");
  for (const char* const name : {"se2.g2o", "zero_rotation.g2o", "huge_ratio.g2o"}) {
    INFO(name);
    GraphFile file = read_graph(*cases / name);
    CHECK(solve_pose_graph(file.graph, {}).summary.final_cost < 1e-3);
    check_round_trip(*cases / name);
  }
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

TEST_CASE("g2o: cubicle converges from every start, intel to GTSAM's cost") {
  const auto folder = shared_graphs();
  if (!folder) return;
  const auto solved = [&](const char* name, PoseGraphStart start) {
    GraphFile file = read_graph(*folder / "g2o" / name);
    PoseGraphOptions options;
    options.starts = {start};
    return solve_pose_graph(file.graph, options).summary.final_cost;
  };
  check_warning(read_graph(*folder / "g2o/cubicle.g2o"), "5021 of 16869 informations");
  const double chordal = solved("cubicle.g2o", PoseGraphStart::kRotations);
  CHECK(chordal == Approx(1361.28884).epsilon(1e-6));
  CHECK(solved("cubicle.g2o", PoseGraphStart::kGiven) == Approx(chordal).epsilon(1e-6));
  CHECK(solved("cubicle.g2o", PoseGraphStart::kTree) == Approx(chordal).epsilon(1e-6));
  // GTSAM 4.3.0: 22.502117. Ours has 2 sin(theta / 2) for theta.
  CHECK(solved("intel.g2o", PoseGraphStart::kRotations) == Approx(22.502117).epsilon(3e-5));
}

}  // namespace hybrid_slam
