#include <fstream>
#include <sstream>
#include <string>

#include "test/support/random.h"

#include <catch2/catch.hpp>

// [snippet]
#include <ceres/autodiff_cost_function.h>

#include "backend/incremental/incremental_solver.h"

using namespace hybrid_slam;

// A beacon on the seafloor, whose distance from the camera an acoustic modem measures.
struct BeaconRange {
  double range, sigma;  // [m]
  template <typename T>
  bool operator()(const T* pose, const T* beacon, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(pose);  // of cam_from_world: x y z w
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(pose + 4), at(beacon);
    residual[0] = ((q * at + t).norm() - T(range)) / T(sigma);
    return true;
  }
};

std::uint32_t add_beacon(IncrementalSolver& solver, const Eigen::Vector3d& guess) {
  GraphBlock beacon;
  beacon.values = guess;
  return solver.add_block(beacon);
}

void add_range(IncrementalSolver& solver, std::uint32_t pose, std::uint32_t beacon, double range) {
  GraphFactor factor;
  factor.function = std::make_shared<ceres::AutoDiffCostFunction<BeaconRange, 1, 7, 3>>(
      new BeaconRange{range, 0.1});
  factor.variables = {pose_variable(pose), block_variable(beacon)};
  factor.loss = Loss::kHuber;
  factor.threshold = 3.84;  // 95 % of one dimension
  solver.add_factor(factor);
}
// [snippet]

namespace {

std::string read_text(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST_CASE("adding a factor: what docs/adding_a_factor.md shows is what is compiled here") {
  const std::string mark = "// [snippet]\n";
  const std::string folder = SOURCE_FOLDER;
  const std::string own = read_text(folder + "/test/backend/mixed_graphs/adding_a_factor_test.cpp");
  const std::size_t from = own.find(mark) + mark.size();
  const std::string snippet = own.substr(from, own.find(mark, from) - from);
  REQUIRE(snippet.size() > 1000);
  CHECK(read_text(folder + "/docs/adding_a_factor.md").find("```cpp\n" + snippet + "```") !=
        std::string::npos);
}

TEST_CASE("adding a factor: the beacon of docs/adding_a_factor.md is found") {
  Random random(3);
  const Eigen::Vector3d truth(1, 2, 6);
  IncrementalSolver solver({});
  const std::uint32_t beacon = add_beacon(solver, truth + Eigen::Vector3d(1, -1, 0.5));
  std::vector<Rigid3d> poses;
  for (std::uint32_t i = 0; i < 40; ++i) {
    poses.push_back(random.rigid(4, 3));
    solver.add_pose({poses.back(), GraphFrame::kNoCamera, true});
    add_range(solver, i, beacon, (poses.back() * truth).norm() + 0.1 * random.gaussian());
    solver.update();
  }
  // 40 ranges of 0.1 m from all around: a few centimetres.
  CHECK((solver.block(beacon) - truth).norm() < 0.1);
  // A range that is wrong by far is outvoted.
  add_range(solver, 0, beacon, (poses[0] * truth).norm() + 30);
  for (int i = 0; i < 5; ++i) solver.update();
  CHECK((solver.block(beacon) - truth).norm() < 0.15);
}

}  // namespace
