#include "apps/io/trajectory.h"

#include <random>

#include <catch2/catch.hpp>

#include "cameras/files/input_error.h"
#include "test/apps/trajectories.h"

namespace hybrid_slam {
namespace {

Trajectory transformed(const Trajectory& path, const Sim3d& b_from_a) {
  Trajectory result;
  for (const StampedPose& pose : path) {
    result.push_back(
        {pose.time,
         Rigid3d(b_from_a.rotation() * Eigen::Quaterniond(pose.world_from_cam.rotation()),
                 b_from_a * Eigen::Vector3d(pose.world_from_cam.translation()))});
  }
  return result;
}

Sim3d some_similarity(double scale) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d(1, -2, 0.5).normalized())),
          Eigen::Vector3d(10, -20, 5), scale};
}

std::string read_complaint(const std::filesystem::path& path) {
  try {
    read_trajectory(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST_CASE("a trajectory moved by a known similarity has no error once aligned") {
  const Trajectory truth = winding_path(200);
  const Sim3d truth_from_estimate = some_similarity(2.5);
  const Trajectory estimate = transformed(truth, inverse(truth_from_estimate));
  const auto pairs = associate(estimate, truth, 0.01);
  REQUIRE(pairs.size() == 200);

  const auto sim3 = absolute_error(pairs, TrajectoryAlignment::kSim3);
  REQUIRE(sim3);
  CHECK(sim3->position.max < 1e-9);
  CHECK(sim3->truth_from_estimate.scale() == Approx(2.5).epsilon(1e-12));
  CHECK((sim3->truth_from_estimate.translation() - truth_from_estimate.translation()).norm() <
        1e-9);
  CHECK(sim3->truth_from_estimate.rotation().angularDistance(
            Eigen::Quaterniond(truth_from_estimate.rotation())) < 1e-9);
  REQUIRE(sim3->length_ratio());
  CHECK(*sim3->length_ratio() == Approx(1 / 2.5));
  CHECK(absolute_error(pairs, TrajectoryAlignment::kSe3)->position.rmse > 1);

  const auto rpe = relative_error(pairs, 1, 2.5);
  REQUIRE(rpe);
  CHECK(rpe->translation.max < 1e-9);
  CHECK(rpe->rotation.max < 1e-9);
}

TEST_CASE("SE3 alignment removes a rigid motion, no alignment leaves it") {
  const Trajectory truth = winding_path(50);
  Sim3d shift;
  shift = Sim3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 3, 4), 1);
  const auto pairs = associate(transformed(truth, shift), truth, 0.01);
  CHECK(absolute_error(pairs, TrajectoryAlignment::kSe3)->position.max < 1e-9);
  const auto none = absolute_error(pairs, TrajectoryAlignment::kNone);
  CHECK(none->position.rmse == Approx(5));
  CHECK(none->position.median == Approx(5));
}

TEST_CASE("noise of known size gives the error it must") {
  const Trajectory truth = winding_path(5000);
  Trajectory estimate = transformed(truth, some_similarity(1));
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.02);
  for (StampedPose& pose : estimate) {
    for (int i = 0; i < 3; ++i) pose.world_from_cam.translation()[i] += noise(random);
  }
  const auto error = absolute_error(associate(estimate, truth, 0.01), TrajectoryAlignment::kSe3);
  CHECK(error->position.rmse == Approx(0.02 * std::sqrt(3)).epsilon(0.03));
  CHECK(error->position.mean == Approx(0.02 * std::sqrt(8 / M_PI)).epsilon(0.03));
}

TEST_CASE("statistics of a known list") {
  const ErrorStatistics s = error_statistics({3, 4, 0, 5});
  CHECK(s.count == 4);
  CHECK(s.rmse == Approx(std::sqrt(12.5)));
  CHECK(s.mean == Approx(3));
  CHECK(s.median == Approx(3.5));
  CHECK(s.max == Approx(5));
  CHECK(error_statistics({7, 1, 2}).median == Approx(2));
}

TEST_CASE("a constant error per motion is what the relative error finds") {
  const Trajectory truth = winding_path(40);
  const Rigid3d drift(Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitZ())),
                      Eigen::Vector3d(0, 0.003, 0.004));
  Trajectory estimate = truth;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    estimate[i].world_from_cam = estimate[i - 1].world_from_cam *
                                 (inverse(truth[i - 1].world_from_cam) * truth[i].world_from_cam) *
                                 drift;
  }
  const auto pairs = associate(estimate, truth, 0.01);
  const auto one = relative_error(pairs, 1, 1);
  REQUIRE(one);
  CHECK(one->translation.count == 39);
  CHECK(one->translation.mean == Approx(0.005));
  CHECK(one->translation.max == Approx(0.005));
  CHECK(one->rotation.rmse == Approx(0.02));
  CHECK(relative_error(pairs, 3, 1)->rotation.count == 37);
  CHECK(relative_error(pairs, 3, 1)->rotation.max > 0.04);
  CHECK_FALSE(relative_error(pairs, 40, 1));
}

TEST_CASE("a straight path and a standing one can be evaluated") {
  Trajectory truth;
  for (int i = 0; i < 20; ++i) {
    truth.push_back({0.1 * i, Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 0.5 * i})});
  }
  const auto straight = absolute_error(
      associate(transformed(truth, some_similarity(2)), truth, 0.01), TrajectoryAlignment::kSim3);
  REQUIRE(straight);
  CHECK(straight->position.max < 1e-9);
  for (StampedPose& pose : truth) pose.world_from_cam.translation().setZero();
  const auto still = associate(truth, truth, 0.01);
  CHECK_FALSE(absolute_error(still, TrajectoryAlignment::kSim3));
  REQUIRE(absolute_error(still, TrajectoryAlignment::kSe3));
  CHECK_FALSE(absolute_error(still, TrajectoryAlignment::kSe3)->length_ratio());
  CHECK_FALSE(absolute_error(std::vector<PosePair>(), TrajectoryAlignment::kNone));
  CHECK_FALSE(absolute_error(std::vector<PosePair>(still.begin(), still.begin() + 2),
                             TrajectoryAlignment::kSe3));
}

TEST_CASE("poses are paired with the nearest in time, each truth once") {
  const auto at = [](double time) { return StampedPose{time, Rigid3d()}; };
  const Trajectory truth{at(0), at(1), at(2), at(3)};
  const Trajectory estimate{at(-0.2), at(0.05), at(1.04), at(1.02), at(1.5), at(2.09), at(9)};
  const auto pairs = associate(estimate, truth, 0.1);
  REQUIRE(pairs.size() == 3);
  CHECK(pairs[0].time == 0.05);
  CHECK(pairs[1].time == 1.02);
  CHECK(pairs[2].time == 2.09);
  CHECK(associate(estimate, Trajectory(), 0.1).empty());
}

TEST_CASE("TUM files hold what was written") {
  const TempFolder folder;
  const auto path = folder.path() / "a.tum";
  Trajectory trajectory = winding_path(30);
  trajectory[3].world_from_cam = Rigid3d(Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {1, 2, 3});
  write_tum(path, trajectory);
  const TrajectoryFile file = read_trajectory(path);
  CHECK(file.has_times);
  REQUIRE(file.poses.size() == trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const Rigid3d error = inverse(file.poses[i].world_from_cam) * trajectory[i].world_from_cam;
    CHECK(file.poses[i].time == Approx(trajectory[i].time).margin(1e-9));
    CHECK(error.translation().norm() < 2e-9);
    CHECK(Eigen::Quaterniond(error.rotation()).vec().norm() < 2e-9);
  }
  write_tum(path, std::vector<StampedPose>{trajectory[3]});
  CHECK(read_text(path) ==
        "0.300000000 1.000000000 2.000000000 3.000000000 -0.500000000 0.500000000 -0.500000000 "
        "0.500000000\n");
}

TEST_CASE("KITTI and TUM files of one trajectory give the same errors") {
  const TempFolder folder;
  const Trajectory truth = winding_path(60);
  Trajectory estimate = truth;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    estimate[i].world_from_cam.translation().x() += 0.01 * std::sin(static_cast<double>(i));
  }
  write_tum(folder.path() / "e.tum", estimate);
  write_tum(folder.path() / "t.tum", truth);
  write_kitti(folder.path() / "e.txt", estimate);
  write_kitti(folder.path() / "t.txt", truth);
  const auto error = [&](const char* e, const char* t) {
    const TrajectoryFile estimated = read_trajectory(folder.path() / e);
    const TrajectoryFile true_file = read_trajectory(folder.path() / t);
    const auto pairs = associate(estimated.poses, true_file.poses, 0.01);
    REQUIRE(pairs.size() == 60);
    return std::pair(absolute_error(pairs, TrajectoryAlignment::kSe3)->position.rmse,
                     relative_error(pairs, 1, 1)->translation.rmse);
  };
  const auto [tum_ate, tum_rpe] = error("e.tum", "t.tum");
  const auto [kitti_ate, kitti_rpe] = error("e.txt", "t.txt");
  CHECK(tum_ate > 0.005);
  CHECK(kitti_ate == Approx(tum_ate).epsilon(1e-6));
  CHECK(kitti_rpe == Approx(tum_rpe).epsilon(1e-6));
  CHECK_FALSE(read_trajectory(folder.path() / "e.txt").has_times);
}

TEST_CASE("trajectory files that cannot be used are refused with their line") {
  const TempFolder folder;
  const auto path = folder.path() / "a.txt";
  const std::string good = "0 1 2 3 0 0 0 1\n";
  const auto refused = [&](const std::string& text, const std::string& expected) {
    write_text(path, text);
    const std::string line = read_complaint(path);
    INFO(line);
    CHECK(line.find(expected) != std::string::npos);
  };
  refused("", "holds no poses");
  refused("# only a comment\n", "holds no poses");
  refused("1 2 3\n", ":1: expected 8 columns (TUM) or 12 (KITTI) or 17 (EuRoC), found 3");
  refused(good + "1 1 2 3 0 0 1\n", ":2: expected 8 columns, found 7");
  refused(good + "1 1 2 nan 0 0 0 1\n", ":2: \"nan\" is not finite");
  refused(good + "1 1 2 x 0 0 0 1\n", ":2: \"x\" is not a number");
  refused(good + "1 1 2 3 0 0 0 0\n", ":2: the quaternion is not of unit length");
  refused("5 1 2 3 0 0 0 1\n" + good, ":2: times are not strictly ascending");
  refused("1 0 0 0 0 1 0 0 0 0 2 0\n", ":1: the 3x3 part is not a rotation");
  CHECK(read_complaint(folder.path() / "missing").find("no such file") != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
