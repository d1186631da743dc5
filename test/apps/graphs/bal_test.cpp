#include <fstream>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "test/apps/graphs/graph_checks.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Two cameras, three points, five observations.
constexpr const char* kSmall = R"(2 3 5
0 0 -100.5 20.25
0 1 3.5e1 -7
0 2 12 13
1 0 -90 25
1 2 14 11.5
0.1 -0.2 0.3
1 2 -3
500 -0.1 0.01
0 0 0
-1 0.5 -4
510 -1e-7 2e-13
1 0.1 -10
2 0.2 -11
3 0.3 -12
)";

// From the numbers of the file alone, with the equations of its authors.
double cost_of_raw_numbers(const fs::path& path) {
  std::ifstream file(path);
  std::size_t cameras = 0, points = 0, observations = 0;
  file >> cameras >> points >> observations;
  std::vector<std::size_t> camera(observations), point(observations);
  std::vector<double> measured(2 * observations), c(9 * cameras), p(3 * points);
  for (std::size_t i = 0; i < observations; ++i) {
    file >> camera[i] >> point[i] >> measured[2 * i] >> measured[2 * i + 1];
  }
  for (double& x : c) file >> x;
  for (double& x : p) file >> x;
  REQUIRE(file);
  double sum = 0;
  for (std::size_t i = 0; i < observations; ++i) {
    const double* values = &c[9 * camera[i]];
    const Eigen::Vector3d axis(values[0], values[1], values[2]);
    const double angle = axis.norm();
    Eigen::Vector3d x(p[3 * point[i]], p[3 * point[i] + 1], p[3 * point[i] + 2]);
    if (angle > 0) x = Eigen::AngleAxisd(angle, axis / angle) * x;
    x += Eigen::Vector3d(values[3], values[4], values[5]);
    const Eigen::Vector2d n = -x.head<2>() / x[2];
    const double r2 = n.squaredNorm();
    const Eigen::Vector2d projected = values[6] * (1 + values[7] * r2 + values[8] * r2 * r2) * n;
    sum += (projected - Eigen::Vector2d(measured[2 * i], measured[2 * i + 1])).squaredNorm();
  }
  return sum / 2;
}

}  // namespace

TEST_CASE("BAL: what the numbers mean") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.txt";
  write_text(path, kSmall);
  const GraphFile file = read_graph(path);
  CHECK(file.format == GraphFormat::kBal);
  REQUIRE(file.graph.frames.size() == 2);
  REQUIRE(file.graph.cameras.size() == 2);
  REQUIRE(file.graph.points.size() == 3);
  REQUIRE(file.graph.observations.size() == 5);
  CHECK(file.graph.frames[0].fixed);
  CHECK_FALSE(file.graph.frames[1].fixed);
  CHECK(file.graph.cameras[1].refined == 0b111);
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(file.graph.frames[0].cam_from_world.rotation()));
  CHECK((turn.angle() * turn.axis() - Eigen::Vector3d(0.1, -0.2, 0.3)).norm() < 1e-15);
  CHECK(file.graph.frames[1].cam_from_world.translation() == Eigen::Vector3d(-1, 0.5, -4));
  CHECK(std::get<Calibrated<Bal>>(file.graph.cameras[1].camera).params ==
        std::array<double, 3>{510, -1e-7, 2e-13});
  CHECK(file.graph.points[2].in_world == Eigen::Vector3d(3, 0.3, -12));
  CHECK(file.graph.observations[1].point == 1);
  CHECK(file.graph.observations[1].measurement.head<2>() == Eigen::Vector2d(35, -7));
  CHECK(reference_cost(file.graph) == Approx(cost_of_raw_numbers(path)).epsilon(1e-13));
  check_round_trip(path);
}

TEST_CASE("BAL: line ends and white space are free") {
  const TempFolder folder;
  const fs::path path = folder.path() / "small.txt";
  write_text(path, kSmall);
  const double cost = reference_cost(read_graph(path).graph);
  std::string text = kSmall;
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 3) {
    text.replace(at, 1, " \r\n");
  }
  write_text(path, text + "\n\n");
  CHECK(reference_cost(read_graph(path).graph) == cost);
}

TEST_CASE("BAL: what is refused") {
  check_faults(
      "small.txt", kSmall,
      {{"truncated", "3 0.3 -12\n", "3 0.3\n", ":16: point is missing"},
       {"truncated in a camera", "510 -1e-7 2e-13\n1 0.1 -10\n2 0.2 -11\n3 0.3 -12\n", "510 -1",
        "camera's f, k1, k2 is missing"},
       {"NaN", "-100.5", "nan", ":2: \"nan\" is not finite"},
       {"infinite", "-0.1 0.01", "-0.1 1e999", ":9: "},
       {"no number", "12 13", "12 x", ":4: \"x\" is not a number"},
       {"camera out of range", "1 2 14", "2 2 14", ":6: observation's camera: 2 is above 1"},
       {"point out of range", "1 2 14", "1 3 14", ":6: observation's point: 3 is above 2"},
       {"negative index", "1 2 14", "1 -2 14", ":6: observation's point: \"-2\" is not a whole"},
       {"observed twice", "1 2 14", "1 0 14", ":6: camera 1 observes point 0 twice"},
       {"absurd observations", "2 3 5", "2 3 4000000000", ":1: promises 4000000000 observations"},
       {"absurd points", "2 3 5", "2 4000000000 5", ":1: promises 4000000000 points"},
       {"absurd cameras", "2 3 5", "4000000000 3 5", ":1: promises 4000000000 cameras"},
       {"a count beyond 32 bits", "2 3 5", "2 3 99999999999", ":1: number of observations"},
       {"a count beyond 64 bits", "2 3 5", "2 3 99999999999999999999", ":1: number of obs"},
       {"a count too large", "2 3 5", "2 3 6", ":7: observation's camera: \"0.1\""},
       {"a count too small", "2 3 5", "2 2 4", ":4: observation's point: 2 is above 1"},
       {"no cameras", "2 3 5", "0 3 5", ":1: there are no cameras"},
       {"no points", "2 3 5", "2 0 5", ":2: an observation, but there are no points"},
       {"trailing rubbish", "3 0.3 -12\n", "3 0.3 -12\nmore", ":16: expected the end of the file"},
       {"empty", kSmall, "", ": is empty"},
       {"blank", kSmall, "\n \n", ": is empty"},
       {"another kind", "2 3 5", "hello", ":1: \"hello\" begins no kind of graph"}});
}

TEST_CASE("BAL: a missing file, a folder and a pipe of no known kind are refused") {
  const TempFolder folder;
  CHECK_THAT(refusal(folder.path() / "nowhere.txt"), Catch::Contains("no such file"));
  CHECK_THAT(refusal("/dev/null"), Catch::Contains("cannot be read"));
}

TEST_CASE("BAL: initial costs of published problems") {
  const auto folder = shared_graphs();
  if (!folder) return;
  for (const char* const name :
       {"trafalgar-21-11315-pre.txt", "survey-150-pre.txt", "problem-49-7776-pre.txt"}) {
    CAPTURE(name);
    const fs::path path = *folder / "bal" / name;
    const GraphFile file = read_graph(path);
    CHECK(reference_cost(file.graph) == Approx(cost_of_raw_numbers(path)).epsilon(1e-12));
    check_round_trip(path);
  }
  // As Ceres' own example prints it, every observation counted.
  CHECK(cost_of_raw_numbers(*folder / "bal/problem-49-7776-pre.txt") ==
        Approx(850912.46).epsilon(1e-8));
}

}  // namespace hybrid_slam
