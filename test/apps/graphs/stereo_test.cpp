#include <limits>

#include <catch2/catch.hpp>

#include "test/apps/graphs/graph_checks.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Camera 8 sits 1 m to the right of camera 2 and is turned by 90 degrees about z.
const TextFiles kStereoGraph{
    {"VO_calibration.txt", "500 500 0 320 240 0.2\n"},
    {"VO_camera_poses_x.txt",
     "2 1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n8 0 -1 0 1  1 0 0 0  0 0 1 0  0 0 0 1\n"},
    {"VO_stereo_factors_x.txt",
     "2 50 420 400 240 1 0 5\n8 50 320 300 240 0.5 0 5\n8 3 320 295 250 0 0.1 4\n"}};

constexpr const char* kStream =
    R"(CAM 500 320 240 0.2 SIGMA_PX 0.5 ODO_SIGMA_ROT 0.001 ODO_SIGMA_T 0.01 NKF 3 NLM 10 NOBS 5
KF 0 GT 1 2 3 0 0 0 1 N 2
7 420 400 240
4 320 330 260
KF 1 GT 2 2 3 0 0 0 1 ODO 1.1 0 0 0 0 0 1 N 2
4 320 310 250
7 320 300 240
KF 5 GT 2 2 3 0 0 0.6 0.8 ODO 0 0 0 0 0 0.6 0.8 N 1
9 1 0 2
)";

}  // namespace

TEST_CASE("Stereo graph: what the numbers mean") {
  const TempFolder folder;
  for (const auto& [name, text] : kStereoGraph) write_text(folder.path() / name, text);
  const GraphFile file = read_graph(folder.path());
  CHECK(file.format == GraphFormat::kStereoGraph);
  const FactorGraph& graph = file.graph;
  REQUIRE(graph.frames.size() == 2);
  REQUIRE(graph.points.size() == 2);
  REQUIRE(graph.observations.size() == 3);
  CHECK(std::get<Calibrated<RectifiedStereo>>(graph.cameras.at(0).camera).params ==
        std::array<double, 5>{500, 500, 320, 240, 0.2});
  CHECK(graph.cameras[0].refined == 0);
  CHECK(graph.frames[0].fixed);
  CHECK_FALSE(graph.frames[1].fixed);
  CHECK(file.frame_names == std::vector<std::string>{"2", "8"});
  CHECK(file.point_ids == std::vector<std::uint64_t>{50, 3});
  CHECK(graph.observations[0].measurement == Eigen::Vector3d(420, 240, 400));  // u_left v u_right
  CHECK(graph.points[0].in_world == Eigen::Vector3d(1, 0, 5));  // by the first of its factors
  // (0, 0.1, 4) of camera 8 lies at its (-0.1, 0) beside (1, 0).
  CHECK(graph.points[1].in_world.isApprox(Eigen::Vector3d(0.9, 0, 4), 1e-15));
  // Exact but for the last: it projects to v = 252.5.
  CHECK(reference_cost(graph) == Approx(0.5 * 2.5 * 2.5).epsilon(1e-12));
  check_round_trip(folder.path());
  check_round_trip(folder.path() / "VO_stereo_factors_x.txt");
}

TEST_CASE("Stereo graph: its own calibration comes before the common one") {
  const TempFolder folder;
  for (const auto& [name, text] : kStereoGraph) write_text(folder.path() / name, text);
  write_text(folder.path() / "VO_calibration_x.txt", "600 600 0 320 240 0.3\n");
  CHECK(focal_length(read_graph(folder.path()).graph.cameras[0].camera) == 600);
}

TEST_CASE("Stereo graph: what is refused") {
  check_faults(kStereoGraph, "VO_calibration.txt", "",
               {{"skew", "500 500 0", "500 500 1", "calibration.txt:1: a skew is not supported"},
                {"no baseline", "0.2", "0", ":1: the baseline must be positive"},
                {"no focal length", "500 500 0", "-500 500 0", ":1: the focal length must"},
                {"NaN", "0.2", "nan", ":1: \"nan\" is not finite"},
                {"truncated", " 0.2", "", ":1: one of fx fy s cx cy baseline is missing"},
                {"trailing rubbish", "0.2\n", "0.2\nmore\n", ":2: expected the end of the file"}});
  check_faults(
      kStereoGraph, "VO_camera_poses_x.txt", "VO_stereo_factors_x.txt",
      {{"the same id", "8 0 -1", "2 0 -1", "poses_x.txt:2: pose 2 is there already"},
       {"truncated", "0 0 1 0  0 0 0 1\n8", "0 0 1 0  0 0\n8", ":1: one of the 16 numbers is"},
       {"NaN", "2 1 0 0 0", "2 1 0 0 nan", ":1: \"nan\" is not finite"},
       {"no rotation", "8 0 -1 0 1", "8 0 -2 0 1", ":2: the 3x3 part is not a rotation"},
       {"no pose", "0 0 0 1\n8", "0 0 0 2\n8", ":1: the last row is not 0 0 0 1"},
       {"trailing rubbish", "0 0 0 1\n8", "0 0 0 1 9\n8", ":1: expected the end of the line"},
       {"a pose missing", "8 0 -1 0 1  1 0 0 0  0 0 1 0  0 0 0 1\n", "",
        "factors_x.txt:2: there is no pose 8"},
       {"empty", kStereoGraph.at("VO_camera_poses_x.txt"), "", "poses_x.txt: holds no poses"}});
  check_faults(kStereoGraph, "VO_stereo_factors_x.txt", "",
               {{"truncated", " 0 0.1 4", " 0 0.1", ":3: X, Y or Z is missing"},
                {"NaN", "320 295", "nan 295", ":3: \"nan\" is not finite"},
                {"no such pose", "8 3", "9 3", ":3: there is no pose 9"},
                {"twice", "8 3", "8 50", ":3: pose 8 sees landmark 50 twice"},
                {"a negative landmark", "8 3", "8 -3", ":3: landmark: \"-3\" is not"},
                {"trailing rubbish", " 0 0.1 4", " 0 0.1 4 x", ":3: expected the end of"},
                {"empty", kStereoGraph.at("VO_stereo_factors_x.txt"), "", "holds no factors"}});
  const TempFolder folder;
  CHECK_THAT(refusal(folder.path()), Catch::Contains("holds neither a COLMAP model nor stereo"));
  for (const auto& [name, text] : kStereoGraph) write_text(folder.path() / name, text);
  write_text(folder.path() / "A_stereo_factors.txt", "");
  CHECK_THAT(refusal(folder.path()), Catch::Contains("holds several problems"));
  fs::remove(folder.path() / "VO_calibration.txt");
  CHECK_THAT(refusal(folder.path() / "VO_stereo_factors_x.txt"),
             Catch::Contains("VO_calibration.txt: no such file"));
}

TEST_CASE("Stereo stream: what the numbers mean") {
  const TempFolder folder;
  write_text(folder.path() / "small.seq", kStream);
  const GraphFile file = read_graph(folder.path() / "small.seq");
  CHECK(file.format == GraphFormat::kStereoStream);
  const FactorGraph& graph = file.graph;
  REQUIRE(graph.frames.size() == 3);
  REQUIRE(graph.points.size() == 3);
  REQUIRE(graph.observations.size() == 5);
  CHECK(std::get<Calibrated<RectifiedStereo>>(graph.cameras.at(0).camera).params ==
        std::array<double, 5>{500, 500, 320, 240, 0.2});
  CHECK(graph.observations[0].sigma == 0.5);
  CHECK(graph.observations[0].measurement == Eigen::Vector3d(420, 240, 400));
  CHECK(file.times == std::vector<double>{0, 1, 5});
  CHECK(file.point_ids == std::vector<std::uint64_t>{7, 4, 9});
  CHECK(graph.frames[0].fixed);
  // Dead reckoning from the first true pose.
  CHECK(inverse(graph.frames[1].cam_from_world).translation().isApprox(Eigen::Vector3d(2.1, 2, 3)));
  CHECK(inverse(file.true_cam_from_world[1]).translation().isApprox(Eigen::Vector3d(2, 2, 3)));
  CHECK(file.previous_from_current[2].rotation().z() == Approx(0.6));
  // Landmark 7 by its first observation, 4 by its second: the first has no positive disparity.
  CHECK(graph.points[0].in_world.isApprox(Eigen::Vector3d(2, 2, 8), 1e-14));
  CHECK(graph.points[1].in_world.isApprox(Eigen::Vector3d(2.1, 2.2, 13), 1e-14));
  check_round_trip(folder.path() / "small.seq");
}

TEST_CASE("Stereo stream: what is written has the motions of the estimate") {
  const TempFolder folder;
  write_text(folder.path() / "small.seq", kStream);
  GraphFile file = read_graph(folder.path() / "small.seq");
  file.graph.frames[1].cam_from_world.translation()[1] += 0.25;
  const GraphFile again = read_graph(file.writers[0].write(file.graph, folder.path()));
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(again.graph.frames[i].cam_from_world.params.isApprox(
        file.graph.frames[i].cam_from_world.params, 1e-14));
    CHECK(again.true_cam_from_world[i].params.isApprox(file.true_cam_from_world[i].params, 1e-14));
  }
}

TEST_CASE("Stereo stream: what is refused") {
  check_faults(
      "small.seq", kStream,
      {{"truncated", "N 1\n9 1 0 2\n", "N 2\n9 1.00000000 0 2.00000000\n",
        ":10: ends within the observations of a keyframe"},
       {"truncated in a line", "9 1 0 2\n", "9 1.00000 0", ":9: u_left, u_right or v is missing"},
       {"a keyframe missing", "KF 5 GT 2 2 3 0 0 0.6 0.8 ODO 0 0 0 0 0 0.6 0.8 N 1\n9 1 0 2\n", "",
        ":8: ends after 2 keyframes, where the header promises 3"},
       {"NaN", "420 400", "nan 400", ":3: \"nan\" is not finite"},
       {"NaN in a pose", "ODO 1.1", "ODO nan", ":5: \"nan\" is not finite"},
       {"no rotation", "GT 1 2 3 0 0 0 1", "GT 1 2 3 0 0 0 0", ":2: the quaternion is not of unit"},
       {"landmark out of range", "9 1 0 2", "10 1 0 2", ":9: landmark: 10 is above 9"},
       {"the same landmark", "7 320 300", "4 320 300", ":7: landmark 4 is seen twice"},
       {"the same keyframe", "KF 5", "KF 1", ":8: the keyframes' numbers do not ascend"},
       {"no odometry", "ODO 1.1 0 0 0 0 0 1 ", "", ":5: expected ODO, found \"N\""},
       {"an absurd count", "N 1\n", "N 4000000000\n", ":8: promises 4000000000 observations"},
       {"absurd keyframes", "NKF 3", "NKF 4000000000", ":1: promises 4000000000 keyframes"},
       {"absurd observations", "NOBS 5", "NOBS 4000000000", ":1: promises 4000000000 obs"},
       {"more observations", "NOBS 5", "NOBS 4", ":10: 5 observations, where the header promises"},
       {"fewer keyframes", "NKF 3", "NKF 2", ":8: expected the end of the file, found \"KF\""},
       {"no keyframes", "NKF 3", "NKF 0", ":1: there are no keyframes"},
       {"no sigma", "SIGMA_PX 0.5", "SIGMA_PX 0", ":1: focal length, baseline and SIGMA_PX must"},
       {"another word", "ODO_SIGMA_T", "ODO_SIGMA", ":1: expected ODO_SIGMA_T, found"},
       {"never in front", "9 1 0 2", "9 0 1 2", "landmark 9 never has a positive disparity"},
       {"trailing rubbish", "9 1 0 2\n", "9 1 0 2\nKF 6", ":10: expected the end of the file"}});
}

TEST_CASE("Stereo problems of the shared data") {
  const auto folder = shared_graphs();
  if (!folder) return;
  const GraphFile graph = read_graph(*folder / "gtsam");
  CHECK(graph.graph.frames.size() == 26);
  CHECK(graph.graph.observations.size() == 8189);
  CHECK(graph.graph.validate() == "");
  check_round_trip(*folder / "gtsam");
  const fs::path stream = *folder / "stereo_seq/survey-150-stereo.seq";
  const GraphFile sequence = read_graph(stream);
  CHECK(sequence.graph.frames.size() == 150);
  CHECK(sequence.graph.points.size() == 2240);
  CHECK(sequence.graph.observations.size() == 21951);
  check_round_trip(stream);
}

}  // namespace hybrid_slam
