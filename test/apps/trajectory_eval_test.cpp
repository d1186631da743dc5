#include <sys/wait.h>

#include <cstdlib>

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
