#include <cmath>
#include <numeric>
#include <sstream>

#include <catch2/catch.hpp>

#include "test/apps/graphs/graph_checks.h"
#include "test/apps/graphs/optimizer_run.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

struct Row {
  double update = 0, poses = 0, cpu_ms = 0, wall_ms = 0, cost = 0;
};

std::vector<Row> updates_of(const TempFolder& folder) {
  std::istringstream text(read_text(folder.path() / "out/updates.csv"));
  std::string line;
  std::getline(text, line);
  CHECK(line == "update,poses,cpu_ms,wall_ms,cost");
  std::vector<Row> rows;
  while (std::getline(text, line)) {
    Row row;
    char c = 0;
    std::istringstream fields(line);
    fields >> row.update >> c >> row.poses >> c >> row.cpu_ms >> c >> row.wall_ms >> c >> row.cost;
    CHECK(fields);
    rows.push_back(row);
  }
  return rows;
}

std::string pose_text(const Rigid3d& pose) {
  std::ostringstream text;
  text.precision(17);
  for (const int i : {4, 5, 6, 0, 1, 2, 3}) text << ' ' << pose.params[i];
  return text.str();
}

constexpr int kRing = 20;

// World_from_body on a circle, with edges from each to the one after the next and then to the next.
std::vector<Rigid3d> ring() {
  std::vector<Rigid3d> poses;
  for (int i = 0; i < kRing; ++i) {
    const double angle = 0.3 * i;
    poses.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())),
                     {std::cos(angle), std::sin(angle), 0}});
  }
  return poses;
}

// `noise` moves each measurement; the vertices but the first are anywhere.
std::string ring_text(const std::vector<Rigid3d>& truth, double noise) {
  Random random(34);
  std::ostringstream text;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    text << "VERTEX_SE3:QUAT " << i << pose_text(i == 0 ? truth[0] : random.rigid(3, 3)) << '\n';
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    for (const std::size_t step : {7, 2, 1}) {
      if (i < step) continue;
      const Rigid3d measured = inverse(truth[i - step]) * truth[i] * random.rigid(noise, noise);
      text << "EDGE_SE3:QUAT " << i - step << ' ' << i << pose_text(measured)
           << " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
    }
  }
  return text.str();
}

// The final cost, after a look at what every run must leave behind.
double run_incrementally(const fs::path& input, const TempFolder& folder, std::size_t updates) {
  const Outcome outcome =
      run_optimizer(folder, {input.string(), "--quiet", "--problem", "incremental"});
  CAPTURE(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(outcome.err.empty());
  const Json report = report_of(folder);
  const std::vector<Row> rows = updates_of(folder);
  REQUIRE(rows.size() == updates);
  double cpu_ms = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    CHECK(rows[i].update == static_cast<double>(i));
    CHECK(rows[i].poses == static_cast<double>(i + 1));
    CHECK(rows[i].wall_ms >= 0);
    CHECK(rows[i].cost >= 0);
    cpu_ms += rows[i].cpu_ms;
  }
  CHECK(report["problem"] == "incremental");
  CHECK(report["updates"]["count"] == updates);
  CHECK(report["updates"]["mean_cpu_ms"] ==
        Approx(cpu_ms / static_cast<double>(updates)).margin(1e-3));
  CHECK(report["updates"]["max_cpu_ms"] >= report["updates"]["mean_cpu_ms"]);
  const double cost = report["final_cost"];
  // The solver keeps measurements in single precision, right to 3e-5 px.
  CHECK(rows.back().cost == Approx(cost).epsilon(1e-6).margin(1e-15));
  return cost;
}

}  // namespace

TEST_CASE("map_optimizer incremental: poses start where their edges lead, whatever the file says") {
  const TempFolder folder;
  write_text(folder.path() / "ring.g2o", ring_text(ring(), 0));
  CHECK(run_incrementally("ring.g2o", folder, kRing) < 1e-20);
  for (const Row& row : updates_of(folder)) CHECK(row.cost < 1e-20);
  const GraphFile result = read_graph(folder.path() / "out/optimized.g2o");
  for (std::size_t i = 0; i < kRing; ++i) {
    CHECK((inverse(result.graph.frames[i].cam_from_world).translation() - ring()[i].translation())
              .norm() < 1e-9);
  }
  CHECK_FALSE(fs::exists(folder.path() / "out/optimized.tum"));
}

TEST_CASE("map_optimizer incremental: ends where the batch solution is") {
  const TempFolder folder;
  write_text(folder.path() / "ring.g2o", ring_text(ring(), 0.05));
  const double cost = run_incrementally("ring.g2o", folder, kRing);
  REQUIRE(run_optimizer(folder, {"ring.g2o", "--quiet", "--out", "batch"}).code == 0);
  const double batch = report_of(folder, "batch")["final_cost"];
  CHECK(batch > 1e-3);
  CHECK(cost == Approx(batch).epsilon(1e-3));
}

TEST_CASE("map_optimizer incremental: the stereo stream reaches the batch optimum") {
  const auto folder = shared_graphs();
  if (!folder) return;
  const TempFolder out;
  CHECK(run_incrementally(*folder / "stereo_seq/survey-150-stereo.seq", out, 150) ==
        Approx(29014.602).epsilon(1e-3));
  CHECK(report_of(out)["ate"]["position_m"]["rmse"] == Approx(0.00556).epsilon(0.05));
  CHECK(fs::exists(out.path() / "out/optimized.tum"));
  CHECK(fs::exists(out.path() / "out/optimized.seq"));
}

TEST_CASE("map_optimizer incremental: pose graphs reach their batch optima", "[slow]") {
  const auto folder = shared_graphs();
  if (!folder) return;
  const TempFolder out;
  CHECK(2 * run_incrementally(*folder / "g2o/sphere2500.g2o", out, 2500) ==
        Approx(1351.2157).epsilon(1e-3));
  CHECK(run_incrementally(*folder / "g2o/parking-garage.g2o", out, 1661) ==
        Approx(0.634192192).epsilon(1e-3));
}

}  // namespace hybrid_slam
