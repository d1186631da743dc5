#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>

#include "apps/io/graphs/g2o.h"
#include "apps/pose_graph/solve_pose_graph.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// The optimum's 2 * cost and its isotropic objective; none without the shared data.
struct Optimum {
  double chi2 = 0;
  double isotropic = 0;
};

std::optional<Optimum> solve_file(const std::string& name) {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::puts("SKIPPED: HYBRID_SLAM_DATA is not set");
    return std::nullopt;
  }
  FactorGraph graph = read_g2o(std::string(data) + "/graphs/g2o/" + name).graph;
  solve_pose_graph(graph, {});
  return Optimum{2 * cost(graph), isotropic_objective(graph)};
}

// Certified optima of the isotropic objective: SE-Sync (Rosen et al., IJRR 2019).

TEST_CASE("torus3D: the certified optimum from the file's own start") {
  const auto optimum = solve_file("torus3D.g2o");
  if (!optimum) return;
  CHECK(optimum->isotropic == Approx(24227.05).epsilon(1e-6));
}

TEST_CASE("sphere2500: the optimum of its anisotropic information") {
  const auto optimum = solve_file("sphere2500.g2o");
  if (!optimum) return;
  CHECK(optimum->chi2 == Approx(1351.2157).epsilon(1e-6));
}

TEST_CASE("parking-garage and smallGrid3D: near the certified optimum") {
  const auto garage = solve_file("parking-garage.g2o");
  const auto grid = solve_file("smallGrid3D.g2o");
  if (!garage || !grid) return;
  CHECK(garage->chi2 == Approx(1.2683844).epsilon(1e-6));
  CHECK(garage->isotropic < 1.2675);
  CHECK(grid->isotropic < 1025.41);
}

}  // namespace
}  // namespace hybrid_slam
