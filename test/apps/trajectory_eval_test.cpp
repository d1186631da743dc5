#include <sys/wait.h>

#include <cstdlib>
#include <numbers>

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "test/apps/trajectories.h"

namespace hybrid_slam {
namespace {

struct Outcome {
  int code = -1;
  std::string out, err;
};

Outcome run_eval(const TempFolder& folder, const std::string& arguments) {
  const std::string out = (folder.path() / "out").string(), err = (folder.path() / "err").string();
  const std::string command = "cd '" + folder.path().string() + "' && '" TRAJECTORY_EVAL "' " +
                              arguments + " >'" + out + "' 2>'" + err + "'";
  const int status = std::system(command.c_str());
  return {WEXITSTATUS(status), read_text(out), read_text(err)};
}

TEST_CASE("trajectory_eval prints errors of TUM and KITTI files alike") {
  const TempFolder folder;
  const Trajectory truth = winding_path(40);
  Trajectory estimate = truth;
  std::string times;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    estimate[i].world_from_cam.translation().y() += i % 2 == 0 ? 0.01 : -0.01;
    times += std::to_string(truth[i].time) + "\n";
  }
  write_tum(folder.path() / "e.tum", estimate);
  write_tum(folder.path() / "t.tum", truth);
  write_kitti(folder.path() / "t.kitti", truth);
  write_text(folder.path() / "times.txt", times);
  for (const char* const files :
       {"e.tum t.tum", "e.tum t.kitti", "e.tum t.kitti --times times.txt"}) {
    const Outcome outcome = run_eval(folder, std::string("ate ") + files + " --align none --json");
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const auto json = nlohmann::json::parse(outcome.out);
    CHECK(json["pairs"] == 40);
    CHECK(json["position_m"]["rmse"].get<double>() == Approx(0.01).epsilon(1e-6));
  }
  const Outcome rpe = run_eval(folder, "rpe e.tum t.tum --json");
  REQUIRE(rpe.code == 0);
  CHECK(nlohmann::json::parse(rpe.out)["translation_m"]["max"].get<double>() ==
        Approx(0.02).epsilon(1e-6));
  const Outcome plain = run_eval(folder, "ate e.tum t.tum --align sim3");
  CHECK(plain.code == 0);
  CHECK(plain.out.find("rmse 0.00") != std::string::npos);
}

// camera_poses.txt as UWslam has it, and times.txt.
void write_uwslam_truth(const std::filesystem::path& folder, const Trajectory& stereo,
                        const Trajectory& fisheye, bool inverted) {
  std::string poses;
  std::string times;
  const auto append = [&](const Rigid3d& world_from_cam) {
    const Rigid3d pose = inverted ? inverse(world_from_cam) : world_from_cam;
    const auto q = pose.rotation();
    const auto t = pose.translation();
    poses += fmt::format(" {} {} {} {} {} {} {}", t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
  };
  for (std::size_t i = 0; i < stereo.size(); ++i) {
    poses += std::to_string(i);
    append(fisheye[i].world_from_cam);
    append(stereo[i].world_from_cam);
    poses += "\n";
    times += fmt::format("{}\n", stereo[i].time);
  }
  write_text(folder / "camera_poses.txt", poses);
  write_text(folder / "times.txt", times);
}

TEST_CASE("trajectory_eval hybrid compares the arm's pose, in either convention") {
  const TempFolder folder;
  const Trajectory stereo = winding_path(30);
  const Rigid3d left_from_fish(Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitY())),
                               {0.5, 0.1, 0.9});
  // The estimate's world is another; every pose of the fisheye is 1 cm and 0.5 degrees off.
  const Rigid3d other(Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d::UnitX())),
                      {1, 2, 3});
  const double half_degree = 0.5 * std::numbers::pi / 180;
  const Rigid3d error(Eigen::Quaterniond(Eigen::AngleAxisd(half_degree, Eigen::Vector3d::UnitZ())),
                      {0, 0.01, 0});
  Trajectory fisheye = stereo;
  Trajectory estimated_stereo = stereo;
  Trajectory estimated_fisheye = stereo;
  for (std::size_t i = 0; i < stereo.size(); ++i) {
    fisheye[i].world_from_cam = stereo[i].world_from_cam * left_from_fish;
    estimated_stereo[i].world_from_cam = other * stereo[i].world_from_cam;
    estimated_fisheye[i].world_from_cam = other * fisheye[i].world_from_cam * error;
  }
  estimated_fisheye.erase(estimated_fisheye.begin() + 4, estimated_fisheye.begin() + 7);
  for (const char* const run : {"run", "late"}) {
    std::filesystem::create_directory(folder.path() / run);
  }
  write_tum(folder.path() / "run/stereo.tum", estimated_stereo);
  write_tum(folder.path() / "run/fisheye.tum", estimated_fisheye);
  for (const std::string convention : {"world_from_cam", "cam_from_world"}) {
    write_uwslam_truth(folder.path(), stereo, fisheye, convention == "cam_from_world");
    const Outcome outcome = run_eval(folder, "hybrid run . --json --gt-convention " + convention);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const auto json = nlohmann::json::parse(outcome.out);
    CHECK(json["convention"] == convention);
    CHECK(json["registered"] == 27);
    CHECK(json["total"] == 30);
    CHECK(json["translation_m"]["mean"].get<double>() == Approx(0.01).epsilon(1e-4));
    CHECK(json["rotation_deg"]["median"].get<double>() == Approx(0.5).epsilon(1e-4));
  }
  const Outcome plain =
      run_eval(folder, "hybrid run camera_poses.txt --gt-convention cam_from_world");
  CHECK(plain.out.find("27 of 30 fisheye frames (90.0 %)") != std::string::npos);
  CHECK(run_eval(folder, "hybrid nowhere .").code == 3);
  const Trajectory long_after{{1e6, {}}};
  write_tum(folder.path() / "late/stereo.tum", long_after);
  write_tum(folder.path() / "late/fisheye.tum", long_after);
  const Outcome late = run_eval(folder, "hybrid late .");
  CHECK(late.code == 3);
  CHECK(late.err.find("no moment has both poses") != std::string::npos);
}

TEST_CASE("trajectory_eval takes EuRoC truth, and shows both ranges where no times meet") {
  const TempFolder folder;
  Trajectory truth = winding_path(40);
  for (StampedPose& pose : truth) pose.time += 1403636579;
  write_tum(folder.path() / "t.tum", truth);
  std::string csv, plain;
  for (const StampedPose& pose : truth) {
    const auto q = pose.world_from_cam.rotation();
    const auto t = pose.world_from_cam.translation();
    const std::string values =
        fmt::format(",{},{},{},{},{},{},{}\n", t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
    csv += fmt::format("{}", std::llround(pose.time * 1e9)) + values;
    plain += fmt::format("{}", pose.time) + values;
  }
  write_text(folder.path() / "t.csv", "#timestamp [ns],x,y,z,q_w,q_x,q_y,q_z\n" + csv);
  write_text(folder.path() / "seconds.csv", plain);
  write_tum(folder.path() / "early.tum", winding_path(40));
  for (const char* const files :
       {"t.tum t.csv", "t.csv t.tum", "t.tum seconds.csv --truth-quaternions wxyz"}) {
    const Outcome outcome = run_eval(folder, std::string("rpe ") + files + " --json");
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const auto json = nlohmann::json::parse(outcome.out);
    CHECK(json["pairs"] == 40);
    CHECK(json["translation_m"]["max"].get<double>() < 1e-6);
    CHECK(json["rotation_deg"]["max"].get<double>() < 1e-4);
  }
  const Outcome apart = run_eval(folder, "ate early.tum t.csv");
  CHECK(apart.code == 3);
  CHECK(apart.err.find("early.tum from 0.000 to 3.900 s, t.csv from 1403636579.000 to "
                       "1403636582.900 s") != std::string::npos);
}

TEST_CASE("trajectory_eval documents and uses its exit codes") {
  const TempFolder folder;
  write_tum(folder.path() / "t.tum", winding_path(10));
  Trajectory late = winding_path(10);
  for (StampedPose& pose : late) pose.time += 100;
  write_tum(folder.path() / "late.tum", late);
  write_kitti(folder.path() / "short.kitti", winding_path(5));
  write_text(folder.path() / "bad.tum", "0 0 0 0 0 0 0 0\n");
  const auto fails = [&](const std::string& arguments, int code) {
    const Outcome outcome = run_eval(folder, arguments);
    INFO(arguments << "\n" << outcome.err);
    CHECK(outcome.code == code);
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(outcome.out.empty());
  };
  CHECK(run_eval(folder, "--help").code == 0);
  CHECK(run_eval(folder, "--help").out.find("Exit codes") != std::string::npos);
  fails("", 2);
  fails("size t.tum t.tum", 2);
  fails("ate t.tum", 2);
  fails("ate t.tum t.tum --align affine", 2);
  fails("rpe t.tum t.tum --delta 0", 2);
  fails("ate t.tum missing.tum", 3);
  fails("ate bad.tum t.tum", 3);
  fails("ate late.tum t.tum", 3);
  fails("ate short.kitti t.tum", 3);
  fails("rpe t.tum t.tum --delta 50", 3);
}

}  // namespace
}  // namespace hybrid_slam
